//! Where things are: the units and axes of the file, and the transforms of what it places.

use schemars::JsonSchema;
use serde::Deserialize;

use super::error::Text;
use super::value::{At, Direction, Number, OneOrMany, Point, Row, Scale};
use crate::import::ImportError;
use crate::math::{DAffine3, DMat3, DQuat, DVec3, function};

/// Which axis points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Up {
    /// y is up, −z is north, x is east: glTF's way, and Radiosa's own.
    #[default]
    Y,
    /// z is up, y is north, x is east: the way of most modellers and of surveyors.
    Z,
}

impl Up {
    /// From the file's coordinates, one unit of which is `scale` metres, to the scene's.
    pub(super) fn to_scene(self, scale: f64) -> DAffine3 {
        let turn = match self {
            Self::Y => DMat3::IDENTITY,
            Self::Z => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        };
        DAffine3::from_mat3(turn * scale)
    }

    /// The direction in the file's coordinates.
    pub(super) fn axis(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }

    /// Unit vector to a place in the sky: degrees clockwise from north seen from above, and degrees above the horizon.
    pub(super) fn sky(self, azimuth: f64, elevation: f64) -> DVec3 {
        let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
        let (north, east, up) = match self {
            Self::Y => (DVec3::NEG_Z, DVec3::X, DVec3::Y),
            Self::Z => (DVec3::Y, DVec3::X, DVec3::Z),
        };
        let level = north * function::cos_f64(azimuth) + east * function::sin_f64(azimuth);
        (level * function::cos_f64(elevation) + up * function::sin_f64(elevation)).normalize()
    }
}

/// One step of moving something into place. Within one step the order is: `matrix` or `look_at`, then `scale`, `rotate`,
/// `translate`; an array of steps is done from first to last.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct TransformTable {
    /// An affine map by rows, `[[xx, xy, xz, tx], [yx, yy, yz, ty], [zx, zy, zz, tz]]`: a point (x, y, z) becomes each row times (x, y, z, 1).
    pub(super) matrix: Option<At<[Row; 3]>>,
    /// Turns its −z axis to a target, as a camera does.
    pub(super) look_at: Option<LookAtTable>,
    /// Stretches around the origin: one number, or one for each axis. Negative numbers mirror; the front stays the front.
    pub(super) scale: Option<Scale>,
    /// Turns around the origin.
    pub(super) rotate: Option<Rotate>,
    /// Moves, in the file's units.
    pub(super) translate: Option<Point>,
}

/// Places something at `from` so that its −z axis points at `to`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LookAtTable {
    /// Where its origin goes.
    pub(super) from: Point,
    /// Where its −z axis points.
    pub(super) to: Point,
    /// Where its y axis points as well as it can; the file's up axis when not given.
    pub(super) up: Option<Direction>,
}

/// A rotation: `{ axis = [x, y, z], degrees = a }` (counter-clockwise seen from the tip of the axis), or three angles in degrees
/// `[x, y, z]`, turned around x first, then y, then z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rotate(DQuat);

/// Around one axis.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct AxisAngle {
    /// The axis.
    axis: Direction,
    /// Counter-clockwise seen from its tip.
    degrees: Number,
}

fn turn(axis: DVec3, degrees: f64) -> DQuat {
    let half = degrees.to_radians() / 2.0;
    let v = axis * function::sin_f64(half);
    DQuat::from_xyzw(v.x, v.y, v.z, function::cos_f64(half))
}

impl<'de> Deserialize<'de> for Rotate {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct V;
        impl<'de> serde::de::Visitor<'de> for V {
            type Value = Rotate;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("{ axis = [x, y, z], degrees = a } or three angles [x, y, z] in degrees")
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, seq: A) -> Result<Rotate, A::Error> {
                let Point(a) = Point::deserialize(serde::de::value::SeqAccessDeserializer::new(seq))?;
                Ok(Rotate(turn(DVec3::Z, a.z) * turn(DVec3::Y, a.y) * turn(DVec3::X, a.x)))
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Rotate, A::Error> {
                let a = AxisAngle::deserialize(serde::de::value::MapAccessDeserializer::new(map))?;
                Ok(Rotate(turn(a.axis.0, a.degrees.0)))
            }
        }
        deserializer.deserialize_any(V)
    }
}

impl JsonSchema for Rotate {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Rotate".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let (angles, axis) = (generator.subschema_for::<Point>(), generator.subschema_for::<AxisAngle>());
        schemars::json_schema!({
            "description": "{ axis = [x, y, z], degrees = a } (counter-clockwise seen from the tip of the axis), or three angles [x, y, z] in degrees, turned around x first, then y, then z.",
            "anyOf": [axis, angles],
        })
    }
}

impl TransformTable {
    fn to_affine(&self, text: &Text, up: Up) -> Result<DAffine3, ImportError> {
        let mut t = DAffine3::IDENTITY;
        if let Some(matrix) = &self.matrix {
            let [x, y, z] = matrix.value.map(|r| r.0);
            let column = |i: usize| DVec3::new(x[i], y[i], z[i]);
            t = DAffine3::from_cols(column(0), column(1), column(2), column(3));
            let size = t.matrix3.to_cols_array().iter().fold(0.0f64, |m, v| m.max(v.abs()));
            if t.matrix3.determinant().abs() <= 1e-12 * size * size * size {
                return Err(text.error(
                    &matrix.span,
                    "this matrix flattens what it is applied to",
                    "its three columns must be independent",
                ));
            }
            if self.look_at.is_some() {
                return Err(text.error(&matrix.span, "`matrix` and `look_at` cannot both be given", "use an array of steps"));
            }
        }
        if let Some(l) = &self.look_at {
            let camera = crate::scene::Camera::look_at(
                "",
                l.from.0,
                l.to.0,
                l.up.map_or(up.axis(), |u| u.0),
                crate::scene::Projection::Panoramic,
            );
            t = DAffine3::from_mat3_translation(camera.basis, camera.position);
        }
        if let Some(Scale(s)) = self.scale {
            t = DAffine3::from_scale(s) * t;
        }
        if let Some(Rotate(r)) = self.rotate {
            t = DAffine3::from_quat(r) * t;
        }
        if let Some(Point(p)) = self.translate {
            t = DAffine3::from_translation(p) * t;
        }
        Ok(t)
    }
}

/// All steps of a transform as one map.
pub(super) fn to_affine(steps: &OneOrMany<TransformTable>, text: &Text, up: Up) -> Result<DAffine3, ImportError> {
    let mut all = DAffine3::IDENTITY;
    for step in &steps.0 {
        all = step.value.to_affine(text, up)? * all;
        let largest = all.matrix3.to_cols_array().iter().chain(all.translation.as_ref()).fold(0.0f64, |m, v| m.max(v.abs()));
        if largest > 1e18 || all.matrix3.determinant().abs() < 1e-60 {
            return Err(text.error(&step.span, "this transform leaves the range of numbers that can be used", ""));
        }
    }
    Ok(all)
}

/// The length one unit becomes: exact for similarities, the mean in volume for others.
pub(super) fn unit_length(t: &DAffine3) -> f64 {
    libm::cbrt(t.matrix3.determinant().abs())
}
