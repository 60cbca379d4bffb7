//! Very many photons where there is no room between them.

use super::*;

const MILLION: usize = 1_000_000;

/// New regions stand where photons are: about the one point, across the one plane; and nothing is lost or takes for ever.
#[test]
fn a_million_photons_in_one_point_or_plane_make_regions_there() {
    let scene = ball(4.0);
    let origin = scene.region_bounds().centre();
    let mut rng = Rng::new(11, Stage::Photons, 1);
    let at = DVec3::new(0.3, -0.2, 0.1);
    let disc: Vec<(u32, DVec3)> =
        (0..MILLION).map(|_| (0, unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]) * DVec3::new(0.9, 0.9, 0.0))).collect();
    let reaches: [(_, &dyn Fn(DVec3) -> f64); 2] =
        [(vec![(0, at); MILLION], &|centre| centre.distance(at)), (disc, &|centre| centre.z.abs())];
    for (photons, least) in reaches {
        let made = run(&scene, &map_of(origin, photons), with(1000));
        let (_, others) = made.regions.split_last().unwrap();
        assert!(!others.is_empty());
        // The last is shrunk to what is left.
        for region in others {
            let (centre, radius) = (region.shape.centre(), region.shape.smallest_half_extent());
            // Photons are in single precision.
            assert!(radius.is_finite() && least(centre) <= radius * (1.0 + 1e-5) + 1e-6, "{} from {centre}, {radius}", least(centre));
        }
        let source = &made.sources[0];
        assert!((source.synthesised / source.mass - 1.0).abs() < 1e-6, "{} of {}", source.synthesised, source.mass);
    }
}
