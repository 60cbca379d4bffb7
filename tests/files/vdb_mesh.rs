//! Depths under a mesh's surface: against every triangle, and against closed forms.

use cloudvdb::scene::BrickGrid;
use cloudvdb::vdb::{limit_threads, mesh_distance};
use glam::DVec3;

const ANCHOR: DVec3 = DVec3::new(0.013, -0.027, 0.031);

/// The distance from a point to a triangle: inside the prism over it to its plane, else to its edges.
fn to_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let n = (b - a).cross(c - a);
    let beside = |a: DVec3, b: DVec3| n.cross(b - a).dot(p - a) < 0.0;
    let edge = |a: DVec3, b: DVec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a + t * (b - a))
    };
    if beside(a, b) || beside(b, c) || beside(c, a) {
        edge(a, b).min(edge(b, c)).min(edge(c, a))
    } else {
        ((p - a).dot(n) / n.length()).abs()
    }
}

type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// A prism over a polygon that winds counter-clockwise and whose first corner sees all others, from z = 0 to `height`.
fn prism(polygon: &[(f64, f64)], height: f64) -> Mesh {
    let n = polygon.len() as u32;
    let ring = |z: f64| polygon.iter().map(move |&(x, y)| DVec3::new(x, y, z));
    let mut triangles = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
        if i > 0 && j > 0 {
            triangles.extend([[0, j, i], [n, n + i, n + j]]);
        }
    }
    (ring(0.0).chain(ring(height)).collect(), triangles)
}

fn sphere(radius: f64, rings: u32) -> Mesh {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let sides = 2 * rings;
    for i in 0..=rings {
        for j in 0..sides {
            let (theta, phi) =
                (std::f64::consts::PI * f64::from(i) / f64::from(rings), std::f64::consts::TAU * f64::from(j) / f64::from(sides));
            vertices.push(radius * DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()));
            let (right, down) = (i * sides + (j + 1) % sides, (i + 1) * sides + j);
            if i < rings {
                triangles.extend([[i * sides + j, down, right], [right, down, (i + 1) * sides + (j + 1) % sides]]);
            }
        }
    }
    let same =
        |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)].iter().any(|&(a, b)| vertices[a as usize].distance(vertices[b as usize]) < 1e-9);
    triangles.retain(|&t| !same(t));
    (vertices, triangles)
}

fn boxed() -> Mesh {
    prism(&[(0.0, 0.0), (1.0, 0.0), (1.0, 0.7), (0.0, 0.7)], 0.5)
}

/// The first corner, the notch, sees all others.
fn l_shape() -> Mesh {
    prism(&[(0.4, 0.4), (0.4, 1.0), (0.0, 1.0), (0.0, 0.0), (1.0, 0.0), (1.0, 0.4)], 0.6)
}

/// Each sample of the grid against all triangles; and that no sample above `-exterior` is missing.
fn check(mesh: &Mesh, voxel: f64, exterior: f64, interior: f64, inside: impl Fn(DVec3) -> bool) -> BrickGrid {
    let grid = mesh_distance(&mesh.0, &mesh.1, voxel, ANCHOR, exterior, interior).unwrap();
    assert!(grid.origins.is_sorted() && !grid.origins.is_empty());
    let corners: Vec<[DVec3; 3]> = mesh.1.iter().map(|t| t.map(|i| mesh.0[i as usize])).collect();
    let depth = |p: DVec3| {
        let away = corners.iter().map(|&t| to_triangle(p, t)).fold(f64::INFINITY, f64::min);
        (if inside(p) { away } else { -away }).clamp(-exterior, interior)
    };
    let (mut worst, mut place, mut there) = (0.0f64, String::new(), 0u64);
    for brick in 0..grid.origins.len() {
        for (voxel, &value) in grid.brick(brick).iter().enumerate() {
            let (p, expected) = (grid.position(brick, voxel), depth(grid.position(brick, voxel)));
            if (f64::from(value) - expected).abs() > worst {
                worst = (f64::from(value) - expected).abs();
                place = format!("at {p} {value} instead of {expected}");
            }
            there += u64::from(f64::from(value) > -exterior * (1.0 - 1e-6));
        }
    }
    // Deep inside a sphere a sample may have the nearest but one of its triangles, and within 0.05 voxels the wrong side.
    assert!(worst < 0.1 * voxel, "{exterior} m outside, {interior} m inside, voxels of {voxel} m: {place}");
    let (low, high) = mesh.0.iter().fold((mesh.0[0], mesh.0[0]), |(l, h), &v| (l.min(v), h.max(v)));
    let index = |p: DVec3| ((p - ANCHOR) / voxel).floor().as_ivec3();
    let (low, high) = (index(low - exterior), index(high + exterior) + 1);
    let mut expected = 0;
    for x in low.x..=high.x {
        for y in low.y..=high.y {
            for z in low.z..=high.z {
                let p = ANCHOR + voxel * DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                expected += u64::from(depth(p) > -exterior * (1.0 - 1e-6));
            }
        }
    }
    assert_eq!(there, expected, "samples above -{exterior} m");
    grid
}

#[test]
fn depths_are_those_of_all_triangles() {
    let within = |p: DVec3, x: f64, y: f64, z: f64| p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::new(x, y, z)).all();
    let in_box = |p: DVec3| within(p, 1.0, 0.7, 0.5);
    let in_l = |p: DVec3| within(p, 1.0, 0.4, 0.6) || within(p, 0.4, 1.0, 0.6);
    for (exterior, interior) in [(0.12, 0.1), (0.05, f64::INFINITY), (0.3, 0.02)] {
        check(&boxed(), 0.03, exterior, interior, in_box);
        check(&l_shape(), 0.03, exterior, interior, in_l);
    }
    let mesh = sphere(0.5, 16);
    let planes: Vec<(DVec3, DVec3)> =
        mesh.1.iter().map(|&[a, b, c]| [a, b, c].map(|i| mesh.0[i as usize])).map(|[a, b, c]| (a, (b - a).cross(c - a))).collect();
    let grid = check(&mesh, 0.04, 0.1, f64::INFINITY, |p| planes.iter().all(|&(a, n)| (p - a).dot(n) < 0.0));
    // And the sphere itself, to the sagitta of its facets.
    for brick in 0..grid.origins.len() {
        for (voxel, &value) in grid.brick(brick).iter().enumerate() {
            let expected = (0.5 - grid.position(brick, voxel).length()).max(-0.1);
            assert!((f64::from(value) - expected).abs() < 0.5 * (1.0 - (std::f64::consts::PI / 16.0).cos()) * 1.2);
        }
    }
}

/// A large inside, most of it tiles of OpenVDB's tree.
#[test]
fn what_is_deep_holds_the_interior_width() {
    let mesh = prism(&[(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0)], 6.0);
    let grid = mesh_distance(&mesh.0, &mesh.1, 0.03, ANCHOR, 0.09, 0.15).unwrap();
    for at in [[100, 100, 100], [8, 100, 150], [190, 12, 60]] {
        assert_eq!(grid.at(at), 0.15, "{at:?}");
    }
    let inside = grid.values.iter().filter(|&&v| v > 0.0).count() as f64 * 0.03f64.powi(3);
    assert!((inside / 216.0 - 1.0).abs() < 0.02, "{inside}");
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let mesh = sphere(0.5, 60);
    let (l, bumpy) = (l_shape(), sphere(1.3, 7));
    let all = |threads: usize| {
        limit_threads(threads);
        [&mesh, &l, &bumpy].map(|m| mesh_distance(&m.0, &m.1, 0.025, ANCHOR, 0.04, 0.2).unwrap())
    };
    let one = all(1);
    for threads in [2, 3, 8] {
        assert!(all(threads) == one, "{threads} threads");
    }
}

#[test]
fn what_makes_no_sense_is_refused_in_a_sentence() {
    let (vertices, triangles) = boxed();
    let says = |v: &[DVec3], t: &[[u32; 3]], voxel: f64, exterior: f64, interior: f64, words: &str| {
        let error = mesh_distance(v, t, voxel, ANCHOR, exterior, interior).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    says(&vertices, &[], 0.1, 0.1, 0.1, "no inside");
    says(&[], &triangles, 0.1, 0.1, 0.1, "beyond its 0");
    says(&vertices, &[[0, 1, 99]], 0.1, 0.1, 0.1, "triangle 0");
    says(&[DVec3::NAN; 8], &triangles, 0.1, 0.1, 0.1, "vertex 0");
    says(&vertices, &triangles, 1e-5, 1e-4, 1e-4, "more than 2147483648");
    says(&vertices, &triangles, 1e-200, 1e-4, 1e-4, "more than 2147483648");
    for (voxel, exterior, interior) in [(0.0, 0.1, 0.1), (0.1, -1.0, 0.1), (0.1, f64::INFINITY, 0.1), (0.1, 0.1, 0.0), (0.1, 0.1, f64::NAN)]
    {
        says(&vertices, &triangles, voxel, exterior, interior, "make no sense");
    }
}
