//! The source function: what the medium at a point sends out, per unit of optical depth. It is what a bake keeps.

use super::BYTES;
use super::basis::{AROUND, Basis, DEGREE, HARMONICS, harmonics, legendre};
use super::field::{Field, Request};
use super::orders::Orders;
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
/// The mean cosine of the lobe about the sun is within these.
const LOBE: [f64; 2] = [0.05, 0.9];

/// What of the directions of light is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kept {
    /// What goes toward a point, in the world (m).
    Toward(DVec3),
    /// Harmonics of degrees 0 to 2 at most.
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
    field: Option<Field>,
    /// The sun's irradiance, W m^-2, and the direction in which its light travels.
    irradiance: f64,
    sunward: Vec3,
    /// The mean cosine of the lobe about the sun's light of what has scattered more than once; 0 where there is none.
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
            let basis = match kept {
                Kept::Toward(eye) => Basis::view(&part, (eye - origin).as_vec3(), None),
                Kept::Around { degree } => {
                    Basis::Around { degree, axis: (degree > 0 && shines && mean_cosine > PEAKED).then_some(sunward) }
                }
            };
            let mut followed = Followed { tracer, photons, field: None, irradiance, sunward, lobe: 0.0 };
            if !part.regions.is_empty() && followed.photons.strongest() > 0.0 {
                let media = &followed.tracer.bands[0].media;
                let share = settings.photons / count as u64;
                let voxels = (settings.memory / (BYTES * basis.len() as u64)).min(share.max(super::LEAST_VOXELS)) as usize;
                let seen = |_| true;
                let orders = Orders::own();
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
                    coarser: 1.0,
                };
                let mut field = Field::new(request);
                field.brighten((&followed.photons, media), share, progress)?;
                followed.lobe = field.lobe(mean_cosine).map_or(0.0, |lobe| lobe.clamp(LOBE[0], LOBE[1]));
                followed.field = Some(field);
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
        self.lights.iter().filter_map(|(_, f)| f.field.as_ref()).map(Field::photons).sum()
    }

    /// Numbers that a part has at a point: one toward a point; else the sunlight that arrives and scatters, the lobe about it, that about
    /// the flow, and the harmonics.
    pub fn numbers(&self) -> usize {
        match self.kept {
            Kept::Toward(_) => 1,
            Kept::Around { degree } => 3 + (degree + 1).pow(2),
        }
    }

    /// A part's numbers at a point of the world, in units of its scale. Gives the extinction there, 1/m; where it is 0, nothing is said.
    pub fn at(&self, part: usize, p: DVec3, scratch: &mut Scratch, into: &mut [f32]) -> f64 {
        let (Part { scale, .. }, followed) = &self.lights[part];
        let band = &followed.tracer.bands[0];
        let p = (p - self.origin).as_vec3();
        // Of each region there: its share of the extinction, and its albedo and mean cosine.
        let mut here: SmallVec<[(f64, f64, f64); 4]> = SmallVec::new();
        let mut whole = 0.0;
        band.media.regions_at(p, |region, sigma_t| {
            let optics = band.media.optics(region);
            here.push((sigma_t, optics.albedo, optics.g));
            whole += sigma_t;
        });
        if whole <= 0.0 {
            return 0.0;
        }
        here.iter_mut().for_each(|region| region.0 /= whole);
        into.fill(0.0);
        let clear = followed.clear(p, scratch);
        match self.kept {
            Kept::Toward(eye) => {
                let outward = ((eye - self.origin).as_vec3() - p).normalize_or_zero();
                let turn = one_minus_cos(followed.sunward, outward);
                let mut sum = 0.0;
                for &(share, albedo, g) in &here {
                    sum += share * albedo * clear * followed.irradiance * henyey_greenstein(g, turn);
                    if let Some(field) = &followed.field {
                        sum += f64::from(field.toward(p, outward, g, (share * albedo) as f32));
                    }
                }
                into[0] = (sum / scale) as f32;
            }
            Kept::Around { degree } => self.around(degree, followed, p, clear, &here, *scale, into),
        }
        whole
    }

    #[allow(clippy::too_many_arguments)]
    fn around(&self, degree: usize, followed: &Followed, p: Vec3, clear: f64, here: &[(f64, f64, f64)], scale: f64, into: &mut [f32]) {
        let lobe = followed.lobe;
        let (count, end) = ((degree + 1).pow(2), if lobe > 0.0 { (degree + 2).pow(2) } else { (degree + 1).pow(2) });
        let along = harmonics(followed.sunward);
        let mut light = [0.0f32; AROUND];
        let found = followed.field.as_ref().is_some_and(|field| field.numbers(p, &mut light[..]));
        let mut sun = 0.0;
        let mut out = [0.0f64; HARMONICS];
        for &(share, albedo, g) in here {
            let once = share * albedo * clear * followed.irradiance;
            sun += once;
            for i in 0..end {
                let l = DEGREE[i] as i32;
                // Sunlight scattered once goes by the mean cosine of all; what the region's own differs by is in the harmonics.
                out[i] += once * (g.powi(l) - self.mean_cosine.powi(l)) * f64::from(along[i]);
                if found {
                    out[i] += share * albedo * g.powi(l) * f64::from(light[i]);
                }
            }
        }
        // The lobe about the sun has the moment beyond the harmonics that the light has there, that about the flow what is left of it
        // along the flow.
        let (mut glow, mut flow) = (0.0, 0.0);
        if end > count {
            let axis = DVec3::new(out[3], out[1], out[2]).normalize_or_zero().as_vec3();
            let about = harmonics(axis);
            let moment = |axis: &[f32; HARMONICS]| (count..end).map(|i| out[i] * f64::from(axis[i])).sum::<f64>();
            let whole = 4.0 * PI / (end - count) as f64 / lobe.powi(degree as i32 + 1);
            glow = whole * moment(&along);
            flow = whole * moment(&about) - glow * f64::from(legendre(degree + 1, followed.sunward.dot(axis)));
        }
        // The harmonics have the rest of what the lobe about the sun does not have; that about the flow has none of their degrees.
        for i in 0..count {
            let own = glow * lobe.powi(DEGREE[i] as i32) * f64::from(along[i]);
            into[3 + i] = ((out[i] - own) / scale) as f32;
        }
        into[0] = (sun / scale) as f32;
        into[1] = (glow / scale) as f32;
        into[2] = (flow / scale) as f32;
    }
}

impl Followed {
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
