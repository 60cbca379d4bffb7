//! What shows similar media's light in media of the scene's own extinction.

use super::super::aspect::Aspect;
use super::super::basis::Basis;
use super::super::behind::behind;
use super::super::field::Request;
use super::super::orders::Orders;
use super::super::space::Space;
use super::*;

/// A ball that sends 1 everywhere, per unit of the similar media's optical depth, is as bright along a ray as its chord through them says; so is
/// a medium of its own extinction that sends what is made of that. Behind a surface nothing is seen.
#[test]
fn what_an_even_ball_sends_is_what_its_chords_say() {
    let (sigma, g, eye) = (8.0, 0.85, Vec3::new(0.0, -4.0, 0.0));
    let mut scene = lit(vec![ball(DVec3::ZERO, 1.0, Medium::with_albedo(sigma, 1.0, g))]);
    let wall = |y: f64| {
        let corner = |x: f64, z: f64| DVec3::new(2.0 * x, y, 2.0 * z);
        let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        Surface { name: "wall".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }, albedo: [0.5; 3] }
    };
    for hidden in [2.0, 0.5] {
        scene.surfaces = vec![wall(hidden)];
        let tracer = PathTracer::new(&scene, &Plan::for_scene(&scene, Density::Source));
        let media = &tracer.bands[0].media;
        let orders = Orders::similarly(&scene, DVec3::ZERO, 84.0, &Aspect::of(&scene, eye));
        let similar = orders.similar().unwrap();
        let (basis, seen) = (Basis::view(&scene, eye, orders.part()), |_: Box3| true);
        let request = |orders| Request {
            scene: &scene,
            media,
            basis,
            orders,
            origin: DVec3::ZERO,
            seen: &seen,
            first: 0,
            seed: 0,
            voxels: 1 << 20,
            coarser: 1.0,
        };
        let space = Space::new(&request(Orders::own(&scene)));
        let found = behind(&space, (media, similar), &tracer.surfaces, eye, |_, _| 1.0);
        let at = |p: Vec3| {
            let (mut light, mut whole) = (0.0, 0.0);
            space.frame.around(p, |voxel, weight| (light, whole) = (light + weight * found[voxel], whole + weight));
            f64::from(light / whole)
        };
        let ratio = similar.ratio(0);
        let end = hidden.min(1.0);
        for y in [-0.9f32, -0.3, 0.3] {
            let expected = -(-ratio * sigma * (end - f64::from(y))).exp_m1();
            let off = at(Vec3::Y * y) / expected - 1.0;
            println!("wall at {hidden}, from {y}: {expected:.3}, off by {:+.2} %", 100.0 * off);
            assert!(off.abs() < 0.02, "{off}");
        }
        // Along a ray through the middle, from the camera's side, by the midpoint rule.
        let (steps, length) = (2000, (1.0 + end) / 2000.0);
        let of_step = |i: usize| {
            let y = -1.0 + (i as f64 + 0.5) * length;
            let sent = ratio + (1.0 - ratio) * at(Vec3::Y * y as f32);
            sigma * length * (-sigma * (y + 1.0)).exp() * sent
        };
        let (sum, expected) = ((0..steps).map(of_step).sum::<f64>(), -(-ratio * sigma * (1.0 + end)).exp_m1());
        println!("wall at {hidden}, the whole: {sum:.4}, expected {expected:.4}");
        assert!((sum / expected - 1.0).abs() < 0.01);
    }
}
