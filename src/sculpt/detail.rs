//! Turbulent detail: noise of many octaves that moves the boundary of a cloud and eats into its edge.
//!
//! The noise is FastNoise Lite's, in metres of the world: it does not know of voxels. Rounded bumps (cellular noise, the squared distance
//! to the nearest of scattered points) heap up to cauliflowers; gradient noise makes rags; ridges along the wind make fibres.

use crate::geom::Bounds;
use fastnoise_lite::{CellularDistanceFunction, CellularReturnType, DomainWarpType, FastNoiseLite, FractalType, NoiseType};
use glam::DVec3;

/// The kinds of clouds whose detail is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Genus {
    /// Cumulus humilis: small heaps with flat bases.
    Humilis,
    /// Cumulus congestus: towers like cauliflowers.
    Congestus,
    /// A deck of rolls and lumps with few gaps.
    Stratocumulus,
    /// Cloudlets side by side, with gaps.
    Altocumulus,
    /// Wisps along the wind, which blows along x.
    Cirrus,
}

impl Genus {
    /// All, with the names that files and flags know them by.
    pub const NAMES: [(&str, Genus); 5] = [
        ("humilis", Genus::Humilis),
        ("congestus", Genus::Congestus),
        ("stratocumulus", Genus::Stratocumulus),
        ("altocumulus", Genus::Altocumulus),
        ("cirrus", Genus::Cirrus),
    ];

    /// What makes it; lengths are in units of the detail's size.
    fn look(self) -> Character {
        match self {
            Genus::Humilis => Character {
                form: Form::Bumps { jitter: 1.0, mean: 0.286 },
                amplitude: 0.45,
                gain: 0.55,
                bias: 0.0,
                stretch: DVec3::ONE,
                warp: 0.12,
                base: 0.35,
                edge: 0.06,
                contrast: 5.0,
                erosion: 0.35,
            },
            Genus::Congestus => Character {
                form: Form::Bumps { jitter: 1.0, mean: 0.286 },
                amplitude: 0.7,
                gain: 0.62,
                bias: 0.0,
                stretch: DVec3::ONE,
                warp: 0.1,
                base: 0.2,
                edge: 0.03,
                contrast: 8.0,
                erosion: 0.2,
            },
            Genus::Stratocumulus => Character {
                form: Form::Bumps { jitter: 0.9, mean: 0.280 },
                amplitude: 0.6,
                gain: 0.45,
                bias: -0.1,
                stretch: DVec3::new(1.6, 1.0, 1.2),
                warp: 0.15,
                base: 0.0,
                edge: 0.12,
                contrast: 3.0,
                erosion: 0.5,
            },
            Genus::Altocumulus => Character {
                form: Form::Bumps { jitter: 0.7, mean: 0.268 },
                amplitude: 1.3,
                gain: 0.35,
                bias: -0.6,
                stretch: DVec3::new(1.3, 1.0, 1.5),
                warp: 0.1,
                base: 0.0,
                edge: 0.15,
                contrast: 3.0,
                erosion: 0.5,
            },
            Genus::Cirrus => Character {
                form: Form::Fibres,
                amplitude: 0.35,
                gain: 0.6,
                bias: -0.05,
                stretch: DVec3::new(6.0, 1.2, 0.6),
                warp: 0.5,
                base: 0.0,
                edge: 1.0,
                contrast: 1.0,
                erosion: 0.9,
            },
        }
    }
}

/// How a kind of cloud is detailed, at strength 1; lengths in units of the detail's size.
#[derive(Debug, Clone, Copy)]
struct Character {
    form: Form,
    /// How far the largest octave moves the boundary, from its mean to its farthest.
    amplitude: f64,
    /// The amplitude of each octave over that of the one before it, which is twice as large.
    gain: f64,
    /// The mean displacement: below 0 where gaps should open.
    bias: f64,
    /// How much longer noise is along each axis.
    stretch: DVec3,
    /// How far points are swirled before noise is looked up.
    warp: f64,
    /// What is cut off at the bottom, flat.
    base: f64,
    /// Over which depth density rises to its full value where a shape has none of its own.
    edge: f64,
    /// By how much the rise of a metaball's density is steepened.
    contrast: f64,
    /// How much of a thin edge is eaten: 1 leaves nothing where the noise is strongest.
    erosion: f64,
}

#[derive(Debug, Clone, Copy)]
enum Form {
    /// Cellular noise: rounded outside, creased between; `jitter` 0 would be a lattice of bumps. The mean is that of the squared
    /// distance to the nearest point, which displacement is counted from; it depends on the jitter.
    Bumps { jitter: f32, mean: f64 },
    /// Ridges of gradient noise.
    Fibres,
}

/// The detail of a cloud.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Detail {
    /// The kind of cloud.
    pub genus: Genus,
    /// How much of it: 0 is the smooth cloud, 1 the genus as it is known.
    pub strength: f64,
    /// The size of the largest bumps, m.
    pub size: f64,
    /// Octaves of noise, 1 to 12; each halves the size.
    pub octaves: u32,
    /// Another seed, another cloud of the same kind.
    pub seed: u32,
}

/// The most octaves.
pub const MOST_OCTAVES: u32 = 12;
/// The largest strength: beyond it a cloud is all noise.
pub const MOST_STRENGTH: f64 = 4.0;

/// Detail as users ask for it: what they leave out follows from the layout.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct DetailRequest {
    /// The kind of cloud.
    pub genus: Genus,
    /// As [`Detail::strength`].
    pub strength: f64,
    /// The size of the largest bumps, m; the mean radius of the parts where it is not said.
    pub size: Option<f64>,
    /// As [`Detail::octaves`].
    pub octaves: u32,
    /// As [`Detail::seed`].
    pub seed: u32,
}

impl DetailRequest {
    /// A kind of cloud at full strength, with five octaves.
    pub fn new(genus: Genus) -> Self {
        DetailRequest { genus, strength: 1.0, size: None, octaves: 5, seed: 0 }
    }

    /// The detail of parts whose mean radius is `radius`; `None` where there is none.
    pub fn settled(&self, radius: f64) -> Option<Detail> {
        let DetailRequest { genus, strength, octaves, seed, .. } = *self;
        (strength > 0.0).then(|| Detail { genus, strength, size: self.size.unwrap_or(radius), octaves, seed })
    }
}

impl Detail {
    /// The size of the smallest bumps, m.
    pub fn finest(&self) -> f64 {
        self.size / f64::from(1u32 << (self.octaves - 1))
    }

    /// The noise, ready to be looked up; periodic over `tile` where one is given.
    pub(super) fn noise(&self, tile: Option<Bounds>) -> Noise {
        let look = self.genus.look();
        let octaves = self.octaves.clamp(1, MOST_OCTAVES);
        let new = |number: u32, kind| {
            let mut noise = FastNoiseLite::with_seed(self.seed.wrapping_mul(0x9E37_79B9).wrapping_add(number) as i32);
            noise.set_frequency(Some(1.0));
            noise.set_noise_type(Some(kind));
            noise
        };
        let bumps = |number: u32, jitter: f32| {
            let mut noise = new(number, NoiseType::Cellular);
            noise.set_cellular_distance_function(Some(CellularDistanceFunction::EuclideanSq));
            noise.set_cellular_return_type(Some(CellularReturnType::Distance));
            noise.set_cellular_jitter(Some(jitter));
            noise
        };
        let octave = |number: u32| match look.form {
            Form::Bumps { jitter, .. } if number < HEAPS => bumps(100 + number, jitter),
            _ => new(100 + number, NoiseType::OpenSimplex2),
        };
        let mut rags = new(200, NoiseType::OpenSimplex2);
        rags.set_fractal_type(Some(FractalType::FBm));
        rags.set_fractal_octaves(Some(octaves as i32));
        let mut swirl = new(300, NoiseType::OpenSimplex2);
        swirl.set_domain_warp_type(Some(DomainWarpType::OpenSimplex2));
        swirl.set_domain_warp_amp(Some(look.warp as f32));
        Noise {
            look,
            size: self.size,
            strength: self.strength,
            octaves: (0..octaves).map(octave).collect(),
            rests: (0..=octaves as i32).map(|from| (from..octaves as i32).map(|k| look.gain.powi(k)).sum()).collect(),
            rags,
            swirl,
            tile,
        }
    }
}

/// A detail's noise, compiled.
pub(super) struct Noise {
    look: Character,
    size: f64,
    strength: f64,
    octaves: Vec<FastNoiseLite>,
    /// The sum of the amplitudes from each octave on; the first is 1.
    rests: Vec<f64>,
    rags: FastNoiseLite,
    swirl: FastNoiseLite,
    tile: Option<Bounds>,
}

/// How far a boundary is moved at a point, as far as it has been looked up: octaves are, from the largest on, until no other can
/// change what is asked.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moved {
    /// Where it is in the noise, swirled.
    swirled: Option<DVec3>,
    /// Octaves that are looked up.
    octaves: usize,
    /// Their sum, in amplitudes of the first.
    sum: f64,
}

/// The largest squared distance (1.15 was the largest of two million), and the mean of ridges.
const FAR_BUMP: f64 = 1.25;
const MEAN_RIDGE: f64 = 0.274;
/// So many octaves of bumps are cellular noise; finer ones are folds of gradient noise, which look alike at a third of the cost: their
/// mean, and the factor that gives them the range of the others.
const HEAPS: u32 = 2;
const MEAN_FOLD: f64 = 0.363;
const FINE_BUMP: f64 = 0.6;
/// The part of a tile, at its end, over which its noise is led back to its beginning.
const SEAM: f64 = 0.25;

impl Noise {
    /// The least and the most that an octave of amplitude 1 can be.
    fn range(&self) -> (f64, f64) {
        let (least, most) = match self.look.form {
            Form::Bumps { mean, .. } => ((mean - FAR_BUMP) / (1.0 - mean), mean / (1.0 - mean)),
            Form::Fibres => (-1.0 - MEAN_RIDGE, 1.0 - MEAN_RIDGE),
        };
        // Where images are blended the sum may be twice as large.
        let blended = if self.tile.is_some() { 2.0 } else { 1.0 };
        (blended * least, blended * most)
    }

    /// Metres of displacement for a sum of octaves.
    fn metres(&self, sum: f64) -> f64 {
        self.strength * self.size * (self.look.amplitude * sum + self.look.bias)
    }

    /// How far boundaries move in the mean, m.
    #[cfg(test)]
    pub fn bias(&self) -> f64 {
        self.metres(0.0)
    }

    /// How far at most a boundary moves outward, m.
    pub fn reach(&self) -> f64 {
        self.metres(self.range().1 * self.rests[0]).max(0.0)
    }

    /// How far at most it moves inward, m.
    pub fn bite(&self) -> f64 {
        -self.metres(self.range().0 * self.rests[0]).min(0.0)
    }

    /// The depth over which density rises where a shape has no rise of its own, m.
    pub fn edge(&self) -> f64 {
        self.strength * self.size * self.look.edge
    }

    /// What is cut off at the bottom, m.
    pub fn base(&self) -> f64 {
        self.strength * self.size * self.look.base
    }

    /// The factor by which a metaball's density rises faster.
    pub fn contrast(&self) -> f64 {
        1.0 + self.strength * (self.look.contrast - 1.0)
    }

    /// What a density that depends on how far the boundary moves (never falling with it) is at a point: octaves are looked up until
    /// what is left of them cannot change it.
    pub fn moved(&self, p: DVec3, known: &mut Moved, density: impl Fn(f64) -> f64) -> f64 {
        let (least, most) = self.range();
        loop {
            let rest = self.rests[known.octaves];
            let low = density(self.metres(known.sum + least * rest));
            if known.octaves == self.octaves.len() || low == density(self.metres(known.sum + most * rest)) {
                return low;
            }
            let (number, octave) = (known.octaves, &self.octaves[known.octaves]);
            let scale = f64::from(1u32 << number);
            let value = self.at(p, known, |q| {
                let noise = f64::from(octave.get_noise_3d(scale * q.x, scale * q.y, scale * q.z));
                match self.look.form {
                    // The library takes 1 off the squared distance.
                    Form::Bumps { mean, .. } if number < HEAPS as usize => (mean - 1.0 - noise) / (1.0 - mean),
                    Form::Bumps { .. } => FINE_BUMP * (noise.abs() - MEAN_FOLD),
                    Form::Fibres => 1.0 - 2.0 * noise.abs() - MEAN_RIDGE,
                }
            });
            known.sum += value * (rest - self.rests[number + 1]);
            known.octaves += 1;
        }
    }

    /// The density left of `density` at a point: thin edges are eaten, cores stay.
    pub fn eroded(&self, density: f64, p: DVec3, known: &mut Moved) -> f64 {
        let most = self.strength.min(1.0) * self.look.erosion;
        if density <= 0.0 || density >= 1.0 || most <= 0.0 {
            return density;
        }
        let rags = self.at(p, known, |q| f64::from(self.rags.get_noise_3d(2.0 * q.x, 2.0 * q.y, 2.0 * q.z)));
        let eaten = most * (0.5 + 0.9 * rags).clamp(0.0, 1.0);
        ((density - eaten) / (1.0 - eaten)).max(0.0)
    }

    /// A point swirled, in units of the noise.
    fn swirled(&self, p: DVec3) -> DVec3 {
        let q = p / (self.look.stretch * self.size);
        self.swirl.domain_warp_3d(q.x, q.y, q.z).into()
    }

    /// A noise at a point, in tiles or not.
    fn at(&self, p: DVec3, known: &mut Moved, noise: impl Fn(DVec3) -> f64) -> f64 {
        match &self.tile {
            None => noise(*known.swirled.get_or_insert_with(|| self.swirled(p))),
            Some(tile) => self.in_tile(tile, p, noise),
        }
    }

    /// A noise at a point; within a tile's last quarter it fades into what comes before the tile, its variance kept.
    ///
    /// Kept apart: else its divisions are made ready for every point of clouds without tiles.
    #[inline(never)]
    fn in_tile(&self, tile: &Bounds, p: DVec3, noise: impl Fn(DVec3) -> f64) -> f64 {
        let size = tile.size();
        let fold = |p: f64, min: f64, size: f64| min + (p - min).rem_euclid(size);
        let p = DVec3::new(fold(p.x, tile.min.x, size.x), fold(p.y, tile.min.y, size.y), p.z);
        let share = |p: f64, min: f64, size: f64| (((p - min) / size - (1.0 - SEAM)) / SEAM).max(0.0);
        let (u, v) = (share(p.x, tile.min.x, size.x), share(p.y, tile.min.y, size.y));
        let (mut sum, mut squares) = (0.0, 0.0);
        for (x, wx) in [(0.0, 1.0 - u), (size.x, u)] {
            for (y, wy) in [(0.0, 1.0 - v), (size.y, v)] {
                let weight = wx * wy;
                if weight > 0.0 {
                    sum += weight * noise(self.swirled(p - DVec3::new(x, y, 0.0)));
                    squares += weight * weight;
                }
            }
        }
        sum / f64::sqrt(squares)
    }
}
