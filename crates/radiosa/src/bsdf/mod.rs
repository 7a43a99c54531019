//! Reflection models at a point: enums over plain structs.
