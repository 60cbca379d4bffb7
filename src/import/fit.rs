//! Is a mesh a sphere? A least-squares ellipsoid through its vertices, and a look at what lies between them.

use super::{linear, weld::Welded};
use glam::{DAffine3, DMat3, DVec3};

/// The fewest different vertices of a sphere: an icosahedron's.
const FEWEST: usize = 12;
/// The farthest that a vertex may lie off the ellipsoid, in radii.
const OFF_SURFACE: f64 = 0.01;
/// The nearest to the centre that a triangle may come, in radii. An icosahedron's comes to 0.795, a cube's and an
/// octahedron's to 0.577.
const DEPTH: f64 = 0.7;

/// The map from the unit ball to the ellipsoid on which all vertices of a closed mesh lie; `None` where there is none.
///
/// The axes come out orthogonal, and equal where they differ by less than 1e-4 (Blender's icosahedron is off by
/// 1e-5): a sphere is exactly a sphere.
pub(super) fn ellipsoid(mesh: &Welded) -> Option<DAffine3> {
    if mesh.points.len() < FEWEST {
        return None;
    }
    // In a space where the vertices' scatter is the same in all directions the fit is well conditioned.
    let (centre, spread) = scatter(&mesh.points)?;
    let inverse = spread.inverse();
    let (axes, middle) = quadric(mesh.points.iter().map(|&p| inverse * (p - centre)))?;
    let unit = orthogonal(spread * axes);
    let fit = DAffine3 { matrix3: unit, translation: centre + spread * middle };
    (fit.is_finite() && lies_on(mesh, fit)).then_some(fit)
}

/// The mean of the points, and a matrix whose product with its transpose is their covariance.
fn scatter(points: &[DVec3]) -> Option<(DVec3, DMat3)> {
    let n = points.len() as f64;
    let first = points.first().copied()?;
    let centre = first + points.iter().map(|&p| p - first).sum::<DVec3>() / n;
    let outer = |d: DVec3| DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    let covariance = points.iter().fold(DMat3::ZERO, |sum, &p| sum + outer(p - centre)) * (1.0 / n);
    let (q, lambda) = linear::eigen(covariance);
    let largest = lambda.max_element();
    if lambda.min_element() <= 1e-10 * largest {
        return None;
    }
    Some((centre, q * DMat3::from_diagonal(DVec3::new(lambda.x.sqrt(), lambda.y.sqrt(), lambda.z.sqrt()))))
}

/// The ellipsoid `x^T A x + b^T x = 1` through points around the origin: the map from the unit ball, and the centre.
fn quadric(points: impl Iterator<Item = DVec3>) -> Option<(DMat3, DVec3)> {
    let (mut gram, mut right) = ([[0.0; 9]; 9], [0.0; 9]);
    for p in points {
        let row = [p.x * p.x, p.y * p.y, p.z * p.z, 2.0 * p.x * p.y, 2.0 * p.x * p.z, 2.0 * p.y * p.z, p.x, p.y, p.z];
        for ((line, sum), &r) in gram.iter_mut().zip(&mut right).zip(&row) {
            *sum += r;
            line.iter_mut().zip(&row).for_each(|(cell, &c)| *cell += r * c);
        }
    }
    let [xx, yy, zz, xy, xz, yz, bx, by, bz] = linear::solve(gram, right)?;
    let a = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
    linear::cholesky(a)?;
    let middle = a.inverse() * DVec3::new(bx, by, bz) * -0.5;
    let level = 1.0 + middle.dot(a * middle);
    let root = linear::cholesky(a * level.recip())?;
    Some((root.inverse(), middle))
}

/// The same ellipsoid with orthogonal axes.
fn orthogonal(m: DMat3) -> DMat3 {
    let (q, lambda) = linear::eigen(m * m.transpose());
    let axes = DVec3::new(lambda.x.max(0.0).sqrt(), lambda.y.max(0.0).sqrt(), lambda.z.max(0.0).sqrt());
    if axes.max_element() - axes.min_element() <= 1e-4 * axes.max_element() {
        return DMat3::from_diagonal(DVec3::splat(axes.element_sum() / 3.0));
    }
    q * DMat3::from_diagonal(axes)
}

/// Whether all vertices lie on the ellipsoid and no triangle cuts deep into it.
fn lies_on(mesh: &Welded, fit: DAffine3) -> bool {
    let unit_from_mesh = fit.inverse();
    let points: Vec<DVec3> = mesh.points.iter().map(|&p| unit_from_mesh.transform_point3(p)).collect();
    if !points.iter().all(|p| (p.length() - 1.0).abs() <= OFF_SURFACE) {
        return false;
    }
    let depth = DEPTH * DEPTH;
    mesh.triangles.iter().all(|triangle| {
        let [a, b, c] = triangle.map(|v| points.get(v as usize).copied().unwrap_or_default());
        let middles = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5, (a + b + c) / 3.0];
        middles.iter().all(|p| p.length_squared() >= depth)
    })
}
