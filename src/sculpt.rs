//! What varies within itself, made into voxels: metaballs, meshes that thicken inward, and any shape with turbulent detail.
//!
//! A [`Sculpture`] is a set of parts whose densities add. Each part has a depth below its boundary, in metres; detail moves that
//! boundary, and density follows from the depth. Density at the core is the part's weight.

use crate::error::Result;
use crate::geom::Bounds;
use crate::progress::Progress;
use crate::scene::density::BRICK_VOXELS;
use crate::scene::{BrickGrid, Mesh, Shape, VoxelGrid};
use crate::voxelise::{Lattice, fitting};
pub use detail::{Detail, DetailRequest, MOST_OCTAVES, MOST_STRENGTH};
pub use genus::Genus;
use glam::{DVec3, IVec3};
pub use metaballs::{Element, ElementKind, Metaballs, visible_radius};
use noise::{Moved, Noise};
use part::{Compiled, Piece, Setting};
use std::sync::Arc;

/// What a part is made of.
#[derive(Debug, Clone)]
pub enum Solid {
    /// A shape that is even within: an ellipsoid, a slab, a closed mesh; a grid only where nothing is done to it but to repeat it.
    Shape(Shape),
    /// A family of metaballs: density is 0 where the field is at most the threshold, and rises with it in proportion until it is 1 where
    /// the field is the largest stiffness, which is the field at the middle of a lone element.
    Metaballs(Arc<Metaballs>),
}

impl Solid {
    /// Its bounds in the world, without detail.
    pub fn bounds(&self) -> Bounds {
        match self {
            Solid::Shape(shape) => shape.bounds(),
            Solid::Metaballs(family) => family.bounds(),
        }
    }

    /// The radius of what it is made of, m: half its smallest side, or the mean visible radius of a family's elements.
    pub fn radius(&self) -> f64 {
        match self {
            Solid::Shape(shape) => shape.smallest_half_extent(),
            Solid::Metaballs(family) => family.mean_visible().unwrap_or(0.0),
        }
    }

    /// The smallest thing of it that should be seen, m.
    fn smallest(&self) -> f64 {
        match self {
            Solid::Shape(shape) => shape.smallest_half_extent(),
            Solid::Metaballs(family) => family.smallest_visible().unwrap_or(f64::INFINITY),
        }
    }

    /// The longest way through it along a straight line, roughly, weighed by density, m.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub fn thickness(&self, progress: &dyn Progress) -> Result<f64> {
        match self {
            Solid::Shape(shape) => Ok(shape.thickness()),
            Solid::Metaballs(_) => {
                let alone = Sculpture { parts: vec![Part::new(self.clone())], detail: None, tile: None };
                let coarse = alone.bounds().size().max_element() / (0.5 * ROUGH);
                Ok(alone.voxels(coarse, &no_meshes, progress)?.thickest())
            }
        }
    }
}

/// One part of a sculpture.
#[derive(Debug, Clone)]
pub struct Part {
    /// What it is.
    pub solid: Solid,
    /// Density at its core.
    pub weight: f64,
    /// The depth over which density rises from 0 at the boundary to its full value, m. Metaballs have a rise of their own.
    pub falloff: f64,
}

impl Part {
    /// A part of density 1.
    pub fn new(solid: Solid) -> Self {
        Part { solid, weight: 1.0, falloff: 0.0 }
    }
}

/// Parts whose densities add, detailed alike.
#[derive(Debug, Clone)]
pub struct Sculpture {
    /// The parts.
    pub parts: Vec<Part>,
    /// Their detail.
    pub detail: Option<Detail>,
    /// The tile that is repeated along x and y without end, where it is.
    pub tile: Option<Bounds>,
}

/// Distances to meshes: (mesh, lattice of cubes, metres that count inside, metres that count outside) to samples of the depth inside.
pub type Distances<'a> = &'a dyn Fn(&Mesh, &Lattice, f64, f64) -> Result<BrickGrid>;

/// For sculptures without meshes.
fn no_meshes(_: &Mesh, lattice: &Lattice, _: f64, _: f64) -> Result<BrickGrid> {
    Ok(BrickGrid { world_from_index: lattice.world_from_index(), origins: Vec::new(), values: Vec::new() })
}

/// Voxels along the longest side of a first look at how much is filled.
const ROUGH: f64 = 64.0;
/// Voxels across the smallest bumps, and across the radius of the smallest part.
const FINE: f64 = 3.0;
/// Voxels along the longest side, at least.
const SIDE: f64 = 128.0;

impl Sculpture {
    /// Where its density can be above 0.
    pub fn bounds(&self) -> Bounds {
        let reach = self.detail.map_or(0.0, |d| Noise::new(&d, None).reach());
        let bounds = self.parts.iter().fold(Bounds::EMPTY, |b, p| {
            let own = p.solid.bounds();
            // A field ends at the radius, whatever moves its surface.
            let grow = if matches!(p.solid, Solid::Metaballs(_)) { 0.0 } else { reach };
            b.union(Bounds { min: own.min - grow, max: own.max + grow })
        });
        match self.tile {
            Some(tile) => Bounds { min: tile.min.with_z(bounds.min.z), max: tile.max.with_z(bounds.max.z) },
            None => bounds,
        }
    }

    /// A voxel size: `asked`, or a third of the smallest part's radius, a third of the smallest bump or 1/128 of the longest side,
    /// whichever is finest, coarsened where more than `max_voxels` would be active. The second value says whether it was coarsened.
    ///
    /// # Errors
    /// [`crate::Error::TooManyVoxels`] where `asked` does not fit, [`crate::Error::Interrupted`].
    pub fn voxel_size(&self, asked: Option<f64>, max_voxels: u64, distances: Distances, progress: &dyn Progress) -> Result<(f64, bool)> {
        let longest = self.bounds().size().max_element();
        let smallest = self.parts.iter().map(|p| p.solid.smallest()).fold(f64::INFINITY, f64::min);
        let finest = self.detail.map_or(f64::INFINITY, |d| d.finest());
        let size = asked.unwrap_or((smallest / FINE).min(finest / FINE).min(longest / SIDE));
        if self.pieces(size) <= max_voxels as f64 {
            return Ok((size, false));
        }
        let rough = longest / ROUGH;
        if rough > 0.5 * smallest {
            // Too rough a look would miss what is small: the boxes of all pieces are the safe side.
            return fitting(size, asked, max_voxels, |size| self.pieces(size));
        }
        // How much of the box is filled, by a first look; and a voxel more along the boundary, whose area the look tells too.
        let look = self.voxels(rough, distances, progress)?;
        let (filled, area) = (look.bricks.active_voxels() as f64 * rough.powi(3), f64::from(surface(&look.bricks)) * rough * rough);
        let active = |size: f64| if size >= rough { 1.0 } else { filled / size.powi(3) + area / (size * size) };
        fitting(size, asked, max_voxels, active)
    }

    /// The voxels of a size in the boxes of all parts, a family's elements each by itself; at most those of the whole box.
    fn pieces(&self, size: f64) -> f64 {
        let reach = 2.0 * self.detail.map_or(0.0, |d| Noise::new(&d, None).reach());
        let voxels = |b: Bounds| ((b.size() + reach) / size + 1.0).element_product();
        let part = |p: &Part| match &p.solid {
            Solid::Metaballs(family) => family.elements.iter().map(|e| voxels(e.bounds())).sum(),
            Solid::Shape(shape) => voxels(shape.bounds()),
        };
        self.parts.iter().map(part).sum::<f64>().min((self.bounds().size() / size + 1.0).element_product())
    }

    /// Its density in voxels of `size` metres; where it is repeated, of nearly that size, so that a tile is a whole number of them.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`], and what `distances` says.
    pub fn voxels(&self, size: f64, distances: Distances, progress: &dyn Progress) -> Result<VoxelGrid> {
        let bounds = self.bounds();
        let (lattice, tile) = match self.tile {
            None => (Lattice::near(bounds, size), None),
            Some(tile) => {
                let count = (tile.size() / size).round().max(DVec3::ONE);
                let step = (tile.size() / count).truncate().extend(size);
                (Lattice { anchor: tile.min.with_z(bounds.min.z), step }, Some(count.as_ivec3()))
            }
        };
        let noise = self.detail.map(|d| Noise::new(&d, self.tile));
        let base = noise.as_ref().map_or(f64::NEG_INFINITY, |n| self.bottom() + n.base());
        let setting = Setting { lattice, noise: noise.as_ref(), base, endless: tile.is_some() };
        let parts = self.parts.iter().map(|part| Compiled::new(part, &setting, distances)).collect::<Result<Vec<_>>>()?;
        let (mut pieces, mut touched): (Vec<Piece>, Vec<([i32; 3], u32)>) = (Vec::new(), Vec::new());
        let within = |voxels: Bounds| match tile {
            None => voxels,
            Some(count) => Bounds {
                min: voxels.min.max(DVec3::new(0.0, 0.0, f64::NEG_INFINITY)),
                max: voxels.max.min((count - 1).as_dvec3().with_z(f64::INFINITY)),
            },
        };
        for (number, part) in (0..).zip(&parts) {
            progress.check()?;
            for shift in self.images(part) {
                part.pieces(number, shift, &lattice, |piece, voxels| {
                    let (item, voxels) = (pieces.len() as u32, within(voxels));
                    if !voxels.is_empty() {
                        let meets = |origin| part.meets(&piece, &lattice, origin);
                        lattice.bricks(voxels, meets, |origin| touched.push((origin, item)));
                        pieces.push(piece);
                    }
                });
            }
        }
        let fill = |origin: IVec3, met: &mut dyn Iterator<Item = u32>, sum: &mut [f64; BRICK_VOXELS]| {
            let met: Vec<&Piece> = met.map(|i| &pieces[i as usize]).collect();
            let mut moved = [Moved::default(); BRICK_VOXELS];
            for group in met.chunk_by(|a, b| a.alike(b)) {
                parts[group[0].part as usize].add(origin, group, &setting, &mut moved, sum);
            }
            if let Some(count) = tile {
                outside(origin, count, |voxel| sum[voxel] = 0.0);
            }
        };
        let bricks = lattice.fill(touched, fill, progress)?;
        let (mut min, mut max) = ends(&bricks);
        if let Some(count) = tile {
            (min, max) = ([0, 0, min[2]], [count.x - 1, count.y - 1, max[2]]);
        }
        Ok(VoxelGrid::new(bricks, min, max, tile.is_some()))
    }

    /// The bottom of all parts, without detail, m.
    fn bottom(&self) -> f64 {
        self.parts.iter().map(|p| p.solid.bounds().min.z).fold(f64::INFINITY, f64::min)
    }

    /// How a part is shifted into this tile, once for each of its images that reaches into it.
    fn images(&self, part: &Compiled) -> Vec<DVec3> {
        let Some(tile) = self.tile.filter(|_| !part.is_endless()) else { return vec![DVec3::ZERO] };
        let (part, size) = (part.bounds(), tile.size());
        let along = |axis: usize| {
            let first = ((tile.min[axis] - part.max[axis]) / size[axis]).ceil() as i64;
            let last = ((tile.max[axis] - part.min[axis]) / size[axis]).floor() as i64;
            first..=last
        };
        along(0).flat_map(|x| along(1).map(move |y| DVec3::new(x as f64 * size.x, y as f64 * size.y, 0.0))).collect()
    }
}

/// Visits the voxels of a brick that lie beyond a tile.
fn outside(origin: IVec3, count: IVec3, mut visit: impl FnMut(usize)) {
    if (origin + 8).truncate().cmple(count.truncate()).all() {
        return;
    }
    for voxel in 0..BRICK_VOXELS {
        let (x, y) = (origin.x + (voxel >> 6) as i32, origin.y + (voxel >> 3 & 7) as i32);
        if x >= count.x || y >= count.y {
            visit(voxel);
        }
    }
}

/// The smallest and the largest index of what is not 0.
fn ends(bricks: &BrickGrid) -> ([i32; 3], [i32; 3]) {
    let (mut min, mut max) = ([i32::MAX; 3], [i32::MIN; 3]);
    for (brick, origin) in bricks.origins.iter().enumerate() {
        for (voxel, _) in bricks.brick(brick).iter().enumerate().filter(|(_, v)| **v != 0.0) {
            let local = [voxel >> 6, voxel >> 3 & 7, voxel & 7];
            for axis in 0..3 {
                let index = origin[axis] + local[axis] as i32;
                (min[axis], max[axis]) = (min[axis].min(index), max[axis].max(index));
            }
        }
    }
    if bricks.origins.is_empty() { ([0; 3], [0; 3]) } else { (min, max) }
}

/// The faces between samples that are 0 and samples that are not, within bricks.
fn surface(bricks: &BrickGrid) -> u32 {
    let mut faces = 0;
    for brick in 0..bricks.origins.len() {
        let values = bricks.brick(brick);
        for (step, beyond) in [(64, 512), (8, 64), (1, 8)] {
            for voxel in (0..BRICK_VOXELS).filter(|v| v % beyond + step < beyond) {
                faces += u32::from((values[voxel] == 0.0) != (values[voxel + step] == 0.0));
            }
        }
    }
    faces
}

mod detail;
mod genus;
mod metaballs;
mod noise;
mod part;
#[cfg(test)]
mod tests;
