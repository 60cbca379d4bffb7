//! What is near a point: a coarse lattice whose cells list the spheres within a short flight of them.
//!
//! Most flights between two collisions are short. From a point of a cell, a flight of at most `margin` metres can only
//! meet the spheres that reach the cell grown by `margin`; those that hold all of it add a constant extinction and need no
//! root at all. Longer flights go by the hierarchy. Both are exact.

use super::balls::Columns;
use super::{Interval, Optics};
use crate::geom::Ray;
use glam::{IVec3, Vec3};
use smallvec::SmallVec;

/// Cells along the longest side, at most.
const MOST_CELLS: f32 = 48.0;
/// The margin in free paths of the densest sphere alone.
const MARGIN: f32 = 1.0;
/// Entries of all lists together, at most: crowds of overlapping spheres get a coarser lattice, or none.
const MOST_ENTRIES: f32 = 4e6;

/// The lattice.
#[derive(Debug, Clone, Default)]
pub(super) struct Cells {
    corner: Vec3,
    per_metre: f32,
    size: IVec3,
    /// How far a flight may go by a cell's lists.
    pub(super) margin: f32,
    cells: Vec<Cell>,
    full: Vec<u32>,
    partial: Columns,
}

#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    /// Extinction of the spheres that hold all of the grown cell.
    sigma_t: f64,
    full: (u32, u32),
    partial: (u32, u32),
}

/// What a cell knows of its surroundings.
pub(super) struct Near<'a> {
    /// The regions that hold every point within the margin.
    pub(super) full: &'a [u32],
    /// Their extinction.
    pub(super) sigma_t: f64,
    range: (usize, usize),
    columns: &'a Columns,
}

impl Cells {
    /// A lattice over spheres; `balls` are (centre, radius, region).
    pub(super) fn new(balls: &[(Vec3, f32, u32)], optics: &[Optics]) -> Self {
        let low = balls.iter().fold(Vec3::INFINITY, |m, b| m.min(b.0 - b.1));
        let high = balls.iter().fold(Vec3::NEG_INFINITY, |m, b| m.max(b.0 + b.1));
        let longest = (high - low).max_element();
        let sigma = balls.iter().map(|b| optics[b.2 as usize].sigma_t).fold(0.0, f64::max) as f32;
        let margin = MARGIN / sigma;
        // Where a free path is a good part of the scene, or next to nothing of it, a lattice cannot help.
        let across = (longest / margin).min(MOST_CELLS).floor();
        // Nor where there are more spheres than entries: each has at least one, whatever the cell.
        if !(longest.is_finite() && across >= 4.0 && (balls.len() as f32) < 0.5 * MOST_ENTRIES) {
            return Cells::default();
        }
        let entries = |cell: f32| balls.iter().map(|b| ((2.0 * (b.1 + margin) / cell) + 1.0).powi(3)).sum::<f32>();
        let mut cell = longest / across;
        while entries(cell) > MOST_ENTRIES {
            cell *= 1.5;
        }
        let margin = margin.min(cell);
        let size = ((high - low) / cell).floor().as_ivec3() + 1;
        if longest / cell < 4.0 {
            return Cells::default();
        }
        let mut lists: Vec<(Vec<u32>, Vec<u32>)> = vec![Default::default(); (size.x * size.y * size.z) as usize];
        for (i, &(centre, radius, _)) in balls.iter().enumerate() {
            let reach = radius + margin * 1.001;
            let from = ((centre - reach - low) / cell).floor().as_ivec3().max(IVec3::ZERO);
            let to = ((centre + reach - low) / cell).floor().as_ivec3().min(size - 1);
            for x in from.x..=to.x {
                for y in from.y..=to.y {
                    for z in from.z..=to.z {
                        let half = cell * 0.5 + margin * 1.001;
                        let offset = (low + (Vec3::new(x as f32, y as f32, z as f32) + 0.5) * cell - centre).abs();
                        let list = &mut lists[((x * size.y + y) * size.z + z) as usize];
                        if (offset + half).length() < radius * 0.999_9 {
                            list.0.push(i as u32);
                        } else if (offset - half).max(Vec3::ZERO).length() <= radius * 1.000_1 {
                            list.1.push(i as u32);
                        }
                    }
                }
            }
        }
        let mut all = Cells { corner: low, per_metre: 1.0 / cell, size, margin, ..Cells::default() };
        for (full, partial) in lists {
            let start = (all.full.len() as u32, all.partial.len() as u32);
            all.full.extend(full.iter().map(|&i| balls[i as usize].2));
            partial.iter().for_each(|&i| all.partial.push(balls[i as usize]));
            // Not `sum`: that of nothing is -0.0.
            let sigma_t = full.iter().map(|&i| optics[balls[i as usize].2 as usize].sigma_t).fold(0.0, |sum, sigma| sum + sigma);
            all.cells.push(Cell { sigma_t, full: (start.0, all.full.len() as u32), partial: (start.1, all.partial.len() as u32) });
        }
        all.partial.pad();
        all
    }

    /// Whether there is no lattice.
    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// What lies within the margin of a point; `None` outside the lattice.
    #[inline]
    pub(super) fn near(&self, p: Vec3) -> Option<Near<'_>> {
        let at = (p - self.corner) * self.per_metre;
        let index = at.as_ivec3();
        if self.cells.is_empty() || at.min_element() < 0.0 || index.cmpge(self.size).any() {
            return None;
        }
        let cell = &self.cells[((index.x * self.size.y + index.y) * self.size.z + index.z) as usize];
        Some(Near {
            full: &self.full[cell.full.0 as usize..cell.full.1 as usize],
            sigma_t: cell.sigma_t,
            range: (cell.partial.0 as usize, cell.partial.1 as usize),
            columns: &self.partial,
        })
    }
}

impl Near<'_> {
    /// Adds the stretches of the ray, as far as `t_max`, inside the spheres that hold only a part.
    #[inline]
    pub(super) fn intervals(&self, ray: &Ray, t_max: f32, out: &mut SmallVec<[Interval; 32]>) {
        self.columns.intervals(ray, t_max, self.range.0..self.range.1, out);
    }
}
