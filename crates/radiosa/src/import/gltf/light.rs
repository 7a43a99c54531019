//! `KHR_lights_punctual`: candela for points and spots, lux for directional lights.

use super::super::{ImportError, Warnings};
use super::json::Item;
use super::material::narrow;
use crate::math::{DAffine3, DVec3};
use crate::scene::{Attenuation, Cone, Light, LightKind, PhotometricUnit};
use crate::spectrum::Spectrum;

/// Reads a light and places it; `None`, with a warning, when it shines nowhere.
pub(super) fn read(
    item: &Item<'_>,
    name: String,
    place: &DAffine3,
    warnings: &mut Warnings,
) -> Result<Option<Light>, ImportError> {
    let mut left_out = |why: &str| {
        warnings.add("ignored-light", item.file(), format!("the light at {} is left out: {why}", item.pointer()));
        Ok(None)
    };
    let color = item.numbers::<3>("color")?.unwrap_or([1.0; 3]);
    let intensity = item.number("intensity")?.unwrap_or(1.0);
    if intensity < 0.0 || color.iter().any(|&c| c < 0.0) {
        return left_out("its intensity is negative");
    }
    let intensity = Spectrum::from(color.map(|c| narrow(c * intensity)));
    let position = place.translation;
    let unit = PhotometricUnit::Physical;
    let attenuation = Attenuation::default();
    // Zero is what some exporters write for "without end"; the extension itself leaves the member out.
    let range = item.number("range")?.filter(|&r| r > 0.0).unwrap_or(f64::INFINITY);
    let axis = place.transform_vector3(-DVec3::Z).try_normalize();
    let kind = item.require("type")?;
    let kind = match kind.as_text()? {
        "point" => LightKind::Point { position, unit, attenuation, range },
        "spot" => {
            let Some(axis) = axis else { return left_out("its node has no direction (a scale of zero)") };
            let (mut inner, mut outer) = (0.0, std::f64::consts::FRAC_PI_4);
            if let Some(spot) = item.object("spot")? {
                inner = spot.number("innerConeAngle")?.unwrap_or(inner);
                outer = spot.number("outerConeAngle")?.unwrap_or(outer);
            }
            if !(0.0 <= inner && inner <= outer && outer <= std::f64::consts::FRAC_PI_2 && outer > 0.0) {
                let what =
                    format!("cone angles {inner} and {outer} (at {}) are brought into 0 ≤ inner ≤ outer ≤ π/2", item.pointer());
                warnings.add("value-out-of-range", item.file(), what);
                outer = outer.clamp(1e-3, std::f64::consts::FRAC_PI_2);
                inner = inner.clamp(0.0, outer);
            }
            LightKind::Spot { position, axis, cone: Cone::Gltf { inner, outer }, unit, attenuation, range }
        }
        "directional" => {
            let Some(axis) = axis else { return left_out("its node has no direction (a scale of zero)") };
            LightKind::Distant { to_light: -axis, unit }
        }
        other => return left_out(&format!("{other:?} is no known type of light")),
    };
    Ok(Some(Light::new(name, intensity, kind)))
}
