//! Shapes at rest: morph targets at their default weights, skins at the pose the nodes hold.

use std::rc::Rc;

use super::super::ImportError;
use super::accessor::Accessors;
use super::budget::Budget;
use super::json::{Item, Table};
use crate::math::{DAffine3, DMat3, DMat4, DVec3, Vec3, Vec4};

/// What bends a mesh.
#[derive(Debug, Default)]
pub(super) struct Deform {
    /// Weight of each morph target.
    pub weights: Vec<f64>,
    /// World matrix of each joint, times its inverse bind matrix.
    pub joints: Option<Rc<[DAffine3]>>,
}

/// Per-vertex columns that deformation changes.
pub(super) struct Columns<'c> {
    pub positions: &'c mut [DVec3],
    pub normals: Option<&'c mut [Vec3]>,
    pub tangents: Option<&'c mut [Vec4]>,
}

/// The numbers in a `weights` member.
pub(super) fn weights(owner: &Item<'_>) -> Result<Vec<f64>, ImportError> {
    owner.array("weights")?.numbers()
}

/// The joint matrices of a skin.
pub(super) fn joints<'a>(
    skin: &Item<'a>,
    nodes: &Table<'a>,
    globals: &[DAffine3],
    accessors: &Accessors<'a>,
    budget: &mut Budget,
) -> Result<Vec<DAffine3>, ImportError> {
    let list = skin.require("joints")?.as_array()?;
    let mut matrices = Vec::with_capacity(list.len());
    for reference in list.iter() {
        matrices.push(globals[nodes.index(&reference)?]);
    }
    if let Some(reference) = skin.get("inverseBindMatrices")? {
        let accessor = accessors.get(&reference)?;
        if accessor.count < matrices.len() {
            let message = format!("{} inverse bind matrices for {} joints", accessor.count, matrices.len());
            return Err(reference.error(message));
        }
        let inverse = accessor.read_numbers::<16, _>(budget, |m| DAffine3::from_mat4(DMat4::from_cols_array(&m)))?;
        for (matrix, inverse) in matrices.iter_mut().zip(inverse) {
            *matrix *= inverse;
        }
    }
    Ok(matrices)
}

/// Adds the weighted targets.
pub(super) fn morph<'a>(
    primitive: &Item<'a>,
    weights: &[f64],
    columns: Columns<'_>,
    accessors: &Accessors<'a>,
    budget: &mut Budget,
) -> Result<(), ImportError> {
    let Columns { positions, mut normals, mut tangents } = columns;
    let n = positions.len();
    for (target, &weight) in primitive.array("targets")?.iter().zip(weights) {
        if weight == 0.0 {
            continue;
        }
        let offsets = |key: &str, budget: &mut Budget| -> Result<Option<Vec<DVec3>>, ImportError> {
            let Some(reference) = target.get(key)? else { return Ok(None) };
            let accessor = accessors.get(&reference)?;
            if accessor.count != n {
                return Err(reference.error(format!("a morph target of {} vertices for a shape of {n}", accessor.count)));
            }
            Ok(Some(accessor.read_numbers::<3, _>(budget, |v| DVec3::from(v) * weight)?))
        };
        if let Some(offsets) = offsets("POSITION", budget)? {
            positions.iter_mut().zip(offsets).for_each(|(p, d)| *p += d);
        }
        if let Some(normals) = normals.as_deref_mut()
            && let Some(offsets) = offsets("NORMAL", budget)?
        {
            normals.iter_mut().zip(offsets).for_each(|(n, d)| *n += d.as_vec3());
        }
        if let Some(tangents) = tangents.as_deref_mut()
            && let Some(offsets) = offsets("TANGENT", budget)?
        {
            tangents.iter_mut().zip(offsets).for_each(|(t, d)| *t += d.as_vec3().extend(0.0));
        }
    }
    Ok(())
}

/// What skinning did.
pub(super) enum Skinned {
    /// The primitive names no joints: it stays as it is.
    Rigid,
    /// Vertices are in world coordinates; true when most were mirrored, so that faces must turn to keep their front.
    Posed(bool),
}

/// Moves every vertex by the weighted sum of its joints' matrices.
pub(super) fn skin<'a>(
    attributes: &Item<'a>,
    joints: &[DAffine3],
    columns: Columns<'_>,
    accessors: &Accessors<'a>,
    budget: &mut Budget,
) -> Result<Skinned, ImportError> {
    let Columns { positions, mut normals, mut tangents } = columns;
    let mut sets = Vec::new();
    while let Some(joint_reference) = attributes.get(&format!("JOINTS_{}", sets.len()))? {
        let weight_reference = attributes.require(&format!("WEIGHTS_{}", sets.len()))?;
        let (of_joints, of_weights) = (accessors.get(&joint_reference)?, accessors.get(&weight_reference)?);
        for (accessor, reference) in [(&of_joints, &joint_reference), (&of_weights, &weight_reference)] {
            if accessor.count != positions.len() {
                return Err(reference.error(format!("{} entries for {} vertices", accessor.count, positions.len())));
            }
        }
        let numbers = of_joints.read_unsigned::<4>(budget)?;
        let weights =
            of_weights.read_numbers::<4, _>(budget, |w| w.map(|w| if w.is_finite() { w.max(0.0) as f32 } else { 0.0 }))?;
        let used = numbers.iter().zip(&weights).flat_map(|(n, w)| n.iter().zip(w));
        if let Some((bad, _)) = used.into_iter().find(|&(&n, &w)| w > 0.0 && n as usize >= joints.len()) {
            return Err(joint_reference.error(format!("joint {bad} of a skin with {} joints", joints.len())));
        }
        sets.push((numbers, weights));
    }
    if sets.is_empty() {
        return Ok(Skinned::Rigid);
    }
    let mut mirrored = 0;
    for i in 0..positions.len() {
        let mut sum = DAffine3::ZERO;
        let mut total = 0.0;
        for (numbers, weights) in &sets {
            for (&joint, &weight) in numbers[i].iter().zip(&weights[i]) {
                if weight > 0.0 {
                    let (joint, weight) = (&joints[joint as usize], f64::from(weight));
                    sum.matrix3 += joint.matrix3 * weight;
                    sum.translation += joint.translation * weight;
                    total += weight;
                }
            }
        }
        if total <= 0.0 {
            // A vertex no joint holds: nothing says where it belongs but its own numbers.
            continue;
        }
        sum.matrix3 *= 1.0 / total;
        sum.translation /= total;
        positions[i] = sum.transform_point3(positions[i]);
        let m = sum.matrix3;
        let sign = m.determinant().signum();
        mirrored += usize::from(sign < 0.0);
        if let Some(normals) = normals.as_deref_mut() {
            // The cofactors are the inverse transpose times the determinant, and exist for singular matrices too.
            let cofactor = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
            let normal = (cofactor * normals[i].as_dvec3()) * sign;
            normals[i] = normal.try_normalize().unwrap_or(DVec3::ZERO).as_vec3();
        }
        if let Some(tangents) = tangents.as_deref_mut() {
            let tangent = (m * tangents[i].truncate().as_dvec3()).try_normalize().unwrap_or(DVec3::ZERO);
            tangents[i] = tangent.as_vec3().extend(tangents[i].w * sign as f32);
        }
    }
    Ok(Skinned::Posed(2 * mirrored > positions.len()))
}
