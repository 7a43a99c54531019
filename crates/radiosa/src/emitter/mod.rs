//! Lights as the methods ask them: what arrives at a point from where.
