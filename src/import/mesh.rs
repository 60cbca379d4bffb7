//! Meshes: triangles out of primitives, and what form they have.

use super::{
    at::At,
    buffers::Buffers,
    fit,
    mend::{Mended, mend},
    weld::{Welded, weld},
};
use crate::{
    Result,
    geom::{Bounds, Ray},
    trimesh::TriMesh,
};
use glam::{DAffine3, DVec3, Vec3};
use std::ops::Range;

/// A mesh as the file has it, in its own space (Y up).
#[derive(Default)]
pub(super) struct RawMesh {
    pub points: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    pub parts: Vec<Part>,
    /// The number of primitives that are points or lines.
    pub skipped: usize,
}

/// The triangles of one primitive.
pub(super) struct Part {
    pub material: Option<usize>,
    pub triangles: Range<usize>,
}

/// What a mesh is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Form {
    /// It has no triangle; the number of its points and lines.
    Nothing(usize),
    /// All its vertices lie on an ellipsoid: the map from the unit ball.
    Ellipsoid(DAffine3),
    /// Closed and with a volume, but not sphere-like.
    Closed,
    /// Closed, without a volume.
    Flat,
    /// With so many edges that are not shared by two triangles; and whether only small holes are open.
    Open(usize, bool),
}

/// What is remembered of a mesh that several nodes may share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Summary {
    pub form: Form,
    pub bounds: Bounds,
    /// The farthest vertex from the centre of the bounds.
    pub reach: f64,
    /// The material of its first primitive.
    pub material: Option<usize>,
}

/// Positions beyond this are damage, not design: squares of them must stay finite.
pub(super) const FARTHEST: f64 = 1e15;

/// Reads all primitives of a mesh.
pub(super) fn read(buffers: &Buffers, index: usize, at: At) -> Result<RawMesh> {
    let meshes = buffers.root.meshes.len();
    let mesh = buffers
        .root
        .meshes
        .get(index)
        .ok_or_else(|| at.error("mesh", index.to_string(), format!("one of the file's {meshes} meshes"), "Export the file again"))?;
    let mut raw = RawMesh::default();
    for primitive in &mesh.primitives {
        let mode = primitive.mode.unwrap_or(4);
        if mode > 6 {
            return Err(at.error("mesh primitive's mode", mode.to_string(), "0 to 6", "Export the file again"));
        }
        let (Some(position), 4..=6) = (primitive.attributes.position, mode) else {
            raw.skipped += 1;
            continue;
        };
        let first = raw.points.len();
        for (i, p) in buffers.numbers::<3>(position, at, "positions")?.into_iter().enumerate() {
            if !p.iter().all(|c| c.abs() <= FARTHEST) {
                let fix = "Delete or move that vertex (in Blender: Mesh > Clean Up), then export again";
                return Err(at.error(format!("position of vertex {i}"), format!("{p:?}"), "three finite numbers", fix));
            }
            raw.points.push(DVec3::from_array(p));
        }
        let count = raw.points.len() - first;
        if raw.points.len() > u32::MAX as usize {
            return Err(at.error("mesh", "more than 4,294,967,295 vertices", "fewer", "Split it or decimate it"));
        }
        let corners: Vec<u32> = match primitive.indices {
            Some(indices) => buffers.indices(indices, count, at)?,
            None => (0..count as u32).collect(),
        };
        let start = raw.triangles.len();
        let first = first as u32;
        assemble(mode, &corners, |t| raw.triangles.push(t.map(|v| first + v)));
        raw.parts.push(Part { material: primitive.material, triangles: start..raw.triangles.len() });
    }
    Ok(raw)
}

/// Triangles out of a list, a strip or a fan.
fn assemble(mode: u64, corners: &[u32], mut emit: impl FnMut([u32; 3])) {
    match mode {
        4 => corners.chunks_exact(3).for_each(|c| {
            if let &[a, b, c] = c {
                emit([a, b, c]);
            }
        }),
        5 => corners.windows(3).enumerate().for_each(|(i, c)| {
            if let &[a, b, c] = c {
                emit(if i % 2 == 0 { [a, b, c] } else { [a, c, b] });
            }
        }),
        _ => corners.windows(2).skip(1).for_each(|pair| {
            if let (&[b, c], Some(&a)) = (pair, corners.first()) {
                emit([a, b, c]);
            }
        }),
    }
}

/// What form a mesh has.
pub(super) fn summary(raw: &RawMesh) -> Summary {
    let used = raw.triangles.iter().flatten().filter_map(|&v| raw.points.get(v as usize).copied());
    let bounds = used.clone().fold(Bounds::EMPTY, Bounds::include);
    let centre = bounds.centre();
    let reach = used.map(|p| p.distance_squared(centre)).fold(0.0, f64::max).sqrt();
    let form = if raw.triangles.is_empty() { Form::Nothing(raw.skipped) } else { form(&weld(&raw.points, &raw.triangles)) };
    Summary { form, bounds, reach, material: raw.parts.first().and_then(|part| part.material) }
}

fn form(mesh: &Welded) -> Form {
    let bounds = mesh.points.iter().fold(Bounds::EMPTY, |b, &p| b.include(p));
    let size = bounds.size();
    if mesh.triangles.is_empty() || mesh.signed_volume().abs() <= 1e-6 * size.max_element() * size.max_element() * size.min_element() {
        return Form::Flat;
    }
    match mesh.open_edges() {
        0 => fit::ellipsoid(mesh).map_or(Form::Closed, Form::Ellipsoid),
        open => Form::Open(open, mend(mesh).is_some()),
    }
}

/// The welded triangles in world space, mended and facing outward; and what was mended.
pub(super) fn solid(raw: &RawMesh, world_from_mesh: DAffine3) -> (crate::scene::Mesh, Mended) {
    let welded = weld(&raw.points, &raw.triangles);
    let (mut welded, mended) = mend(&welded).unwrap_or((welded, Mended::default()));
    if welded.signed_volume() * world_from_mesh.matrix3.determinant() < 0.0 {
        welded.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let vertices = welded.points.iter().map(|&p| world_from_mesh.transform_point3(p)).collect();
    (crate::scene::Mesh { vertices, triangles: welded.triangles }, mended)
}

/// How much larger the volume of a closed mesh is when what it encloses twice counts once less, over that volume: 0 where its surface
/// does not pass through itself. By lines through it, within a percent.
pub(super) fn overlap(mesh: &crate::scene::Mesh) -> f64 {
    const LINES: u32 = 96;
    let (bounds, whole) = (mesh.bounds(), mesh.signed_volume().abs());
    let (centre, size) = (bounds.centre(), bounds.size());
    let triangles = TriMesh::new(&[mesh], centre);
    let (mut crossings, mut length) = (Vec::new(), 0.0);
    for i in 0..LINES * LINES {
        let across = |n: u32| (f64::from(n) + 0.5) / f64::from(LINES) - 0.5;
        let below = DVec3::new(size.x * across(i / LINES), size.y * across(i % LINES), -size.z);
        let ray = Ray { origin: below.as_vec3(), direction: Vec3::Z };
        triangles.inside(&ray, &mut crossings, |from, to| length += f64::from(to) - f64::from(from));
    }
    let once = length * size.x * size.y / f64::from(LINES * LINES);
    if whole > 0.0 { (once - whole).abs() / whole } else { 0.0 }
}

/// The triangles of one primitive in world space, with only the vertices that they use.
pub(super) fn part(raw: &RawMesh, part: &Part, world_from_mesh: DAffine3) -> crate::scene::Mesh {
    let triangles = raw.triangles.get(part.triangles.clone()).unwrap_or_default();
    let mut names = std::collections::HashMap::new();
    let mut mesh = crate::scene::Mesh { vertices: Vec::new(), triangles: Vec::with_capacity(triangles.len()) };
    for triangle in triangles {
        let corners = triangle.map(|v| {
            *names.entry(v).or_insert_with(|| {
                let p = raw.points.get(v as usize).copied().unwrap_or_default();
                mesh.vertices.push(world_from_mesh.transform_point3(p));
                (mesh.vertices.len() - 1) as u32
            })
        });
        mesh.triangles.push(corners);
    }
    mesh
}
