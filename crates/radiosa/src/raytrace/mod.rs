//! Methods that trace rays from the eye.
