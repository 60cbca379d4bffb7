//! Roughly how deep in the shade a point of a grid lies: what decides how carefully its sunlight is looked at.

use super::walk::cell_at;
use super::{BRICK, Grid, trilinear};
use crate::geom::Ray;
use glam::{IVec3, Mat3A, Vec3};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// So many voxels are near.
const NEAR: f32 = 8.0;
/// Samples between two nodes of the lattice; fine where so many would be more than [`COARSE`] optical depths.
const SPACINGS: (i32, i32) = (4, 2);
const COARSE: f32 = 2.0;
/// Optical depths beyond this are all dark.
const DARK: f32 = 12.0;
/// Depths are stored in so many parts of [`DARK`].
const PARTS: f32 = 65535.0;

/// Optical depths toward the sun, on a lattice within each brick, its far sides included.
#[derive(Debug, Clone, Default)]
pub(super) struct Shade {
    spacing: i32,
    /// Nodes along a side of a brick.
    nodes: usize,
    /// Brick by brick, x slowest.
    depths: Vec<u16>,
}

impl Grid {
    /// The optical depth along `ray`, roughly, and no farther than to `most`: near by in steps of a voxel, then by the means of blocks.
    fn rough_depth(&self, ray: &Ray, most: f32) -> f32 {
        let mut depth = 0.0;
        self.walk::<false>(ray, f32::INFINITY, |segment| {
            let (length, per_metre) = (segment.to - segment.from, segment.direction.length());
            if segment.before + segment.from > NEAR / per_metre {
                depth += self.mean(segment.low) * length * self.sigma_t as f32;
                return if depth < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
            }
            let steps = (length * per_metre).ceil();
            let step = length / steps;
            for i in 0..steps as u32 {
                let p = segment.origin + segment.direction * (segment.from + (i as f32 + 0.5) * step);
                let cell = cell_at(p, segment.low, segment.high);
                depth += trilinear(&self.corners(cell), p - cell.as_vec3a()) * step * self.sigma_t as f32;
            }
            if depth < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        depth
    }

    /// Learns the optical depths in direction `toward` (the sun's middle), roughly.
    pub(in crate::media) fn learn_shade(&mut self, toward: Vec3) {
        let local_from_index: Mat3A = self.index_from_local.inverse();
        let densest = self.majorants.iter().copied().fold(0.0, f32::max) * self.sigma_t as f32;
        let voxel = 1.0 / (self.index_from_local * toward).length();
        let spacing = if densest * voxel * SPACINGS.0 as f32 > COARSE { SPACINGS.1 } else { SPACINGS.0 };
        let nodes = (super::BRICK_SIDE / spacing) as usize + 1;
        let one = |corner: IVec3, i: usize| {
            let node = IVec3::new((i / nodes / nodes) as i32, (i / nodes % nodes) as i32, (i % nodes) as i32);
            let p = (corner + node * spacing).clamp(self.low, self.high).as_vec3a();
            let ray = Ray { origin: (local_from_index * (p - self.offset)).into(), direction: toward };
            (self.rough_depth(&ray, DARK).min(DARK) * (PARTS / DARK) + 0.5) as u16
        };
        let depths = self.bricks.par_iter().flat_map_iter(|brick| (0..nodes.pow(3)).map(move |i| one(brick.corner, i))).collect();
        self.shade = Shade { spacing, nodes, depths };
    }

    /// The optical depth toward the sun at a point of the scene's local space, roughly; `None` where no brick is, or nothing was learnt.
    #[inline]
    pub(in crate::media) fn shade(&self, p: Vec3) -> Option<f32> {
        let mut q = self.index_from_local * p + Vec3::from(self.offset);
        if self.periodic {
            for axis in 0..2 {
                let (low, tile) = (self.low[axis] as f32, (self.high[axis] - self.low[axis]) as f32);
                q[axis] -= ((q[axis] - low) / tile).floor() * tile;
            }
        }
        let cell = q.floor().as_ivec3();
        if cell.cmplt(self.low).any() || cell.cmpge(self.high).any() {
            return None;
        }
        let (n, spacing) = (self.shade.nodes, self.shade.spacing);
        if n == 0 {
            return None;
        }
        let depths = &self.shade.depths[self.brick(cell)? * n * n * n..][..n * n * n];
        let f = (q - ((cell >> BRICK) << BRICK).as_vec3()) / spacing as f32;
        let node = f.as_ivec3().min(IVec3::splat(n as i32 - 2));
        let at = (node.x as usize * n + node.y as usize) * n + node.z as usize;
        let corners = [0, 1, n, n + 1, n * n, n * n + 1, n * n + n, n * n + n + 1];
        Some(trilinear(&corners.map(|c| f32::from(depths[at + c])), (f - node.as_vec3()).into()) * (DARK / PARTS))
    }
}
