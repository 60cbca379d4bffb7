//! The rule of each effect: whether there is any of it in a scene, the figure that decides, and a bound on what leaving it out changes.

use super::{Density, Finding};
use crate::bvh::{Box3, Bvh};
use crate::geom::Bounds;
use crate::scene::phase::henyey_greenstein;
use crate::scene::{Region, Scene, Shape};
use glam::DVec3;
use std::f64::consts::PI;

/// More orders than this are as good as all.
const MOST_ORDERS: u32 = 64;
/// From this optical depth on no bound on multiple scattering is worth having.
const THICK: f64 = 3.0;
/// What stands for the optical depth along a layer without end: a figure that files can hold.
const ENDLESS: f64 = 1e6;

/// An upper bound of the optical depth along any straight line through a region, largest channel.
fn deepest(region: &Region) -> f64 {
    let sigma = region.medium.sigma_t_rgb().into_iter().fold(region.medium.sigma_t(), f64::max);
    let largest = match &region.shape {
        Shape::Grid(grid) => grid.bricks.values.iter().copied().fold(0.0, f32::max).into(),
        _ => 1.0,
    };
    if sigma == 0.0 {
        0.0
    } else if region.shape.is_endless() {
        ENDLESS
    } else {
        sigma * largest * region.shape.longest()
    }
}

/// By how much light that has scattered `order` times may be stronger, in one direction, than light of as much power that has scattered
/// once: convolved with itself, the Henyey-Greenstein function of g is that of a power of g.
fn flatter(g: (f64, f64), order: i32) -> f64 {
    let cosines = (0..=64).map(|i| f64::from(i) / 32.0);
    let steps = |low: f64, high: f64| (0..=8).map(move |i| low + (high - low) * f64::from(i) / 8.0);
    // A product of `order` mean cosines out of a range.
    let (small, large) = (g.0.abs().min(g.1.abs()), g.0.abs().max(g.1.abs()));
    let sign = if g.0 < 0.0 { -1.0 } else { 1.0 };
    let products = || steps(sign * small.powi(order), large.powi(order));
    cosines
        .map(|x| {
            let once = steps(g.0, g.1).map(|g| henyey_greenstein(g, x)).fold(f64::INFINITY, f64::min);
            products().map(|g| henyey_greenstein(g, x)).fold(0.0, f64::max) / once
        })
        .fold(1.0, f64::max)
}

/// Light of all orders from the second on, over that of the first: bounds, order by order.
struct Orders {
    /// An upper bound of the optical depth along any line.
    tau: f64,
    /// Of the orders 2 to [`MOST_ORDERS`], and of all beyond; none where the sum has no bound worth having.
    terms: Option<(Vec<f64>, f64)>,
}

/// Light of order n + 1 comes from light of order n that collides once more, of which there is a share of at most 1 - e^-tau; the first
/// order is at least e^-tau of what the sun's is without attenuation, unless a surface hides the sun. Of lamps and flames, which may be anywhere, no
/// order has such a bound.
fn orders(scene: &Scene) -> Orders {
    let tau: f64 = scene.regions.iter().map(deepest).sum();
    if tau >= THICK || scene.regions.is_empty() || may_hide_the_sun(scene) || !scene.lamps.is_empty() || !scene.flames.is_empty() {
        return Orders { tau, terms: None };
    }
    let collides = -(-tau).exp_m1();
    let range = scene.regions.iter().fold((1.0f64, -1.0f64), |(low, high), r| (low.min(r.medium.g), high.max(r.medium.g)));
    // What is never flatter than even; light of sky and surfaces comes from where the sun does not.
    let even = henyey_greenstein(0.0, 1.0) / henyey_greenstein(range.1.abs().max(range.0.abs()), 2.0);
    let sun = scene.sun.irradiance.into_iter().fold(f64::INFINITY, f64::min);
    let sky = scene.sky.into_iter().fold(0.0, f64::max);
    let others = match (sky > 0.0, sun > 0.0) {
        (true, true) => even * (4.0 * PI * sky / sun + reflected(scene)),
        (false, true) => even * reflected(scene),
        // The sky alone is even.
        (true, false) if scene.surfaces.is_empty() && scene.dome.is_none() => 0.0,
        _ => return Orders { tau, terms: None },
    };
    let strength = tau.exp() * (1.0 + others);
    let term = |order: u32| strength * collides.powi(order as i32 - 1) * flatter(range, order as i32);
    // Beyond, terms fall by the same factor at least.
    let rest = strength * collides.powi(MOST_ORDERS as i32) / (1.0 - collides) * even;
    Orders { tau, terms: Some(((2..=MOST_ORDERS).map(term).collect(), rest)) }
}

/// Whether a surface may stand between the sun and a region: one that lies wholly below all regions does not, where light comes from above.
fn may_hide_the_sun(scene: &Scene) -> bool {
    let lowest = scene.region_bounds().min.z;
    let steep = scene.sun.direction.z < -(0.5 * scene.sun.angular_diameter).sin();
    scene.surfaces.iter().any(|s| !steep || s.mesh.bounds().max.z > lowest)
}

/// Orders after the last that matters are not followed.
pub(super) fn multiple_scattering(scene: &Scene, tolerance: f64) -> (Finding, Option<u32>) {
    let Orders { tau, terms } = orders(scene);
    let scatters = scene.regions.iter().any(|r| r.medium.albedo() > 0.0);
    let (mut bound, mut last) = (1.0, None);
    if let Some((terms, rest)) = terms.filter(|_| scatters) {
        bound = rest;
        for (order, term) in (2..=MOST_ORDERS).rev().zip(terms.iter().rev()) {
            bound += term;
            if bound <= tolerance {
                last = Some(order - 1);
            }
        }
    }
    let bound = bound.min(1.0);
    let reason = match last {
        Some(n) if n > 1 => format!("along any line optical depth is at most {tau:.3}: orders after the {n}. add less than the tolerance"),
        _ if bound < 1.0 => {
            format!("along any line optical depth is at most {tau:.3}: all orders from the second on add at most {:.2} %", 100.0 * bound)
        }
        _ => format!("along some line optical depth may be {tau:.3}: light scatters many times, or surfaces may hide the first"),
    };
    (Finding { there: scatters && tau > 0.0, figure: tau, bound, reason }, last)
}

/// Of light that has scattered n times, absorption takes at most n times what it takes at one collision. In thick regions nothing bounds
/// how often the light of their dark side has scattered.
pub(super) fn absorption(scene: &Scene) -> Finding {
    let absorbed = most(scene, |r| 1.0 - r.medium.albedo_rgb().into_iter().fold(r.medium.albedo(), f64::min));
    let collisions = orders(scene).terms.map_or(f64::INFINITY, |(terms, rest)| {
        1.0 + (2..=MOST_ORDERS).zip(&terms).map(|(order, term)| f64::from(order) * term).sum::<f64>() + f64::from(2 * MOST_ORDERS) * rest
    });
    let reason = if absorbed > 0.0 {
        format!("the darkest medium absorbs {:.4} % at each collision", 100.0 * absorbed)
    } else {
        "every albedo is 1: no photon needs a roulette".into()
    };
    Finding { there: absorbed > 0.0, figure: absorbed, bound: (collisions * absorbed).min(1.0), reason }
}

/// The phase function differs from an even one by at most what its peak is above it.
pub(super) fn anisotropy(scene: &Scene) -> Finding {
    let g = most(scene, |r| r.medium.g.abs());
    let reason = if g > 0.0 { format!("mean cosine up to {g:.3}") } else { "every medium scatters alike in all directions".into() };
    Finding { there: g > 0.0, figure: g, bound: ((1.0 + g) / (1.0 - g).powi(2) - 1.0).min(1.0), reason }
}

pub(super) fn heterogeneity(scene: &Scene) -> Finding {
    let grids = scene.regions.iter().filter(|r| matches!(r.shape, Shape::Grid(_))).count();
    let reason = match grids {
        0 => "every region is even: flights in closed form, no tracking".into(),
        n => format!("{n} of {} regions are voxel grids: null collisions", scene.regions.len()),
    };
    Finding { there: grids > 0, figure: grids as f64, bound: 1.0, reason }
}

pub(super) fn overlap(scene: &Scene) -> Finding {
    let overlapping = overlapping(&scene.regions);
    let reason = if overlapping > 0 {
        format!("{overlapping} of {} regions may overlap another: extinction adds", scene.regions.len())
    } else {
        "no two regions' bounds meet".into()
    };
    Finding { there: overlapping > 0, figure: overlapping as f64, bound: 1.0, reason }
}

/// Shadows blur by the disc's angle over the scene.
pub(super) fn sun_disc(scene: &Scene) -> Finding {
    let smallest = scene.regions.iter().map(|r| r.shape.smallest_half_extent()).fold(f64::INFINITY, f64::min);
    let all = scene.surfaces.iter().fold(scene.region_bounds(), |b, s| b.union(s.mesh.bounds()));
    let blur = scene.sun.angular_diameter * all.size().length() / smallest;
    let reason =
        format!("{:.4} rad blurs shadows by up to {:.3} % of the smallest region's half extent", scene.sun.angular_diameter, 100.0 * blur);
    let there = scene.sun.angular_diameter > 0.0 && scene.sun.shines() && blur.is_finite();
    Finding { there, figure: blur, bound: blur.min(1.0), reason }
}

/// What of the light that falls on the regions is the sky's; it is also seen itself.
pub(super) fn sky(scene: &Scene) -> Finding {
    let light = scene.sky.into_iter().fold(0.0, f64::max);
    let sun = scene.sun.irradiance.into_iter().fold(f64::INFINITY, f64::min);
    let share = if light > 0.0 { 4.0 * PI * light / (4.0 * PI * light + sun) } else { 0.0 };
    let reason = match share {
        0.0 => "the sky is black".into(),
        share => format!("{:.3} % of the light is the sky's, which is seen too", 100.0 * share),
    };
    Finding { there: light > 0.0, figure: share, bound: 1.0, reason }
}

pub(super) fn surface_shadow(scene: &Scene) -> Finding {
    let reason = match scene.surfaces.len() {
        0 => "there is no surface".into(),
        n => format!("{n} surfaces can stand in the light's way"),
    };
    Finding { there: !scene.surfaces.is_empty(), figure: scene.surfaces.len() as f64, bound: 1.0, reason }
}

/// Regions cast shadows on what lies behind them, seen from the sun; as balls around them, widened by the sun's disc.
pub(super) fn cloud_shadow(scene: &Scene) -> Finding {
    let tan = (0.5 * scene.sun.angular_diameter).tan();
    let light = scene.sun.direction;
    let ball = |b: Bounds| (b.centre(), 0.5 * b.size().length());
    let shaded = |surface: Bounds, region: &Region| {
        if region.shape.is_endless() {
            return true;
        }
        let ((s, wide), (r, half)) = (ball(surface), ball(region.shape.bounds()));
        let along = (s - r).dot(light);
        let aside = ((s - r) - along * light).length();
        along + wide + half > 0.0 && aside <= wide + half + tan.abs() * (along + wide + half)
    };
    let under = |s: &crate::scene::Surface| scene.regions.iter().any(|region| shaded(s.mesh.bounds(), region));
    let count = if scene.sun.shines() { scene.surfaces.iter().filter(|s| under(s)).count() } else { 0 };
    let tau: f64 = scene.regions.iter().map(deepest).sum();
    let reason = match (scene.surfaces.len(), count) {
        (0, _) => "there is no surface".into(),
        (_, 0) => "no region stands between the sun and a surface".into(),
        (_, n) => format!("regions of optical depth up to {tau:.3} may shade {n} surfaces"),
    };
    Finding { there: count > 0 && tau > 0.0, figure: tau, bound: -(-tau).exp_m1(), reason }
}

/// A white surface under the sun sends 2 E cos over the half of directions that it fills; it fills no more than it is seen to.
fn reflected(scene: &Scene) -> f64 {
    let regions = scene.region_bounds();
    let (centre, half) = (regions.centre(), 0.5 * regions.size().length());
    let seen = |s: &crate::scene::Surface| {
        let b = s.mesh.bounds();
        let (away, wide) = ((b.centre() - centre).length() - half, 0.5 * b.size().length());
        // The share of all directions within the cone to a ball.
        if away > wide { 0.5 * (1.0 - (1.0 - (wide / away).powi(2)).sqrt()) } else { 0.5 }
    };
    scene.surfaces.iter().map(|s| 4.0 * seen(s) * s.albedo.into_iter().fold(0.0, f64::max)).sum()
}

/// Light of n scatterings that meets a point is at most the n-th power of the chance of a collision along the deepest line, of all light
/// there is; a surface gets of it at most that, and of the sun's own the cosine and what regions let pass.
pub(super) fn cloud_light(scene: &Scene) -> Finding {
    let brightest = scene.surfaces.iter().flat_map(|s| s.albedo).fold(0.0, f64::max);
    let scatters = scene.regions.iter().any(|r| r.medium.albedo() > 0.0);
    let tau: f64 = scene.regions.iter().map(deepest).sum();
    let sun = scene.sun.irradiance.into_iter().fold(f64::INFINITY, f64::min);
    let even = scene.lamps.is_empty() && scene.flames.is_empty() && scene.dome.is_none() && scene.air.is_empty();
    let bound = match sunlit(scene).filter(|_| even && tau < THICK && sun > 0.0) {
        Some(cos) => {
            let all = 1.0 + 4.0 * PI * scene.sky.into_iter().fold(0.0, f64::max) / sun + reflected(scene);
            (tau.exp_m1() * all * tau.exp() / cos).min(1.0)
        }
        None => 1.0,
    };
    let there = brightest > 0.0 && scatters && tau > 0.0;
    let reason = match (scene.surfaces.len(), there) {
        (0, _) => "there is no surface".into(),
        _ if brightest <= 0.0 => "every surface is black".into(),
        (_, false) => "no region scatters".into(),
        _ => format!("regions of optical depth up to {tau:.3} send surfaces at most {:.2} % of what the sun does", 100.0 * bound),
    };
    Finding { there, figure: tau, bound, reason }
}

/// The cosine at which sunlight meets a flat surface that is alone, has all regions before its lit side, and so hides nothing from itself.
fn sunlit(scene: &Scene) -> Option<f64> {
    let [surface] = &scene.surfaces[..] else { return None };
    let corners = |t: &[u32; 3]| t.map(|i| surface.mesh.vertices[i as usize]);
    let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).normalize_or_zero();
    let mut triangles = surface.mesh.triangles.iter().map(corners);
    let first = triangles.next()?;
    let up = normal(first) * -normal(first).dot(scene.sun.direction).signum();
    let cos = -up.dot(scene.sun.direction);
    let (size, height) = (surface.mesh.bounds().size().length(), up.dot(first[0]));
    let flat = triangles.all(|t| t.iter().all(|p| (up.dot(*p) - height).abs() <= 1e-6 * size));
    let before = |r: &Region| {
        let b = r.shape.bounds();
        up.dot(b.centre()) - 0.5 * up.abs().dot(b.size()) >= height
    };
    // The whole disc is above its horizon.
    let risen = cos > (0.5 * scene.sun.angular_diameter).sin();
    (flat && risen && scene.regions.iter().all(before)).then_some(cos)
}

pub(super) fn surface_bounce(scene: &Scene) -> Finding {
    let albedo = scene.surfaces.iter().flat_map(|s| s.albedo).fold(0.0, f64::max);
    let near = !scene.lamps.is_empty() || !scene.flames.is_empty();
    let bound = if near { 1.0 } else { reflected(scene) };
    let reason = if albedo > 0.0 && near {
        format!("surfaces reflect up to {:.1} % of the light of lamps and flames, which may be near", 100.0 * albedo)
    } else if albedo > 0.0 && !scene.regions.is_empty() {
        format!("surfaces reflect up to {:.1} %, and send regions at most {:.2} % of what the sun does", 100.0 * albedo, 100.0 * bound)
    } else if scene.surfaces.is_empty() {
        "there is no surface".into()
    } else if albedo > 0.0 {
        "there is no region".into()
    } else {
        "every surface is black".into()
    };
    Finding { there: albedo > 0.0, figure: bound, bound: if scene.regions.is_empty() { 0.0 } else { bound.min(1.0) }, reason }
}

/// Along the horizon layers have no end: what they take and give is bounded by nothing less than all.
pub(super) fn air(scene: &Scene) -> Finding {
    let depth = scene.air.depth().into_iter().fold(0.0, f64::max);
    let reason = match scene.air.layers().count() {
        0 => "there is no air".into(),
        n => format!("{n} layers of air, of optical depth {depth:.3} straight up"),
    };
    Finding { there: depth > 0.0, figure: depth, bound: 1.0, reason }
}

/// Flames are seen themselves, and how near they are to what they light nobody bounds.
pub(super) fn emission(scene: &Scene) -> Finding {
    let power: f64 = scene.flames.iter().map(crate::scene::Flame::power).sum();
    let reason = match scene.flames.len() {
        0 => "nothing shines by itself".into(),
        n => format!("{n} flames send out {power:.4} W, and are seen"),
    };
    Finding { there: power > 0.0, figure: power, bound: 1.0, reason }
}

/// The largest spread of a colour, over itself; of a medium, as often as it counts.
pub(super) fn colour(scene: &Scene) -> Finding {
    let spread = |rgb: [f64; 3]| {
        let (low, high) = rgb.into_iter().fold((f64::INFINITY, 0.0f64), |(l, h), c| (l.min(c), h.max(c)));
        if high > 0.0 { (high - low) / high } else { 0.0 }
    };
    let tau: f64 = scene.regions.iter().map(deepest).sum();
    let media = most(scene, |r| spread(r.medium.sigma_s).max(spread(r.medium.sigma_t_rgb())));
    let air = scene.air.layers().map(|l| spread(l.sigma_s).max(spread(l.sigma_a))).fold(0.0, f64::max);
    let surfaces = scene.surfaces.iter().map(|s| spread(s.albedo)).fold(0.0, f64::max);
    let near = scene.lamps.iter().map(|lamp| lamp.intensity).chain(scene.flames.iter().map(|flame| flame.emission));
    let near = near.map(spread).fold(0.0, f64::max);
    let lights = spread(scene.sun.irradiance).max(spread(scene.sky)).max(near);
    let lights = if scene.dome.as_ref().is_some_and(|dome| !dome.has_one_colour()) { 1.0 } else { lights };
    let figure = media.max(air).max(surfaces).max(lights);
    let reason = if figure > 0.0 {
        format!("colours differ by up to {:.2} % between channels", 100.0 * figure)
    } else {
        "sun, media and surfaces are grey: one number says all".into()
    };
    // What absorption differs by at each collision may differ without bound after many. What scattering does not: where there are more
    // collisions there is less way between them. Of light that has scattered n times along an optical depth t, the share n - t is what
    // it changes by, in the mean; that is t at most for light that went straight, and about 1 for light that wanders.
    let absorbs = scene.regions.iter().any(|r| spread(r.medium.sigma_a) > 0.0);
    let often = match media {
        0.0 => 0.0,
        _ if tau < THICK => 3.0 * (1.0 + tau) * tau.exp() * media,
        _ if absorbs => 1.0,
        _ => 3.0 * (1.0 + 2.0 * tau) * media,
    };
    Finding { there: figure > 0.0, figure, bound: (often + air + 3.0 * surfaces + lights).min(1.0), reason }
}

pub(super) fn duality(scene: &Scene, density: Density) -> Finding {
    let reason = match density {
        Density::Duality => format!("{} regions of the layout become photon-cloud regions", scene.regions.len()),
        Density::Source => "this looks at the layout as it is (--density source): no region is made, and no photon traced for it".into(),
    };
    Finding { there: density == Density::Duality, figure: scene.regions.len() as f64, bound: 1.0, reason }
}

fn most(scene: &Scene, of: impl Fn(&Region) -> f64) -> f64 {
    scene.regions.iter().map(of).fold(0.0, f64::max)
}

/// How many regions' bounds meet another's.
fn overlapping(regions: &[Region]) -> usize {
    if regions.iter().any(|r| r.shape.is_endless()) && regions.len() > 1 {
        return regions.len();
    }
    let origin = regions.first().map_or(DVec3::ZERO, |r| r.shape.centre());
    let boxes: Vec<Box3> = regions.iter().map(|r| Box3::around(r.shape.bounds(), origin)).collect();
    let bvh = Bvh::new(&boxes.iter().copied().map(Some).collect::<Vec<_>>(), 2);
    (0..boxes.len())
        .filter(|&i| {
            let mut met = false;
            bvh.overlapping(&boxes[i], |other| {
                met |= other as usize != i && boxes[other as usize].meets(&boxes[i]);
                met
            });
            met
        })
        .count()
}
