//! Reflection models at a point: enums over plain structs.

pub mod texture;
