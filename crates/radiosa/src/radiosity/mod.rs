//! Radiosity: the light between diffuse surfaces, for the scene and not for a camera.

pub mod form_factor;
