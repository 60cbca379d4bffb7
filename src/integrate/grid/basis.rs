//! What of light's directions a field keeps.

use super::orders::Through;
use crate::integrate::lobe::Lobe;
use crate::rng::Rng;
use crate::sampling::around;
use crate::scene::{Phase, Scene, Similar};
use glam::Vec3;

/// Real spherical harmonics of degrees 0 to 3.
pub const HARMONICS: usize = 16;
/// Phase functions with a mean cosine nearer to 0 have no peak worth aiming with.
const PEAKED: f64 = 0.3;
/// How many flights are aimed at the camera, per collision.
const ASIDE: f32 = 0.3;
/// The degree of each.
pub(super) const DEGREE: [usize; HARMONICS] = [0, 1, 1, 1, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3];

/// The directions that light is gathered for.
#[derive(Debug)]
pub(super) enum Basis {
    /// One camera: what each phase function of the scene scatters toward it.
    View {
        eye: Vec3,
        /// The mean cosines, in increasing order.
        cosines: Vec<f64>,
        lobes: Vec<Lobe>,
        /// The same seen through the media that pass for the scene's, where there are any: per unit of their optical depth; and their own.
        worth: Vec<Lobe>,
        wide: Vec<Lobe>,
    },
    /// Any: radiance by harmonics of its direction of travel, of all degrees up to one of 0 to 3. A phase function of mean cosine g
    /// scatters degree l by g^l.
    Around { degree: usize },
}

impl Basis {
    /// For a camera at `eye`, that sees light through the scene's media or through similar ones too, as far from them as [`Similar::to`] says.
    pub fn view(scene: &Scene, eye: Vec3, similar: Option<f64>) -> Self {
        let mut cosines: Vec<f64> = scene.regions.iter().map(|r| r.medium.g).collect();
        cosines.sort_unstable_by(f64::total_cmp);
        cosines.dedup();
        let wide = similar.into_iter().flat_map(|part| cosines.iter().map(move |&g| Similar::to(g, part)));
        let worth = |g: f64| similar.map_or(1.0, |part| 1.0 / (1.0 - Similar::to(g, part).straight));
        let wide = wide.map(|similar| Lobe::of(similar.phase, Vec3::Z)).collect();
        let lobes: Vec<Lobe> = cosines.iter().map(|&g| Lobe::new(g, Vec3::Z)).collect();
        let worth = lobes.iter().zip(&cosines).map(|(lobe, &g)| lobe.times(worth(g))).collect();
        Basis::View { eye, cosines, lobes, worth, wide }
    }

    /// Numbers that a voxel has.
    pub fn len(&self) -> usize {
        match self {
            Basis::View { lobes, .. } => lobes.len(),
            Basis::Around { degree } => (degree + 1).pow(2),
        }
    }

    /// The largest that light of 1 W m^-2 sr^-1 from one steradian can make any of them.
    pub fn peak(&self) -> f64 {
        match self {
            Basis::View { worth, .. } => worth.iter().map(|lobe| f64::from(lobe.peak())).fold(0.0, f64::max),
            Basis::Around { .. } => 1.1,
        }
    }

    /// What light that travels along `direction` at `p` makes of each where it scatters in, and is seen through, such media.
    #[inline]
    pub fn each(&self, p: Vec3, direction: Vec3, (scattered, seen): (Through, Through), mut visit: impl FnMut(usize, f32)) {
        match self {
            Basis::View { eye, lobes, worth, wide, .. } => {
                let outward = (*eye - p).normalize_or_zero();
                let lobes = match (scattered, seen) {
                    (Through::Own, Through::Own) => lobes,
                    (Through::Own, Through::Similar) => worth,
                    (Through::Similar, _) => wide,
                };
                for (number, lobe) in lobes.iter().enumerate() {
                    visit(number, lobe.toward(outward).value(direction));
                }
            }
            Basis::Around { .. } => harmonics(direction).into_iter().take(self.len()).enumerate().for_each(|(number, y)| visit(number, y)),
        }
    }

    /// The same, where it does not depend on the place.
    #[inline]
    pub fn of_direction(&self, direction: Vec3) -> Option<[f32; HARMONICS]> {
        matches!(self, Basis::Around { .. }).then(|| harmonics(direction))
    }

    /// What each counts in the light that a phase function of mean cosine `g` scatters into `outward`.
    #[inline]
    pub fn shares(&self, g: f64, outward: Vec3, mut visit: impl FnMut(usize, f32)) {
        match self {
            Basis::View { cosines, .. } => visit(cosines.iter().position(|&c| c == g).unwrap_or(0), 1.0),
            Basis::Around { degree } => {
                let g = g as f32;
                for (number, y) in harmonics(outward).into_iter().take((degree + 1).pow(2)).enumerate() {
                    visit(number, y * g.powi(DEGREE[number] as i32));
                }
            }
        }
    }

    /// Most of what a photon sends toward the camera it sends when it happens to fly there, seldom and much at once. So now and then
    /// a flight begins toward the camera by the phase function of the scattering that is to follow, and shares with the photon's
    /// own by the balance heuristic: what either could find is bounded by the other. The direction, and the flight's part of the power.
    #[inline]
    pub fn aside(&self, p: Vec3, before: Vec3, phase: Phase, rng: &mut Rng) -> Option<(Vec3, f64)> {
        if phase.g.abs() < PEAKED || !matches!(self, Basis::View { .. }) || rng.uniform_f32() >= ASIDE {
            return None;
        }
        let direction = self.toward(p, phase, rng)?;
        Some((direction, self.own(p, before, direction, phase).into()))
    }

    /// The part of a photon's power that is left to its own flight.
    #[inline]
    pub fn share(&self, p: Vec3, before: Vec3, direction: Vec3, phase: Phase) -> f64 {
        if phase.g.abs() < PEAKED { 1.0 } else { self.own(p, before, direction, phase).into() }
    }

    /// The same for light that a surface sends in all directions: a direction toward the camera by the phase function that has the highest peak, which
    /// is what the camera sees such light by where it has scattered once.
    #[inline]
    pub fn off_surface(&self, p: Vec3, rng: &mut Rng) -> Option<Vec3> {
        self.toward(p, self.most_peaked()?, rng)
    }

    /// The density of these directions, 1/sr.
    #[inline]
    pub fn off_surface_density(&self, p: Vec3, direction: Vec3) -> f64 {
        let (Some(phase), Basis::View { eye, .. }) = (self.most_peaked(), self) else { return 0.0 };
        (*eye - p).try_normalize().map_or(0.0, |outward| Lobe::of(phase, outward).value(direction).into())
    }

    fn most_peaked(&self) -> Option<Phase> {
        let Basis::View { cosines, .. } = self else { return None };
        cosines.last().filter(|&&g| g >= PEAKED).map(|&g| Phase::henyey_greenstein(g))
    }

    /// A direction toward the camera, by a phase function around it.
    #[inline]
    fn toward(&self, p: Vec3, phase: Phase, rng: &mut Rng) -> Option<Vec3> {
        let Basis::View { eye, .. } = self else { return None };
        let (cos, sin) = phase.sample(rng);
        Some(around((*eye - p).try_normalize()?, cos as f32, sin as f32, rng.uniform_f32()))
    }

    /// Of light scattered from `before` into `direction` at `p`, the part that belongs to the phase function's own sampling, where
    /// directions are drawn by [`Basis::toward`] too, [`ASIDE`] times as often (the balance heuristic; Veach 1997, 9.2).
    #[inline]
    fn own(&self, p: Vec3, before: Vec3, direction: Vec3, phase: Phase) -> f32 {
        let Basis::View { eye, .. } = self else { return 1.0 };
        let Some(outward) = (*eye - p).try_normalize() else { return 1.0 };
        let lobe = Lobe::of(phase, before);
        let own = lobe.value(direction);
        own / (own + ASIDE * lobe.toward(outward).value(direction))
    }
}

/// The real spherical harmonics of degrees 0 to 3, orthonormal, in a direction of unit length.
#[inline]
pub fn harmonics(d: Vec3) -> [f32; HARMONICS] {
    // sqrt(1 / 4 pi), sqrt(3 / 4 pi), sqrt(15 / 4 pi), sqrt(5 / 16 pi), sqrt(15 / 16 pi)
    const C: [f32; 5] = [0.282_094_8, 0.488_602_5, 1.092_548_4, 0.315_391_57, 0.546_274_2];
    // sqrt(35 / 32 pi), sqrt(105 / 4 pi), sqrt(21 / 32 pi), sqrt(7 / 16 pi), sqrt(105 / 16 pi)
    const D: [f32; 5] = [0.590_043_6, 2.890_611_4, 0.457_045_8, 0.373_176_33, 1.445_305_7];
    let [xx, yy, zz] = (d * d).to_array();
    [
        C[0],
        C[1] * d.y,
        C[1] * d.z,
        C[1] * d.x,
        C[2] * d.x * d.y,
        C[2] * d.y * d.z,
        C[3] * (3.0 * zz - 1.0),
        C[2] * d.x * d.z,
        C[4] * (xx - yy),
        D[0] * d.y * (3.0 * xx - yy),
        D[1] * d.x * d.y * d.z,
        D[2] * d.y * (5.0 * zz - 1.0),
        D[3] * d.z * (5.0 * zz - 3.0),
        D[2] * d.x * (5.0 * zz - 1.0),
        D[4] * d.z * (xx - yy),
        D[0] * d.x * (xx - 3.0 * yy),
    ]
}
