//! What effects cost: on, off, and in a scene that never had them.
//!
//! `cargo bench --bench effects`. Processor time of a picture of the demo's cumulus, medians of some runs in turn, over that with every
//! effect on. An effect that is off costs what it costs not to have it (`tests/light/plan.rs` counts: the same picture, bit by bit).
#![allow(missing_docs, clippy::unwrap_used)]

use cloudvdb::import::{ImportOptions, load};
use cloudvdb::integrate::photon::PhotonSettings;
use cloudvdb::integrate::{Integrator, RenderSettings, render};
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::Silent;
use cloudvdb::scene::air::AirLayer;
use cloudvdb::scene::effect::EffectName;
use cloudvdb::scene::{Air, Camera, Medium, Scene, Wishes};
use glam::DVec3;
use std::path::Path;
use std::time::Instant;

const RUNS: usize = 3;

/// The cumulus with every effect: air, a sky, colours, absorption, a wide sun.
fn scene() -> Scene {
    let mut scene = load(Path::new("scenes/cumulus.gltf"), &ImportOptions::default(), &Silent).unwrap().scene;
    let size = scene.region_bounds().size().length();
    for region in &mut scene.regions {
        let m = region.medium;
        region.medium = Medium { sigma_s: [0.99 * m.sigma_s[0], m.sigma_s[1], m.sigma_s[2]], sigma_a: m.sigma_s.map(|s| 0.01 * s), ..m };
    }
    let haze = AirLayer { sigma_s: [0.05 / size, 0.1 / size, 0.2 / size], ..AirLayer::aerosol(scene.region_bounds().min.z, None) };
    (scene.air, scene.sky, scene.sun.angular_diameter) = (Air::new([haze]), [0.05, 0.1, 0.2], 0.1);
    scene
}

/// A scene that never had an effect; `None` where the scene itself says nothing of it.
fn without(scene: &Scene, name: EffectName) -> Option<Scene> {
    let mut other = scene.clone();
    let media = other.regions.iter_mut().map(|region| &mut region.medium);
    match name {
        EffectName::Absorption => {
            media.for_each(|m| *m = Medium { sigma_s: std::array::from_fn(|c| m.sigma_s[c] + m.sigma_a[c]), sigma_a: [0.0; 3], ..*m });
        }
        EffectName::Anisotropy => media.for_each(|m| m.g = 0.0),
        EffectName::SunDisc => other.sun.angular_diameter = 0.0,
        EffectName::Sky => other.sky = [0.0; 3],
        EffectName::Air => other.air = Air::default(),
        _ => return None,
    }
    Some(other)
}

/// Seconds that the processors have given to this process's threads; where the system does not say, by the clock.
fn seconds(work: impl FnOnce()) -> f64 {
    let one = |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("schedstat")).ok()?.split(' ').next()?.parse::<f64>().ok();
    let spent = || Some(std::fs::read_dir("/proc/self/task").ok()?.flatten().filter_map(one).sum::<f64>() * 1e-9);
    let (clock, before) = (Instant::now(), spent());
    work();
    before.zip(spent()).map_or(clock.elapsed().as_secs_f64(), |(before, after)| after - before)
}

fn picture(scene: &Scene, wishes: Wishes, integrator: Integrator) -> f64 {
    let scene = Scene { wishes, ..scene.clone() };
    let (bounds, plan) = (scene.region_bounds(), Plan::for_scene(&scene, Density::Source));
    let from = bounds.centre() + bounds.size().length() * DVec3::new(0.3, -1.5, 0.3);
    let camera = Camera::look_at(from, bounds.centre(), 0.7).unwrap();
    let photon = PhotonSettings { photons: 20_000, ..PhotonSettings::default() };
    let settings = RenderSettings { integrator, width: 48, height: 36, spp: 16, seed: 1, photon };
    seconds(|| drop(render(&scene, &plan, &camera, &settings, None, &Silent).unwrap()))
}

fn main() {
    let scene = scene();
    let all = EffectName::SWITCHES.iter().fold(Wishes { tolerance: 0.0, ..Wishes::default() }, |w, &(_, name)| w.with(name, Some(true)));
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    for integrator in [Integrator::Path, Integrator::Grid] {
        let full = median((0..RUNS).map(|_| picture(&scene, all, integrator)).collect());
        println!("{integrator:?}, every effect: {full:.3} s");
        for &(flag, name) in EffectName::SWITCHES.iter() {
            let never = without(&scene, name);
            let (mut off, mut none) = (Vec::new(), Vec::new());
            for _ in 0..RUNS {
                off.push(picture(&scene, all.with(name, Some(false)), integrator) / full);
                none.extend(never.as_ref().map(|never| picture(never, all, integrator) / full));
            }
            let none = if none.is_empty() { String::new() } else { format!(", never there {:.2}", median(none)) };
            println!("  {flag:20} off {:.2}{none}", median(off));
        }
    }
}
