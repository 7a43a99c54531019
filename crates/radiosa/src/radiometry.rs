//! Conversions between quantities, each in one place.

use crate::spectrum::Spectrum;

/// Luminous efficacy used to turn watts into lumens, 179 lm/W: the convention of Radiance (equal-energy white light over
/// the visible band). Applied only where lux or cd/m² are asked of a radiometric scene.
pub const LUMINOUS_EFFICACY: f32 = 179.0;

/// Radiance leaving a Lambertian surface of reflectance `rho` under irradiance `e`: `L = ρ E / π`, the one place where the
/// π of diffuse reflection stands. W/(m² sr) from W/m².
pub fn lambertian_radiance(rho: Spectrum, e: Spectrum) -> Spectrum {
    rho * e * std::f32::consts::FRAC_1_PI
}

/// Exitance of a surface emitting the radiance `l` in all directions: `M = π L`. W/m² from W/(m² sr).
pub fn exitance(l: Spectrum) -> Spectrum {
    l * std::f32::consts::PI
}
