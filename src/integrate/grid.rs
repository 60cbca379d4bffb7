//! Photons' light in voxels: the fast integrator.
//!
//! Sunlight that scattered once is looked at where camera rays pass, as the path tracer does; all that scattered more often, and the
//! light of the sky, is looked up in a [`field::Field`], smoothed by orders of scattering. Along a ray, extinction is integrated once,
//! without error, and light is looked up at points spread evenly over the chance of a collision, each jittered in its slice. So a
//! picture costs photons and voxels; its pixels cost little.
//!
//! Where there is air, sunlight in it is looked at along the way, and the rest looked up in a [`glow::Glow`]; what clouds, air and flames
//! send to the surfaces that the camera sees is looked up in a [`cast::Cast`].
//!
//! One field holds what goes toward the camera, with the phase functions' peaks. Where surfaces are seen, a coarser one holds light of
//! all directions by harmonics of degrees 0 to 2, for what clouds send them.

mod air;
mod aspect;
mod basis;
mod behind;
mod cast;
mod deposit;
mod field;
mod fit;
mod frame;
mod glow;
mod lobes;
mod orders;
mod plain;
mod source;
mod space;
mod sums;
mod walk;

use super::lens::{Lens, View};
use super::path::PathTracer;
use super::photon::{Lighting, by_channel};
use super::tile::{Arrival, Transport};
use super::{Directional, RenderSettings};
use crate::bvh::Box3;
use crate::error::Result;
use crate::geom::Ray;
use crate::media::{Media, Profile, Scratch};
use crate::photon::{Model, Tracer};
use crate::plan::{EffectName, Plan};
use crate::progress::Progress;
use crate::rng::Rng;
use crate::scene::{Camera, Region, Scene, medium::luminance};
use aspect::{Aspect, usual_extinction};
use basis::Basis;
pub use basis::harmonics;
use cast::Cast;
use field::{Field, Found, Request};
use glam::{DVec3, Vec3};
use glow::Glow;
pub use lobes::of_flow;
use orders::Orders;
pub use source::{Kept, Light, Part, SourceFunction, SourceSettings};
use std::borrow::Cow;
use std::sync::Arc;

/// Bricks behind more optical depth than this, from everywhere in them, are not lit.
const HIDDEN: f64 = 9.0;
/// And behind so much of similar media.
const HAZY: f64 = 5.0;
/// What a number of a voxel takes while light is gathered and smoothed, bytes, colours included; and what it takes afterwards.
const BYTES: u64 = 1160;
const KEPT: u64 = 82;
/// Voxels are at most so many a pixel, but in small pictures, where they would be wider than free paths: then at most so many, if there are as many
/// photons. And so many may always be.
const VOXELS_A_PIXEL: u64 = 48;
const FINE_VOXELS: u64 = 120_000;
const LEAST_VOXELS: u64 = 30_000;
/// Light for surfaces: so many times wider voxels, so many times fewer photons; its photons' items begin here.
const COARSER: f64 = 2.0;
/// Voxels are so many times as wide as usual where the camera is among them.
const FINER: f64 = 0.6;
const FEWER: u64 = 4;
const FIRST: u64 = 1 << 40;
/// All directions.
const ALL: Basis = Basis::Around { degree: 2 };

/// The scene, compiled for one camera.
#[derive(Debug)]
pub(super) struct GridTracer {
    channels: Vec<Channel>,
    pub origin: DVec3,
}

/// What of the spectrum is followed together: everything where the regions' extinction is grey, else a channel.
#[derive(Debug)]
struct Channel {
    tracer: PathTracer,
    photons: Tracer,
    /// The light that the camera sees, and, where it is another, that surfaces get.
    view: Option<Field>,
    around: Option<Field>,
    /// What air sends to the camera, where there is air.
    glow: Option<Glow>,
    /// What media send to the surfaces that the camera sees, where there are both.
    cast: Option<Cast>,
    /// Which of R, G, B this is.
    mask: Vec3,
}

/// Room that a tile keeps from ray to ray.
#[derive(Debug, Default)]
pub(super) struct Room {
    scratch: Scratch,
    profile: Profile,
    own: Profile,
}

impl GridTracer {
    /// Compiles a scene, which is dark yet, for a camera, with voxels for the light of so many photons.
    pub(super) fn new(scene: &Scene, plan: &Plan, camera: &Camera, settings: &RenderSettings, photons: u64) -> Self {
        let scene = &*plan.scene(scene);
        let parts = parts(scene);
        let fields = parts.len() as u64 * if scene.surfaces.is_empty() { 1 } else { 2 };
        let held = settings.photon.memory / (BYTES + (fields - 1) * KEPT);
        // What photons are too few for, or pixels too wide, is not worth its time.
        let told = photons / parts.len() as u64;
        let shown = VOXELS_A_PIXEL * u64::from(settings.width) * u64::from(settings.height);
        let channel = |(part, mask): (Cow<Scene>, Vec3)| {
            let tracer = PathTracer::new(&part, plan);
            let lens = Lens::new(camera, settings.width, settings.height, tracer.origin);
            let photons = Tracer::new(&part, plan, Model::Physical).of_second_pass().in_colour(&part);
            let toward = settings.photon.directional == Directional::View;
            let photons = if toward {
                photons.seen_from(&part, tracer.origin, lens.position(), |centre, radius| lens.frames(centre, radius))
            } else {
                photons
            }
            .through(&part.air);
            let (mut view, mut around) = (None, None);
            // Sunlight that scattered once is looked at: photons are for the rest.
            let once = plan.orders == Some(1) && !sends(&part, plan);
            if !part.regions.is_empty() && photons.strongest() > 0.0 && !once {
                let media = &tracer.bands[0].media;
                let field =
                    |(basis, orders): (Basis, Orders), seen: &(dyn Fn(Box3) -> bool + Sync), first: u64, coarser: f64, fewer: u64| {
                        let worth = told.min(shown.max(FINE_VOXELS)).max(LEAST_VOXELS) / fewer;
                        let voxels = (held / basis.len() as u64).min(worth) as usize;
                        let (scene, origin, seed) = (&*part, tracer.origin, settings.seed);
                        Field::new(Request { scene, media, basis, orders, origin, seen, first, seed, voxels, coarser })
                    };
                if settings.photon.directional == Directional::View {
                    let aspect = Aspect::of(&part, lens.position());
                    let usual = usual_extinction(media, &lens, [settings.width, settings.height]);
                    let crowd = told as f64 / (photons.silhouette() * usual.powi(2));
                    let orders = Orders::similarly(&part, tracer.origin, crowd, &aspect);
                    let basis = Basis::view(&part, lens.position(), orders.part());
                    let through = orders.similar().map(|similar| Arc::clone(&similar.media));
                    let seen = |brick: Box3| {
                        through.as_ref().map_or_else(|| sees(&lens, (media, HIDDEN), brick), |media| sees(&lens, (media, HAZY), brick))
                    };
                    view = Some(field((basis, orders), &seen, 0, if aspect.within { FINER } else { 1.0 }, 1));
                    around = tracer.lights.then(|| field((ALL, Orders::afar(&part)), &|_| true, FIRST, COARSER, FEWER));
                } else {
                    view = Some(field((ALL, Orders::own(&part)), &|_| true, 0, 1.0, 1));
                }
            }
            let glow = || Glow::new(&tracer, lens, [settings.width, settings.height], told, settings.seed);
            let glow = (!part.air.is_empty()).then(glow).flatten();
            let media = tracer.lights || !part.air.is_empty() || !part.flames.is_empty();
            let bright = part.surfaces.iter().flat_map(|s| s.albedo).any(|albedo| albedo > 0.0);
            let cast = (media && bright).then(|| Cast::new(lens, [settings.width, settings.height], settings.seed));
            Channel { tracer, photons, view, around, glow, cast, mask }
        };
        let channels: Vec<Channel> = parts.into_iter().map(channel).collect();
        let origin = channels[0].tracer.origin;
        GridTracer { channels, origin }
    }

    /// Follows so many photons, all channels together.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(super) fn brighten(&mut self, photons: u64, progress: &dyn Progress) -> Result<()> {
        let photons = photons.div_ceil(self.channels.len() as u64);
        for channel in &mut self.channels {
            let Channel { tracer, photons: followed, view, around, glow, .. } = channel;
            if let Some(glow) = glow {
                glow.brighten(tracer, photons, progress)?;
            }
            for (field, fewer) in [(view, 1), (around, FEWER)] {
                if let Some(field) = field {
                    field.brighten((followed, &tracer.bands[0].media), photons.div_ceil(fewer), progress)?;
                }
            }
            if let Some(mut cast) = channel.cast.take() {
                cast.brighten(channel, photons, progress)?;
                channel.cast = Some(cast);
            }
        }
        Ok(())
    }

    /// What lights it.
    pub(super) fn lighting(&self) -> Lighting {
        let fields = || self.channels.iter().flat_map(|channel| [&channel.view, &channel.around]).flatten();
        Lighting { emitted: fields().map(Field::photons).sum(), voxels: fields().map(Field::voxels).sum(), ..Lighting::default() }
    }
}

/// What of a scene is followed together, and which channels that is: the scene as it is where its regions' extinction is grey; else three
/// grey scenes.
fn parts(scene: &Scene) -> Vec<(Cow<'_, Scene>, Vec3)> {
    let grey = |r: &Region| {
        let sigma_t = r.medium.sigma_t_rgb();
        sigma_t.iter().all(|&c| (c - sigma_t[0]).abs() <= 1e-12 * sigma_t[0])
    };
    if scene.regions.iter().all(grey) { vec![(Cow::Borrowed(scene), Vec3::ONE)] } else { by_channel(scene) }
}

/// Whether regions get other light than the sun's own.
fn sends(scene: &Scene, plan: &Plan) -> bool {
    luminance(scene.sky) > 0.0 || !scene.flames.is_empty() || !scene.air.is_empty() || plan.on(EffectName::SurfaceBounce)
}

/// Whether a camera may see anything of a box behind less than so much optical depth.
fn sees(lens: &Lens, (media, hidden): (&Media, f64), brick: Box3) -> bool {
    let (centre, half) = ((brick.min + brick.max) * 0.5, (brick.max - brick.min) * 0.5);
    if !lens.frames(centre, half.length()) {
        return false;
    }
    let mut scratch = Scratch::default();
    let origin = lens.position();
    (0..27).any(|i| {
        let way = centre + half * (Vec3::new((i / 9) as f32, (i / 3 % 3) as f32, (i % 3) as f32) - 1.0) - origin;
        let distance = way.length();
        distance <= half.x || media.optical_depth(&Ray { origin, direction: way / distance }, distance, &mut scratch) < hidden
    })
}

impl Found {
    /// Adds what each group has brought, and what it may be off by, in the colour of the whole.
    fn add_to(&self, arrival: &mut Arrival, throughput: Vec3) {
        let tint = throughput * self.tint();
        arrival.groups.iter_mut().zip(self.groups).for_each(|(sum, group)| *sum += tint * group);
        arrival.doubt += tint * self.doubt;
    }
}

impl Transport for GridTracer {
    type Room = Room;

    const DEALT: bool = true;

    fn arrival(&self, view: &View, rng: &mut Rng, room: &mut Room) -> Arrival {
        let mut whole = Arrival::default();
        for channel in &self.channels {
            whole.add_stored(&channel.radiance(view, rng, room), channel.mask);
        }
        whole
    }

    fn clear(&self, _: &View, brought: &Arrival, _: &mut Room) -> (f64, bool) {
        (brought.clear.0 / self.channels.len() as f64, brought.clear.1 > 0.0)
    }

    fn scratch(room: &Room) -> &Scratch {
        &room.scratch
    }
}

#[cfg(test)]
mod tests;
