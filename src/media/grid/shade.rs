//! Roughly how deep in the shade a point of a grid lies: what decides how carefully its sunlight is looked at.

use super::{BRICK, Grid};
use crate::geom::Ray;
use glam::{IVec3, Mat3, Vec3};
use rayon::prelude::*;

/// Nodes along the side of a brick, its far side included: one at every other sample.
const NODES: usize = 5;
/// Optical depths beyond this are all dark.
const DARK: f32 = 16.0;
/// Depths are stored in so many parts of [`DARK`].
const PARTS: f32 = 65535.0;

/// Optical depths toward the sun, on a lattice within each brick.
#[derive(Debug, Clone, Default)]
pub(super) struct Shade(Vec<[u16; NODES * NODES * NODES]>);

impl Grid {
    /// Learns the optical depths in direction `toward` (the sun's middle), roughly.
    pub(in crate::media) fn learn_shade(&mut self, toward: Vec3) {
        let local_from_index: Mat3 = self.index_from_local.inverse();
        let mut corners = vec![IVec3::ZERO; self.bricks.len()];
        for node in 0..self.nodes.len() {
            if self.nodes[node] == super::NONE {
                continue;
            }
            let n = node as i32;
            let at = IVec3::new(n / (self.size.y * self.size.z), n / self.size.z % self.size.y, n % self.size.z) * 64;
            for (i, &brick) in (0..).zip(&self.tables[self.nodes[node] as usize * 512..][..512]) {
                if brick != super::NONE {
                    corners[brick as usize] = at + IVec3::new(i >> 6, i >> 3 & 7, i & 7) * 8;
                }
            }
        }
        let one = |corner: &IVec3| {
            std::array::from_fn(|i| {
                let node = IVec3::new((i / NODES / NODES) as i32, (i / NODES % NODES) as i32, (i % NODES) as i32);
                let p = (*corner + node * 2).clamp(self.low, self.high).as_vec3();
                let ray = Ray { origin: local_from_index * (p - self.offset), direction: toward };
                (self.rough_depth(&ray, DARK).min(DARK) * (PARTS / DARK) + 0.5) as u16
            })
        };
        self.shade = Shade(corners.par_iter().map(one).collect());
    }

    /// The optical depth toward the sun at a point of the scene's local space, roughly; `None` where no brick is.
    #[inline]
    pub(in crate::media) fn shade(&self, p: Vec3) -> Option<f32> {
        let mut q = self.index_from_local * p + self.offset;
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
        let depths = &self.shade.0[self.brick(cell)?];
        let f = (q - ((cell >> BRICK) << BRICK).as_vec3()) * 0.5;
        let node = f.as_ivec3().min(IVec3::splat(NODES as i32 - 2));
        let at = (node.x as usize * NODES + node.y as usize) * NODES + node.z as usize;
        let corners = [0, 1, NODES, NODES + 1, NODES * NODES, NODES * NODES + 1, NODES * NODES + NODES, NODES * NODES + NODES + 1];
        Some(super::trilinear(&corners.map(|c| f32::from(depths[at + c])), f - node.as_vec3()) * (DARK / PARTS))
    }
}
