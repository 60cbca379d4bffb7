//! Tracing photons: through overlapping regions in closed form, off Lambertian surfaces, until the map is full.

use super::air::AirLight;
use super::colour::Colours;
use super::emit::{Emitter, Start};
use super::eye::Eye;
use super::flame::Flames;
use super::lamp::Lamps;
use super::map::PhotonMap;
use super::rules::{Hura2006, Physical, Rules};
use super::sky::Sky;
use super::witness::Witness;
use super::{Model, Photon};
use crate::error::{Error, Result};
use crate::geom::{Bounds, Ray, Tile};
use crate::media::{
    Flight, Media, Scratch,
    air::{Atmosphere, Spectrum},
};
use crate::plan::{EffectName, Plan};
use crate::progress::Progress;
use crate::rng::{Rng, Stage};
use crate::sampling::around;
use crate::scene::{Air, Dome, Phase, Region, Scene, Shape, medium::luminance};
use crate::stats::{Estimate, Ratios};
use crate::trimesh::TriMesh;
use branch::Branch;
use glam::{DVec3, Vec3};
use smallvec::SmallVec;
use std::ops::Range;
use std::sync::Arc;
use waves::Waves;

/// Paths in a batch: the item that has a stream of random numbers of its own.
const BATCH_PATHS: u64 = 128;
/// Photons that one wave of batches may be expected to store beyond what the map takes.
const WAVE_PHOTONS: u64 = 1 << 17;
/// Collisions after which a path is cut; its power is reported as truncated.
const MAX_COLLISIONS: u64 = 1_000_000;
/// Paths after which it is clear that nothing is stored.
const HOPELESS_PATHS: u64 = 1 << 20;

/// Where the power of a batch went. Order of the numerators in [`Energy`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// Absorbed in regions.
    AbsorbedMedium,
    /// Absorbed by surfaces.
    AbsorbedSurface,
    /// Left the scene.
    Escaped,
    /// Lost to eq. 25, which attenuates what eq. 17 has already sampled; only in [`Model::Hura2006`].
    Attenuated,
    /// Cut after a million collisions.
    Truncated,
    /// What chance took at surfaces and did not give back: its expectation is zero.
    Roulette,
}

/// How many fates there are.
pub const FATES: usize = 6;

/// The energy balance: all fates over the power that crossed the regions' silhouette, or that surfaces sent toward them, by batch.
pub type Energy = Ratios<FATES>;

/// What a whole pass 1 gives.
#[derive(Debug, Clone)]
pub struct Shot {
    /// The stored photons.
    pub map: PhotonMap,
    /// Photons emitted until the map was full: the number that its powers are divided by.
    pub emitted: u64,
    /// Paths that the energy balance counts: those of every batch up to the one that filled the map.
    pub traced: u64,
    /// Collisions of all traced paths.
    pub collisions: u64,
    /// Where the power went.
    pub energy: Energy,
}

impl Shot {
    /// Adds batches in order, up to the one that fills the map: the path that fills it is the last that counts as emitted.
    fn fold(&mut self, wave: &[Batch], wanted: u64) {
        for batch in wave {
            let room = wanted - self.map.len();
            let full = batch.ends.iter().position(|&end| u64::from(end) >= room);
            self.emitted += full.map_or(batch.ends.len(), |path| path + 1) as u64;
            self.traced += batch.ends.len() as u64;
            self.map.extend(&batch.photons[..batch.photons.len().min(room as usize)]);
            self.energy.add(batch.fates, batch.power);
            self.collisions += batch.collisions;
            if full.is_some() {
                return;
            }
        }
    }
}

/// What one batch of paths gives.
#[derive(Debug, Default)]
struct Batch {
    photons: Vec<Photon>,
    /// The number of photons stored by the end of each path.
    ends: Vec<u32>,
    fates: [f64; FATES],
    power: f64,
    collisions: u64,
    interrupted: bool,
}

/// Traces the photons of a scene.
#[derive(Debug, Clone)]
pub struct Tracer {
    pub(super) media: Media,
    pub(super) air: Atmosphere,
    air_light: Option<AirLight>,
    pub(super) surfaces: TriMesh,
    pub(super) albedos: Vec<f64>,
    pub(super) emitter: Emitter,
    sky: Option<Sky>,
    pub(super) lamps: Option<Lamps>,
    flames: Option<Flames>,
    pub(super) sky_radiance: DVec3,
    pub(super) dome: Option<Arc<Dome>>,
    pub(super) colours: Colours,
    pub(super) eye: Option<Eye>,
    model: Model,
    stage: Stage,
    absorption: bool,
    /// Collisions after which a path ends.
    orders: u64,
    /// The largest optical depth across a region.
    thickest: f64,
    origin: DVec3,
    /// A scene of slabs alone looks the same everywhere: its photons are kept within the tile.
    wrap: Option<Tile>,
    /// The tiles of slabs beside other regions: photons outside are not stored.
    pub(super) tiles: Vec<Option<Tile>>,
}

impl Tracer {
    /// Compiles the scene for the effects that the plan calls for.
    pub fn new(scene: &Scene, plan: &Plan, model: Model) -> Self {
        let scene = &*plan.scene(scene);
        let bounds = scene.region_bounds();
        let origin = bounds.centre();
        let bounces = plan.on(EffectName::SurfaceBounce);
        let meshes: Vec<_> = scene.surfaces.iter().map(|s| &s.mesh).collect();
        let alone = scene.regions.iter().all(|r| r.shape.is_endless());
        let local = |b: Bounds| Tile { min: (b.min - origin).as_vec3(), max: (b.max - origin).as_vec3() };
        let tile = |shape: &Shape| (shape.is_endless() && !alone).then(|| local(shape.bounds()));
        let emitter = Emitter::new(scene, origin, plan.on(EffectName::SunDisc), bounces);
        Tracer {
            media: Media::new(&scene.regions, origin),
            air: Atmosphere::default(),
            air_light: None,
            surfaces: TriMesh::new(&meshes, origin),
            albedos: scene.surfaces.iter().map(|s| if bounces { luminance(s.albedo).clamp(0.0, 1.0) } else { 0.0 }).collect(),
            sky: Sky::of(scene, origin, bounces),
            lamps: Lamps::of(scene, origin, emitter.aim(), bounces),
            flames: Flames::of(scene, origin, emitter.aim(), bounces),
            emitter,
            sky_radiance: DVec3::from_array(scene.sky),
            dome: scene.dome.clone(),
            colours: Colours::Even(Vec3::ONE),
            eye: None,
            model,
            stage: Stage::Photons,
            absorption: plan.on(EffectName::Absorption),
            orders: plan.orders.map_or(MAX_COLLISIONS, u64::from),
            thickest: scene.regions.iter().map(|r| r.medium.sigma_t() * r.shape.thickness()).fold(0.0, f64::max),
            origin,
            wrap: (alone && !scene.regions.is_empty()).then(|| local(bounds)),
            tiles: scene.regions.iter().map(|r| tile(&r.shape)).collect(),
        }
    }

    /// The tracer of pass 2's own photons: random numbers that pass 1 has not used.
    pub fn of_second_pass(self) -> Self {
        Tracer { stage: Stage::Gather, ..self }
    }

    /// The tracer of photons that fly through air as well, and come from it.
    pub fn through(self, air: &Air) -> Self {
        let tracer = Tracer { air: Atmosphere::new(air, self.origin), ..self };
        let air_light = if tracer.air.is_empty() { None } else { AirLight::of(&tracer) };
        Tracer { air_light, ..tracer }
    }

    /// The tile, relative to the scene's origin, that photons of a scene without end are kept in.
    pub fn tile(&self) -> Option<Tile> {
        self.wrap
    }

    /// Traces photons until `wanted` are stored (the thesis's "when the volume photon map is full"), or until so many have
    /// been emitted that the scene is too thin to fill it.
    ///
    /// # Errors
    /// [`Error::Interrupted`], and [`Error::Scene`] where no light reaches a region or none scatters twice.
    pub fn fill(&self, wanted: u64, seed: u64, progress: &dyn Progress) -> Result<Shot> {
        progress.begin("photons", wanted);
        let most_paths = 16 * wanted + HOPELESS_PATHS;
        let mut shot = Shot { map: PhotonMap::new(self.origin, wanted), emitted: 0, traced: 0, collisions: 0, energy: Energy::default() };
        let mut next = 2u64;
        let mut waves = Waves::new(self, seed, wanted, progress);
        let mut wave = waves.wave(0..next, 0, WAVE_PHOTONS)?;
        while !wave.is_empty() {
            progress.check()?;
            // What this wave brings is known before it is folded, so that the next one can be traced meanwhile.
            let stored = shot.map.len() + wave.iter().map(|b| b.photons.len() as u64).sum::<u64>();
            let traced = shot.traced + wave.iter().map(|b| b.ends.len() as u64).sum::<u64>();
            let ended = stored >= wanted || traced >= most_paths || (stored == 0 && traced >= HOPELESS_PATHS);
            let expected = (stored / next).max(1);
            let size = if ended { 0 } else { (WAVE_PHOTONS.min(wanted - stored) / expected + 1).clamp(2, 4096) };
            let mut trace = || waves.wave(next..next + size, stored, expected);
            // Ranks meet on the thread that they began on.
            let (following, ()) = match progress.crew() {
                Some(_) => (trace(), shot.fold(&wave, wanted)),
                None => rayon::join(trace, || shot.fold(&wave, wanted)),
            };
            next += size;
            wave = following?;
            progress.at(shot.map.len());
        }
        progress.check()?;
        // A white surface sends the light away: then none of it is absorbed, and still none arrives.
        let shut_out = shot.collisions == 0 && (self.thickest > 0.01 || shot.energy.ratio(Fate::AbsorbedSurface as usize).value > 0.999);
        if shot.energy.denominator() <= 0.0 || shut_out {
            return Err(Error::Scene {
                reason: "no light reaches any region: the sun is dark (lamps and flames too), below the horizon of a layer without end, or surfaces stand between it and every region".into(),
                fix: "Give the sun a strength above zero, and check what lies between it and the cloud".into(),
            });
        }
        shot.map.finish(1.0 / shot.emitted as f64);
        Ok(shot)
    }

    /// The share of sunlight that crosses the scene's own regions, and the `other` ones, without a collision: over the sunlight
    /// that the emitter aims at the scene, by 16 batches of 1024 rays.
    pub fn sunlight_through(&self, other: &[Region], seed: u64) -> (Estimate, Estimate) {
        let other = Media::new(other, self.origin);
        // Shares are those of any sun, a dark one too.
        let emitter = self.emitter.bright();
        let (mut ratios, mut scratch) = (Ratios::<2>::default(), Scratch::default());
        for item in 0..16 {
            let mut rng = Rng::new(seed, Stage::Sunlight, item);
            let (mut through, mut power) = ([0.0; 2], 0.0);
            for _ in 0..1024 {
                let start = emitter.emit(&mut rng, &self.surfaces, None);
                let depth = self.media.optical_depth(&start.ray, f32::INFINITY, &mut scratch);
                // Light beside the layout, or aimed at surfaces, says nothing about it.
                if depth > 0.0 {
                    power += start.power;
                    through[0] += start.power * (-depth).exp();
                    through[1] += start.power * (-other.optical_depth(&start.ray, f32::INFINITY, &mut scratch)).exp();
                }
            }
            ratios.add(through, power);
        }
        (ratios.ratio(0), ratios.ratio(1))
    }

    /// One batch of paths: the same whatever else is traced, and on whatever thread. Stops after the path that alone would
    /// fill the map.
    #[allow(clippy::too_many_arguments)]
    fn batch<W: Witness>(
        &self,
        seed: u64,
        item: u64,
        sample: Option<&Range<u64>>,
        wanted: u64,
        witness: &W,
        progress: &dyn Progress,
    ) -> Batch {
        let mut rng = Rng::new(seed, self.stage, item);
        let (mut batch, mut scratch) = (Batch::default(), Scratch::default());
        for path in 0..BATCH_PATHS {
            // Of paths that are a sample of their own, each starts in its own part of the silhouette.
            let along = |of: &Range<u64>| {
                let paths = ((of.end - of.start) * BATCH_PATHS) as f64;
                (((item - of.start) * BATCH_PATHS + path) as f64 + rng.uniform()) / paths
            };
            let along = sample.map(along);
            let start = self.start(&mut rng, along, &mut scratch);
            batch.power += if start.counted { start.power } else { 0.0 };
            match self.model {
                Model::Physical => self.path::<Physical, W>(start, &mut rng, &mut batch, &mut scratch, wanted, witness, progress),
                Model::Hura2006 => self.path::<Hura2006, W>(start, &mut rng, &mut batch, &mut scratch, wanted, witness, progress),
            }
            batch.ends.push(batch.photons.len() as u32);
            if batch.interrupted || (W::KEEPS && batch.photons.len() as u64 >= wanted) {
                break;
            }
        }
        batch
    }

    /// One path with all its branches: a bounce toward the regions is a branch of its own.
    #[allow(clippy::too_many_arguments)]
    fn path<R: Rules, W: Witness>(
        &self,
        start: Start,
        rng: &mut Rng,
        batch: &mut Batch,
        scratch: &mut Scratch,
        wanted: u64,
        witness: &W,
        progress: &dyn Progress,
    ) {
        let mut left: SmallVec<[Branch; 8]> = SmallVec::new();
        if start.power > 0.0 {
            let Start { ray, power, tint, counted, scattered, from_air } = start;
            let spectrum = Spectrum::draw(&self.air, rng);
            left.push(Branch { ray, power, share: 1.0, tint, spectrum, counted, bounced: scattered, met: false, from_air });
        }
        while let Some(branch) = left.pop() {
            self.branch::<R, W>(branch, rng, batch, scratch, &mut left, wanted, witness, progress);
            if batch.interrupted {
                return;
            }
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn branch<R: Rules, W: Witness>(
        &self,
        mut at: Branch,
        rng: &mut Rng,
        batch: &mut Batch,
        scratch: &mut Scratch,
        left: &mut SmallVec<[Branch; 8]>,
        wanted: u64,
        witness: &W,
        progress: &dyn Progress,
    ) {
        let (mut collisions, mut hint) = (0u64, 0.0);
        let grids = self.model == Model::Hura2006 && self.media.has_grids();
        loop {
            let tau = R::optical_depth(rng);
            let events = collisions + u64::from(at.bounced);
            let similar = witness.similar(events);
            let media = similar.map_or(&self.media, |similar| &*similar.media);
            let flight = media.fly(&at.ray, f32::INFINITY, tau, hint, rng, scratch);
            let reach = if let Flight::Collision { distance, .. } = flight { distance } else { f32::INFINITY };
            let hit = if self.surfaces.is_empty() { None } else { self.surfaces.nearest(&at.ray, reach) };
            let reach = hit.as_ref().map_or(reach, |h| h.t);
            let in_air = if self.air.is_empty() { None } else { self.air.fly(&at.ray, reach, &at.spectrum, rng) };
            let reach = in_air.map_or(reach, |(distance, _)| distance);
            witness.flight(&at.ray, reach, at.power * at.share, at.colour(&self.air), events, rng);
            at.tint *= at.spectrum.flown(&self.air, &at.ray, reach, in_air.map(|(_, layer)| layer));
            if let Some((distance, layer)) = in_air {
                match at.in_air(distance, layer, rng) {
                    Some(next) => at = next,
                    None => return batch.end(Fate::Escaped, &at),
                }
                hint = 0.0;
                continue;
            }
            if let Some(hit) = hit {
                let outside = |light: AirLight| !light.holds(at.ray.at(hit.t));
                if at.from_air && !at.met && self.air_light.is_some_and(outside) {
                    return batch.end(Fate::Escaped, &at);
                }
                match self.bounce(&at, &hit, (witness, scratch), rng, batch, left) {
                    Some(next) => at = next,
                    None => return,
                }
                hint = 0.0;
                continue;
            }
            let Flight::Collision { distance, region, sigma_t } = flight else {
                return batch.end(Fate::Escaped, &at);
            };
            let optics = media.optics(region);
            let p = at.ray.at(distance);
            let p = self.wrap.map_or(p, |tile| tile.wrapped(p));
            collisions += 1;
            at.met = true;
            batch.collisions += 1;
            // Light that a surface happened to send to a region begins to count there.
            if !at.counted {
                at.counted = true;
                batch.power += at.power;
            }
            // In a grid the flight has spent an optical depth of its own.
            let spent = if grids { self.media.optical_depth(&at.ray, distance, scratch) } else { tau };
            let kept = at.power * R::attenuation(spent);
            batch.shift(Fate::Attenuated, &at, at.power - kept);
            at.power = kept;
            if W::KEEPS && (collisions > 1 || at.bounced) && (batch.photons.len() as u64) < wanted && self.in_tile(region, p) {
                let stored = at.power * R::stored(optics.albedo);
                batch.photons.push(Photon::new(p, at.ray.direction, stored as f32, region, batch.ends.len()));
            }
            let mut albedo = optics.albedo;
            // Those media absorb without a colour.
            if let Some(tints) = self.tints().filter(|_| similar.is_none()) {
                albedo = tints.kept[region as usize];
                at.tint *= tints.regions[region as usize];
            }
            if self.absorption && rng.uniform() >= albedo {
                return batch.end(Fate::AbsorbedMedium, &at);
            }
            if collisions >= self.orders {
                return batch.end(Fate::Truncated, &at);
            }
            if collisions.is_multiple_of(4096) && progress.cancelled() {
                batch.interrupted = true;
                return;
            }
            let before = at.ray.direction;
            let phase = similar.map_or(Phase::henyey_greenstein(optics.g), |similar| similar.phase(region));
            if let Some((direction, part)) = witness.aside(p, before, phase, rng) {
                let (ray, events) = (Ray { origin: p, direction }, collisions + u64::from(at.bounced));
                let media = witness.similar(events).map_or(&self.media, |similar| &*similar.media);
                let reach = self.reach(media, &ray, sigma_t, &at.spectrum, rng, scratch);
                witness.flight(&ray, reach, at.power * part, at.colour(&self.air), events, rng);
            }
            let (cos, sin) = if similar.is_some() { phase.sample(rng) } else { R::scatter(optics.g, rng.uniform()) };
            at.ray = Ray { origin: p, direction: around(before, cos as f32, sin as f32, rng.uniform_f32()) };
            hint = sigma_t;
            at.share = witness.share(p, before, at.ray.direction, phase);
        }
    }

    fn in_tile(&self, region: u32, p: Vec3) -> bool {
        self.tiles[region as usize].is_none_or(|tile| tile.holds(p))
    }
}

impl Batch {
    /// A branch ends.
    fn end(&mut self, fate: Fate, at: &Branch) {
        self.shift(fate, at, at.power);
    }

    /// Some of a branch's power ends, if it is counted.
    fn shift(&mut self, fate: Fate, at: &Branch, power: f64) {
        if at.counted {
            self.fates[fate as usize] += power;
        }
    }
}

mod branch;
mod follow;
mod waves;
