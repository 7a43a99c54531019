//! Light as numbers: irradiance at sensors.
//!
//! A sensor is a point and a direction in the coordinates of the input file; it sees the half space its direction points into. One that lies on a surface,
//! but for the rounding of its file, is put onto it.

use crate::emitter::EnvironmentShadows;
use crate::math::rounding::gamma;
use crate::math::{DVec3, Ray, Vec3};
use crate::spectrum::Spectrum;
use crate::transport::{Emitters, LightSettings, Lights, Surface, World};

/// A sensor this close to a surface, relative to the size of the scene, lies on it.
const ON_SURFACE: f32 = 1e-4;

/// Sensors of a grid at most.
pub const MAX_SENSORS: usize = 4_000_000;

/// Where light is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Coordinates of the input file.
    pub position: DVec3,
    /// Unit, coordinates of the input file.
    pub normal: DVec3,
}

/// What a sensor saw.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// W/m² or lux.
    pub irradiance: Spectrum,
    /// Standard error of its luminance, as the method estimates it.
    pub standard_error: f64,
}

/// What is wrong with a list of sensors.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// A line that is not six numbers.
    #[error("line {line}: {text:?} is not \"x y z nx ny nz\"")]
    Line {
        /// From 1.
        line: usize,
        /// As it stands there.
        text: String,
    },
    /// A direction without length, or a number that is not finite.
    #[error("line {line}: the direction must be longer than zero and every number finite")]
    Value {
        /// From 1.
        line: usize,
    },
    /// Too many.
    #[error("{n} sensors are more than {MAX_SENSORS}")]
    TooMany {
        /// How many there would be.
        n: u64,
    },
}

/// Reads sensors, one a line: `x y z nx ny nz`, separated by blanks, tabs or commas, as Radiance's `.pts` files. Empty lines and those that begin with `#`
/// are passed over; directions need not have unit length.
///
/// # Errors
/// At the first line that is something else.
pub fn parse_sensors(text: &str) -> Result<Vec<Sensor>, SensorError> {
    let mut sensors = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let (line, number) = (line.trim(), k + 1);
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let short = || SensorError::Line { line: number, text: line.chars().take(60).collect() };
        let mut v = [0.0f64; 6];
        let mut words = line.split([' ', '\t', ',']).filter(|w| !w.is_empty());
        for x in &mut v {
            *x = words.next().and_then(|w| w.parse().ok()).ok_or_else(short)?;
        }
        if words.next().is_some() {
            return Err(short());
        }
        let normal = DVec3::new(v[3], v[4], v[5]).try_normalize().ok_or(SensorError::Value { line: number })?;
        let position = DVec3::new(v[0], v[1], v[2]);
        if !position.is_finite() || !normal.is_finite() {
            return Err(SensorError::Value { line: number });
        }
        if sensors.len() == MAX_SENSORS {
            return Err(SensorError::TooMany { n: sensors.len() as u64 + 1 });
        }
        sensors.push(Sensor { position, normal });
    }
    Ok(sensors)
}

/// Sensors on a regular grid, some of whose places may be empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Row by row.
    pub sensors: Vec<Sensor>,
    /// Places along x and z.
    pub n: [u32; 2],
    /// Of each sensor the place, `z · n[0] + x`.
    pub places: Vec<u32>,
}

/// A horizontal grid facing up, `height` above the floors of a scene: wherever a regular grid of points has a surface below it and is not inside of a
/// solid. Spacing and height in metres.
///
/// # Errors
/// When there would be too many.
pub fn grid(world: &World, spacing: f64, height: f64) -> Result<Grid, SensorError> {
    let bounds = world.accel().bounds();
    let (lo, extent) = (bounds.min.as_dvec3(), bounds.extent().as_dvec3());
    // At least half a spacing from either end: what bounds a room is no place for sensors.
    let along = |length: f64| ((length / spacing + 1e-6).floor().max(1.0)) as u64;
    let n = [along(extent.x), along(extent.z)];
    if n[0].saturating_mul(n[1]) > MAX_SENSORS as u64 {
        return Err(SensorError::TooMany { n: n[0].saturating_mul(n[1]) });
    }
    // The lowest floor carries the plane: a table is not one.
    let floor = f64::from(bounds.min.y);
    let mut grid = Grid { sensors: Vec::new(), n: n.map(|n| n as u32), places: Vec::new() };
    for j in 0..n[1] {
        for i in 0..n[0] {
            // Centred: the same margin on both sides.
            let at = |k: u64, count: u64, lo: f64, length: f64| {
                lo + 0.5 * (length - (count - 1) as f64 * spacing) + k as f64 * spacing
            };
            let p = DVec3::new(at(i, n[0], lo.x, extent.x), floor + height, at(j, n[1], lo.z, extent.z));
            let ray = Ray::new(p.as_vec3(), Vec3::NEG_Y);
            let Some((hit, surface)) = world.closest_visible(&ray) else { continue };
            if hit.t > 0.0 && surface.ng.y > 0.0 {
                let (position, normal, _) = world.to_file(p.as_vec3(), Vec3::Y);
                grid.sensors.push(Sensor { position: position.as_dvec3(), normal: normal.as_dvec3() });
                grid.places.push((j * n[0] + i) as u32);
            }
        }
    }
    Ok(grid)
}

impl Sensor {
    /// Where it is in a world: on the surface it lies on, or in space; and its unit direction there.
    pub fn place(&self, world: &World) -> (Surface, Vec3) {
        let map = world.scene().from_file;
        let p = (map.transform_point3(self.position) - world.origin()).as_vec3();
        let n = map.transform_vector3(self.normal).normalize_or(DVec3::Y).as_vec3();
        let reach = ON_SURFACE * world.accel().bounds().extent().max_element();
        let ray = Ray { origin: p + n * reach, dir: -n, t_max: 2.0 * reach };
        if reach.is_finite()
            && let Some((_, surface)) = world.closest_visible(&ray)
            && surface.ng.dot(n).abs() > 0.95
        {
            return (surface, n);
        }
        let error = Vec3::splat(p.abs().max_element() * gamma(8));
        (Surface::in_space(p, error, n), n)
    }
}

/// Light that comes from lamps directly, as ray casting has it.
#[derive(Debug)]
pub struct Direct {
    lights: Lights,
}

impl Direct {
    /// Every light of a world; an emissive surface becomes `n × n` points. Environments cast shadows.
    pub fn new(world: &World, n: u32) -> Self {
        let settings =
            LightSettings { emitters: Emitters::Points { n, max: 1 << 16 }, environment_shadows: EnvironmentShadows::On };
        Self { lights: Lights::prepare(world, &settings, &[]) }
    }

    /// What a sensor sees of them.
    pub fn at(&self, world: &World, sensor: &Sensor) -> Reading {
        let (surface, n) = sensor.place(world);
        Reading { irradiance: self.lights.irradiance(world, &surface, n), standard_error: 0.0 }
    }
}

/// The smallest, mean and largest of some values, and the uniformities lighting designers ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Smallest.
    pub min: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

impl Summary {
    /// Of at least one value.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let (mut min, mut max, mut sum, mut n) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
        for v in values {
            (min, max, sum, n) = (v.min(min), v.max(max), sum + v, n + 1.0);
        }
        (n > 0.0).then(|| Self { min, mean: sum / n, max })
    }

    /// U_o = min/mean (EN 12464-1).
    pub fn uniformity(&self) -> f64 {
        if self.mean > 0.0 { self.min / self.mean } else { 0.0 }
    }

    /// U_d = min/max.
    pub fn diversity(&self) -> f64 {
        if self.max > 0.0 { self.min / self.max } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_are_read_as_radiance_writes_them() {
        let sensors = parse_sensors("# desk\n0 0.8 1  0 2 0\n\n1,2,3,0,0,-1\n").expect("it is well formed");
        assert_eq!(sensors.len(), 2);
        assert_eq!(sensors[0], Sensor { position: DVec3::new(0.0, 0.8, 1.0), normal: DVec3::Y });
        assert_eq!(parse_sensors("0 0 0 0 0"), Err(SensorError::Line { line: 1, text: "0 0 0 0 0".into() }));
        assert_eq!(parse_sensors("\n0 0 0 0 0 0"), Err(SensorError::Value { line: 2 }));
        assert!(parse_sensors("0 0 0 0 1 0 7").is_err());
    }
}
