//! Near a region's end, where a part of the ball holds no medium.

use super::*;

/// A sphere of radius 1, seen sidelong at its lit side.
const MEDIUM: (f64, f64, f64) = (4.0, 0.9, 0.5);
const PHOTONS: u64 = 300_000;
const ESTIMATE: u64 = 200;
/// Search radii below the surface.
const DEPTHS: [f32; 5] = [0.0, 0.25, 0.5, 1.0, 2.0];
/// Places on a circle about the sun's axis.
const AROUND: usize = 16;

/// What is found at a depth, over what is there: with the medium's share of the ball, and with all of the ball; and its radius.
struct Row {
    depth: f32,
    corrected: Estimate,
    full: Estimate,
    radius: f64,
}

fn found(gather: &Gather, media: &Media, p: Vec3, outward: Vec3) -> (f64, f64, f64) {
    let mut hood = Neighbourhood::default();
    let radius = gather.nearest().find(p, &mut hood).unwrap();
    let light = gather.scattered(p, outward, MEDIUM.2, MEDIUM.0, media, &mut hood).iter().sum::<f64>();
    let whole = MEDIUM.0 * 4.0 / 3.0 * std::f64::consts::PI * f64::from(radius).powi(3);
    (light, light * media.mass_within(p, radius) / whole, f64::from(radius))
}

fn gather(scene: &Scene, seed: u64) -> Gather {
    match lights(scene, settings(Gathering::March, PHOTONS, ESTIMATE), seed).channels.remove(0).light {
        Light::Nearest(gather) => gather,
        Light::Beams(_) => panic!("nearest photons were asked for"),
    }
}

/// The table for points below a place on the surface, in polar angle from the zenith.
fn table(name: &str, scene: &Scene, gathers: &[Gather], polar: f32, outward: Vec3) -> Vec<Row> {
    let reference = PathTracer::new(scene, &plan(scene));
    let media = &reference.bands[0].media;
    let up = Vec3::new(polar.sin(), 0.0, polar.cos());
    // The depth whose search radius is that part of it.
    let deep = |share: f32| (0..8).fold(0.1 * share, |depth, _| share * found(&gathers[0], media, up * (1.0 - depth), outward).2 as f32);
    let row = |(share, seed): (f32, u64)| {
        let depth = deep(share);
        let truth = super::scattered(&reference, up * (1.0 - depth), outward, MEDIUM.2, 60_000, seed);
        let mut samples: [Vec<f64>; 3] = Default::default();
        for gather in &gathers[1..] {
            let mut sums = [0.0; 3];
            for part in 0..AROUND {
                let turn = glam::Quat::from_rotation_z(std::f32::consts::TAU * part as f32 / AROUND as f32);
                let (corrected, full, radius) = found(gather, media, turn * up * (1.0 - depth), turn * outward);
                let part = 1.0 / AROUND as f64;
                sums = [sums[0] + corrected / truth.value * part, sums[1] + full / truth.value * part, sums[2] + radius * part];
            }
            samples.iter_mut().zip(sums).for_each(|(all, one)| all.push(one));
        }
        let bias = |samples: &[f64]| {
            let found = mean(samples);
            Estimate { value: found.value - 1.0, se: found.se.hypot(truth.se / truth.value * found.value) }
        };
        let row = Row { depth: share, corrected: bias(&samples[0]), full: bias(&samples[1]), radius: mean(&samples[2]).value };
        println!(
            "{name}, {:.2} radii of {:.3} deep: bias {:+.4} +- {:.4}, uncorrected {:+.4} +- {:.4}",
            row.depth, row.radius, row.corrected.value, row.corrected.se, row.full.value, row.full.se
        );
        row
    };
    DEPTHS.into_iter().zip(500..).map(row).collect()
}

#[test]
fn the_part_of_the_ball_outside_is_made_up_for() {
    let scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(MEDIUM.0, MEDIUM.1, MEDIUM.2))], DVec3::NEG_Z);
    let gathers: Vec<Gather> = (0..8).map(|seed| gather(&scene, seed)).collect();
    let places = [
        ("lit side", 0.8f32, Vec3::new(0.6, 0.0, 0.8), 0.6),
        ("half in shade", 1.57, Vec3::new(0.8, 0.6, 0.0), 0.6),
        ("in shade", 2.4, Vec3::new(0.6, 0.0, -0.8), 0.25),
    ];
    for (name, polar, outward, removed) in places {
        let rows = table(name, &scene, &gathers, polar, outward);
        // At the surface at least that share of the bias is gone; what is left is that light differs across half a ball.
        let (corrected, full) = (rows[0].corrected, rows[0].full);
        let most = (1.0 - removed) * full.value.abs();
        assert!(corrected.value.abs() + 3.9 * corrected.se.hypot((1.0 - removed) * full.se) < most, "{name}: {corrected:?} {full:?}");
        // Two radii deep the ball is whole.
        assert!((rows[4].corrected.value - rows[4].full.value).abs() < 1e-3, "{name}");
    }
}
