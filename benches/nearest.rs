//! What the n nearest photons cost: kiddo's own `nearest_n`, and [`Nearest`], at unrelated points and along rays.
//!
//! `cargo bench --bench nearest`. Compare within one run only.
#![allow(missing_docs, clippy::unwrap_used)]

use cloudvdb::photon::{Nearest, Neighbourhood, Photon, PhotonMap};
use cloudvdb::rng::{Rng, Stage};
use cloudvdb::sampling::unit_ball;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::hint::black_box;
use std::num::NonZero;

const QUERIES: usize = 256;

fn photons(n: usize) -> Vec<Photon> {
    let mut rng = Rng::new(1, Stage::Gather, 0);
    let mut map = PhotonMap::new(DVec3::ZERO, n as u64);
    let point = |rng: &mut Rng| unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3();
    let all: Vec<Photon> = (0..n).map(|i| Photon::new(point(&mut rng), Vec3::Z, 1.0, 0, i)).collect();
    map.extend(&all);
    map.along_curve(DVec3::ZERO)
}

fn nearest(c: &mut Criterion) {
    let photons = photons(1_000_000);
    let positions: Vec<[f32; 3]> = photons.iter().map(|p| p.position).collect();
    let kiddo: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&positions).unwrap();
    let mut rng = Rng::new(2, Stage::Gather, 0);
    let apart: Vec<Vec3> = (0..QUERIES).map(|_| unit_ball([rng.uniform(), rng.uniform(), rng.uniform()]).as_vec3()).collect();
    // Rays through the middle, by steps of a fiftieth of the radius.
    let along: Vec<Vec3> = (0..QUERIES).map(|i| Vec3::new(-0.98 + (i % 98) as f32 * 0.02, 0.0, (i / 98) as f32 * 0.03)).collect();
    for n in [100u64, 1000, 5000] {
        let mut group = c.benchmark_group(format!("{n} nearest of a million"));
        group.sample_size(20).throughput(Throughput::Elements(QUERIES as u64 * n));
        group.bench_function(BenchmarkId::new("kiddo", "apart"), |b| {
            b.iter(|| {
                let n = NonZero::new(n as usize).unwrap();
                let query = |p: &Vec3| kiddo.query(&p.to_array()).nearest_n::<SquaredEuclidean<f32>>(n).unsorted().execute().len();
                black_box(apart.iter().map(query).sum::<usize>())
            })
        });
        let own = Nearest::new(photons.clone(), n, None);
        for (name, points) in [("apart", &apart), ("along rays", &along)] {
            group.bench_function(BenchmarkId::new("ours", name), |b| {
                b.iter(|| {
                    let mut hood = Neighbourhood::default();
                    black_box(points.iter().map(|&p| own.find(p, &mut hood).unwrap()).sum::<f32>())
                })
            });
        }
        group.finish();
    }
}

criterion_group!(benches, nearest);
criterion_main!(benches);
