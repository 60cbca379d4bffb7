//! What the main job reaches: scattering events a second, the duality of 10 million photons, the import of 10,000 spheres.
//!
//! `cargo bench --bench main_job`. Times on shared machines swing by half: compare within one run only.
#![allow(missing_docs, clippy::unwrap_used)]

use cloudvdb::import::{ImportOptions, load};
use cloudvdb::photon::{Model, Shot, Tracer};
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::Silent;
use cloudvdb::regions::{Duality, synthesise};
use cloudvdb::scene::{Medium, Region, Scene, Shape, Surface};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use std::path::Path;

/// The demo's cumulus of 21 spheres; without its ground, `denser` times as dense (1: optical depth 20 across the cloud).
fn cumulus(denser: f64) -> Scene {
    let layout = load(Path::new("scenes/cumulus.gltf"), &ImportOptions::default(), &Silent).unwrap();
    let mut scene = layout.scene;
    scene.surfaces = Vec::<Surface>::new();
    for region in &mut scene.regions {
        let m = region.medium;
        region.medium = Medium { sigma_s: m.sigma_s.map(|s| s * denser), sigma_a: m.sigma_a.map(|s| s * denser), g: m.g };
    }
    scene
}

fn fill(scene: &Scene, photons: u64) -> Shot {
    Tracer::new(scene, &Plan::for_scene(scene, Density::Duality), Model::Physical).fill(photons, 1, &Silent).unwrap()
}

fn scattering(c: &mut Criterion) {
    let mut group = c.benchmark_group("scattering events");
    group.sample_size(10);
    // Optical depth 20 across the cloud, 20 across each sphere, and one sphere alone as the upper bound.
    let alone = Scene {
        regions: vec![Region {
            name: "ball".into(),
            shape: Shape::sphere(DVec3::ZERO, 1.0),
            medium: Medium::with_albedo(10.0, 0.9999, 0.86),
            photons: None,
        }],
        ..Scene::default()
    };
    for (name, scene) in
        [("cumulus, 20 across the cloud", cumulus(1.0)), ("cumulus, 20 across its spheres", cumulus(5.0)), ("one sphere, 20 across", alone)]
    {
        group.throughput(Throughput::Elements(fill(&scene, 1_000_000).collisions));
        group.bench_function(name, |b| b.iter(|| fill(&scene, 1_000_000)));
    }
    group.finish();
}

fn duality(c: &mut Criterion) {
    let scene = cumulus(5.0);
    let mut group = c.benchmark_group("10 million photons");
    group.sample_size(10);
    group.bench_function("stored", |b| b.iter(|| fill(&scene, 10_000_000)));
    let shot = fill(&scene, 10_000_000);
    group.bench_function("regions out of them", |b| {
        b.iter(|| {
            let made = synthesise(&scene, &shot.map, &Duality::default(), &Silent).unwrap();
            assert!(made.regions.len() >= 256);
        });
    });
    group.finish();
}

fn import(c: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let (path, copy) = (folder.path().join("one.glb"), folder.path().join("many.glb"));
    let ball = |i: u32| Region {
        name: format!("Ball.{i}"),
        shape: Shape::sphere(DVec3::new(f64::from(i), 0.0, 0.0), 0.4),
        medium: Medium::grey(1.0, 0.0, 0.8),
        photons: None,
    };
    let many: Vec<Region> = (0..10_000).map(ball).collect();
    cloudvdb::export::glb::write(&path, &Scene::default(), &many[..1]).unwrap();
    cloudvdb::export::glb::write(&copy, &Scene::default(), &many).unwrap();
    let mut group = c.benchmark_group("import");
    group.bench_function("1 sphere", |b| b.iter(|| load(&path, &ImportOptions::default(), &Silent).unwrap()));
    group.bench_function("10,000 spheres", |b| {
        b.iter(|| assert_eq!(load(&copy, &ImportOptions::default(), &Silent).unwrap().scene.regions.len(), 10_000))
    });
    group.finish();
}

criterion_group!(benches, scattering, duality, import);
criterion_main!(benches);
