//! Lights, the environment, and cameras.

use schemars::JsonSchema;
use serde::Deserialize;

use super::Reading;
use super::transform::unit_length;
use super::value::{At, Color, Direction, DirectionCount, Exponent, Falloff, FieldOfView, HalfAngle, Number, Point, Positive};
use crate::import::ImportError;
use crate::math::{DMat3, DQuat, DVec3, function};
use crate::scene::{
    Attenuation, Camera, Cone, Directional, Environment, EnvironmentRadiance, Lens, Light, LightKind, PhotometricUnit, Projection,
};
use crate::spectrum::Spectrum;

/// A light: at most one of the keys `point`, `spot`, `distant`, `hemispherical`, `discrete`, and how strong it is. One that has only
/// `ambient` is an ambient light.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct LightTable {
    /// Shines from this point in all directions.
    point: Option<Point>,
    /// Shines from a point into a cone.
    spot: Option<At<SpotTable>>,
    /// Shines from one direction, as the sun does.
    distant: Option<At<DistantTable>>,
    /// Two radiances, above and below a horizon; `intensity` is the upper one.
    hemispherical: Option<HemisphericalTable>,
    /// Shines from several directions, everywhere the same; `intensity` multiplies all of them.
    discrete: Option<Vec<DirectionTable>>,
    /// `I`, for diffuse and specular reflection alike; 1 when not given.
    intensity: Option<Color>,
    /// `I_d`, for diffuse reflection; `intensity` when not given.
    diffuse: Option<Color>,
    /// `I_s`, for specular reflection; `intensity` when not given.
    specular: Option<Color>,
    /// `I_a`, this light's ambient part: local models add `I_a k_a`, never attenuated, coned or shadowed; 0 when not given.
    ambient: Option<Color>,
    /// `"classic"` (when not given): the value white shows when lit head-on. `"physical"`: W/sr or cd for `point` and `spot`, falling off with the
    /// square of the distance; W/m² or lux for `distant`.
    unit: Option<UnitKind>,
    /// Classic points and spots: `[c1, c2, c3]` of `f = min(1/(c1 + c2 d + c3 d²), 1)`, with d in the file's units; `[1, 0, 0]` when not given.
    attenuation: Option<At<Falloff>>,
    /// Points and spots: no light beyond this distance, which it approaches smoothly; without end when not given.
    range: Option<At<Positive>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum UnitKind {
    /// The value white shows when lit head-on.
    Classic,
    /// W/sr, cd, W/m² or lux.
    Physical,
}

/// A cone of light. With `cutoff` and `exponent` it falls off as the classic model does; with `inner` and `outer` as glTF's.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SpotTable {
    /// Where it is.
    position: Point,
    /// A point on its axis.
    look_at: Option<Point>,
    /// Or the direction it shines in.
    direction: Option<Direction>,
    /// Half angle beyond which nothing is lit, degrees; 180 when not given.
    cutoff: Option<HalfAngle>,
    /// Power of the cosine from the axis; 0 when not given.
    exponent: Option<Exponent>,
    /// Half angle inside which it is strongest, degrees; 0 when not given.
    inner: Option<HalfAngle>,
    /// Half angle beyond which nothing is lit, degrees.
    outer: Option<HalfAngle>,
}

/// Where distant light comes from: either `to_light`, or `azimuth` and `elevation`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct DistantTable {
    /// Direction towards the light.
    to_light: Option<Direction>,
    /// Degrees clockwise from north seen from above: 90 is east, 180 south. North is −z where y is up, y where z is up; east is x.
    azimuth: Option<Number>,
    /// Degrees above the horizon.
    elevation: Option<Number>,
}

/// Light from above and below.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct HemisphericalTable {
    /// Where above is; the file's up axis when not given.
    axis: Option<Direction>,
    /// Radiance from below; 0 when not given.
    down: Option<Color>,
}

/// Light from one of several directions.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct DirectionTable {
    /// Direction towards the light.
    to_light: Direction,
    /// Its classic intensity; 1 when not given.
    intensity: Option<Color>,
}

impl LightTable {
    /// The light in scene coordinates.
    pub(super) fn build(&self, name: &At<String>, r: &mut Reading<'_>) -> Result<Light, ImportError> {
        let present = [
            ("point", self.point.is_some()),
            ("spot", self.spot.is_some()),
            ("distant", self.distant.is_some()),
            ("hemispherical", self.hemispherical.is_some()),
            ("discrete", self.discrete.is_some()),
        ];
        let kind = super::at_most_one(&r.text, &name.span, "a light", &present)?;
        let text = &r.text;
        if kind.is_none()
            && (self.ambient.is_none() || self.intensity.is_some() || self.diffuse.is_some() || self.specular.is_some())
        {
            let help = format!("a light needs one of: {}; or `ambient` alone", present.map(|(k, _)| k).join(", "));
            return Err(text.error(&name.span, format!("the light {:?} does not say where it shines from", name.value), help));
        }
        let is_local = matches!(kind, Some("point" | "spot"));
        if let (false, Some(a)) = (is_local, &self.attenuation) {
            return Err(text.error(&a.span, "only `point` and `spot` lights are attenuated", "leave `attenuation` out"));
        }
        if let (false, Some(a)) = (is_local, &self.range) {
            return Err(text.error(&a.span, "only `point` and `spot` lights have a range", "leave `range` out"));
        }
        if self.unit == Some(UnitKind::Physical) {
            if let Some(a) = &self.attenuation {
                let help = "leave `attenuation` out, or use `unit = \"classic\"`";
                return Err(text.error(&a.span, "a physical light always falls off with the square of the distance", help));
            }
            if matches!(kind, Some("hemispherical" | "discrete") | None) {
                let help = "leave `unit` out";
                return Err(text.error(&name.span, "only `point`, `spot` and `distant` lights have a unit", help));
            }
        }
        let unit = if self.unit == Some(UnitKind::Physical) { PhotometricUnit::Physical } else { PhotometricUnit::Classic };
        let metres = unit_length(&r.scene.from_file);
        let attenuation = self.attenuation.as_ref().map_or_else(Attenuation::default, |a| {
            let [c1, c2, c3] = a.value.0;
            Attenuation { c1, c2: c2 / metres, c3: c3 / (metres * metres) }
        });
        let range = self.range.as_ref().map_or(f64::INFINITY, |a| a.value.0 * metres);
        let kind = if let Some(position) = self.point {
            LightKind::Point { position: r.point(position.0), unit, attenuation, range }
        } else if let Some(At { value: s, span }) = &self.spot {
            let axis = match (s.look_at, s.direction) {
                (Some(target), None) => (target.0 - s.position.0).try_normalize(),
                (None, Some(direction)) => Some(direction.0),
                _ => return Err(text.error(span, "a spot needs either `look_at` or `direction`", "")),
            };
            let Some(axis) = axis else {
                return Err(text.error(span, "the spot's `position` and `look_at` are the same place", ""));
            };
            let classic = s.cutoff.is_some() || s.exponent.is_some();
            let cone = if let Some(outer) = s.outer {
                if classic {
                    let help = "`cutoff` and `exponent` are the classic cone, `inner` and `outer` that of glTF";
                    return Err(text.error(span, "this spot mixes two kinds of cone", help));
                }
                let inner = s.inner.map_or(0.0, |i| i.0);
                if !(inner < outer.0 && outer.0 <= 90.0) {
                    return Err(text.error(span, "`inner` must be smaller than `outer`, and `outer` at most 90 degrees", ""));
                }
                Cone::Gltf { inner: inner.to_radians(), outer: outer.0.to_radians() }
            } else if s.inner.is_some() {
                return Err(text.error(span, "`inner` needs `outer` beside it", ""));
            } else {
                let cutoff = s.cutoff.map_or(180.0, |c| c.0);
                if cutoff <= 0.0 {
                    return Err(text.error(span, "a spot with a `cutoff` of 0 lights nothing", ""));
                }
                Cone::Classic { exponent: s.exponent.map_or(0.0, |e| e.0), cutoff: cutoff.to_radians() }
            };
            LightKind::Spot { position: r.point(s.position.0), axis: r.direction(axis), cone, unit, attenuation, range }
        } else if let Some(At { value: d, span }) = &self.distant {
            let to_light = match (d.to_light, d.azimuth, d.elevation) {
                (Some(direction), None, None) => direction.0,
                (None, azimuth, Some(elevation)) => r.up.sky(azimuth.map_or(180.0, |a| a.0), elevation.0),
                _ => return Err(text.error(span, "distant light needs either `to_light`, or `azimuth` and `elevation`", "")),
            };
            LightKind::Distant { to_light: r.direction(to_light), unit }
        } else if let Some(h) = &self.hemispherical {
            let axis = r.direction(h.axis.map_or(r.up.axis(), |a| a.0));
            LightKind::Hemispherical { axis, down: h.down.map_or(Spectrum::BLACK, |d| d.0) }
        } else if let Some(all) = &self.discrete {
            if all.is_empty() {
                return Err(text.error(&name.span, "`discrete` is empty", "give at least one direction"));
            }
            let one = |d: &DirectionTable| Directional {
                to_light: r.direction(d.to_light.0),
                intensity: d.intensity.map_or(Spectrum::WHITE, |i| i.0),
            };
            LightKind::Discrete { directions: all.iter().map(one).collect() }
        } else {
            LightKind::Ambient
        };
        let intensity = match kind {
            LightKind::Ambient => Spectrum::BLACK,
            _ => self.intensity.map_or(Spectrum::WHITE, |i| i.0),
        };
        Ok(Light {
            name: name.value.clone(),
            ambient: self.ambient.map_or(Spectrum::BLACK, |a| a.0),
            diffuse: self.diffuse.map_or(intensity, |d| d.0),
            specular: self.specular.map_or(intensity, |s| s.0),
            kind,
        })
    }
}

/// Light from infinitely far away in every direction: either `radiance` or `map`.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct EnvironmentTable {
    /// The same radiance in every direction.
    radiance: Option<Color>,
    /// An equirectangular picture (HDR, EXR, or any other), found from the folder of this file: its top is up, its middle column north (−z), columns go
    /// to the right.
    map: Option<At<String>>,
    /// Multiplies the radiance; 1 when not given.
    scale: Option<Color>,
    /// Turns the map around the vertical, degrees counter-clockwise seen from above.
    rotation: Option<Number>,
    /// The camera sees it; true when not given.
    visible: Option<bool>,
    /// To how many directions local models and ray casting reduce it; 64 when not given.
    n_directions: Option<DirectionCount>,
}

impl EnvironmentTable {
    /// The environment in scene coordinates.
    pub(super) fn build(at: &At<Self>, r: &mut Reading<'_>) -> Result<Environment, ImportError> {
        let t = &at.value;
        let (radiance, factor) = match (&t.map, t.radiance) {
            (Some(file), None) => (EnvironmentRadiance::Map(r.image(file)?), Spectrum::WHITE),
            (None, Some(radiance)) => (EnvironmentRadiance::Constant, radiance.0),
            _ => return Err(r.text.error(&at.span, "an environment needs either `radiance` or `map`", "")),
        };
        let half = t.rotation.map_or(0.0, |a| a.0).to_radians() / 2.0;
        Ok(Environment {
            radiance,
            scale: factor * t.scale.map_or(Spectrum::WHITE, |s| s.0),
            rotation: DQuat::from_xyzw(0.0, function::sin_f64(half), 0.0, function::cos_f64(half)),
            visible: t.visible.unwrap_or(true),
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be a small whole number")]
            n_directions: t.n_directions.map_or(64, |n| n.0 as u32),
        })
    }
}

/// A view point. At most one of `fov_y`, `orthographic_height` and `panoramic` says how it sees; perspective of 45 degrees when none does.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraTable {
    /// Where it is.
    position: Point,
    /// A point in the middle of its picture.
    look_at: Option<Point>,
    /// Or the direction it looks in.
    direction: Option<Direction>,
    /// What points upwards in its picture; the file's up axis when not given.
    up: Option<Direction>,
    /// Perspective, with this full vertical angle in degrees.
    fov_y: Option<FieldOfView>,
    /// Parallel projection, with this full height in the file's units.
    orthographic_height: Option<Positive>,
    /// All directions, equirectangular.
    #[serde(default)]
    panoramic: bool,
    /// Width over height of its picture; that of the picture asked for when not given.
    aspect: Option<Positive>,
    /// Diameter of a perspective camera's lens in the file's units: what is out of focus blurs. A pinhole when not given.
    aperture: Option<Positive>,
    /// Or that diameter as photographers say it: the focal length over it, for a film 24 mm high.
    f_number: Option<Positive>,
    /// Distance of what is in focus along the direction of view, in the file's units; that of `look_at` when not given.
    focus_distance: Option<Positive>,
}

/// Height of the film that `f_number` means, metres: the 24 mm of a 35 mm camera.
const FILM_HEIGHT: f64 = 0.024;

impl CameraTable {
    /// The camera in scene coordinates.
    pub(super) fn build(&self, name: &At<String>, r: &Reading<'_>) -> Result<Camera, ImportError> {
        let present = [
            ("fov_y", self.fov_y.is_some()),
            ("orthographic_height", self.orthographic_height.is_some()),
            ("panoramic", self.panoramic),
        ];
        super::at_most_one(&r.text, &name.span, "a camera", &present)?;
        let target = match (self.look_at, self.direction) {
            (Some(target), None) if target.0 != self.position.0 => target.0,
            (Some(_), None) => {
                let message = format!("`position` and `look_at` of the camera {:?} are the same place", name.value);
                return Err(r.text.error(&name.span, message, ""));
            }
            (None, Some(direction)) => self.position.0 + direction.0,
            _ => return Err(r.text.error(&name.span, "a camera needs either `look_at` or `direction`", "")),
        };
        let projection = if self.panoramic {
            Projection::Panoramic
        } else if let Some(height) = self.orthographic_height {
            Projection::Orthographic { height: height.0 * unit_length(&r.scene.from_file) }
        } else {
            Projection::Perspective { fov_y: self.fov_y.map_or(45.0, |f| f.0).to_radians() }
        };
        let lens = self.lens(name, projection, (target - self.position.0).length(), r)?;
        let up = self.up.map_or(r.up.axis(), |u| u.0);
        let forward = r.direction((target - self.position.0).normalize_or(DVec3::NEG_Z));
        let position = r.point(self.position.0);
        let mut camera = Camera::look_at(name.value.clone(), DVec3::ZERO, forward, r.direction(up), projection);
        camera.position = position;
        camera.aspect = self.aspect.map(|a| a.0);
        camera.lens = lens;
        Ok(camera)
    }

    /// `to_target` in the file's units.
    fn lens(
        &self,
        name: &At<String>,
        projection: Projection,
        to_target: f64,
        r: &Reading<'_>,
    ) -> Result<Option<Lens>, ImportError> {
        let present = [("aperture", self.aperture.is_some()), ("f_number", self.f_number.is_some())];
        super::at_most_one(&r.text, &name.span, "a camera", &present)?;
        let unit = unit_length(&r.scene.from_file);
        let Projection::Perspective { fov_y } = projection else {
            return if self.aperture.or(self.f_number).or(self.focus_distance).is_some() {
                Err(r.text.error(&name.span, format!("the camera {:?} has a lens, but no perspective", name.value), ""))
            } else {
                Ok(None)
            };
        };
        let diameter = match (self.aperture, self.f_number) {
            (Some(aperture), _) => aperture.0 * unit,
            // fov = 2 atan(h / 2f)
            (_, Some(number)) => 0.5 * FILM_HEIGHT / crate::math::function::tan_f64(0.5 * fov_y) / number.0,
            (None, None) => return Ok(None),
        };
        let focus_distance = self.focus_distance.map_or(to_target, |d| d.0) * unit;
        Ok(Some(Lens { aperture: diameter, focus_distance }))
    }
}

/// An orthonormal basis of a camera after a map that may stretch.
pub(super) fn turned(basis: DMat3, by: DMat3) -> DMat3 {
    let back = (by * basis.z_axis).normalize_or(DVec3::Z);
    let up = by * basis.y_axis;
    let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
    DMat3::from_cols(right, back.cross(right), back)
}
