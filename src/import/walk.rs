//! The tree of nodes: which are in the scene, and where they are.

use super::{at::At, at::file_error, json, mesh::FARTHEST};
use crate::{Error, Result};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::path::Path;

/// A node that is in the scene.
#[derive(Clone, Copy)]
pub(super) struct Visit {
    pub node: usize,
    /// From the node's own space (glTF's, Y up) to the world (Z up).
    pub world: DAffine3,
    /// Whether its name, or that of a node above it, matches `--regions`.
    pub picked: bool,
}

/// (x, y, z) of glTF, Y up, is (x, -z, y) of ours, Z up: a quarter turn about x.
pub(super) const Z_UP: DAffine3 =
    DAffine3 { matrix3: DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0]), translation: DVec3::ZERO };

/// The scene that is shown and its number, where the file has scenes.
type Shown<'a> = Option<(usize, &'a json::Scene)>;

/// The scene that is shown, and its roots: the default scene's, else the first one's, else all nodes below no other.
pub(super) fn roots<'a>(file: &Path, root: &'a json::Root) -> Result<(Shown<'a>, Vec<usize>)> {
    let index = root.scene.unwrap_or(0);
    match root.scenes.get(index) {
        Some(scene) => Ok((Some((index, scene)), scene.nodes.clone())),
        None if root.scene.is_some() => {
            let reason = format!("its default scene is number {index}, and it has {} scenes", root.scenes.len());
            Err(file_error(file, reason, "Export the file again"))
        }
        None => {
            let mut below = vec![false; root.nodes.len()];
            for &child in root.nodes.iter().flat_map(|node| &node.children) {
                if let Some(below) = below.get_mut(child) {
                    *below = true;
                }
            }
            Ok((None, (0..root.nodes.len()).filter(|&i| below.get(i) == Some(&false)).collect()))
        }
    }
}

/// All nodes below the roots, parents before children, in the order of the file's lists.
pub(super) fn walk(file: &Path, root: &json::Root, roots: &[usize], pattern: Option<&str>) -> Result<Vec<Visit>> {
    let mut visits = Vec::with_capacity(root.nodes.len());
    let mut seen = vec![false; root.nodes.len()];
    let mut stack: Vec<Visit> = roots.iter().rev().map(|&node| Visit { node, world: Z_UP, picked: pattern.is_none() }).collect();
    while let Some(Visit { node: index, world: above, picked }) = stack.pop() {
        let (Some(node), Some(seen)) = (root.nodes.get(index), seen.get_mut(index)) else {
            let reason = format!("a scene or a node names node {index} as a child, and there are {} nodes", root.nodes.len());
            return Err(file_error(file, reason, "Export the file again"));
        };
        let at = node_at(file, index, node);
        if std::mem::replace(seen, true) {
            return Err(at.error("its place in the tree", "below two nodes, or below itself", "below one node", "Give it one parent"));
        }
        let world = above * local(node, at)?;
        if !world.to_cols_array().iter().all(|v| v.abs() <= FARTHEST) {
            let found = format!("beyond {FARTHEST:e} once the nodes above it are applied");
            return Err(at.error("world transform", found, "finite", "Correct the scales and locations of it and of its parents"));
        }
        let picked = picked || pattern.is_some_and(|p| node.name.as_deref().is_some_and(|name| matches(p, name)));
        visits.push(Visit { node: index, world, picked });
        stack.extend(node.children.iter().rev().map(|&node| Visit { node, world, picked }));
    }
    Ok(visits)
}

pub(super) fn node_at<'a>(file: &'a Path, index: usize, node: &'a json::Node) -> At<'a> {
    At { file, kind: "node", index, name: node.name.as_deref().filter(|name| !name.is_empty()) }
}

/// The node's own transform.
fn local(node: &json::Node, at: At) -> Result<DAffine3> {
    if let Some(matrix) = &node.matrix {
        let m: [f64; 16] = numbers(matrix, "matrix", at)?;
        let [_, _, _, x, _, _, _, y, _, _, _, z, _, _, _, w] = m;
        if [x, y, z, w] != [0.0, 0.0, 0.0, 1.0] {
            return Err(at.error(
                "matrix",
                format!("one with the last row {:?}", [x, y, z, w]),
                "the last row [0, 0, 0, 1]",
                "Export the file again",
            ));
        }
        return Ok(DAffine3::from_mat4(glam::DMat4::from_cols_array(&m)));
    }
    let translation = node.translation.as_ref().map_or(Ok([0.0; 3]), |v| numbers(v, "translation", at))?;
    let scale = node.scale.as_ref().map_or(Ok([1.0; 3]), |v| numbers(v, "scale", at))?;
    let rotation = node.rotation.as_ref().map_or(Ok([0.0, 0.0, 0.0, 1.0]), |v| numbers(v, "rotation", at))?;
    Ok(DAffine3::from_scale_rotation_translation(scale.into(), quaternion(rotation, "rotation", at)?, translation.into()))
}

/// A quaternion (x, y, z, w) of unit length, give or take rounding.
pub(super) fn quaternion(xyzw: [f64; 4], field: &str, at: At) -> Result<DQuat> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    if (0.9..=1.1).contains(&length) {
        return Ok(q * length.recip());
    }
    Err(at.error(field, format!("a quaternion {xyzw:?} of length {length}"), "length 1", "Set the object's rotation again and export"))
}

/// `N` finite numbers.
pub(super) fn numbers<const N: usize>(values: &[Option<f64>], field: &str, at: At) -> Result<[f64; N]> {
    let wrong = |found: String| -> Error {
        let fix = "Reset the object's transform (in Blender: Object > Clear), or mend the file";
        at.error(field, found, format!("{N} finite numbers"), fix)
    };
    let array: [Option<f64>; N] = values.try_into().map_err(|_| wrong(format!("{} numbers", values.len())))?;
    let mut out = [0.0; N];
    for (out, value) in out.iter_mut().zip(array) {
        *out = value.filter(|v| v.abs() <= f64::from(f32::MAX)).ok_or_else(|| wrong("NaN or infinite".into()))?;
    }
    Ok(out)
}

/// Whether a name matches a pattern of `*` (any characters) and `?` (one character).
pub(super) fn matches(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n, mut star) = (0, 0, None);
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(&c) if c == '?' || name.get(n) == Some(&c) => {
                p += 1;
                n += 1;
            }
            // Let the last star take one more character.
            _ => match star {
                Some((at, taken)) => {
                    star = Some((at, taken + 1));
                    p = at + 1;
                    n = taken + 1;
                }
                None => return false,
            },
        }
    }
    pattern.iter().skip(p).all(|&c| c == '*')
}
