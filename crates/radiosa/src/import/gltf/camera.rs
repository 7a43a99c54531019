//! Cameras.

use super::super::{ImportError, Warnings};
use super::json::Item;
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::{Camera, Projection};

/// Reads a camera and places it; `None`, with a warning, when it sees nothing.
pub(super) fn read(
    item: &Item<'_>,
    name: String,
    place: &DAffine3,
    warnings: &mut Warnings,
) -> Result<Option<Camera>, ImportError> {
    let mut left_out = |why: &str| {
        warnings.add("ignored-camera", item.file(), format!("the camera at {} is left out: {why}", item.pointer()));
        Ok(None)
    };
    let kind = item.require("type")?;
    let (projection, aspect) = match kind.as_text()? {
        "perspective" => {
            let lens = item.require("perspective")?;
            let fov_y = lens.require("yfov")?.as_number()?;
            if !(fov_y > 0.0 && fov_y < std::f64::consts::PI) {
                return left_out(&format!("its yfov of {fov_y} is not between 0 and π"));
            }
            (Projection::Perspective { fov_y }, lens.number("aspectRatio")?)
        }
        "orthographic" => {
            let lens = item.require("orthographic")?;
            // Negative magnifications mirror the picture, which no renderer does.
            let (x, y) = (lens.require("xmag")?.as_number()?.abs(), lens.require("ymag")?.as_number()?.abs());
            if y == 0.0 {
                return left_out("its ymag is zero");
            }
            (Projection::Orthographic { height: 2.0 * y }, Some(x / y))
        }
        other => return left_out(&format!("{other:?} is no known type of camera")),
    };
    let aspect = aspect.filter(|a| a.is_finite() && *a > 0.0);
    Ok(Some(Camera { name, position: place.translation, basis: basis(place), projection, aspect, lens: None }))
}

/// The frame of a camera on a node. The specification ignores the node's scale; a mirrored node turns the view but does not mirror
/// the picture.
fn basis(place: &DAffine3) -> DMat3 {
    let back = place.transform_vector3(DVec3::Z).try_normalize().unwrap_or(DVec3::Z);
    let up = place.transform_vector3(DVec3::Y);
    let right = [up, DVec3::Y, DVec3::X].iter().find_map(|up| up.cross(back).try_normalize()).unwrap_or(DVec3::X);
    DMat3::from_cols(right, back.cross(right), back)
}
