//! Media that absorb and emit, and what shines by itself among them: what a baked cloud looks like, as other renderers draw it.

use super::lens::View;
use super::path::PathTracer;
use super::tile::{Arrival, Layer, Transport};
use super::{RenderSettings, Rendering, expose};
use crate::error::Result;
use crate::media::{Profile, Scratch};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::rng::Rng;
use crate::scene::{Camera, Scene};
use glam::{DVec3, Vec3};

/// The chance of absorption in a slice of the march.
const SLICE: f64 = 0.0625;
/// Beyond this optical depth nothing is seen.
const OPAQUE: f64 = 14.0;

/// What a point of the world sends toward a direction, W m^-2 sr^-1 per unit of optical depth, linear RGB.
pub type Emitted<'a> = dyn Fn(DVec3, DVec3) -> Vec3 + Sync + 'a;

struct EmissionTracer<'a> {
    tracer: PathTracer,
    emitted: &'a Emitted<'a>,
}

/// Room that a tile keeps from ray to ray.
#[derive(Default)]
struct Room {
    scratch: Scratch,
    profile: Profile,
    own: Profile,
}

/// Renders the media of a scene by what they emit, and its flames; surfaces hide it, and nothing else gives light.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn render_emission(
    scene: &Scene,
    plan: &Plan,
    camera: &Camera,
    emitted: &Emitted,
    settings: &RenderSettings,
    progress: &dyn Progress,
) -> Result<Rendering> {
    let tracer = EmissionTracer { tracer: PathTracer::new(scene, plan), emitted };
    expose(&tracer, tracer.tracer.origin, scene, camera, settings, progress)
}

impl Transport for EmissionTracer<'_> {
    type Room = Room;

    const DEALT: bool = true;

    const STORED: bool = false;

    fn arrival(&self, view: &View, rng: &mut Rng, room: &mut Room) -> Arrival {
        let mut arrival = Arrival::default();
        let reach = self.tracer.surfaces.nearest(&view.ray, view.reach).map_or(view.reach, |hit| hit.t);
        self.tracer.bands[0].media.profile(&view.ray, reach, (OPAQUE, OPAQUE), &mut room.scratch, &mut room.profile);
        let chance = -(-room.profile.depth()).exp_m1();
        let slices = (chance / SLICE).ceil() as u32;
        let weight = chance / f64::from(slices.max(1));
        let (mut sum, mut step) = (Vec3::ZERO, 0);
        let outward = -view.ray.direction.as_dvec3();
        for i in 0..slices {
            let tau = -(-(f64::from(i) + rng.uniform()) * weight).ln_1p();
            let distance = room.profile.distance(tau, &mut step);
            sum += (self.emitted)(self.tracer.origin + view.ray.at(distance).as_dvec3(), outward);
        }
        arrival.light[Layer::VolumeIndirect as usize] = sum * weight as f32;
        if !self.tracer.fire.is_empty() {
            let Room { scratch, profile, own } = room;
            arrival.light[Layer::VolumeIndirect as usize] += self.tracer.fire_along(&view.ray, reach, profile, scratch, own);
        }
        arrival
    }

    fn clear(&self, view: &View, brought: &Arrival, room: &mut Room) -> (f64, bool) {
        self.tracer.clear(view, brought, &mut room.scratch)
    }

    fn scratch(room: &Room) -> &Scratch {
        &room.scratch
    }
}
