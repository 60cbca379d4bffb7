//! What of a layout its new regions keep: where its mass lies, what passes along lines, what the camera sees.

use super::Stage;
use crate::error::{Error, Result};
use crate::geom::{Bounds, Ray};
use crate::media::{Media, Scratch};
use crate::progress::Progress;
use crate::rng::{Rng, Stage as Stream};
use crate::sampling::uniform_sphere;
use crate::scene::{Region, medium::luminance};
use glam::{DVec3, Vec3};

/// Figures of a synthesis.
pub(super) const FIGURES: usize = 9;
/// Their names, all of them shares.
///
/// * `mass`: the new regions' optical mass over the layout's.
/// * `uncovered`: what of the layout's mass lies where no new region is.
/// * `in_place`: what of it is there, and no more than was there.
/// * `inside`: what of the new mass lies within the layout.
/// * `transmittance_layout`, `transmittance`: means over random lines through the layout, in it and in the new regions.
/// * `transmittance_square`: the mean square of what the two differ by, line by line.
/// * `depth_square`: that of optical depths, over the square of the layout's mean.
/// * `radiance_square`: the mean squared difference of a pixel from the layout's, over its squared mean; noise is in neither.
pub(super) const NAMES: [&str; FIGURES] = [
    "mass",
    "uncovered",
    "in_place",
    "inside",
    "transmittance_layout",
    "transmittance",
    "transmittance_square",
    "depth_square",
    "radiance_square",
];
pub(super) const UNCOVERED: usize = 1;
pub(super) const IN_PLACE: usize = 2;
pub(super) const INSIDE: usize = 3;
pub(super) const TRANSMITTANCE: [usize; 2] = [4, 5];
pub(super) const TRANSMITTANCE_SQUARE: usize = 6;
pub(super) const DEPTH_SQUARE: usize = 7;
pub(super) const RADIANCE_SQUARE: usize = 8;

/// Points in the layout, and lines through it.
const POINTS: usize = 20_000;
pub(super) const LINES: usize = 10_000;
/// Tries for each of them.
const TRIES: usize = 1000;
/// The seeds of the layout's pictures, of points and of lines: none that a run has.
const HALVES: [u64; 2] = [1 << 50, (1 << 50) + 1];

/// The layout.
pub(super) struct Truth {
    origin: DVec3,
    /// Places, and the extinction there, 1/m.
    points: Vec<(Vec3, f64)>,
    /// Lines, and the optical depth along each.
    lines: Vec<(Ray, f64)>,
    /// Two pictures, in luminance, and their mean over lit pixels; how many are lit.
    halves: [Vec<f64>; 2],
    mean: f64,
    lit: f64,
    /// Their mean, RGB.
    pub picture: Vec<[f32; 3]>,
}

impl Truth {
    pub fn new(stage: &Stage, progress: &dyn Progress) -> Result<Self> {
        let regions = &stage.scene.regions;
        let bounds = regions.iter().fold(Bounds::EMPTY, |b, r| b.union(r.shape.bounds()));
        let (origin, half) = (bounds.centre(), (0.5 * bounds.size()).as_vec3());
        let media = Media::new(regions, origin);
        let [a, b] = HALVES;
        let (a, b) = (stage.picture(stage.scene, stage.spp.0, a, progress)?, stage.picture(stage.scene, stage.spp.0, b, progress)?);
        let picture: Vec<[f32; 3]> = a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
        let lit: Vec<f64> = picture.iter().map(grey).filter(|&l| l > 0.0).collect();
        let mean = lit.iter().sum::<f64>() / lit.len().max(1) as f64;
        let (points, lines) = (points(&media, half), lines(&media, half.length()));
        if mean <= 0.0 || points.is_empty() || lines.is_empty() {
            return Err(Error::Scene {
                reason: "no pixel of the layout receives light, or it has no mass: there is nothing to compare".into(),
                fix: "Look at the scene first: cloudvdb SCENE -o look.png --density source".into(),
            });
        }
        let halves = [a, b].map(|half| half.iter().map(grey).collect());
        Ok(Truth { origin, points, lines, halves, mean, lit: lit.len() as f64, picture })
    }

    /// The figures of regions that have so much of the layout's mass, with two independent pictures of them.
    pub fn judge(&self, regions: &[Region], mass: f64, pictures: &[Vec<[f32; 3]>; 2]) -> [f64; FIGURES] {
        let media = Media::new(regions, self.origin);
        let whole: f64 = self.points.iter().map(|p| p.1).sum();
        let [mut uncovered, mut in_place, mut inside] = [0.0; 3];
        for &(p, before) in &self.points {
            let after = media.extinction(p);
            uncovered += if after == 0.0 { before } else { 0.0 };
            in_place += before.min(after);
            inside += after;
        }
        let (n, mut scratch) = (self.lines.len() as f64, Scratch::default());
        let [mut passed, mut passes, mut square, mut depths, mut depth] = [0.0; 5];
        for (line, before) in &self.lines {
            let after = media.optical_depth(line, f32::INFINITY, &mut scratch);
            let [t, u] = [*before, after].map(|tau| (-tau).exp());
            (passed, passes, square) = (passed + t, passes + u, square + (u - t).powi(2));
            (depth, depths) = (depth + before, depths + (after - before).powi(2));
        }
        let [a, b] = &self.halves;
        let light = pictures.each_ref().map(|p| p.iter().map(grey).collect::<Vec<f64>>());
        let off = |i: usize| (light[0][i] - a[i]) * (light[1][i] - b[i]);
        let radiance = (0..a.len()).map(off).sum::<f64>() / self.lit / self.mean.powi(2);
        let depths = depths / n / (depth / n).powi(2);
        // What is made beyond the layout's bounds is seen by no point: it is what is left of the mass.
        [mass, uncovered / whole, in_place / whole, inside / whole / mass, passed / n, passes / n, square / n, depths, radiance]
    }
}

/// Points that are even in the layout's bounds, where there is any extinction.
fn points(media: &Media, half: Vec3) -> Vec<(Vec3, f64)> {
    let mut rng = Rng::new(HALVES[0], Stream::Sunlight, 0);
    let all = (0..POINTS * TRIES).map(|_| half * (2.0 * rng.uniform_vec3() - 1.0));
    all.map(|p| (p, media.extinction(p))).filter(|p| p.1 > 0.0).take(POINTS).collect()
}

/// Lines that are even in direction and place (isotropic, uniform) about a ball of that radius, which meet the layout.
fn lines(media: &Media, radius: f32) -> Vec<(Ray, f64)> {
    let (mut rng, mut scratch) = (Rng::new(HALVES[0], Stream::Sunlight, 1), Scratch::default());
    let mut line = || {
        let direction = uniform_sphere(&mut rng);
        let (x, y) = direction.any_orthonormal_pair();
        let (r, angle) = (radius * rng.uniform_f32().sqrt(), std::f32::consts::TAU * rng.uniform_f32());
        // From farther than any new region reaches out of the layout.
        Ray { origin: r * (angle.cos() * x + angle.sin() * y) - 4.0 * radius * direction, direction }
    };
    let all = (0..LINES * TRIES).map(|_| line());
    let met = all.map(|ray| (ray, media.optical_depth(&ray, f32::INFINITY, &mut scratch))).filter(|line| line.1 > 0.0);
    met.take(LINES).collect()
}

fn grey(texel: &[f32; 3]) -> f64 {
    luminance(texel.map(f64::from))
}
