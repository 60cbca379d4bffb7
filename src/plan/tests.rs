//! Every effect has a scene on either side of its rule; wishes; what is taken out of a scene.

use super::*;
use crate::scene::air::AirLayer;
use crate::scene::{Medium, Mesh, Shape};
use glam::DVec3;

fn scene(second_at: f64) -> Scene {
    let sphere = |x: f64| Region {
        name: "s".into(),
        shape: Shape::sphere(DVec3::new(x, 0.0, 0.0), 1.0),
        medium: Medium::with_albedo(5.0, 1.0, 0.0),
        photons: None,
    };
    Scene { regions: vec![sphere(0.0), sphere(second_at)], ..Scene::default() }
}

fn ground(z: f64, albedo: f64) -> Surface {
    let corner = |x: f64, y: f64| DVec3::new(x, y, z);
    let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)];
    Surface { name: "ground".into(), mesh: Mesh { vertices, triangles: vec![[0, 1, 2]] }, albedo: [albedo; 3] }
}

fn on(scene: &Scene, name: EffectName) -> bool {
    Plan::for_scene(scene, Density::Source).on(name)
}

/// Of sky, variation and overlap: scenes that are alike but for that.
#[test]
fn sky_variation_and_overlap_are_on_where_they_are_there() {
    use EffectName::*;
    let with = |change: &dyn Fn(&mut Scene)| {
        let mut scene = scene(5.0);
        change(&mut scene);
        scene
    };
    // The sky: black; even and faint, which is seen all the same.
    assert!(!on(&with(&|s| s.sky = [0.0; 3]), Sky) && on(&with(&|s| s.sky = [0.0, 0.0, 1e-9]), Sky));
    // One region of voxels, and the same ball without.
    let bricks = crate::scene::BrickGrid { world_from_index: glam::DAffine3::IDENTITY, origins: vec![[0; 3]], values: vec![1.0; 512] };
    let grid = Shape::Grid(Arc::new(crate::scene::VoxelGrid::new(bricks, [0; 3], [7; 3], false)));
    assert!(on(&with(&|s| s.regions[0].shape = grid.clone()), Heterogeneity) && !on(&with(&|_| ()), Heterogeneity));
    // Balls a hair apart, and a hair into each other.
    assert!(!on(&scene(2.001), Overlap) && on(&scene(1.999), Overlap));
}

#[test]
fn each_effect_is_on_only_where_the_scene_calls_for_it() {
    use EffectName::*;
    let bare = scene(5.0);
    for name in
        [Absorption, Anisotropy, Heterogeneity, Overlap, Sky, SurfaceShadow, CloudShadow, CloudLight, SurfaceBounce, Air, Colour, Duality]
    {
        assert!(!on(&bare, name), "{name:?}");
    }
    assert!(on(&bare, MultipleScattering) && on(&bare, SunDisc));
    let mut full = scene(1.5);
    full.regions[0].medium = Medium::with_albedo(5.0, 0.9, 0.8);
    full.regions[1].medium.sigma_s = [4.0, 5.0, 6.0];
    full.surfaces = vec![ground(-3.0, 0.3)];
    full.sky = [0.1; 3];
    full.air = crate::scene::Air::new([AirLayer::molecules(-10.0)]);
    let plan = Plan::for_scene(&full, Density::Duality);
    for name in [Absorption, Anisotropy, Overlap, Sky, SurfaceShadow, CloudShadow, CloudLight, SurfaceBounce, Air, Colour, Duality] {
        assert!(plan.on(name), "{name:?}");
    }
    let change = |of: &dyn Fn(&mut Scene)| {
        let mut other = full.clone();
        of(&mut other);
        other
    };
    // A sun that is a point; a surface that is black, that is upstream, that is too far to be seen from the regions.
    assert!(!on(&change(&|s| s.sun.angular_diameter = 1e-6), SunDisc));
    assert!(!on(&change(&|s| s.surfaces = vec![ground(-3.0, 0.0)]), SurfaceBounce));
    assert!(!on(&change(&|s| s.surfaces = vec![ground(30.0, 0.3)]), CloudShadow));
    assert!(!on(&change(&|s| s.surfaces = vec![ground(-300.0, 0.3)]), SurfaceBounce));
    let thin = change(&|s| s.regions.iter_mut().for_each(|r| r.medium = Medium::with_albedo(1e-5, 1.0, 0.0)));
    assert!(!on(&thin, MultipleScattering));
    assert!(Plan::for_scene(&thin, Density::Duality).on(MultipleScattering), "the duality is made of what scatters twice");
}

/// What thin regions send to the ground is little beside the sun's light there; on its dark side it is all there is, and black ground shows none.
#[test]
fn regions_light_surfaces_where_it_shows() {
    use EffectName::CloudLight;
    let with = |sigma: f64, ground: Vec<Surface>| {
        let mut scene = scene(5.0);
        scene.regions.iter_mut().for_each(|r| r.medium = Medium::with_albedo(sigma, 1.0, 0.0));
        Scene { surfaces: ground, ..scene }
    };
    assert!(on(&with(1e-2, vec![ground(-3.0, 0.3)]), CloudLight) && !on(&with(1e-5, vec![ground(-3.0, 0.3)]), CloudLight));
    assert!(on(&with(1e-5, vec![ground(3.0, 0.3)]), CloudLight) && !on(&with(1.0, vec![ground(3.0, 0.0)]), CloudLight));
    // Two surfaces may shade each other; a lamp may be near a region and far from the ground.
    assert!(on(&with(1e-5, vec![ground(-3.0, 0.3), ground(-4.0, 0.3)]), CloudLight));
}

/// A thick region's colour counts where absorption has one, and where that of scattering is more than little.
#[test]
fn colours_of_thick_regions() {
    let with = |change: &dyn Fn(&mut Medium)| {
        let mut scene = scene(5.0);
        change(&mut scene.regions[0].medium);
        on(&scene, EffectName::Colour)
    };
    assert!(with(&|m| m.sigma_s[0] *= 1.001) && !with(&|m| m.sigma_s[0] *= 1.0 + 1e-6) && with(&|m| m.sigma_a[0] += 1e-6));
}

/// Orders that matter grow with depth, and with what may be left out they fall.
#[test]
fn as_many_orders_as_matter() {
    let orders = |sigma: f64, tolerance: f64| {
        let mut scene = scene(5.0);
        scene.regions.truncate(1);
        scene.regions[0].medium = Medium::with_albedo(sigma, 1.0, 0.7);
        scene.wishes.tolerance = tolerance;
        Plan::for_scene(&scene, Density::Source).orders
    };
    assert_eq!((orders(1e-5, 1e-3), orders(10.0, 1e-3)), (Some(1), None));
    let (few, more, most) = (orders(0.05, 0.05).unwrap(), orders(0.05, 1e-3).unwrap(), orders(0.3, 1e-3).unwrap());
    assert!(1 < few && few < more && more < most, "{few} {more} {most}");
}

#[test]
fn wishes_come_first() {
    let mut scene = scene(5.0);
    scene.regions[0].medium = Medium::with_albedo(5.0, 0.9, 0.8);
    let wishes = scene.wishes.with(EffectName::Anisotropy, Some(false)).with(EffectName::Absorption, Some(false));
    scene.wishes = wishes;
    let plan = Plan::for_scene(&scene, Density::Source);
    let without = plan.scene(&scene);
    assert!(without.regions.iter().all(|r| r.medium.g == 0.0 && r.medium.albedo() == 1.0 && (r.medium.sigma_t() - 5.0).abs() < 1e-12));
    let effect = plan.effects.iter().find(|e| e.name == EffectName::Anisotropy).unwrap();
    assert!(!effect.on && effect.bound == 1.0 && effect.reason.contains("--effect"));
    scene.wishes = wishes.with(EffectName::Anisotropy, None).with(EffectName::Absorption, None);
    assert!(matches!(Plan::for_scene(&scene, Density::Source).scene(&scene), Cow::Borrowed(_)), "nothing is left out, nothing is copied");
}

/// Effects that each change little are left out as long as all of them together do.
#[test]
fn what_is_left_out_together_is_less_than_the_tolerance() {
    let mut scene = scene(5.0);
    scene.regions.iter_mut().for_each(|r| r.medium = Medium::with_albedo(2e-4, 0.9996, 0.0002));
    let off = |tolerance: f64| {
        let mut scene = scene.clone();
        scene.wishes.tolerance = tolerance;
        let plan = Plan::for_scene(&scene, Density::Source);
        let left: Vec<Effect> = plan.effects.into_iter().filter(|e| !e.on && e.bound > 0.0).collect();
        let sum: f64 = left.iter().map(|e| e.bound).sum();
        assert!(sum <= tolerance, "{sum} of {tolerance}");
        (left.len(), left.iter().map(|e| e.bound).fold(0.0, f64::max), sum)
    };
    let (all, largest, sum) = off(0.02);
    assert!(all >= 3 && sum > 1.2 * largest, "{all} {largest} {sum}");
    // Each by itself would be less than this.
    let (fewer, ..) = off(0.5 * (largest + sum));
    assert!(fewer < all);
    // Of a wish nobody asks how large it is.
    scene.wishes = scene.wishes.with(EffectName::Absorption, Some(false));
    assert!(!on(&scene, EffectName::Absorption));
}

/// On the dark side of a thick ball light has scattered so often that a little absorption shows (measured: 0.3 % at optical depth 60 and an
/// albedo of 0.999995); under a roof there is no first order to compare with.
#[test]
fn what_has_no_bound_is_not_left_out() {
    let mut thick = scene(5.0);
    thick.regions.iter_mut().for_each(|r| r.medium = Medium::with_albedo(30.0, 0.999_995, 0.0));
    assert!(on(&thick, EffectName::Absorption));
    let mut thin = scene(5.0);
    thin.regions.iter_mut().for_each(|r| r.medium = Medium::with_albedo(1e-3, 0.999_995, 0.0));
    assert!(!on(&thin, EffectName::Absorption));
    thin.wishes.tolerance = 0.1;
    thin.surfaces = vec![ground(-3.0, 0.0)];
    assert!(!on(&thin, EffectName::MultipleScattering), "the ground is below");
    thin.surfaces = vec![ground(3.0, 0.0)];
    assert!(on(&thin, EffectName::MultipleScattering), "a roof may hide the sun");
}
