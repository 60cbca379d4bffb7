//! Triangle meshes in world space.

use crate::geom::Bounds;
use glam::DVec3;

/// A triangle mesh in world space.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions, world space, metres.
    pub vertices: Vec<DVec3>,
    /// Corners of the triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The corners of triangle `i`.
    pub fn triangle(&self, i: usize) -> [DVec3; 3] {
        self.triangles[i].map(|v| self.vertices[v as usize])
    }

    /// The bounds of all vertices that a triangle uses.
    pub fn bounds(&self) -> Bounds {
        self.triangles.iter().flatten().fold(Bounds::EMPTY, |b, &v| b.include(self.vertices[v as usize]))
    }

    /// The volume inside a closed mesh by the divergence theorem, m^3; positive where triangles face outward.
    pub fn signed_volume(&self) -> f64 {
        let centre = self.bounds().centre();
        (0..self.triangles.len())
            .map(|i| {
                let [a, b, c] = self.triangle(i).map(|v| v - centre);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }
}
