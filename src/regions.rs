//! The duality (thesis 3.3.1, eqs 17 and 27): new regions where enough multiply scattered photons lie close together.
//!
//! Each region of the layout is analysed by itself: a point of it is drawn, a search distance d from eq. 17; if n of
//! its photons lie within d, a ball of that radius becomes a region. This goes on until the new regions' optical mass
//! is the old one's.

use crate::error::Result;
use crate::photon::{Model, Photon, PhotonMap, PhotonTree};
use crate::progress::Progress;
use crate::rng::{Rng, Stage};
use crate::sampling::unit_ball;
use crate::scene::{Mesh, Region, Scene, Shape, VoxelGrid};
use crate::trimesh::TriMesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::Arc;

/// Candidates that share a stream of random numbers and are looked up together.
const CANDIDATES: usize = 64;
/// The stopping rule: so many candidates in a row refused, and the region is left as it is, the shortfall reported.
pub const REFUSALS: u64 = 4096;
/// And so many regions made of one: candidates at photons always find one, and an opaque region asks for (radius sigma)^3 / 6.
pub const MOST_REGIONS: u64 = 1 << 20;

/// Where candidates for regions are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Placement {
    /// Uniformly in the region (the thesis).
    #[default]
    Uniform,
    /// At photons themselves, so in proportion to their density (the thesis's future work, 5.1).
    Importance,
}

/// How regions are synthesised.
#[derive(Debug, Clone, Copy, Default)]
pub struct Duality {
    /// The reading of the thesis.
    pub model: Model,
    /// Where candidates are drawn.
    pub placement: Placement,
    /// Photons that must lie within the search distance; `None` takes the square root of the region's photons, which is
    /// the thesis's 10,000/100 and 1,000,000/1,000.
    pub estimate: Option<u64>,
    /// The seed.
    pub seed: u64,
}

/// What became of one region of the layout.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Source {
    /// Its name.
    pub name: String,
    /// Its photons in the map.
    pub photons: u64,
    /// Photons that had to lie within the search distance.
    pub estimate: u64,
    /// New regions made of it.
    pub regions: u64,
    /// Candidates drawn.
    pub candidates: u64,
    /// Its optical mass, m^2.
    pub mass: f64,
    /// The new regions' optical mass, m^2.
    pub synthesised: f64,
}

/// The regions that the duality made, and where they came from.
#[derive(Debug, Clone)]
pub struct Synthesis {
    /// The new regions.
    pub regions: Vec<Region>,
    /// One entry for each region of the layout.
    pub sources: Vec<Source>,
    /// The share of the new regions' volume that sticks out of the region they came from (kept: the thesis keeps it).
    pub sticking_out: f64,
}

/// Makes new regions of every region of the scene.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn synthesise(scene: &Scene, map: &PhotonMap, duality: &Duality, progress: &dyn Progress) -> Result<Synthesis> {
    let whole = scene.optical_mass();
    progress.begin("regions", 1000);
    let (mut regions, mut sources) = (Vec::new(), Vec::new());
    let (mut done, mut out, mut volume) = (0.0, 0.0, 0.0);
    for (index, region) in scene.regions.iter().enumerate() {
        let first = regions.len();
        let tell = |share: f64| progress.at((1000.0 * (done + share * region.optical_mass()) / whole) as u64);
        let source = one(region, index, map, duality, &mut regions, progress, &tell)?;
        let (o, v) = sticking_out(region, &regions[first..], Rng::new(duality.seed, Stage::Regions, u64::MAX - index as u64));
        (out, volume) = (out + o, volume + v);
        done += source.mass;
        sources.push(source);
        progress.at((1000.0 * done / whole) as u64);
    }
    Ok(Synthesis { regions, sources, sticking_out: if volume > 0.0 { out / volume } else { 0.0 } })
}

/// The duality of one region.
fn one(
    region: &Region,
    index: usize,
    map: &PhotonMap,
    duality: &Duality,
    made: &mut Vec<Region>,
    progress: &dyn Progress,
    tell: &dyn Fn(f64),
) -> Result<Source> {
    let photons = map.of_region(index);
    let estimate = duality.estimate.unwrap_or(((photons.len() as f64).sqrt().round() as u64).max(1));
    let (sigma_t, volume) = (region.medium.sigma_t(), region.shape.volume());
    let mut source = Source {
        name: region.name.clone(),
        photons: photons.len() as u64,
        estimate,
        regions: 0,
        candidates: 0,
        mass: sigma_t * volume,
        synthesised: 0.0,
    };
    let Some(tree) = Some(photons).filter(|p| p.len() as u64 >= estimate.max(1)).and_then(PhotonTree::new) else {
        return Ok(source);
    };
    let points = Points::new(region, photons, map.origin, duality.placement);
    let (mut left, mut refused) = (volume, 0);
    for batch in 0u64.. {
        progress.check()?;
        tell(1.0 - left / volume);
        let largest = match duality.model {
            // A ball larger than the region it refines could only be the region again, elsewhere.
            Model::Physical => 0.5 * region.shape.thickness(),
            // What cannot fit need not be counted; rounding is left to the rule below.
            Model::Hura2006 => (left * 0.75 / PI).cbrt() * (1.0 + 1e-9),
        };
        let mut rng = Rng::new(duality.seed, Stage::Regions, (index as u64) << 32 | batch);
        let candidates: Vec<(DVec3, f64)> =
            (0..CANDIDATES).map(|_| (points.draw(&mut rng), search_distance(duality.model, sigma_t, &mut rng))).collect();
        let found: Vec<u64> = candidates
            .par_iter()
            .map(|&(centre, d)| if d <= largest { tree.count_within((centre - map.origin).as_vec3(), d as f32) } else { 0 })
            .collect();
        for ((centre, d), photons) in candidates.into_iter().zip(found) {
            source.candidates += 1;
            let ball = 4.0 / 3.0 * PI * d.powi(3);
            let fits = ball <= left || duality.model == Model::Physical;
            if d.is_finite() && photons >= estimate && fits {
                refused = 0;
                // The last one is shrunk to close the budget.
                let (d, photons) = if ball <= left {
                    (d, photons)
                } else {
                    let d = (left * 0.75 / PI).cbrt();
                    (d, tree.count_within((centre - map.origin).as_vec3(), d as f32))
                };
                left -= 4.0 / 3.0 * PI * d.powi(3);
                source.regions += 1;
                made.push(Region {
                    name: format!("{}.{:03}", region.name, source.regions),
                    shape: Shape::sphere(centre, d),
                    medium: region.medium,
                    photons: Some(photons),
                });
                // What rounding leaves of the budget is no region.
                if left <= 1e-9 * volume {
                    source.synthesised = source.mass;
                    return Ok(source);
                }
                if source.regions >= MOST_REGIONS {
                    source.synthesised = sigma_t * (volume - left);
                    return Ok(source);
                }
            } else {
                refused += 1;
                if refused >= REFUSALS {
                    source.synthesised = sigma_t * (volume - left);
                    return Ok(source);
                }
            }
        }
    }
    unreachable!("the stopping rule ends every search")
}

/// Eq. 17: without its ln 0 in the physical model.
fn search_distance(model: Model, sigma_t: f64, rng: &mut Rng) -> f64 {
    match model {
        Model::Physical => rng.optical_depth() / sigma_t,
        Model::Hura2006 => -rng.uniform().ln() / sigma_t,
    }
}

/// The new regions' volume outside the region they came from, by 32 points in each, and their whole volume, m^3.
fn sticking_out(source: &Region, made: &[Region], mut rng: Rng) -> (f64, f64) {
    let inside = Inside::new(&source.shape);
    let (mut out, mut whole) = (0.0, 0.0);
    for region in made {
        let Shape::Ellipsoid { world_from_unit } = &region.shape else { continue };
        let outside = (0..32).filter(|_| {
            let p = world_from_unit.transform_point3(unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]));
            !inside.holds(p)
        });
        out += outside.count() as f64 / 32.0 * region.shape.volume();
        whole += region.shape.volume();
    }
    (out, whole)
}

/// Where candidates come from.
enum Points<'a> {
    Photons(&'a [Photon], DVec3),
    Ball(&'a glam::DAffine3),
    Box(crate::geom::Bounds, Option<Inside>),
}

impl<'a> Points<'a> {
    fn new(region: &'a Region, photons: &'a [Photon], origin: DVec3, placement: Placement) -> Self {
        match (placement, &region.shape) {
            (Placement::Importance, _) => Points::Photons(photons, origin),
            (_, Shape::Ellipsoid { world_from_unit }) => Points::Ball(world_from_unit),
            (_, Shape::Slab { .. }) => Points::Box(region.shape.bounds(), None),
            (_, Shape::Mesh(_) | Shape::Grid(_)) => Points::Box(region.shape.bounds(), Some(Inside::new(&region.shape))),
        }
    }

    fn draw(&self, rng: &mut Rng) -> DVec3 {
        match self {
            Points::Photons(photons, origin) => {
                let i = ((rng.uniform() * photons.len() as f64) as usize).min(photons.len() - 1);
                *origin + Vec3::from_array(photons[i].position).as_dvec3()
            }
            Points::Ball(world_from_unit) => world_from_unit.transform_point3(unit_ball([rng.uniform(), rng.uniform(), rng.uniform()])),
            Points::Box(bounds, inside) => loop {
                let p = bounds.min + bounds.size() * DVec3::new(rng.uniform(), rng.uniform(), rng.uniform());
                if inside.as_ref().is_none_or(|i| i.holds(p)) {
                    return p;
                }
            },
        }
    }
}

/// Whether points lie in a shape.
enum Inside {
    Unit(glam::DAffine3),
    Layer(f64, f64),
    Mesh(TriMesh, DVec3),
    Grid(Arc<VoxelGrid>),
}

impl Inside {
    fn new(shape: &Shape) -> Self {
        match shape {
            Shape::Ellipsoid { world_from_unit } => Inside::Unit(world_from_unit.inverse()),
            Shape::Slab { centre, half_height, .. } => Inside::Layer(centre.z, *half_height),
            Shape::Grid(grid) => Inside::Grid(Arc::clone(grid)),
            Shape::Mesh(mesh) => {
                let mesh: &Mesh = mesh;
                let origin = mesh.bounds().centre();
                Inside::Mesh(TriMesh::new(&[mesh], origin), origin)
            }
        }
    }

    fn holds(&self, p: DVec3) -> bool {
        match self {
            Inside::Unit(unit_from_world) => unit_from_world.transform_point3(p).length_squared() <= 1.0,
            Inside::Layer(z, half) => (p.z - z).abs() <= *half,
            Inside::Grid(grid) => grid.density(p) > 0.0,
            Inside::Mesh(mesh, origin) => mesh.holds((p - origin).as_vec3()),
        }
    }
}

#[cfg(test)]
mod tests;
