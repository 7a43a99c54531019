//! View points.

use crate::math::{DMat3, DVec3};

/// A camera: an eye point, a frame, and how directions map to the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the source.
    pub name: String,
    /// Eye point, scene coordinates.
    pub position: DVec3,
    /// Columns are right, up and back (+z, away from what it looks at): orthonormal, right-handed.
    pub basis: DMat3,
    /// How directions map to the picture.
    pub projection: Projection,
    /// Width over height the source wants; the picture's own when `None`.
    pub aspect: Option<f64>,
    /// The lens of a perspective camera; a pinhole when `None`.
    pub lens: Option<Lens>,
}

/// A thin lens: what is not in focus blurs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Diameter of the opening, metres, above zero.
    pub aperture: f64,
    /// From the eye point to the plane in focus along the direction it looks in, metres, above zero.
    pub focus_distance: f64,
}

/// The projections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole.
    Perspective {
        /// Full vertical angle, radians, in `(0, π)`.
        fov_y: f64,
    },
    /// Parallel.
    Orthographic {
        /// Full height of the view, metres.
        height: f64,
    },
    /// All directions, equirectangular, the middle looks forward.
    Panoramic,
}

impl Camera {
    /// A camera at `position` that looks at `target`; `up` need not be perpendicular. Falls back to another up vector when it is parallel.
    pub fn look_at(name: impl Into<String>, position: DVec3, target: DVec3, up: DVec3, projection: Projection) -> Self {
        let back = (position - target).try_normalize().unwrap_or(DVec3::Z);
        let right = up
            .cross(back)
            .try_normalize()
            .or_else(|| DVec3::Y.cross(back).try_normalize())
            .unwrap_or_else(|| DVec3::Z.cross(back).try_normalize().unwrap_or(DVec3::X));
        Self {
            name: name.into(),
            position,
            basis: DMat3::from_cols(right, back.cross(right), back),
            projection,
            aspect: None,
            lens: None,
        }
    }

    /// The direction it looks in.
    pub fn forward(&self) -> DVec3 {
        -self.basis.z_axis
    }
}
