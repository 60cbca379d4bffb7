//! What regions become when all are known: their media; and voxels, where they vary within themselves.

use super::{
    ImportOptions,
    fire::{Ember, Place},
    medium::{self, Filling, Shining},
};
use crate::{
    Result,
    geom::Bounds,
    progress::Progress,
    scene::{BrickGrid, Medium, Mesh, Region, Shape},
    sculpt::{Detail, DetailRequest, Genus, Part, Sculpture, Solid},
    vdb,
    voxelise::Lattice,
};
use glam::DVec3;
use std::sync::Arc;

/// A region, before its medium is known.
pub(super) struct Draft {
    pub name: String,
    pub solid: Solid,
    pub filling: Filling,
    pub detail: Option<DetailRequest>,
    /// The depth over which density rises from the boundary inward, m.
    pub falloff: f64,
    /// Whether what its place says of light is another grid's.
    pub dark: bool,
    /// A mesh that passes through itself, whose inside OpenVDB must tell.
    pub tangled: bool,
}

impl Draft {
    /// Whether it must become voxels.
    fn varies(&self, periodic: bool) -> bool {
        let plain = match &self.solid {
            Solid::Metaballs(_) => false,
            Solid::Shape(Shape::Grid(_)) => return false,
            Solid::Shape(Shape::Slab { .. }) => true,
            Solid::Shape(_) => !periodic && !self.tangled,
        };
        !plain || self.falloff > 0.0 || self.detail.is_some_and(|d| d.strength > 0.0)
    }
}

/// What shares a sculpture: medium but for extinction, and detail.
#[derive(PartialEq)]
struct Kind {
    albedo: [f64; 3],
    g: f64,
    detail: Option<DetailRequest>,
    /// What shines has one extinction, as its light does not follow it.
    shining: Option<(Shining, u64)>,
    /// A slab's tile is its own: what is beside it is not repeated with it.
    slab: Option<usize>,
}

/// Gives the drafts their media, and makes voxels of those that vary: one grid for all that are alike but for their extinction.
pub(super) fn settle(
    drafts: Vec<Draft>,
    options: &ImportOptions,
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<(Vec<Region>, Vec<Ember>)> {
    let (drafts, thick) = seen(drafts, notes, progress)?;
    let names: Vec<(&str, f64)> = drafts.iter().zip(&thick).map(|(d, &t)| (d.name.as_str(), t)).collect();
    let fillings: Vec<Filling> = drafts.iter().map(|d| d.filling).collect();
    let media = medium::fill(&names, &fillings, options.overrides.sigma_t.is_some(), notes);
    let media: Vec<Medium> = media.into_iter().map(|m| options.overrides.medium(m)).collect();
    let periodic = options.overrides.periodic;
    let tile = periodic.then(|| drafts.iter().map(|d| d.solid.bounds()).fold(Bounds::EMPTY, Bounds::union));
    let (mut regions, mut embers) = (Vec::new(), Vec::new());
    // A grid of a VDB that says which of its grids shine does not do so itself.
    let shining = |draft: &Draft| Some(draft.filling.shining()).filter(|s| s.shines() && !draft.dark);
    let mut groups: Vec<(Kind, Vec<usize>)> = Vec::new();
    for (i, draft) in drafts.iter().enumerate() {
        if !draft.varies(periodic) {
            let Solid::Shape(shape) = &draft.solid else { continue };
            if draft.detail.is_some_and(|d| d.strength > 0.0) {
                notes.push(format!("Region {:?} is a voxel grid, and was left without detail.", draft.name));
            }
            let ember = |shining| Ember { name: draft.name.clone(), shining, place: Place::Region(regions.len()) };
            embers.extend(shining(draft).map(ember));
            regions.push(Region { name: draft.name.clone(), shape: shape.clone(), medium: media[i], photons: None });
            continue;
        }
        let slab = !periodic && matches!(draft.solid, Solid::Shape(Shape::Slab { .. }));
        let kind = Kind {
            albedo: albedo(&media[i]),
            g: media[i].g,
            detail: draft.detail,
            shining: shining(draft).map(|s| (s, media[i].sigma_t().to_bits())),
            slab: slab.then_some(i),
        };
        match groups.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, members)) => members.push(i),
            None => groups.push((kind, vec![i])),
        }
    }
    for (kind, members) in groups {
        let tile = kind.slab.map(|i| drafts[i].solid.bounds()).or(tile);
        let parts = Parts { drafts: &drafts, media: &media, members: &members };
        let Some(region) = sculpted(&parts, kind.detail, tile, options, notes, progress)? else { continue };
        let ember = |(shining, _)| Ember { name: region.name.clone(), shining, place: Place::Region(regions.len()) };
        embers.extend(kind.shining.map(ember));
        regions.push(region);
    }
    Ok((regions, embers))
}

/// The drafts that can be seen, with their thicknesses in m.
fn seen(drafts: Vec<Draft>, notes: &mut Vec<String>, progress: &dyn Progress) -> Result<(Vec<Draft>, Vec<f64>)> {
    let mut kept = (Vec::new(), Vec::new());
    for draft in drafts {
        let thickness = draft.solid.thickness(progress)?;
        if thickness > 0.0 {
            kept.0.push(draft);
            kept.1.push(thickness);
        } else {
            notes.push(format!("The metaballs {:?} are nowhere above their threshold, and were left out.", draft.name));
        }
    }
    Ok(kept)
}

fn albedo(medium: &Medium) -> [f64; 3] {
    std::array::from_fn(|c| {
        let sigma_t = medium.sigma_s[c] + medium.sigma_a[c];
        // To what rounding leaves alike.
        if sigma_t > 0.0 { (medium.sigma_s[c] / sigma_t * 1e12).round() } else { 0.0 }
    })
}

/// The members of a group, by their numbers.
struct Parts<'a> {
    drafts: &'a [Draft],
    media: &'a [Medium],
    members: &'a [usize],
}

/// The depth inside a mesh at the samples of a lattice, by OpenVDB. Voxels that are not quite cubes (a tile is a whole number of them) are
/// taken as cubes.
fn distances(mesh: &Mesh, lattice: &Lattice, inside: f64, outside: f64) -> Result<BrickGrid> {
    let size = lattice.step.z;
    let vertices: Vec<DVec3> = mesh.vertices.iter().map(|&v| lattice.index(v) * size).collect();
    let bricks = vdb::mesh_distance(&vertices, &mesh.triangles, size, DVec3::splat(0.5 * size), outside, inside)?;
    Ok(BrickGrid { world_from_index: lattice.world_from_index(), ..bricks })
}

/// One grid of all members of a group; none where it comes out empty.
fn sculpted(
    group: &Parts,
    detail: Option<DetailRequest>,
    tile: Option<Bounds>,
    options: &ImportOptions,
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<Option<Region>> {
    let Parts { drafts, media, members } = *group;
    let sigma = |i: &usize| media[*i].sigma_t();
    let Some(&densest) = members.iter().max_by(|a, b| sigma(a).total_cmp(&sigma(b))) else { return Ok(None) };
    let whole = sigma(&densest);
    let parts: Vec<Part> = members
        .iter()
        .map(|i| {
            let weight = if whole > 0.0 { sigma(i) / whole } else { 1.0 };
            Part { solid: drafts[*i].solid.clone(), weight, falloff: drafts[*i].falloff }
        })
        .collect();
    let radius = parts.iter().map(|p| p.solid.radius()).sum::<f64>() / parts.len() as f64;
    let sculpture = Sculpture { parts, detail: detail.and_then(|d| d.settled(radius)), tile };
    let (size, coarsened) = sculpture.voxel_size(options.voxel_size, options.max_voxels, &distances, progress)?;
    let grid = sculpture.voxels(size, &distances, progress)?;
    let first = &drafts[members[0]].name;
    let name = if members.len() > 1 { format!("{first} and {} more", members.len() - 1) } else { first.clone() };
    if grid.integral() <= 0.0 {
        notes.push(format!("Nothing is left of {name:?}: its detail is larger than itself."));
        return Ok(None);
    }
    let made_of = if members.len() > 1 { format!("{} regions, {name:?},", members.len()) } else { format!("Region {name:?}") };
    let why = sculpture.detail.as_ref().map_or(String::new(), |d| format!(" with {}", told(d)));
    let coarse = if coarsened { ", coarser than its detail asks for, to stay within --max-voxels" } else { "" };
    notes.push(format!(
        "{made_of} became one voxel grid{why}: {} voxels of {:.4} m{coarse}.",
        grid.bricks.active_voxels(),
        grid.voxel_size()
    ));
    Ok(Some(Region { name, shape: Shape::Grid(Arc::new(grid)), medium: media[densest], photons: None }))
}

/// A detail in words.
fn told(detail: &Detail) -> String {
    let genus = Genus::NAMES.iter().find(|(_, genus)| *genus == detail.genus).map_or("", |(name, _)| name);
    format!("the detail of {genus} (bumps from {:.4} m down to {:.4} m)", detail.size, detail.finest())
}
