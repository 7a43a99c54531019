//! `EXT_mesh_gpu_instancing`: one node, many places.

use super::super::ImportError;
use super::accessor::Accessors;
use super::budget::Budget;
use super::json::Item;
use super::node::rotation;
use crate::math::{DAffine3, DQuat, DVec3};

/// The world transforms of a node's instances.
pub(super) fn read<'a>(
    extension: &Item<'a>,
    node: &DAffine3,
    accessors: &Accessors<'a>,
    budget: &mut Budget,
) -> Result<Vec<DAffine3>, ImportError> {
    let attributes = extension.require("attributes")?;
    let get = |key: &str| attributes.get(key)?.map(|reference| accessors.get(&reference)).transpose();
    let [translations, rotations, scales] = [get("TRANSLATION")?, get("ROTATION")?, get("SCALE")?];
    let counts: Vec<usize> = [&translations, &rotations, &scales].into_iter().flatten().map(|accessor| accessor.count).collect();
    let n = counts.first().copied().unwrap_or(0);
    if let Some(other) = counts.iter().find(|&&other| other != n) {
        return Err(attributes.error(format!("one attribute has {n} instances, another {other}")));
    }
    let translations = translations.map(|a| a.read_numbers::<3, _>(budget, DVec3::from)).transpose()?;
    let rotations = rotations.map(|a| a.read_numbers::<4, _>(budget, |[x, y, z, w]| rotation(x, y, z, w))).transpose()?;
    let scales = scales.map(|a| a.read_numbers::<3, _>(budget, DVec3::from)).transpose()?;
    budget.reserve(&|| format!("the instances of {}", extension.pointer()), (n * size_of::<DAffine3>()) as u64)?;
    let mut places = Vec::with_capacity(n);
    for i in 0..n {
        let translation = translations.as_ref().map_or(DVec3::ZERO, |t| t[i]);
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |r| r[i]);
        let scale = scales.as_ref().map_or(DVec3::ONE, |s| s[i]);
        let place = *node * DAffine3::from_scale_rotation_translation(scale, rotation, translation);
        if !place.is_finite() {
            return Err(attributes.error(format!("the transform of instance {i} is not finite")));
        }
        places.push(place);
    }
    Ok(places)
}
