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
    /// Looks at the layout, twice by the path tracer.
    ///
    /// # Errors
    /// Those of a picture, and [`Error::Scene`] where there is nothing to compare.
    pub fn new(stage: &Stage, progress: &dyn Progress) -> Result<Self> {
        let take = |seed| stage.picture(stage.scene, stage.spp.0, seed, progress);
        let [a, b] = HALVES;
        let halves = [take(a)?, take(b)?];
        Truth::of(&stage.scene.regions, &halves).ok_or_else(|| Error::Scene {
            reason: "no pixel of the layout receives light, or it has no mass: there is nothing to compare".into(),
            fix: "Look at the scene first: cloudvdb SCENE -o look.png --density source".into(),
        })
    }

    /// Regions, and two independent pictures of them.
    fn of(regions: &[Region], [a, b]: &[Vec<[f32; 3]>; 2]) -> Option<Self> {
        let bounds = regions.iter().fold(Bounds::EMPTY, |b, r| b.union(r.shape.bounds()));
        let (origin, half) = (bounds.centre(), (0.5 * bounds.size()).as_vec3());
        let media = Media::new(regions, origin);
        let picture: Vec<[f32; 3]> = a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
        let lit: Vec<f64> = picture.iter().map(grey).filter(|&l| l > 0.0).collect();
        let mean = lit.iter().sum::<f64>() / lit.len().max(1) as f64;
        let (points, lines) = (points(&media, half), lines(&media, half.length()));
        let halves = [a, b].map(|half| half.iter().map(grey).collect());
        let something = mean > 0.0 && !points.is_empty() && !lines.is_empty();
        something.then_some(Truth { origin, points, lines, halves, mean, lit: lit.len() as f64, picture })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Medium, Shape};

    const RADIUS: f64 = 3.0;
    const SIGMA: f64 = 0.4;

    fn ball(x: f64, sigma: f64) -> Region {
        let shape = Shape::sphere(DVec3::new(x, 0.0, 0.0), RADIUS);
        Region { name: "ball".into(), shape, medium: Medium::grey(sigma, 0.0, 0.0), photons: None }
    }

    fn normal(rng: &mut Rng) -> f64 {
        (-2.0 * (1.0 - rng.uniform()).ln()).sqrt() * (std::f64::consts::TAU * rng.uniform()).cos()
    }

    /// A ball, against itself, one of half its extinction, one moved by its radius: all by formulas.
    #[test]
    fn figures_are_those_of_balls_by_hand() {
        let picture = || [vec![[1.0; 3]; 4], vec![[1.0; 3]; 4]];
        let truth = Truth::of(&[ball(5.0, SIGMA)], &picture()).unwrap();
        assert_eq!((truth.points.len(), truth.lines.len()), (POINTS, LINES));
        let judge = |region: Region, mass| truth.judge(&[region], mass, &picture());
        // Shares of points, and means over chords of length 0 to 2 R: within 4.5 standard errors.
        let of_points = |p: f64| 4.5 * (p * (1.0 - p) / POINTS as f64).sqrt();
        let of_lines = 4.5 / (LINES as f64).sqrt();
        let same = judge(ball(5.0, SIGMA), 1.0);
        assert_eq!([0, 1, 2, 3, 6, 7, 8].map(|i| same[i]), [1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        // The mean of e^(-sigma l) over isotropic chords, whose lengths have the density l / 2 R^2.
        let passing = |sigma: f64| {
            let x = 2.0 * sigma * RADIUS;
            2.0 * (1.0 - (1.0 + x) * (-x).exp()) / (x * x)
        };
        let half = judge(ball(5.0, SIGMA / 2.0), 0.5);
        assert_eq!(half[UNCOVERED], 0.0);
        assert!((half[IN_PLACE] - 0.5).abs() < 1e-9 && (half[INSIDE] - 1.0).abs() < 1e-9);
        for (found, sigma) in half[4..].iter().zip([SIGMA, SIGMA / 2.0]) {
            assert!((found - passing(sigma)).abs() < 0.3 * of_lines, "{found} {}", passing(sigma));
        }
        // (u - t)^2 = e^(-sigma l) + e^(-2 sigma l) - 2 e^(-3/2 sigma l); E l^2 / (E l)^2 = 9/8.
        let square = passing(SIGMA) + passing(2.0 * SIGMA) - 2.0 * passing(1.5 * SIGMA);
        assert!((half[TRANSMITTANCE_SQUARE] - square).abs() < 0.05 * of_lines, "{} {square}", half[TRANSMITTANCE_SQUARE]);
        assert!((half[DEPTH_SQUARE] - 9.0 / 32.0).abs() < 0.1 * of_lines, "{}", half[DEPTH_SQUARE]);
        // Two equal balls at a distance of their radius share 5/16.
        let moved = judge(ball(5.0 + RADIUS, SIGMA), 1.0);
        for (found, share) in [(moved[UNCOVERED], 11.0 / 16.0), (moved[IN_PLACE], 5.0 / 16.0), (moved[INSIDE], 5.0 / 16.0)] {
            assert!((found - share).abs() < of_points(share), "{found} {share}");
        }
    }

    /// The noise of pictures is in no square: over 400 pairs of pictures its mean is what was put in, within 4.5 of its standard errors.
    #[test]
    fn noise_is_in_no_square() {
        let mut rng = Rng::new(3, Stream::Render, 0);
        let mut noisy = |light: f64| (0..64).map(|_| [(light + 0.5 * normal(&mut rng)) as f32; 3]).collect::<Vec<_>>();
        let mut truth = Truth::of(&[ball(0.0, SIGMA)], &[vec![[1.0; 3]; 64], vec![[1.0; 3]; 64]]).unwrap();
        (truth.points, truth.lines) = (truth.points[..1].to_vec(), truth.lines[..1].to_vec());
        for off in [0.0, 0.2] {
            let squares: Vec<f64> = (0..400)
                .map(|_| {
                    truth.halves = [noisy(1.0), noisy(1.0)].map(|half| half.iter().map(grey).collect());
                    truth.judge(&[ball(0.0, SIGMA)], 1.0, &[noisy(1.0 + off), noisy(1.0 + off)])[RADIANCE_SQUARE]
                })
                .collect();
            let mean = squares.iter().sum::<f64>() / 400.0;
            let error = (squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 399.0 / 400.0).sqrt();
            assert!((mean - off * off).abs() < 4.5 * error, "{mean} +- {error}, {off}");
        }
    }
}
