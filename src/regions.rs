//! The duality (thesis 3.3.1, eqs 17 and 27): new regions where enough multiply scattered photons lie close together.
//!
//! Each region of the layout is analysed by itself: a point of it is drawn, a search distance d from eq. 17; if n of
//! its photons lie within d, a ball of that radius becomes a region. This goes on until the new regions' optical mass
//! is the old one's.
//!
//! In a voxel grid sigma_t is the one at the point, and a ball is the grid's own medium within d of it: together they are one
//! grid again, its samples times the number of balls around them. Where the density is even this is the thesis's rule, with the
//! balls cut to what the grid fills.

use crate::error::Result;
use crate::photon::{Model, PhotonMap, PhotonTree};
use crate::progress::Progress;
use crate::rng::{Rng, Stage};
use crate::scene::{Region, Scene, Shape};
use body::{Body, Even};
use cloud::Cloud;
use points::{Points, sticking_out};
use search::{Ball, Search};

/// The stopping rule: so many candidates in a row refused, and the region is left as it is, the shortfall reported.
pub const REFUSALS: u64 = 4096;
/// And so many regions made of one: candidates at photons always find one, and an opaque region asks for (radius sigma)^3 / 6.
pub const MOST_REGIONS: u64 = 1 << 20;

/// Where candidates for regions are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
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
    /// New regions made of it; of a voxel grid, the balls that its new grid consists of.
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
    /// The new regions: balls, and one grid for each that was analysed.
    pub regions: Vec<Region>,
    /// One entry for each region of the layout.
    pub sources: Vec<Source>,
    /// The share of the new balls' volume that sticks out of the region they came from (kept: the thesis keeps it). What is made
    /// of voxel grids does not count: it is cut to them.
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
        let tell = |share: f64| {
            progress.at((1000.0 * (done + share * region.optical_mass()) / whole) as u64);
            progress.check()
        };
        let source = one(region, index, map, duality, &mut regions, &tell)?;
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
    tell: &dyn Fn(f64) -> Result<()>,
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
    let enough = photons.len() as u64 >= estimate.max(1) && volume > 0.0;
    let Some(tree) = Some(photons).filter(|_| enough).and_then(PhotonTree::new) else {
        return Ok(source);
    };
    let search = Search {
        points: Points::new(region, photons, map.origin, duality.placement),
        tree: &tree,
        origin: map.origin,
        model: duality.model,
        estimate,
        sigma_t,
        volume,
        seed: duality.seed,
        stream: (index as u64) << 32,
    };
    let (found, grid) = match &region.shape {
        Shape::Grid(grid) => {
            let cloud = Cloud::new(grid);
            let found = search.run(&cloud, tell)?;
            let grid = (!found.balls.is_empty()).then(|| cloud.within(&found.balls));
            (found, grid)
        }
        shape => (search.run(&Even::new(shape), tell)?, None),
    };
    source.regions = found.balls.len() as u64;
    source.candidates = found.candidates;
    source.synthesised = if found.left == 0.0 { source.mass } else { sigma_t * (volume - found.left) };
    let new = |name, shape, photons| Region { name, shape, medium: region.medium, photons: Some(photons) };
    match grid {
        Some(grid) => made.push(new(region.name.clone(), Shape::Grid(grid.into()), found.balls.iter().map(|b| b.photons).sum())),
        None => made.extend(found.balls.iter().zip(1..).map(|(&Ball { centre, radius, photons }, number)| {
            new(format!("{}.{number:03}", region.name), Shape::sphere(centre, radius), photons)
        })),
    }
    Ok(source)
}

mod body;
mod cloud;
mod cover;
mod points;
mod search;
#[cfg(test)]
mod tests;
