//! What a picture says of its own noise, and what the march's step does to it.

use super::image::{average, balls, picture, values};
use super::*;

/// The film's variances and the scatter of its values over seeds that change photons and samples alike: the ratio of their sums
/// over the picture, with its error by leaving out one seed at a time.
fn stated_over_found(name: &str, scene: &Scene, spp: u32, seeds: u64, photon: PhotonSettings) -> Estimate {
    let films: Vec<Rendering> = (0..seeds).map(|seed| picture(scene, Integrator::Photon, spp, 1000 + seed, photon)).collect();
    let luminous = |r: &Rendering| values(r).into_iter().skip(1).step_by(3).collect::<Vec<f64>>();
    let stated =
        |r: &Rendering| r.film.pixels.iter().map(|p| f64::from(p.standard_error[1]).powi(2) - f64::from(p.bias).powi(2)).sum::<f64>();
    let ratio = |without: usize| {
        let kept: Vec<&Rendering> = films.iter().enumerate().filter(|(i, _)| *i != without).map(|(_, film)| film).collect();
        let n = kept.len() as f64;
        let pixels: Vec<Vec<f64>> = kept.iter().map(|r| luminous(r)).collect();
        let scatter: f64 = (0..pixels[0].len())
            .map(|i| {
                let middle = pixels.iter().map(|p| p[i]).sum::<f64>() / n;
                pixels.iter().map(|p| (p[i] - middle).powi(2)).sum::<f64>() / (n - 1.0)
            })
            .sum();
        kept.iter().map(|r| stated(r)).sum::<f64>() / n / scatter
    };
    let without: Vec<f64> = (0..films.len()).map(ratio).collect();
    let n = without.len() as f64;
    let middle = average(&without);
    let found =
        Estimate { value: ratio(usize::MAX), se: (without.iter().map(|x| (x - middle).powi(2)).sum::<f64>() * (n - 1.0) / n).sqrt() };
    println!("{name}: stated variance over found {:.3} +- {:.3}", found.value, found.se);
    found
}

#[test]
fn the_stated_error_is_the_scatter_over_seeds() {
    for (spp, gather) in [(8, Gathering::March), (8, Gathering::Beam)] {
        let found = stated_over_found(&format!("{gather:?}, {spp} samples"), &balls(), spp, 16, settings(gather, 20_000, 60));
        assert!((found.value - 1.0).abs() < 3.9 * found.se && found.se < 0.12, "{found:?}");
    }
}

#[test]
fn the_step_has_no_bias() {
    let scene = balls();
    let off: Vec<f64> = (0..12)
        .map(|seed| {
            let with = |step, spp| {
                let photon = PhotonSettings { step, ..settings(Gathering::March, 20_000, 60) };
                average(&values(&picture(&scene, Integrator::Photon, spp, seed, photon)))
            };
            with(2.0, 128) / with(0.05, 16) - 1.0
        })
        .collect();
    let off = mean(&off);
    println!("steps of optical depth 2 against 0.05: {:+.3} % +- {:.3} %", 100.0 * off.value, 100.0 * off.se);
    assert!(off.value.abs() < 4.4 * off.se && off.se < 0.002, "{off:?}");
}

/// What a picture says that its photons blur, against what its mean over seeds is off by: where there is much, about as much, and where
/// there is little, little.
#[test]
fn the_stated_blur_is_about_the_bias() {
    let scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(8.0, 0.9, 0.3))], DVec3::new(0.8, 0.4, -0.6).normalize());
    let truth = picture(&scene, Integrator::Path, 4096, 1, PhotonSettings::default());
    let unsure = average(&truth.film.pixels.iter().map(|p| f64::from(p.standard_error[1]).powi(2)).collect::<Vec<f64>>());
    let grey = |rgb: &[f64]| rgb.iter().skip(1).step_by(3).copied().collect::<Vec<f64>>();
    let truth = grey(&values(&truth));
    for gather in [Gathering::March, Gathering::Beam] {
        let films: Vec<Rendering> =
            (0..4).map(|seed| picture(&scene, Integrator::Photon, 8, 50 + seed, settings(gather, 40_000, 600))).collect();
        let pictures: Vec<Vec<f64>> = films.iter().map(|film| grey(&values(film))).collect();
        let mean: Vec<f64> = (0..truth.len()).map(|i| average(&pictures.iter().map(|p| p[i]).collect::<Vec<f64>>())).collect();
        let scatter = |i: usize| pictures.iter().map(|p| (p[i] - mean[i]).powi(2)).sum::<f64>() / 12.0;
        let off = average(&(0..truth.len()).map(|i| (mean[i] - truth[i]).powi(2) - scatter(i)).collect::<Vec<f64>>()) - unsure;
        let off = off.max(0.0).sqrt();
        let stated = |film: &Rendering| average(&film.film.pixels.iter().map(|p| f64::from(p.bias).powi(2)).collect::<Vec<f64>>());
        let stated = average(&films.iter().map(stated).collect::<Vec<f64>>()).sqrt();
        println!("{gather:?}: stated {stated:.4}, off by {off:.4} of {:.4}", average(&truth));
        assert!((0.5..4.0).contains(&(stated / off)), "{gather:?}: {stated} {off}");
    }
}
