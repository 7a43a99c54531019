//! Camera rays.

use super::Footprint;
use crate::math::{DVec3, Ray, Vec3};
use crate::raster;
use crate::sampling::{Stream, warp};
use crate::scene::{Camera, Projection};

/// A camera with a picture of a given size: maps picture coordinates to rays in world coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    camera: Camera,
    eye: DVec3,
    width: f64,
    height: f64,
    /// Half the height of the picture plane at distance 1, or half the height of a parallel view.
    half: f64,
}

impl View {
    /// `origin` is the world's ([`super::World::origin`]).
    pub fn new(camera: &Camera, origin: DVec3, width: u32, height: u32) -> Self {
        let half = match camera.projection {
            Projection::Perspective { fov_y } => libm::tan(fov_y * 0.5),
            Projection::Orthographic { height } => height * 0.5,
            Projection::Panoramic => 1.0,
        };
        Self { camera: camera.clone(), eye: camera.position - origin, width: f64::from(width), height: f64::from(height), half }
    }

    /// The eye point (centre of projection) in world coordinates.
    pub fn eye(&self) -> Vec3 {
        self.eye.as_vec3()
    }

    /// The direction it looks in.
    pub fn forward(&self) -> Vec3 {
        self.camera.forward().as_vec3()
    }

    /// The ray through the picture point `(x, y)`, in pixels from the top left; pixel centres are at half integers. Unit direction.
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        // Picture plane coordinates, +x right and +y up, both in units of half the picture's height.
        let u = (2.0 * x - self.width) / self.height;
        let v = 1.0 - 2.0 * y / self.height;
        let basis = &self.camera.basis;
        let s = self.half;
        let (origin, dir) = match self.camera.projection {
            Projection::Perspective { .. } => (self.eye, basis.x_axis * (u * s) + basis.y_axis * (v * s) - basis.z_axis),
            Projection::Orthographic { .. } => (self.eye + basis.x_axis * (u * s) + basis.y_axis * (v * s), -basis.z_axis),
            Projection::Panoramic => {
                let phi = (x / self.width - 0.5) * std::f64::consts::TAU;
                let theta = y / self.height * std::f64::consts::PI;
                let (sin_theta, cos_theta) = libm::sincos(theta);
                let (sin_phi, cos_phi) = libm::sincos(phi);
                (self.eye, basis.x_axis * (sin_theta * sin_phi) + basis.y_axis * cos_theta - basis.z_axis * (sin_theta * cos_phi))
            }
        };
        Ray::new(origin.as_vec3(), dir.normalize().as_vec3())
    }

    /// Where in the picture a point in world coordinates is seen, in pixels from the top left; `None` behind the eye. The inverse of [`Self::ray`].
    pub fn place_of(&self, p: DVec3) -> Option<[f64; 2]> {
        use std::f64::consts::{PI, TAU};
        let d = p - self.eye;
        let [x, y, z] = [self.camera.basis.x_axis, self.camera.basis.y_axis, self.camera.basis.z_axis].map(|axis| d.dot(axis));
        let (u, v) = match self.camera.projection {
            Projection::Perspective { .. } if z < 0.0 => (x / (-z * self.half), y / (-z * self.half)),
            Projection::Orthographic { .. } if z < 0.0 => (x / self.half, y / self.half),
            Projection::Panoramic if d != DVec3::ZERO => {
                let (phi, theta) = (libm::atan2(x, -z), libm::acos((y / d.length()).clamp(-1.0, 1.0)));
                return Some([(phi / TAU + 0.5) * self.width, theta / PI * self.height]);
            }
            _ => return None,
        };
        Some([0.5 * (u * self.height + self.width), 0.5 * (1.0 - v) * self.height])
    }

    /// Points are seen in one place each: not so through a lens.
    pub(crate) fn shows_points_once(&self) -> bool {
        self.camera.lens.is_none()
    }

    /// How a point in world coordinates is seen; `None` where it cannot be, outside the picture by more than `margin` pixels, and by cameras with a lens, to which every point
    /// is seen in many places.
    pub(crate) fn sight(&self, p: Vec3, margin: f64) -> Option<Sight> {
        if !self.shows_points_once() {
            return None;
        }
        let p = p.as_dvec3();
        let place = self.place_of(p)?;
        let is_near = |v: f64, end: f64| v > -margin && v < end + margin;
        if !is_near(place[0], self.width) || !is_near(place[1], self.height) {
            return None;
        }
        let (back, to_eye) = (self.camera.basis.z_axis, self.eye - p);
        let d2 = to_eye.length_squared();
        // Pixels to one unit of the picture plane at distance 1, or to a metre of a parallel view.
        let scale = self.height / (2.0 * self.half);
        let (from, density) = match self.camera.projection {
            Projection::Orthographic { .. } => (p + back * back.dot(to_eye), scale * scale),
            Projection::Perspective { .. } => {
                // A pixel is cos³θ of its share of the plane as solid angle.
                let cos = back.dot(to_eye) / d2.sqrt();
                (self.eye, scale * scale / (cos * cos * cos) / d2)
            }
            Projection::Panoramic => {
                let sin = libm::sin(place[1] / self.height * std::f64::consts::PI);
                (self.eye, self.width * self.height / (2.0 * std::f64::consts::PI.powi(2) * sin) / d2)
            }
        };
        let density = density as f32;
        let is_usable = density.is_finite() && d2 > 0.0;
        is_usable.then(|| Sight { place, from: from.as_vec3(), to_eye: (from - p).normalize().as_vec3(), density })
    }

    /// The linear map to the picture that scan conversion needs, with `near` where perspective needs a near plane; `None` for panoramas, which are not linear.
    pub fn projection(&self, near: f64) -> Option<raster::Projection> {
        let basis = &self.camera.basis;
        match self.camera.projection {
            Projection::Perspective { fov_y } => Some(raster::Projection::perspective(self.eye, basis, fov_y, self.height, near)),
            Projection::Orthographic { height } => Some(raster::Projection::orthographic(self.eye, basis, height, self.height)),
            Projection::Panoramic => None,
        }
    }

    /// The same through a random point of the lens, where the camera has one: things off its focal plane blur. A pinhole draws no numbers.
    ///
    /// A thin lens brings everything on the plane at the focal distance to one point of the picture, so that the rays of one picture
    /// point all meet there. Source: [Cook84].
    pub fn sample_ray(&self, x: f64, y: f64, stream: &mut Stream) -> Ray {
        let pinhole = self.ray(x, y);
        let (Some(lens), Projection::Perspective { .. }) = (self.camera.lens, self.camera.projection) else { return pinhole };
        let dir = pinhole.dir.as_dvec3();
        let cos = dir.dot(self.camera.forward());
        let focus = self.eye + dir * (lens.focus_distance / cos);
        let p = warp::uniform_disc(stream.next_2d()).as_dvec2() * (0.5 * lens.aperture);
        let origin = self.eye + self.camera.basis.x_axis * p.x + self.camera.basis.y_axis * p.y;
        let dir = (focus - origin).try_normalize().map_or(pinhole.dir, |dir| dir.as_vec3());
        Ray::new(origin.as_vec3(), dir)
    }

    /// How wide a pixel is that `samples` share evenly.
    pub fn footprint(&self, samples: u32) -> Footprint {
        let share = 1.0 / (self.height * f64::from(samples.max(1)).sqrt());
        let pixel = (2.0 * self.half * share) as f32;
        match self.camera.projection {
            Projection::Perspective { .. } => Footprint { at_eye: 0.0, growth: pixel },
            Projection::Orthographic { .. } => Footprint { at_eye: pixel, growth: 0.0 },
            Projection::Panoramic => Footprint { at_eye: 0.0, growth: (std::f64::consts::PI * share) as f32 },
        }
    }

    /// As Radiance writes views: type, eye point, direction, up and angles, in scene coordinates.
    pub fn radiance_view(&self) -> String {
        let c = &self.camera;
        let (p, d, u) = (c.position, c.forward(), c.basis.y_axis);
        let degrees = 180.0 / std::f64::consts::PI;
        let (kind, h, v) = match c.projection {
            Projection::Perspective { fov_y } => {
                let half = self.half * self.width / self.height;
                ("vtv", 2.0 * libm::atan(half) * degrees, fov_y * degrees)
            }
            Projection::Orthographic { height } => ("vtl", height * self.width / self.height, height),
            Projection::Panoramic => ("vtq", 360.0, 180.0),
        };
        format!("-{kind} -vp {} {} {} -vd {} {} {} -vu {} {} {} -vh {h} -vv {v}", p.x, p.y, p.z, d.x, d.y, d.z, u.x, u.y, u.z)
    }
}

/// How a point is seen in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sight {
    /// Pixels from the top left.
    pub(crate) place: [f64; 2],
    /// Where the camera ray that meets it begins.
    pub(crate) from: Vec3,
    /// Unit, towards there.
    pub(crate) to_eye: Vec3,
    /// Pixels a square metre there, across the ray.
    pub(crate) density: f32,
}
