//! The thesis's pass 2 (3.3.2): marching along each camera ray, sunlight that scattered once looked at where it scatters, and all
//! that scattered more often taken from stored photons.
//!
//! [`Model::Physical`] lights the regions by photons traced through those very regions, counts where regions overlap once, and
//! follows light off surfaces on; as photons N and the n of an estimate grow with n / N falling, its picture becomes that of
//! [`super::Integrator::Path`]. [`Model::Hura2006`] does what the text says: see [`crate::photon::Model`].

mod beam;
mod gather;
mod march;

use super::lens::View;
use super::path::PathTracer;
use super::tile::{Arrival, Layer, Transport};
use super::{Directional, RenderSettings};
use crate::error::{Error, Result};
use crate::geom::Ray;
use crate::media::{Media, Profile, Scratch};
use crate::photon::{Model, Neighbourhood, Photon, PhotonMap, Tracer};
use crate::plan::{EffectName, Plan};
use crate::progress::Progress;
use crate::rng::Rng;
use crate::sampling::cosine_hemisphere;
use crate::scene::medium::luminance;
use crate::scene::{Medium, Region, Scene, Sun, Surface};
use crate::trimesh::Hit;
use beam::Beams;
use gather::Gather;
use glam::{DVec3, Vec3};
use march::Stretch;
use std::borrow::Cow;
use std::sync::Arc;

/// Where stored photons are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Gathering {
    /// At points of the march, the n nearest (thesis eq. 31).
    #[default]
    March,
    /// Along the whole ray, each photon a ball (the beam radiance estimate; Jarosz, Zwicker and Jensen 2008).
    Beam,
}

/// How the photon integrator works.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PhotonSettings {
    /// The reading of the thesis.
    pub model: Model,
    /// Where photons are looked for.
    pub gather: Gathering,
    /// Photons to store.
    pub photons: u64,
    /// Photons in an estimate; `None` takes the square root of those stored, as the thesis's tests do.
    pub estimate: Option<u64>,
    /// The optical depth of the march's first step. It sets the noise, and no bias.
    pub step: f64,
    /// Looks at the sun's disc from each point of a surface that is met.
    pub shadow_rays: u32,
    /// What the voxels of [`super::Integrator::Grid`] may take, bytes.
    pub memory: u64,
    /// What they keep of light's directions.
    pub directional: Directional,
}

impl Default for PhotonSettings {
    fn default() -> Self {
        PhotonSettings {
            model: Model::Physical,
            gather: Gathering::March,
            photons: 1_000_000,
            estimate: None,
            step: 0.1,
            shadow_rays: 1,
            memory: 1_000_000_000,
            directional: Directional::View,
        }
    }
}

/// The stored photons that lit a picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Lighting {
    /// Stored, of all channels; none by [`super::Integrator::Grid`].
    pub stored: u64,
    /// Emitted; 0 where pass 1's were taken.
    pub emitted: u64,
    /// In an estimate.
    pub estimate: u64,
    /// Voxels that they were gathered in, by [`super::Integrator::Grid`].
    pub voxels: u64,
}

/// Neighbourhoods that a tile keeps of each channel, and of its wider looks.
const HOODS: usize = 64;
/// Beyond this optical depth nothing is seen of flames.
const OPAQUE: f64 = 14.0;
/// Light off a surface, and on it, is marched by steps so much longer: it is a part of the picture only.
const COARSER: f64 = 8.0;

/// The scene, compiled for pass 2.
#[derive(Debug)]
pub(super) struct PhotonTracer {
    channels: Vec<Channel>,
    /// The chance of a collision in a slice of the march.
    slice: f64,
    pub origin: DVec3,
    pub lighting: Lighting,
}

/// What of the spectrum is followed together: everything where the scene is grey, else a channel.
#[derive(Debug)]
struct Channel {
    number: usize,
    tracer: PathTracer,
    light: Light,
    model: Model,
    shadow_rays: u32,
    /// Which of R, G, B this is.
    mask: Vec3,
    /// What sunlight of grey power 1 is in colour.
    tint: Vec3,
}

/// The stored photons, ready to be looked for.
#[derive(Debug)]
enum Light {
    Nearest(Gather),
    Beams(Beams),
}

/// Room that a tile keeps from ray to ray.
#[derive(Debug, Default)]
pub(super) struct Room {
    scratch: Scratch,
    crossings: Vec<(f32, f32, u32)>,
    stretches: Vec<beam::Even>,
    hoods: Vec<Neighbourhood>,
    before: Profile,
    own: Profile,
    /// Whether photons are to be looked for twice as wide too.
    wider: bool,
}

impl Room {
    /// The neighbourhood of a slice of that number of one of the marches: rays of a tile find theirs close together.
    fn neighbourhood(&mut self, march: usize, slice: usize) -> &mut Neighbourhood {
        let i = march * HOODS + slice % HOODS;
        if self.hoods.len() <= i {
            self.hoods.resize_with(i + 1, Neighbourhood::default);
        }
        &mut self.hoods[i]
    }
}

impl PhotonTracer {
    /// Traces the photons, unless `pass1` gives them, and makes them ready.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(super) fn new(
        scene: &Scene,
        plan: &Plan,
        settings: &RenderSettings,
        pass1: Option<PhotonMap>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (seed, settings) = (settings.seed, settings.photon);
        let mut lighting = Lighting::default();
        let mut channels = Vec::new();
        let scene = &*plan.scene(scene);
        let parts = channels_of(scene, settings.model);
        // Sunlight that scattered once is looked at: photons are for the rest.
        let once = plan.orders == Some(1) && !plan.on(EffectName::SurfaceBounce);
        let mut pass1 = pass1;
        for (part, mask, tint) in &parts {
            let tracer = PathTracer::new(part, plan);
            let pass2 = Tracer::new(part, plan, settings.model).of_second_pass();
            let map = match pass1.take() {
                Some(map) => Some(map),
                None if once => None,
                None => traced(part, &pass2, settings.photons.div_ceil(parts.len() as u64), seed, progress, &mut lighting)?,
            };
            let photons = map.map_or(Vec::new(), |map| map.along_curve(tracer.origin));
            lighting.stored += photons.len() as u64;
            let estimate = settings.estimate.unwrap_or((photons.len() as f64).sqrt().round() as u64);
            let photons = if settings.model == Model::Physical { collisions(photons, &tracer.bands[0].media) } else { photons };
            let light = match settings.gather {
                Gathering::March => Light::Nearest(Gather::new(photons, estimate, settings.model, pass2.tile())),
                Gathering::Beam => Light::Beams(Beams::new(photons, estimate, &tracer.bands[0].media, progress)?),
            };
            lighting.estimate = match &light {
                Light::Nearest(gather) => gather.estimate(),
                Light::Beams(beams) => beams.estimate(),
            };
            channels.push(Channel {
                number: channels.len(),
                tracer,
                light,
                model: settings.model,
                shadow_rays: settings.shadow_rays.max(1),
                mask: *mask,
                tint: *tint,
            });
        }
        let origin = channels[0].tracer.origin;
        Ok(PhotonTracer { channels, slice: -(-settings.step).exp_m1(), origin, lighting })
    }
}

/// The grey scenes that make up a scene, with the channels that each stands for and the tint of the light of its sun and lamps.
pub(super) fn channels_of(scene: &Scene, model: Model) -> Vec<(Cow<'_, Scene>, Vec3, Vec3)> {
    let tint = scene.tints().next().unwrap_or(DVec3::ZERO);
    let alike = scene.tints().all(|other| (other - tint).abs().max_element() <= 1e-9);
    let tint = tint.as_vec3();
    let same = |c: [f64; 3]| c[0] == c[1] && c[1] == c[2];
    if scene.regions.iter().all(|r| r.medium.is_grey())
        && scene.air.is_grey()
        && alike
        && scene.dome.as_ref().is_none_or(|dome| dome.has_one_colour())
        && (scene.surfaces.iter().all(|s| same(s.albedo)) || model == Model::Hura2006)
    {
        return vec![(Cow::Borrowed(scene), Vec3::ONE, tint)];
    }
    if model == Model::Hura2006 {
        // The thesis has one wavelength.
        let medium = |m: &Medium| Medium::with_albedo(m.sigma_t(), m.albedo(), m.g);
        return vec![(Cow::Owned(with(scene, &medium, &|c| c)), Vec3::ONE, tint)];
    }
    by_channel(scene).into_iter().map(|(scene, mask)| (scene, mask, Vec3::ONE)).collect()
}

/// The scene in R, in G and in B.
pub(super) fn by_channel<'a>(scene: &Scene) -> Vec<(Cow<'a, Scene>, Vec3)> {
    (0..3).map(|c| (Cow::Owned(with(scene, &|m| m.channel(c), &|rgb| [rgb[c]; 3])), Vec3::AXES[c])).collect()
}

/// A scene with other media and colours.
fn with(scene: &Scene, medium: &dyn Fn(&Medium) -> Medium, of: &dyn Fn([f64; 3]) -> [f64; 3]) -> Scene {
    Scene {
        regions: scene.regions.iter().map(|r| Region { medium: medium(&r.medium), ..r.clone() }).collect(),
        surfaces: scene.surfaces.iter().map(|s| Surface { albedo: of(s.albedo), ..s.clone() }).collect(),
        sun: Sun { irradiance: of(scene.sun.irradiance), ..scene.sun },
        lamps: scene.lamps.iter().map(|lamp| lamp.coloured(of)).collect(),
        flames: scene.flames.iter().map(|flame| flame.coloured(of)).collect(),
        sky: of(scene.sky),
        dome: scene.dome.as_ref().and_then(|dome| dome.coloured(of)).map(Arc::new),
        air: scene.air.coloured(of),
        camera: scene.camera,
        wishes: scene.wishes,
    }
}

/// Pass 2's own photons; `None` where no light finds a region.
fn traced(
    scene: &Scene,
    tracer: &Tracer,
    wanted: u64,
    seed: u64,
    progress: &dyn Progress,
    lighting: &mut Lighting,
) -> Result<Option<PhotonMap>> {
    if !scene.is_lit() || scene.regions.is_empty() {
        return Ok(None);
    }
    match tracer.fill(wanted, seed, progress) {
        Ok(shot) => {
            lighting.emitted += shot.emitted;
            Ok(Some(shot.map))
        }
        Err(Error::Scene { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

/// From what scatters to what collides: powers without the albedo of the region that they were stored in, so that the regions
/// at the point of an estimate can bring theirs.
fn collisions(mut photons: Vec<Photon>, media: &Media) -> Vec<Photon> {
    photons.retain_mut(|photon| {
        let albedo = media.optics(photon.region()).albedo;
        photon.power = (f64::from(photon.power) / albedo) as f32;
        albedo > 0.0
    });
    photons
}

impl Channel {
    /// What arrives along `ray` from its first `reach` metres, or from the sky behind.
    fn radiance(&self, mut ray: Ray, mut reach: f32, slice: f64, rng: &mut Rng, room: &mut Room) -> Arrival {
        let tracer = &self.tracer;
        let (mut arrival, mut throughput, mut layer) = (Arrival::default(), Vec3::ONE, Layer::Environment);
        loop {
            let hit = tracer.surfaces.nearest(&ray, reach);
            let end = hit.map_or(reach, |h| h.t);
            let first = layer == Layer::Environment;
            let stretch = if first || tracer.lights {
                self.march(&ray, end, if first { slice } else { slice * COARSER }, rng, room)
            } else {
                let depth = tracer.bands[0].media.optical_depth(&ray, end, &mut room.scratch);
                Stretch { clear: (-depth).exp(), ..Stretch::default() }
            };
            self.credit(&stretch, throughput, layer, &mut arrival);
            if first {
                arrival.depth = match hit {
                    Some(hit) => (stretch.depth + stretch.clear * f64::from(hit.t), 1.0),
                    None => (stretch.depth, 1.0 - stretch.clear),
                };
            }
            if !tracer.fire.is_empty() {
                let near = if first { f32::INFINITY } else { tracer.fire.near_surface() };
                let Room { scratch, before, own, .. } = room;
                tracer.bands[0].media.profile(&ray, end, (OPAQUE, OPAQUE), scratch, before);
                arrival.light[layer.beside(Layer::VolumeDirect) as usize] +=
                    throughput * tracer.fire_along(&ray, end.min(near), before, scratch, own);
            }
            throughput *= stretch.clear as f32;
            let Some(hit) = hit else {
                arrival.light[layer as usize] += throughput * tracer.sky.seen(ray.direction);
                return arrival;
            };
            layer = Layer::Surface;
            throughput *= tracer.albedos[hit.owner as usize];
            if throughput == Vec3::ZERO {
                return arrival;
            }
            let (p, share) = (hit.off(&ray), throughput / self.shadow_rays as f32);
            if self.model == Model::Hura2006 {
                // Surfaces are there for the shadows alone: what they receive from clouds and from each other is left out.
                (0..self.shadow_rays).for_each(|_| self.case2(&hit, p, share, slice, &mut arrival, rng, room));
                return arrival;
            }
            for _ in 0..self.shadow_rays {
                let light = tracer.on_surface(&tracer.bands[0], p, &hit, rng, &mut room.scratch);
                arrival.light[layer as usize] += share * light;
            }
            ray = Ray { origin: p, direction: cosine_hemisphere(hit.normal, rng.uniform_f32(), rng.uniform_f32()) };
            reach = f32::INFINITY;
            let kept = throughput.max_element().min(1.0);
            if rng.uniform_f32() >= kept {
                return arrival;
            }
            throughput /= kept;
        }
    }

    /// Adds what a stretch of a ray brings, of which `share` arrives, behind events that `layer` stands for.
    fn credit(&self, stretch: &Stretch, share: Vec3, layer: Layer, arrival: &mut Arrival) {
        let indirect = stretch.groups.iter().sum::<f64>() as f32 * self.tint;
        arrival.light[layer.then(Layer::VolumeDirect) as usize] += share * stretch.direct;
        arrival.light[layer.then(Layer::VolumeIndirect) as usize] += share * indirect;
        for (sum, group) in arrival.groups.iter_mut().zip(stretch.groups) {
            *sum += share * self.tint * group as f32;
        }
        let grey = luminance((share * self.tint).as_dvec3().to_array());
        for (sum, wider) in arrival.wider.iter_mut().zip(stretch.wider) {
            *sum += (grey * wider) as f32;
        }
        arrival.collisions += stretch.gathered;
    }

    /// Case 2 to the letter: what a shadow ray brings to a surface, the sun behind regions and what they scatter along it, whose
    /// radiance is taken for an irradiance.
    #[allow(clippy::too_many_arguments)]
    fn case2(&self, hit: &Hit, p: Vec3, share: Vec3, slice: f64, arrival: &mut Arrival, rng: &mut Rng, room: &mut Room) {
        let tracer = &self.tracer;
        let Some((toward, weight)) = tracer.sun.toward(rng) else { return };
        let cos = toward.dot(hit.normal);
        let ray = Ray { origin: p, direction: toward };
        if cos <= 0.0 || tracer.surfaces.nearest(&ray, f32::INFINITY).is_some() {
            return;
        }
        let stretch = self.march(&ray, f32::INFINITY, slice * COARSER, rng, room);
        let share = share * (cos * std::f32::consts::FRAC_1_PI);
        arrival.light[Layer::Surface as usize] += share * tracer.sun.irradiance * (weight * stretch.clear as f32);
        self.credit(&stretch, share, Layer::Surface, arrival);
    }
}

impl Transport for PhotonTracer {
    type Room = Room;

    const BLURS: bool = true;

    fn widen(room: &mut Room, wider: bool) {
        room.wider = wider;
    }

    fn arrival(&self, view: &View, rng: &mut Rng, room: &mut Room) -> Arrival {
        let mut whole = Arrival::default();
        for channel in &self.channels {
            whole.add_stored(&channel.radiance(view.ray, view.reach, self.slice, rng, room), channel.mask);
        }
        whole
    }

    fn clear(&self, view: &View, brought: &Arrival, room: &mut Room) -> (f64, bool) {
        let mut sum = (0.0, false);
        for channel in &self.channels {
            let (clear, surface) = channel.tracer.clear(view, brought, &mut room.scratch);
            sum = (sum.0 + clear / self.channels.len() as f64, surface);
        }
        sum
    }

    fn scratch(room: &Room) -> &Scratch {
        &room.scratch
    }
}

#[cfg(test)]
mod tests;
