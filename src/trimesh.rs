//! Triangles as rays see them: the nearest hit for surfaces, inside and outside for closed meshes.

use crate::bvh::{Box3, Bvh};
use crate::geom::{Bounds, Ray};
use crate::scene::Mesh;
use glam::{DVec3, Vec3};

/// One or more meshes' triangles, relative to an origin, under one hierarchy.
#[derive(Debug, Clone, Default)]
pub struct TriMesh {
    /// Corners; kept in f64 so that shared edges are seen alike from both sides.
    triangles: Vec<[DVec3; 3]>,
    /// The mesh that each triangle came from.
    owners: Vec<u32>,
    bvh: Bvh,
}

/// Where a ray met a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in metres.
    pub t: f32,
    /// Unit normal, on the side that the ray came from.
    pub normal: Vec3,
    /// The mesh, by its index in the list given to [`TriMesh::new`].
    pub owner: u32,
}

impl Hit {
    /// The point that `ray` hit, off the surface by more than the position's rounding, so that it is not met again.
    pub fn off(&self, ray: &Ray) -> Vec3 {
        let p = ray.at(self.t);
        p + self.normal * (p.abs().max_element().max(self.t) * 8.0 * f32::EPSILON)
    }
}

impl TriMesh {
    /// Compiles meshes relative to `origin`. Triangles without area are dropped: no ray can meet them.
    pub fn new(meshes: &[&Mesh], origin: DVec3) -> Self {
        let mut all = TriMesh::default();
        for (owner, mesh) in meshes.iter().enumerate() {
            for i in 0..mesh.triangles.len() {
                let corners = mesh.triangle(i).map(|v| v - origin);
                if (corners[1] - corners[0]).cross(corners[2] - corners[0]) != DVec3::ZERO {
                    all.triangles.push(corners);
                    all.owners.push(owner as u32);
                }
            }
        }
        let around = |t: &[DVec3; 3]| Box3::around(t.iter().fold(Bounds::EMPTY, |b, &v| b.include(v)), DVec3::ZERO);
        let boxes: Vec<Option<Box3>> = all.triangles.iter().map(|t| Some(around(t))).collect();
        all.bvh = Bvh::new(&boxes, 2);
        all
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The nearest triangle in (0, t_max).
    pub fn nearest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        // Most rays meet no box: the shear is made for the first that does.
        let mut shear = None;
        let mut best: Option<(f64, u32)> = None;
        self.bvh.traverse(ray.origin, ray.direction, t_max, |i, t_max| {
            let shear = shear.get_or_insert_with(|| Shear::new(ray));
            if let Some((t, _)) = shear.hit(&self.triangles[i as usize])
                && t > 0.0
                && t < f64::from(*t_max)
            {
                best = Some((t, i));
                *t_max = (t as f32).next_up();
            }
        });
        best.map(|(t, i)| {
            let [a, b, c] = self.triangles[i as usize];
            let normal = (b - a).cross(c - a).normalize().as_vec3();
            let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
            Hit { t: t as f32, normal, owner: self.owners[i as usize] }
        })
    }

    /// Calls `keep(enter, exit)` for every stretch of the ray inside the closed mesh (winding number not zero).
    pub fn inside(&self, ray: &Ray, crossings: &mut Vec<(f64, i32)>, mut keep: impl FnMut(f32, f32)) {
        let shear = Shear::new(ray);
        crossings.clear();
        self.bvh.traverse(ray.origin, ray.direction, f32::INFINITY, |i, _| {
            if let Some((t, sign)) = shear.hit(&self.triangles[i as usize])
                && t > 0.0
            {
                crossings.push((t, sign));
            }
        });
        crossings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // Far away the ray is outside: what it still crosses says where it is now.
        let mut winding: i32 = -crossings.iter().map(|c| c.1).sum::<i32>();
        let mut enter = if winding != 0 { f32::NEG_INFINITY } else { f32::NAN };
        for &(t, sign) in crossings.iter() {
            let before = winding;
            winding += sign;
            if before == 0 && winding != 0 {
                enter = t as f32;
            } else if before != 0 && winding == 0 {
                keep(enter, t as f32);
            }
        }
    }

    /// Whether a point is inside the closed mesh (winding number not zero).
    pub fn holds(&self, p: Vec3) -> bool {
        let mut inside = false;
        // Any direction does; one that no modeller aligns anything with avoids ties.
        let direction = Vec3::new(0.267_261, 0.534_522, 0.801_784);
        self.inside(&Ray { origin: p, direction }, &mut Vec::new(), |enter, _| inside |= enter < 0.0);
        inside
    }
}

/// A ray prepared for watertight triangle tests (Woop, Benthin, Wald 2013), in f64.
struct Shear {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

impl Shear {
    fn new(ray: &Ray) -> Self {
        let d = ray.direction.as_dvec3();
        let a = d.abs();
        let z = if a.x >= a.y && a.x >= a.z { 0 } else { 1 + usize::from(a.z > a.y) };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if d[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        Shear { origin: ray.origin.as_dvec3(), axes: [x, y, z], shear: DVec3::new(d[x] / d[z], d[y] / d[z], 1.0 / d[z]) }
    }

    /// The distance, and a sign that tells the two faces of a triangle apart.
    #[inline]
    fn hit(&self, triangle: &[DVec3; 3]) -> Option<(f64, i32)> {
        let [x, y, z] = self.axes;
        let p = triangle.map(|v| {
            let o = v - self.origin;
            DVec3::new(o[x] - self.shear.x * o[z], o[y] - self.shear.y * o[z], self.shear.z * o[z])
        });
        // A ray exactly through an edge: the edge's own direction decides, and the neighbour sees it reversed, so that of two
        // triangles facing alike exactly one is hit, and of two facing apart both or none.
        let edge = |a: DVec3, b: DVec3| {
            let value = a.x * b.y - a.y * b.x;
            let d = b - a;
            (value, if value != 0.0 { value > 0.0 } else { d.y > 0.0 || (d.y == 0.0 && d.x > 0.0) })
        };
        let ((u, pu), (v, pv), (w, pw)) = (edge(p[1], p[2]), edge(p[2], p[0]), edge(p[0], p[1]));
        let det = u + v + w;
        if pu != pv || pv != pw || det == 0.0 {
            return None;
        }
        Some(((u * p[0].z + v * p[1].z + w * p[2].z) / det, if pu { 1 } else { -1 }))
    }
}
