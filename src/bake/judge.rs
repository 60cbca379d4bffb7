//! How far a bake is off: its picture against the path tracer's, from its own camera and from others.

use super::{Baked, Term};
use crate::error::Result;
use crate::film::Film;
use crate::geom::Bounds;
use crate::integrate::photon::PhotonSettings;
use crate::integrate::{Integrator, RenderSettings, of_flow, render, render_emission};
use crate::plan::{Density, Plan};
use crate::progress::Progress;
use crate::scene::density::BRICK_SIDE;
use crate::scene::medium::luminance;
use crate::scene::phase::henyey_greenstein;
use crate::scene::{BrickGrid, Camera, Flame, Medium, Region, Scene, Shape, VoxelGrid};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use serde::Serialize;
use smallvec::{SmallVec, smallvec};
use std::f64::consts::TAU;
use std::sync::Arc;

/// The longer side of the pictures that are compared, pixels; the blocks, pixels; samples of the path tracer and of the bake.
const SIDE: f64 = 64.0;
const BLOCK: u32 = 8;
const SAMPLES: u32 = 128;
const LOOKS: u32 = 4;
/// Cameras: that of the bake, and that turned about the cloud's middle by thirds of a circle.
const CAMERAS: u32 = 3;

/// What a bake is off by, from one camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BakeError {
    /// Turned from the bake's camera about the cloud's vertical, degrees.
    pub turned: f64,
    /// The mean light of the cloud over the path tracer's, less 1.
    pub mean: f64,
    /// The standard error of that, the path tracer's.
    pub mean_se: f64,
    /// The root mean square difference of blocks of 8 x 8 pixels in a picture of 64 along its longer side, its noise taken off, over the
    /// mean of the blocks that are lit.
    pub rms: f64,
}

/// What a file holds beside baked light.
#[derive(Debug)]
pub struct Beside<'a> {
    /// The medium.
    pub density: &'a BrickGrid,
    /// Its extinction in 1/m of a sample of 1.
    pub density_scale: f64,
    /// What shines by itself, in the scene's world.
    pub flames: Vec<Flame>,
    /// What turned the scene into the world of the grids.
    pub turned: Option<DAffine3>,
}

/// Compares a bake with the truth.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub fn judge(
    baked: &Baked,
    Beside { density, density_scale, flames, turned }: Beside,
    scene: &Scene,
    (camera, aspect, seed): (&Camera, f64, u64),
    progress: &dyn Progress,
) -> Result<Vec<BakeError>> {
    let back = turned.map_or(DAffine3::IDENTITY, |turn| turn.inverse());
    let bricks = BrickGrid { world_from_index: back * density.world_from_index, ..density.clone() };
    let (low, high) = bricks.extent();
    let shape = Shape::Grid(Arc::new(VoxelGrid::new(bricks, low, high, false)));
    let region = Region { name: "density".into(), shape, medium: Medium::with_albedo(density_scale, 0.0, 0.0), photons: None };
    let written = Scene { regions: vec![region], surfaces: scene.surfaces.clone(), flames, ..Scene::default() };
    let plans = [&written, scene].map(|scene| Plan::for_scene(scene, Density::Source));
    let lookup = Lookup::new(baked, back, scene);
    let emitted = |p: DVec3, outward: DVec3| lookup.toward(p, outward);
    let (width, height) = if aspect >= 1.0 { (SIDE, SIDE / aspect) } else { (SIDE * aspect, SIDE) };
    let (width, height) = ((width as u32).max(BLOCK), (height as u32).max(BLOCK));
    let bounds = scene.region_bounds();
    let mut errors = Vec::new();
    for i in 0..CAMERAS {
        let turn = TAU * f64::from(i) / f64::from(CAMERAS);
        let camera = around(camera, bounds, turn);
        let settings =
            |spp: u32| RenderSettings { integrator: Integrator::Path, width, height, spp, seed, photon: PhotonSettings::default() };
        let bake = render_emission(&written, &plans[0], &camera, &emitted, &settings(LOOKS), progress)?.film;
        let truth = render(scene, &plans[1], &camera, &settings(SAMPLES), None, progress)?.film;
        errors.push(compare(&bake, &truth, turn.to_degrees()));
    }
    Ok(errors)
}

/// The camera, turned about the middle of what it looks at.
fn around(camera: &Camera, bounds: Bounds, angle: f64) -> Camera {
    let centre = bounds.centre();
    let turn =
        DAffine3::from_translation(centre) * DAffine3::from_quat(DQuat::from_rotation_z(angle)) * DAffine3::from_translation(-centre);
    Camera { world_from_camera: turn * camera.world_from_camera, ..*camera }
}

/// The light of the volumes in two pictures.
fn compare(bake: &Film, truth: &Film, turned: f64) -> BakeError {
    let grey = |rgb: [f32; 3]| luminance(rgb.map(f64::from));
    let (mut ours, mut theirs, mut variance) = (Vec::new(), Vec::new(), Vec::new());
    for block_y in 0..truth.height / BLOCK {
        for block_x in 0..truth.width / BLOCK {
            let (mut a, mut b, mut v) = (0.0, 0.0, 0.0);
            for i in 0..BLOCK * BLOCK {
                let at = ((block_y * BLOCK + i / BLOCK) * truth.width + block_x * BLOCK + i % BLOCK) as usize;
                let (bake, truth) = (&bake.pixels[at], &truth.pixels[at]);
                a += grey(bake.volume_indirect);
                b += grey(truth.volume_direct) + grey(truth.volume_indirect);
                v += grey(truth.standard_error).powi(2) + grey(bake.standard_error).powi(2);
            }
            ours.push(a);
            theirs.push(b);
            variance.push(v);
        }
    }
    let (a, b, v) = (ours.iter().sum::<f64>(), theirs.iter().sum::<f64>(), variance.iter().sum::<f64>());
    let lit = theirs.iter().filter(|&&b| b > 0.0).count().max(1) as f64;
    let squares: f64 = ours.iter().zip(&theirs).map(|(a, b)| (a - b).powi(2)).sum::<f64>() - v;
    let b = b.max(f64::MIN_POSITIVE);
    BakeError { turned, mean: a / b - 1.0, mean_se: v.sqrt() / b, rms: (squares.max(0.0) * lit).sqrt() / b }
}

/// Baked light at any point, trilinear between samples.
struct Lookup<'a> {
    baked: &'a Baked,
    /// Of each part: its grids, which share their bricks.
    parts: Vec<Vec<&'a super::LightGrid>>,
    index_from_world: DAffine3,
    sunward: DVec3,
}

impl<'a> Lookup<'a> {
    fn new(baked: &'a Baked, back: DAffine3, scene: &Scene) -> Self {
        let parts = (0..baked.parts.len()).map(|part| baked.grids.iter().filter(|grid| grid.part == part).collect()).collect();
        let world = baked.grids.first().map_or(DAffine3::IDENTITY, |grid| back * grid.bricks.world_from_index);
        Lookup { baked, parts, index_from_world: world.inverse(), sunward: scene.sun.direction.normalize() }
    }

    /// What is sent into `outward`, W m^-2 sr^-1 per unit of optical depth.
    fn toward(&self, p: DVec3, outward: DVec3) -> Vec3 {
        let p = self.index_from_world.transform_point3(p);
        let (base, f) = (p.floor(), p - p.floor());
        let mut sum = DVec3::ZERO;
        for (number, grids) in self.parts.iter().enumerate() {
            let Some(first) = grids.first() else { continue };
            let part = &self.baked.parts[number];
            let mut values: SmallVec<[f64; 24]> = smallvec![0.0; grids.len()];
            for corner in 0..8usize {
                let side = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
                let weight: f64 = (0..3).map(|a| if side[a] == 1 { f[a] } else { 1.0 - f[a] }).product();
                let index: [i32; 3] = std::array::from_fn(|a| base[a] as i32 + side[a] as i32);
                let Ok(brick) = first.bricks.origins.binary_search(&index.map(|i| i & !(BRICK_SIDE - 1))) else { continue };
                let [x, y, z] = index.map(|i| (i & (BRICK_SIDE - 1)) as usize);
                for (value, grid) in values.iter_mut().zip(grids) {
                    *value += weight * f64::from(grid.bricks.brick(brick)[x << 6 | y << 3 | z]);
                }
            }
            let terms = || grids.iter().map(|grid| grid.term).zip(values.iter().copied());
            let flow = Self::flow(terms());
            let value: f64 = terms().map(|(term, value)| value * self.share(term, number, outward, flow)).sum();
            sum += DVec3::from_array(part.tint) * (part.scale * value.max(0.0));
        }
        sum.as_vec3()
    }

    /// The way of the flow of light, and the mean cosine of the lobe about it.
    fn flow(terms: impl Iterator<Item = (Term, f64)>) -> (DVec3, f64) {
        let (flow, whole) = terms.fold((DVec3::ZERO, 0.0), |(flow, whole), (term, value)| match term {
            Term::Flow => (flow, value),
            Term::FlowX => (flow + DVec3::X * value, whole),
            Term::FlowY => (flow + DVec3::Y * value, whole),
            Term::FlowZ => (flow + DVec3::Z * value, whole),
            _ => (flow, whole),
        });
        (flow.normalize_or_zero(), of_flow(flow.length(), whole))
    }

    /// What a term counts toward a direction.
    fn share(&self, term: Term, part: usize, outward: DVec3, (way, mean_cosine): (DVec3, f64)) -> f64 {
        let lobe = |g: f64| henyey_greenstein(g, 0.5 * (self.sunward - outward).length_squared());
        match term {
            Term::Light => 1.0,
            Term::Sunlight => lobe(self.baked.mean_cosine),
            Term::Glow => lobe(self.baked.lobes[part]),
            Term::Flow => henyey_greenstein(mean_cosine, 1.0 - way.dot(outward)),
            Term::FlowX | Term::FlowY | Term::FlowZ => 0.0,
            Term::Harmonic(i) => f64::from(crate::integrate::harmonics(outward.as_vec3())[i]),
        }
    }
}
