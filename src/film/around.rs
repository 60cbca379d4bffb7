//! What a pixel's error is by the pixels around it, where its own samples do not tell.

use super::{Film, Pixel, grey};
use std::ops::Range;

/// Noise, and what stored photons blur, is told by the pixels so far around.
const REACH: usize = 2;

impl Film {
    /// Gives the variance of each pixel that has any to those around it that have, itself among them, in even shares.
    ///
    /// A pixel's own samples tell its variance badly where few paths bring most of the light: one that has missed them is too dark and
    /// too sure of it at once. Its neighbours have found some. The sum of variances stays as it is, and so does
    /// [`Film::relative_error`]. Pixels that are not known, or known exactly, take no part.
    pub(crate) fn share_noise(&mut self) {
        let (width, height) = (self.width as usize, self.height as usize);
        let before: Vec<[f64; 3]> = self.pixels.iter().map(|p| p.standard_error.map(|e| f64::from(e).powi(2))).collect();
        for c in 0..3 {
            let noisy = |i: usize| before[i][c] > 0.0 && before[i][c].is_finite();
            let share = |i: usize| before[i][c] / near(i, width, height).filter(|&j| noisy(j)).count() as f64;
            let shares: Vec<f64> = (0..before.len()).map(|i| if noisy(i) { share(i) } else { 0.0 }).collect();
            for i in (0..before.len()).filter(|&i| noisy(i)) {
                let sum: f64 = near(i, width, height).map(|j| shares[j]).sum();
                self.pixels[i].standard_error[c] = sum.sqrt() as f32;
            }
        }
    }

    /// From what each pixel alone knows of the square of its blur, which is noisy and may be below zero, to its [`Pixel::bias`]: the root of
    /// the mean over the lit pixels around it. Its standard error grows by that, in the colour of what stored photons brought.
    pub(crate) fn spread_blur(&mut self) {
        let (width, height) = (self.width as usize, self.height as usize);
        let lit = |p: &Pixel| *p != Pixel::UNKNOWN && grey(p.combined()) > 0.0;
        let around = |i: usize| {
            let lit_near = near(i, width, height).map(|j| &self.pixels[j]).filter(|p| lit(p));
            let (n, sum) = lit_near.fold((0.0f64, 0.0f64), |(n, sum), p| (n + 1.0, sum + f64::from(p.bias)));
            if lit(&self.pixels[i]) { (sum / n).max(0.0).sqrt() } else { 0.0 }
        };
        let blurs: Vec<f64> = (0..self.pixels.len()).map(around).collect();
        for (pixel, blur) in self.pixels.iter_mut().zip(blurs) {
            let whole = grey(pixel.volume_indirect);
            for (error, light) in pixel.standard_error.iter_mut().zip(pixel.volume_indirect) {
                let share = if whole > 0.0 { f64::from(light) / whole } else { 1.0 };
                *error = f64::from(*error).hypot(blur * share) as f32;
            }
            pixel.bias = blur as f32;
        }
    }
}

/// The pixels up to [`REACH`] around one, itself among them, row by row.
fn near(i: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let around = |x: usize, end: usize| -> Range<usize> { x.saturating_sub(REACH)..(x + REACH + 1).min(end) };
    let columns = around(i % width, width);
    around(i / width, height).flat_map(move |y| columns.clone().map(move |x| y * width + x))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blur is spread over what is lit, where noise took some of it below zero, and is in the error in the colour of the light.
    #[test]
    fn blur_is_that_of_the_pixels_around() {
        let lit = |bias: f32| Pixel { volume_indirect: [2.0, 1.0, 0.0], standard_error: [0.3; 3], bias, ..Pixel::default() };
        let mut pixels = vec![lit(0.5); 9];
        (pixels[4], pixels[8]) = (lit(-0.1), Pixel { standard_error: [0.3; 3], bias: 7.0, ..Pixel::default() });
        let mut film = Film { width: 3, height: 3, pixels, sky: false };
        film.spread_blur();
        let bias = f64::from((7.0f32 * 0.5 - 0.1) / 8.0).sqrt();
        assert!(film.pixels[..8].iter().all(|p| (f64::from(p.bias) - bias).abs() < 1e-6) && film.pixels[8].bias == 0.0);
        let [red, green, blue] = film.pixels[0].standard_error.map(f64::from);
        let whole = grey([2.0, 1.0, 0.0]);
        assert!((red - 0.3f64.hypot(2.0 * bias / whole)).abs() < 1e-6 && (green - 0.3f64.hypot(bias / whole)).abs() < 1e-6);
        assert!((blue - 0.3).abs() < 1e-6 && film.pixels[8].standard_error == [0.3; 3]);
        // What is dark on the whole has none.
        let mut film = Film { width: 1, height: 1, pixels: vec![lit(-1.0)], sky: false };
        film.spread_blur();
        assert_eq!((film.pixels[0].bias, film.relative_bias()), (0.0, Some(0.0)));
    }

    /// Variances stay what they are in sum, by channel; what is not known or exact gives and takes nothing.
    #[test]
    fn noise_is_shared_among_the_noisy_and_none_is_lost() {
        let pixel = |e: [f32; 3]| Pixel { surface: [1.0; 3], standard_error: e, ..Pixel::default() };
        let mut pixels: Vec<Pixel> = (1..=12).map(|i| pixel([i as f32, 1.0, 0.0])).collect();
        (pixels[5], pixels[11]) = (pixel([0.0, 1.0, 0.0]), Pixel::UNKNOWN);
        let mut film = Film { width: 4, height: 3, pixels, sky: false };
        let sum = |film: &Film, c: usize| film.pixels[..11].iter().map(|p| f64::from(p.standard_error[c]).powi(2)).sum::<f64>();
        let (before, said) = ([0, 1].map(|c| sum(&film, c)), film.clone());
        film.share_noise();
        for c in [0, 1] {
            assert!((sum(&film, c) / before[c] - 1.0).abs() < 1e-6);
        }
        assert_eq!((film.pixels[5].standard_error[0], film.pixels[11]), (0.0, Pixel::UNKNOWN));
        assert!(film.pixels.iter().zip(&said.pixels).all(|(p, q)| p.standard_error[2] == q.standard_error[2]));
        // The corner: what its column has for eight noisy pixels each, and the two beside it for ten.
        let corner = f64::from(film.pixels[0].standard_error[0]).powi(2);
        assert!((corner - (1.0 + 25.0 + 81.0) / 8.0 - (4.0 + 9.0 + 49.0 + 100.0 + 121.0) / 10.0).abs() < 1e-5, "{corner}");
    }
}
