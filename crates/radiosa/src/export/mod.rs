//! Writing results to files.
//!
//! Every file is written beside its target under a temporary name, flushed to the disk and renamed: a file that exists is
//! whole. What can be known to fail ([`check_target`]) is asked before the first ray.

pub mod checkpoint;
mod container;
pub mod gathers;
pub mod image;
pub mod matrix;
pub mod mesh;
pub mod solution;
mod target;

pub use target::{ExportError, check_writable, write_atomically};
