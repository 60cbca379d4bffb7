//! Traps 5, 6 and 12: what pass 1 does with power.

use super::*;
use crate::integrate::flux::{Flux, flux};
use crate::photon::trace::Fate;
use crate::photon::{Model, Shot, Tracer};
use crate::plan::{Density, Plan};
use crate::progress::Silent;
use glam::DVec2;

fn shoot(scene: &Scene, model: Model, photons: u64, seed: u64) -> Shot {
    Tracer::new(scene, &Plan::for_scene(scene, Density::Duality), model).fill(photons, seed, &Silent).unwrap()
}

fn layer(optical_depth: f64, albedo: f64, g: f64) -> Scene {
    let slab = Shape::Slab { centre: DVec3::ZERO, half_height: 0.5 * optical_depth, half_extent: DVec2::ONE };
    overhead(slab, Medium::with_albedo(1.0, albedo, g))
}

#[test]
fn trap_05_each_flight_loses_half_its_power_again() {
    let mut rng = random(5);
    agrees("e^-tau", mean((0..1_000_000).map(|_| (-rng.optical_depth()).exp())), 0.5);
    // Light that hardly turns in a layer that it hardly leaves: of 1 W a half is lost on each flight, and 0.8 of the rest goes on.
    let shot = shoot(&layer(200.0, 0.8, 0.999), Model::Hura2006, 200_000, 1);
    agrees("lost", shot.energy.ratio(Fate::Attenuated as usize), 5.0 / 6.0);
    agrees("absorbed", shot.energy.ratio(Fate::AbsorbedMedium as usize), 1.0 / 6.0);
    // The thesis's medium.
    for (model, lost, absorbed, escaped) in [(Model::Hura2006, 0.780, 0.161, 0.058), (Model::Physical, 0.0, 0.724, 0.276)] {
        let shot = shoot(&thesis_sphere(), model, 400_000, 2);
        let share = |fate: Fate, figure: f64| printed(&format!("{model:?} {fate:?}"), shot.energy.ratio(fate as usize), figure, 1e-3);
        share(Fate::Attenuated, lost);
        share(Fate::AbsorbedMedium, absorbed);
        share(Fate::Escaped, escaped);
    }
}

#[test]
fn trap_06_absorbed_photons_are_stored_too() {
    let scene = thesis_sphere();
    let flux = flux(&scene, &Plan::for_scene(&scene, Density::Source), 200_000, 3, &Silent).unwrap();
    // Scatterings from the second on, per photon that meets the sphere: what the map stands for.
    let truth = flux.mean_scatterings.value - 0.8 * (1.0 - clear(12.0));
    let per_photon = |values: Vec<f64>| {
        let e = mean(values);
        let value = e.value / truth;
        Estimate { value, se: (e.se / truth).hypot(value * flux.mean_scatterings.se / truth) }
    };
    let area = std::f64::consts::PI * 36.0;
    let power = |shot: &Shot| shot.map.photons().iter().map(|p| f64::from(p.power)).sum::<f64>() / area;
    let shots = |model| (0..16).map(|seed| shoot(&scene, model, 15_000, seed)).collect::<Vec<Shot>>();
    let (physical, letter) = (shots(Model::Physical), shots(Model::Hura2006));
    let met = physical[0].energy.denominator() / physical[0].traced as f64 / area;
    agrees("physical", per_photon(physical.iter().map(power).collect()), 1.0);
    // Full power for each photon, scattered or absorbed, of the same map.
    let full = per_photon(physical.iter().map(|s| met * s.map.len() as f64 / s.emitted as f64).collect());
    agrees("full power", full, 1.25);
    printed("with eq. 25", per_photon(letter.iter().map(power).collect()), 0.148, 1e-3);
}

#[test]
fn trap_12_the_thesis_s_medium_is_no_cloud() {
    let run = |albedo, g, photons| -> Flux {
        let scene = layer(100.0, albedo, g);
        flux(&scene, &Plan::for_scene(&scene, Density::Source), photons, 12, &Silent).unwrap()
    };
    let (thesis, cumulus) = (run(0.8, 0.9, 100_000), run(0.9999, 0.86, 10_000));
    printed("thesis up", thesis.up, 0.029, 1e-3);
    printed("cumulus up", cumulus.up, 0.877, 1e-3);
    printed("thesis scatterings", thesis.mean_scatterings, 3.88, 0.01);
    printed("cumulus scatterings", cumulus.mean_scatterings, 237.0, 1.0);
    // Of 1 / (1 - albedo) collisions that end in absorption all but the last scatter.
    for (flux, per_absorption) in [(thesis, 4.0), (cumulus, 9999.0)] {
        let (n, a) = (flux.mean_scatterings, flux.absorbed_medium);
        agrees("scatterings per absorption", Estimate { value: n.value / per_absorption, se: n.se / per_absorption + a.se }, a.value);
    }
}
