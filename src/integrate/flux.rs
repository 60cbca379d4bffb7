//! The energy balance: where the sunlight goes that meets the media.

use crate::error::{Error, Result};
use crate::media::{Flight, Media, Scratch};
use crate::photon::emit::Emitter;
use crate::plan::{EffectName, Plan};
use crate::progress::{Parcel, Parcels, Progress, put, share};
use crate::rng::{Rng, Stage};
use crate::sampling::{around, cosine_hemisphere};
use crate::scene::phase::sample_henyey_greenstein;
use crate::scene::{Region, Scene, medium::luminance};
use crate::stats::{Estimate, Ratios};
use crate::trimesh::TriMesh;
use glam::DVec3;

/// Photons that share a stream of random numbers.
const BATCH: u64 = 1024;
/// Batches that are traced before progress is told and the run can stop.
const WAVE: u64 = 256;
/// Below this weight a photon is absorbed as a whole or not at all.
const LIGHT: f64 = 0.01;
/// Collisions after which a path is cut, and counted as such.
const MOST_COLLISIONS: u64 = 1 << 24;

/// The energy balance of a scene: shares of the sunlight that meets the media. The first five add up to 1.
///
/// That is what crosses a region's surface, or passes a voxel that is not empty within two voxels: `area` says how much it is.
/// Other light does not count, nor does that of the sky, of lamps and of flames. Up and down go by the sign of the direction's z as it leaves. Where media or
/// surfaces are coloured, shares are of luminance.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Flux {
    /// The area, across the sunlight, of the light that meets the media, m^2: a share of it times the irradiance is a power in W.
    pub area: Estimate,
    /// Leaves upward.
    pub up: Estimate,
    /// Leaves downward, neither scattered nor reflected.
    pub down_direct: Estimate,
    /// Leaves downward, scattered or reflected at least once.
    pub down_diffuse: Estimate,
    /// Is absorbed in media.
    pub absorbed_medium: Estimate,
    /// Is absorbed by surfaces.
    pub absorbed_surface: Estimate,
    /// The mean length of the way within a region's surface or the box of a grid's voxels, m.
    pub mean_path_length: Estimate,
    /// The mean number of scatterings.
    pub mean_scatterings: Estimate,
    /// Photons that met the media.
    pub photons: u64,
    /// Collisions.
    pub collisions: u64,
    /// Paths cut after very many collisions, counted as absorbed in media.
    pub truncated: u64,
}

/// What became of a photon, and what it went through: the order of the numerators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tally {
    Up,
    DownDirect,
    DownDiffuse,
    AbsorbedMedium,
    AbsorbedSurface,
    Length,
    Scatterings,
}

const TALLIES: usize = 7;

/// The energy balance by `photons` emitted photons. Deterministic for any number of threads.
///
/// # Errors
/// [`Error::Interrupted`]; [`Error::Scene`] where no sunlight reaches the media.
pub fn flux(scene: &Scene, plan: &Plan, photons: u64, seed: u64, progress: &dyn Progress) -> Result<Flux> {
    progress.begin("flux", photons);
    let scene = &*plan.scene(scene);
    let tracer = Tracer::new(scene, plan);
    let batches = photons.div_ceil(BATCH);
    let mut sums = Ratios::<TALLIES>::default();
    let (mut crossed, mut collisions, mut truncated) = (0, 0, 0);
    // Where ranks have to meet they meet seldom.
    let waves = if progress.crew().is_some() { WAVE << 8 } else { WAVE };
    for wave in (0..batches).step_by(waves as usize) {
        let one = |item: u64| tracer.batch(seed, item, BATCH.min(photons - item * BATCH), progress);
        let told = |done: u64| progress.at(((wave + done) * BATCH).min(photons));
        let wave = share(wave..batches.min(wave + waves), one, progress, told)?;
        progress.check()?;
        for batch in wave {
            sums.add(batch.tallies, batch.power);
            crossed += batch.crossed;
            collisions += batch.collisions;
            truncated += batch.truncated;
        }
    }
    if crossed == 0 {
        return Err(Error::Scene {
            reason: format!(
                "of {photons} photons none reaches the media: the sun is dark, below the horizon of a layer without end, or surfaces stand before them"
            ),
            fix: "Give the sun a strength above zero, and check what lies between it and the cloud".into(),
        });
    }
    let of = |tally: Tally| sums.ratio(tally as usize);
    let (whole, share) = (tracer.emitter.area(), crossed as f64 / photons as f64);
    Ok(Flux {
        area: Estimate { value: whole * share, se: whole * (share * (1.0 - share) / photons as f64).sqrt() },
        up: of(Tally::Up),
        down_direct: of(Tally::DownDirect),
        down_diffuse: of(Tally::DownDiffuse),
        absorbed_medium: of(Tally::AbsorbedMedium),
        absorbed_surface: of(Tally::AbsorbedSurface),
        mean_path_length: of(Tally::Length),
        mean_scatterings: of(Tally::Scatterings),
        photons: crossed,
        collisions,
        truncated,
    })
}

/// One colour of light: its media, albedos, and its share of the luminance.
#[derive(Debug)]
struct Colour {
    media: Media,
    surfaces: Vec<f64>,
    /// The share of photons up to and including this colour.
    until: f64,
}

#[derive(Debug)]
struct Tracer {
    colours: Vec<Colour>,
    surfaces: TriMesh,
    emitter: Emitter,
}

#[derive(Debug, Default)]
struct Batch {
    tallies: [f64; TALLIES],
    power: f64,
    crossed: u64,
    collisions: u64,
    truncated: u64,
}

impl Parcel for Batch {
    fn pack(&self, into: &mut Vec<u8>) {
        put(&self.tallies, into);
        put(&[self.power], into);
        put(&[self.crossed, self.collisions, self.truncated], into);
    }

    fn unpack(from: &mut Parcels) -> Option<Self> {
        let (tallies, [power]) = (from.some()?, from.some()?);
        let [crossed, collisions, truncated] = from.some()?;
        Some(Batch { tallies, power, crossed, collisions, truncated })
    }
}

impl Tracer {
    fn new(scene: &Scene, plan: &Plan) -> Self {
        let origin = scene.region_bounds().centre();
        let meshes: Vec<_> = scene.surfaces.iter().map(|s| &s.mesh).collect();
        Tracer {
            colours: colours(scene, origin),
            surfaces: TriMesh::new(&meshes, origin),
            emitter: Emitter::new(scene, origin, plan.on(EffectName::SunDisc), false),
        }
    }

    fn batch(&self, seed: u64, item: u64, photons: u64, progress: &dyn Progress) -> Batch {
        let mut rng = Rng::new(seed, Stage::Flux, item);
        let (mut batch, mut scratch) = (Batch::default(), Scratch::default());
        for _ in 0..photons {
            if progress.cancelled() {
                break;
            }
            self.photon(&mut batch, &mut rng, &mut scratch, progress);
        }
        batch
    }

    /// One photon from the sun to its end; its weights always add up to its power.
    fn photon(&self, batch: &mut Batch, rng: &mut Rng, scratch: &mut Scratch, progress: &dyn Progress) {
        let start = self.emitter.emit(rng, &self.surfaces, None);
        let pick = if self.colours.len() > 1 { rng.uniform() } else { 0.0 };
        let Some(colour) = self.colours.iter().find(|c| pick < c.until) else { return };
        let (mut ray, mut weight) = (start.ray, start.power);
        let Some(entrance) = colour.media.entrance(&ray, scratch) else { return };
        if weight <= 0.0 || (!self.surfaces.is_empty() && self.surfaces.nearest(&ray, entrance).is_some()) {
            return;
        }
        (batch.power, batch.crossed) = (batch.power + weight, batch.crossed + 1);
        let (mut collisions, mut diffuse, mut hint) = (0u64, false, 0.0);
        let least = LIGHT * weight;
        let mut tally = |tally: Tally, amount: f64| batch.tallies[tally as usize] += amount;
        loop {
            let tau = rng.optical_depth();
            let flight = colour.media.fly(&ray, f32::INFINITY, tau, hint, rng, scratch);
            let distance = if let Flight::Collision { distance, .. } = flight { distance } else { f32::INFINITY };
            let hit = if self.surfaces.is_empty() { None } else { self.surfaces.nearest(&ray, distance) };
            let flown = hit.map_or(distance, |h| h.t);
            tally(Tally::Length, weight * colour.media.length_inside(&ray, flown, scratch));
            let (albedo, absorbed) = match (&hit, flight) {
                (Some(hit), _) => (colour.surfaces[hit.owner as usize], Tally::AbsorbedSurface),
                (None, Flight::Collision { region, .. }) => (colour.media.optics(region).albedo, Tally::AbsorbedMedium),
                (None, Flight::Passed) => {
                    let up = ray.direction.z > 0.0;
                    tally(
                        if up {
                            Tally::Up
                        } else if diffuse {
                            Tally::DownDiffuse
                        } else {
                            Tally::DownDirect
                        },
                        weight,
                    );
                    return;
                }
            };
            if weight > least {
                tally(absorbed, weight * (1.0 - albedo));
                weight *= albedo;
            } else if rng.uniform() >= albedo {
                tally(absorbed, weight);
                return;
            }
            if weight == 0.0 {
                return;
            }
            diffuse = true;
            if let Some(hit) = hit {
                ray.origin = hit.off(&ray);
                ray.direction = cosine_hemisphere(hit.normal, rng.uniform_f32(), rng.uniform_f32());
                hint = 0.0;
            } else if let Flight::Collision { distance, region, sigma_t } = flight {
                tally(Tally::Scatterings, weight);
                ray.origin = ray.at(distance);
                let (cos, sin) = sample_henyey_greenstein(colour.media.optics(region).g, rng.uniform());
                ray.direction = around(ray.direction, cos as f32, sin as f32, rng.uniform_f32());
                hint = sigma_t;
                collisions += 1;
                batch.collisions += 1;
            }
            let stuck = collisions >= MOST_COLLISIONS;
            if stuck || (collisions % 4096 == 4095 && progress.cancelled()) {
                tally(Tally::AbsorbedMedium, weight);
                batch.truncated += u64::from(stuck);
                return;
            }
        }
    }
}

/// One colour where everything is grey, else three that share the photons by luminance.
fn colours(scene: &Scene, origin: DVec3) -> Vec<Colour> {
    let grey = |rgb: [f64; 3]| rgb[0] == rgb[1] && rgb[1] == rgb[2];
    if scene.regions.iter().all(|r| r.medium.is_grey()) && scene.surfaces.iter().all(|s| grey(s.albedo)) {
        let surfaces = scene.surfaces.iter().map(|s| s.albedo[0].clamp(0.0, 1.0)).collect();
        return vec![Colour { media: Media::new(&scene.regions, origin), surfaces, until: 1.0 }];
    }
    let shares: [f64; 3] = std::array::from_fn(|c| {
        let mut one = [0.0; 3];
        one[c] = scene.sun.irradiance[c];
        luminance(one)
    });
    let whole: f64 = shares.iter().sum();
    let one = |c: usize| {
        let regions: Vec<Region> = scene.regions.iter().map(|r| Region { medium: r.medium.channel(c), ..r.clone() }).collect();
        Colour {
            media: Media::new(&regions, origin),
            surfaces: scene.surfaces.iter().map(|s| s.albedo[c].clamp(0.0, 1.0)).collect(),
            until: if c == 2 { 1.0 } else { shares[..=c].iter().sum::<f64>() / whole },
        }
    };
    (0..3).map(one).collect()
}
