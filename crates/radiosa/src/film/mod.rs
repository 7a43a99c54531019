//! Pictures in linear light, as named planes.
