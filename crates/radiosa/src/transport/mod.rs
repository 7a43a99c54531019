//! The words all methods share.
