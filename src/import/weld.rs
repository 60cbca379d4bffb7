//! Vertices that exporters tore apart along seams, put together again; and whether the result is closed.

use crate::geom::Bounds;
use glam::{DVec3, IVec3};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A mesh whose vertices are all different.
pub(super) struct Welded {
    pub points: Vec<DVec3>,
    /// Triangles without those that have no area.
    pub triangles: Vec<[u32; 3]>,
}

/// A fast hash for cells of a grid.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 29)
    }
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_i32(i32::from(b)));
    }
    fn write_i32(&mut self, i: i32) {
        self.0 = (self.0.rotate_left(23) ^ u64::from(i as u32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
}

/// Welds the points that triangles use. Points closer than 1e-7 of the mesh's size (or the precision of `f32`) become one.
pub(super) fn weld(points: &[DVec3], triangles: &[[u32; 3]]) -> Welded {
    let bounds = points.iter().fold(Bounds::EMPTY, |b, &p| b.include(p));
    let size = bounds.size().max_element();
    let far = bounds.min.abs().max(bounds.max.abs()).max_element();
    let near = (1e-7 * size).max(1.2e-7 * far).max(1e-30);
    let cell = (1e-5 * size).max(4.0 * near);
    let place = |p: DVec3| -> IVec3 { ((p - bounds.min) / cell).floor().as_ivec3() };
    let mut cells: HashMap<IVec3, u32, BuildHasherDefault<CellHasher>> = HashMap::default();
    cells.reserve(points.len() / 2);
    let mut welded = Welded { points: Vec::with_capacity(points.len() / 2), triangles: Vec::with_capacity(triangles.len()) };
    let mut find = |p: DVec3| -> u32 {
        let home = place(p);
        if let Some(&known) = cells.get(&home) {
            return known;
        }
        let (low, high) = (place(p - near), place(p + near));
        if low != high {
            for corner in 0..8 {
                let pick = |bit: i32, a: i32, b: i32| if corner & bit == 0 { a } else { b };
                let neighbour = IVec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z));
                if let Some(&known) = cells.get(&neighbour) {
                    return known;
                }
            }
        }
        let new = welded.points.len() as u32;
        welded.points.push(p);
        cells.insert(home, new);
        new
    };
    let mut names = vec![u32::MAX; points.len()];
    for triangle in triangles {
        let corners = triangle.map(|v| match (names.get_mut(v as usize), points.get(v as usize)) {
            (Some(name), Some(&p)) => {
                if *name == u32::MAX {
                    *name = find(p);
                }
                *name
            }
            _ => 0,
        });
        let [a, b, c] = corners;
        if a != b && b != c && c != a {
            welded.triangles.push(corners);
        }
    }
    welded
}

impl Welded {
    /// The number of edges that are not shared by exactly two triangles; zero in a closed mesh.
    pub fn open_edges(&self) -> usize {
        // Edges in buckets by their lower vertex: a few in each.
        let edges = || self.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).map(|(a, b)| (a.min(b) as usize, a.max(b)));
        let mut ends = vec![0_usize; self.points.len() + 1];
        edges().for_each(|(low, _)| ends[low + 1] += 1);
        for i in 1..ends.len() {
            ends[i] += ends[i - 1];
        }
        let mut highs = vec![0_u32; self.triangles.len() * 3];
        for (low, high) in edges() {
            highs[ends[low]] = high;
            ends[low] += 1;
        }
        // Each end has now become its bucket's: the next one's start.
        let mut start = 0;
        let mut open = 0;
        for &end in ends.iter().take(self.points.len()) {
            let bucket = &mut highs[start..end];
            bucket.sort_unstable();
            open += bucket.chunk_by(|a, b| a == b).filter(|edge| edge.len() != 2).count();
            start = end;
        }
        open
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: &[u32; 3]) -> [DVec3; 3] {
        triangle.map(|v| self.points.get(v as usize).copied().unwrap_or_default())
    }

    /// The volume inside, positive where triangles face outward.
    pub fn signed_volume(&self) -> f64 {
        let centre = self.points.first().copied().unwrap_or_default();
        let cone = |t: &[u32; 3]| {
            let [a, b, c] = self.corners(t).map(|p| p - centre);
            a.dot(b.cross(c)) / 6.0
        };
        self.triangles.iter().map(cone).sum()
    }
}
