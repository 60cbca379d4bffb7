//! Turbulent detail: noise of many octaves that moves the boundary of a cloud and eats into its edge.
//!
//! The noise is FastNoise Lite's, in metres of the world: it does not know of voxels. Rounded bumps (cellular noise, the squared distance
//! to the nearest of scattered points) heap up to cauliflowers; gradient noise makes rags; ridges along the wind make fibres.
//! A point looks up no more octaves than it needs.

use super::detail::{Detail, MOST_OCTAVES};
use super::genus::{Character, Form};
use crate::geom::Bounds;
use fastnoise_lite::{CellularDistanceFunction, CellularReturnType, DomainWarpType, FastNoiseLite, FractalType, NoiseType};
use glam::DVec3;

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

/// A detail's noise, ready to be looked up.
pub(super) struct Noise {
    look: Character,
    size: f64,
    strength: f64,
    octaves: Vec<Octave>,
    /// The least and the most that octaves from each one on add, m; after the last, nothing.
    rests: Vec<(f64, f64)>,
    rags: FastNoiseLite,
    swirl: FastNoiseLite,
    tile: Option<Bounds>,
}

/// One octave: `a + b * noise` metres, or `a + b * |noise|` where it is folded.
struct Octave {
    noise: FastNoiseLite,
    scale: f64,
    folded: bool,
    line: (f64, f64),
}

impl Octave {
    fn new(seed: u32, number: u32, form: Form, metres: f64) -> Self {
        let gradient = || seeded(seed, 100 + number, NoiseType::OpenSimplex2);
        // The noise, whether it is folded, the line, and the range.
        let (noise, folded, (a, b)) = match form {
            Form::Bumps { jitter, mean } if number < HEAPS => {
                let mut noise = seeded(seed, 100 + number, NoiseType::Cellular);
                noise.set_cellular_distance_function(Some(CellularDistanceFunction::EuclideanSq));
                noise.set_cellular_return_type(Some(CellularReturnType::Distance));
                noise.set_cellular_jitter(Some(jitter));
                // The library takes 1 off the squared distance.
                (noise, false, ((mean - 1.0) / (1.0 - mean), -1.0 / (1.0 - mean)))
            }
            Form::Bumps { .. } => (gradient(), true, (-FINE_BUMP * MEAN_FOLD, FINE_BUMP)),
            Form::Fibres => (gradient(), true, (1.0 - MEAN_RIDGE, -2.0)),
        };
        Octave { noise, folded, scale: f64::from(1u32 << number), line: (metres * a, metres * b) }
    }

    /// The least and the most that it adds, m.
    fn range(&self) -> (f64, f64) {
        let (a, b) = self.line;
        let (first, last) = if self.folded { (a, a + b) } else { (a - b, a + b * (FAR_BUMP - 1.0)) };
        (first.min(last), first.max(last))
    }

    /// What it adds at a point of the noise, m.
    fn at(&self, q: DVec3) -> f64 {
        let noise = f64::from(self.noise.get_noise_3d(self.scale * q.x, self.scale * q.y, self.scale * q.z));
        self.line.0 + self.line.1 * if self.folded { noise.abs() } else { noise }
    }
}

/// The library's noise of a kind, of lattice 1.
fn seeded(seed: u32, number: u32, kind: NoiseType) -> FastNoiseLite {
    let mut noise = FastNoiseLite::with_seed(seed.wrapping_mul(0x9E37_79B9).wrapping_add(number) as i32);
    noise.set_frequency(Some(1.0));
    noise.set_noise_type(Some(kind));
    noise
}

/// How far a boundary is moved at a point, as far as it has been looked up: octaves are, from the largest on, until no other can
/// change what is asked.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moved {
    /// Where it is in the noise, swirled.
    swirled: Option<DVec3>,
    /// Octaves that are looked up.
    octaves: usize,
    /// Their sum, m.
    sum: f64,
}

impl Noise {
    /// The noise of a detail; periodic over `tile` where one is given.
    pub fn new(detail: &Detail, tile: Option<Bounds>) -> Self {
        let Detail { genus, strength, size, seed, .. } = *detail;
        let (look, count) = (genus.look(), detail.octaves.clamp(1, MOST_OCTAVES));
        let amplitude = |number: u32| strength * size * look.amplitude * look.gain.powi(number as i32);
        let octaves: Vec<Octave> = (0..count).map(|number| Octave::new(seed, number, look.form, amplitude(number))).collect();
        // Where images are blended the sum may be twice as large.
        let blended = if tile.is_some() { 2.0 } else { 1.0 };
        let mut rests = vec![(0.0, 0.0)];
        for octave in octaves.iter().rev() {
            let (least, most) = octave.range();
            let rest = rests[rests.len() - 1];
            rests.push((rest.0 + blended * least, rest.1 + blended * most));
        }
        rests.reverse();
        let mut rags = seeded(seed, 200, NoiseType::OpenSimplex2);
        rags.set_fractal_type(Some(FractalType::FBm));
        rags.set_fractal_octaves(Some(count as i32));
        let mut swirl = seeded(seed, 300, NoiseType::OpenSimplex2);
        swirl.set_domain_warp_type(Some(DomainWarpType::OpenSimplex2));
        swirl.set_domain_warp_amp(Some(look.warp as f32));
        Noise { look, size, strength, octaves, rests, rags, swirl, tile }
    }

    /// How far boundaries move in the mean, m.
    pub fn bias(&self) -> f64 {
        self.strength * self.size * self.look.bias
    }

    /// How far at most a boundary moves outward, m.
    pub fn reach(&self) -> f64 {
        (self.bias() + self.rests[0].1).max(0.0)
    }

    /// How far at most it moves inward, m.
    pub fn bite(&self) -> f64 {
        -(self.bias() + self.rests[0].0).min(0.0)
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
        loop {
            let (by, (least, most)) = (self.bias() + known.sum, self.rests[known.octaves]);
            let low = density(by + least);
            if known.octaves == self.octaves.len() || low == density(by + most) {
                return low;
            }
            let octave = &self.octaves[known.octaves];
            known.sum += self.at(p, known, |q| octave.at(q));
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
