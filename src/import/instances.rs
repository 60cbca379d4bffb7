//! `EXT_mesh_gpu_instancing`: one node that stands for many.

use super::{at::At, buffers::Buffers, json::Instancing, mesh::FARTHEST, walk::quaternion};
use crate::Result;
use glam::DAffine3;

/// The transforms of the instances in the node's space.
pub(super) fn transforms(buffers: &Buffers, instancing: &Instancing, at: At) -> Result<Vec<DAffine3>> {
    let names = &instancing.attributes;
    let translations = names.translation.map(|i| buffers.numbers::<3>(i, at, "instances' TRANSLATION")).transpose()?;
    let rotations = names.rotation.map(|i| buffers.numbers::<4>(i, at, "instances' ROTATION")).transpose()?;
    let scales = names.scale.map(|i| buffers.numbers::<3>(i, at, "instances' SCALE")).transpose()?;
    let counts = [translations.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len)];
    let mut counts = counts.into_iter().flatten();
    let count = counts.next().unwrap_or(0);
    if counts.any(|other| other != count) {
        let fix = "Export the file again";
        return Err(at.error("EXT_mesh_gpu_instancing", "attributes of different counts", "one value per instance in each", fix));
    }
    let mut all = Vec::with_capacity(count);
    for i in 0..count {
        let translation = pick(&translations, i, [0.0; 3]);
        let scale = pick(&scales, i, [1.0; 3]);
        let rotation = pick(&rotations, i, [0.0, 0.0, 0.0, 1.0]);
        if !translation.iter().chain(&scale).chain(&rotation).all(|v| v.abs() <= FARTHEST) {
            return Err(at.error(
                format!("transform of instance {i}"),
                "NaN or infinite",
                "finite numbers",
                "Correct that instance and export again",
            ));
        }
        let rotation = quaternion(rotation, &format!("rotation of instance {i}"), at)?;
        all.push(DAffine3::from_scale_rotation_translation(scale.into(), rotation, translation.into()));
    }
    Ok(all)
}

fn pick<const N: usize>(values: &Option<Vec<[f64; N]>>, i: usize, otherwise: [f64; N]) -> [f64; N] {
    values.as_ref().and_then(|v| v.get(i)).copied().unwrap_or(otherwise)
}
