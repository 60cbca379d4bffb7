//! The source function: what the medium at a point sends out, per unit of optical depth. It is what a bake keeps.

use super::aspect::Aspect;
use super::basis::{Basis, HARMONICS};
use super::field::Request;
use super::lobes::{LOBES, Sunlight};
use super::orders::{Orders, Through};
use super::plain::{APART, NARROWER, Plain};
use super::space::mean_extinction;
use crate::error::Result;
use crate::geom::Ray;
use crate::integrate::path::PathTracer;
use crate::integrate::photon::{by_channel, channels_of};
use crate::media::Scratch;
use crate::photon::{Model, Tracer};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::scene::phase::{henyey_greenstein, one_minus_cos};
use crate::scene::{Lamp, Scene, Sun, medium::luminance};
use glam::{DVec3, Vec3};
use smallvec::SmallVec;
use std::borrow::Cow;
use std::f64::consts::PI;

/// Phase functions with a mean cosine below this leave no light that is peaked about the sun's once it has scattered twice.
const PEAKED: f64 = 0.3;

/// Numbers of a place in a field, at most, but for cameras that see many phase functions.
const NUMBERS: usize = HARMONICS + 4 * APART;

/// What of the directions of light is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kept {
    /// What goes toward a point, in the world (m).
    Toward(DVec3),
    /// Harmonics of degrees 0 to 3 at most, and lobes.
    Around {
        /// The largest degree.
        degree: usize,
    },
}

/// How the light is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceSettings {
    /// Photons to follow.
    pub photons: u64,
    /// What voxels may take, bytes.
    pub memory: u64,
    /// The seed.
    pub seed: u64,
}

/// Which of a scene's light a [`Part`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Light {
    /// All.
    All,
    /// The sun's.
    Sun,
    /// The sky's.
    Sky,
    /// All of its red.
    Red,
    /// All of its green.
    Green,
    /// All of its blue.
    Blue,
}

/// Light that is followed together.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Part {
    /// Which.
    pub light: Light,
    /// What a number of 1 stands for, W m^-2 sr^-1: the sun's irradiance over one steradian, or without sun the sky's radiance; at least
    /// what lamps and flames would give at the distance of the regions' size.
    pub scale: f64,
    /// Its colour: linear RGB with a luminance of 1, or one channel.
    pub tint: [f64; 3],
}

/// The source function of a scene, for any point of its media.
#[derive(Debug)]
pub struct SourceFunction {
    lights: Vec<(Part, Followed)>,
    kept: Kept,
    origin: DVec3,
    mean_cosine: f64,
}

/// The light of a part, where it is.
#[derive(Debug)]
struct Followed {
    tracer: PathTracer,
    photons: Tracer,
    field: Option<Plain>,
    /// The sun's irradiance, W m^-2, and the direction in which its light travels.
    irradiance: f64,
    sunward: Vec3,
    /// The mean cosine of the lobe about the sun's light of what has scattered twice; 0 where there is none.
    lobe: f64,
}

/// The grey scenes that make up a scene, with the channels that each stands for and the tint of its light: one, where sun and sky have the
/// same and nothing else is coloured, air neither; two, one of the sun's light and one of the sky's, where only these differ, so that
/// noise has no other colours than they; else three.
fn parts(scene: &Scene) -> Vec<(Cow<'_, Scene>, Vec3, Vec3)> {
    let sky = scene.sky;
    let mut parts = channels_of(scene, Model::Physical);
    // Where all is grey, the sun, lamps and flames have one colour.
    let sun = scene.tints().next().unwrap_or(DVec3::ZERO).to_array();
    if parts.len() > 1 || luminance(sky) <= 0.0 {
        return parts;
    }
    let alike = (0..3).all(|c| (sun[c] * luminance(sky) - sky[c] * luminance(sun)).abs() <= 1e-9 * luminance(sky) * luminance(sun));
    let sky_tint = (DVec3::from_array(sky) / luminance(sky)).as_vec3();
    if luminance(sun) <= 0.0 {
        parts[0].2 = sky_tint;
    } else if !alike && (!scene.lamps.is_empty() || !scene.flames.is_empty()) {
        return by_channel(scene).into_iter().map(|(scene, mask)| (scene, mask, Vec3::ONE)).collect();
    } else if !alike {
        parts[0].0 = Cow::Owned(Scene { sky: [0.0; 3], dome: None, ..scene.clone() });
        let dark = Sun { irradiance: [0.0; 3], ..scene.sun };
        parts.push((Cow::Owned(Scene { sun: dark, ..scene.clone() }), Vec3::ONE, sky_tint));
    }
    parts
}

/// About what lamps and flames send to regions, over one steradian, W m^-2 sr^-1.
fn from_near(scene: &Scene) -> f64 {
    let intensity = scene.lamps.iter().map(Lamp::grey).chain(scene.flames.iter().map(|flame| flame.power() / (4.0 * PI))).sum::<f64>();
    let size = scene.region_bounds().size().length_squared();
    if size > 0.0 && size.is_finite() { intensity / size } else { 0.0 }
}

impl SourceFunction {
    /// Follows the photons of a scene whose regions all have an end.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub fn new(scene: &Scene, plan: &Plan, kept: Kept, settings: &SourceSettings, progress: &dyn Progress) -> Result<Self> {
        let weight = |r: &crate::scene::Region| r.optical_mass() * r.medium.albedo();
        let whole: f64 = scene.regions.iter().map(weight).sum();
        let mean_cosine = scene.regions.iter().map(|r| weight(r) * r.medium.g).sum::<f64>() / whole.max(f64::MIN_POSITIVE);
        let parts = parts(scene);
        let count = parts.len();
        let mut lights = Vec::with_capacity(count);
        let mut origin = DVec3::ZERO;
        for (number, (part, mask, tint)) in parts.into_iter().enumerate() {
            let tracer = PathTracer::new(&part, plan);
            let photons = Tracer::new(&part, plan, Model::Physical).of_second_pass().with_lamps_gathered();
            origin = tracer.origin;
            let irradiance = part.sun.grey_irradiance();
            let shines = irradiance > 0.0;
            let sunward = part.sun.direction.normalize().as_vec3();
            let share = settings.photons / count as u64;
            let (basis, orders) = match kept {
                Kept::Toward(eye) => {
                    let eye = (eye - origin).as_vec3();
                    let crowd = share as f64 / (photons.silhouette() * mean_extinction(&part.regions).powi(2));
                    let orders = Orders::similarly(&part, origin, crowd, &Aspect::of(&part, eye));
                    (Basis::view(&part, eye, orders.part()), orders)
                }
                Kept::Around { degree } => (Basis::Around { degree }, Orders::own(&part)),
            };
            let peaked = matches!(basis, Basis::Around { degree: 1.. }) && shines && mean_cosine > PEAKED;
            let lobe = if peaked { mean_cosine.powi(2) } else { 0.0 };
            let mut followed = Followed { tracer, photons, field: None, irradiance, sunward, lobe };
            if !part.regions.is_empty() && followed.photons.strongest() > 0.0 {
                let media = &followed.tracer.bands[0].media;
                let voxels = Plain::room(&basis, settings.memory).min(share.max(super::LEAST_VOXELS)) as usize;
                let seen = |_| true;
                let request = Request {
                    scene: &part,
                    media,
                    basis,
                    orders,
                    origin,
                    seen: &seen,
                    first: 0,
                    seed: settings.seed,
                    voxels,
                    coarser: if matches!(kept, Kept::Toward(_)) { 1.0 } else { NARROWER },
                };
                followed.field = Some(Plain::new(request, (&followed.photons, &followed.tracer.surfaces), share, progress)?);
            }
            let light = match (count, number) {
                (1, _) => Light::All,
                (2, 0) => Light::Sun,
                (2, _) => Light::Sky,
                (_, 0) => Light::Red,
                (_, 1) => Light::Green,
                _ => Light::Blue,
            };
            let scale = (if shines { irradiance } else { luminance(part.sky) }).max(from_near(&part));
            let tint = (tint * mask).as_dvec3().to_array();
            lights.push((Part { light, scale: if scale > 0.0 { scale } else { 1.0 }, tint }, followed));
        }
        Ok(SourceFunction { lights, kept, origin, mean_cosine })
    }

    /// The parts of the light.
    pub fn parts(&self) -> impl Iterator<Item = &Part> {
        self.lights.iter().map(|(part, _)| part)
    }

    /// The mean cosine of the medium, by optical mass that scatters: that of sunlight scattered once.
    pub fn mean_cosine(&self) -> f64 {
        self.mean_cosine
    }

    /// The mean cosine of a part's lobe about the sun's light; 0 where it has none.
    pub fn lobe(&self, part: usize) -> f64 {
        self.lights[part].1.lobe
    }

    /// Photons that were followed.
    pub fn photons(&self) -> u64 {
        self.lights.iter().filter_map(|(_, f)| f.field.as_ref()).map(Plain::photons).sum()
    }

    /// Numbers that a part has at a point: one toward a point; else the sunlight that arrives and scatters, the lobe about it, that about
    /// the flow, the flow along x, y and z, and the harmonics.
    pub fn numbers(&self) -> usize {
        match self.kept {
            Kept::Toward(_) => 1,
            Kept::Around { degree } => LOBES + (degree + 1).pow(2),
        }
    }

    /// A part's numbers at a point of the world, in units of its scale. Gives the extinction there, 1/m; where it is 0, nothing is said.
    pub fn at(&self, part: usize, p: DVec3, scratch: &mut Scratch, into: &mut [f32]) -> f64 {
        self.beside(part, (p, p), scratch, into)
    }

    /// The same beside the medium, as if that of `inside` reached there; if a surface is between, of `inside` itself.
    pub fn beside(&self, part: usize, (p, inside): (DVec3, DVec3), scratch: &mut Scratch, into: &mut [f32]) -> f64 {
        let (Part { scale, .. }, followed) = &self.lights[part];
        let band = &followed.tracer.bands[0];
        let (mut p, inside) = ((p - self.origin).as_vec3(), (inside - self.origin).as_vec3());
        if followed.walled(inside, p) {
            p = inside;
        }
        // Of each region there: its share of the extinction, and its albedo and mean cosine.
        let mut here: SmallVec<[(f64, f64, f64); 4]> = SmallVec::new();
        // What of the extinction similar media have, and what of that scatters.
        let mut seen: SmallVec<[(f64, f64); 4]> = SmallVec::new();
        let similar = followed.field.as_ref().and_then(Plain::similar);
        let mut whole = 0.0;
        band.media.regions_at(inside, |region, sigma_t| {
            let optics = band.media.optics(region);
            here.push((sigma_t, optics.albedo, optics.g));
            seen.extend(similar.map(|similar| (similar.ratio(region), similar.media.optics(region).albedo)));
            whole += sigma_t;
        });
        if whole <= 0.0 {
            return 0.0;
        }
        here.iter_mut().for_each(|region| region.0 /= whole);
        into.fill(0.0);
        let clear = followed.clear(p, scratch);
        let mut light: SmallVec<[f32; NUMBERS]> = SmallVec::new();
        let found = followed.field.as_ref().is_some_and(|field| {
            light.resize(field.numbers(), 0.0);
            field.at(p, &mut light) || field.at(inside, &mut light)
        });
        match self.kept {
            Kept::Toward(eye) => {
                let outward = ((eye - self.origin).as_vec3() - p).normalize_or_zero();
                let turn = one_minus_cos(followed.sunward, outward);
                let mut sum = 0.0;
                for (number, &(share, albedo, g)) in here.iter().enumerate() {
                    sum += share * albedo * clear * followed.irradiance * henyey_greenstein(g, turn);
                    let Some(field) = followed.field.as_ref().filter(|_| found) else { continue };
                    sum += share * albedo * f64::from(field.toward(&light, g, Through::Own));
                    if let Some(&(ratio, albedo)) = seen.get(number) {
                        let sent = albedo * f64::from(field.toward(&light, g, Through::Similar));
                        sum += share * (ratio * sent + (1.0 - ratio) * f64::from(field.behind(&light)));
                    }
                }
                into[0] = (sum / scale) as f32;
            }
            Kept::Around { .. } => {
                let Followed { irradiance, sunward, lobe, .. } = *followed;
                let sunlight = Sunlight { way: sunward, arrives: clear * irradiance, mean_cosine: self.mean_cosine, lobe };
                sunlight.with_others(&here, found.then_some(&light[..]), *scale, into);
            }
        }
        whole
    }
}

impl Followed {
    /// Whether a surface is between two points.
    fn walled(&self, from: Vec3, to: Vec3) -> bool {
        let way = to - from;
        let (reach, surfaces) = (way.length(), &self.tracer.surfaces);
        reach > 0.0 && !surfaces.is_empty() && surfaces.nearest(&Ray { origin: from, direction: way / reach }, reach).is_some()
    }

    /// The share of sunlight that arrives at a point.
    fn clear(&self, p: Vec3, scratch: &mut Scratch) -> f64 {
        if self.irradiance <= 0.0 {
            return 0.0;
        }
        let ray = Ray { origin: p, direction: -self.sunward };
        if !self.tracer.surfaces.is_empty() && self.tracer.surfaces.nearest(&ray, f32::INFINITY).is_some() {
            return 0.0;
        }
        (-self.tracer.bands[0].media.optical_depth(&ray, f32::INFINITY, scratch)).exp()
    }
}
