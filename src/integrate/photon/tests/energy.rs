//! What is gathered in all directions is what was stored.

use super::*;
use crate::sampling::unit_ball;

#[test]
fn the_energy_gathered_is_the_energy_stored() {
    let (sigma_t, albedo, g) = (4.0, 0.9, 0.5);
    let scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(sigma_t, albedo, g))], DVec3::new(0.6, 0.0, -0.8));
    // Even points on the sphere of directions (Fibonacci's).
    let count = 32;
    let directions: Vec<Vec3> = (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f32 / count as f32;
            let (sin, cos) = (2.399_963_2 * i as f32).sin_cos();
            Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
        })
        .collect();
    // Photons of one path lie together: by few of them the density is overestimated, a hundredth at n = 8.
    let shares: Vec<f64> = (0..6)
        .map(|seed| {
            let photon = settings(Gathering::March, 600_000, 64);
            let map = Tracer::new(&scene, &plan(&scene), Model::Physical).of_second_pass().fill(photon.photons, seed, &Silent).unwrap().map;
            let stored = map.photons().iter().map(|p| f64::from(p.power)).sum::<f64>();
            let tracer = lights(&scene, photon, seed);
            let (Light::Nearest(gather), media) = (&tracer.channels[0].light, &tracer.channels[0].tracer.bands[0].media) else {
                panic!("nearest photons were asked for")
            };
            let points = 6144;
            let sums: Vec<f64> = (0..points)
                .into_par_iter()
                .map(|i| {
                    let mut rng = Rng::new(seed, Stage::Flux, i);
                    let mut hood = Neighbourhood::default();
                    let p = unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3();
                    let leaves = |&w| gather.scattered(p, w, g, sigma_t, media, &mut hood).iter().sum::<f64>();
                    directions.iter().map(leaves).sum::<f64>() / f64::from(count)
                })
                .collect();
            let volume = 4.0 / 3.0 * std::f64::consts::PI;
            let gathered = sums.iter().sum::<f64>() / points as f64 * 4.0 * std::f64::consts::PI * albedo * sigma_t * volume;
            gathered / stored
        })
        .collect();
    let share = mean(&shares);
    println!("gathered over stored: {:.5} +- {:.5}", share.value, share.se);
    // By chance once in a thousand, with five degrees of freedom.
    assert!((share.value - 1.0).abs() < 6.9 * share.se && share.se < 0.005, "{share:?}");
}
