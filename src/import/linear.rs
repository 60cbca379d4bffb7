//! The little linear algebra that a fit needs.

use glam::{DMat3, DVec3};

/// Solves `a x = b` for a symmetric positive definite matrix by Cholesky; `None` where it is close to singular.
pub(super) fn solve<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> Option<[f64; N]> {
    let largest = (0..N).map(|i| a[i][i]).fold(0.0, f64::max);
    for j in 0..N {
        let pivot = a[j][j] - (0..j).map(|k| a[j][k] * a[j][k]).sum::<f64>();
        if pivot.is_nan() || pivot <= 1e-9 * largest {
            return None;
        }
        a[j][j] = pivot.sqrt();
        for i in j + 1..N {
            a[i][j] = (a[i][j] - (0..j).map(|k| a[i][k] * a[j][k]).sum::<f64>()) / a[j][j];
        }
    }
    for i in 0..N {
        b[i] = (b[i] - (0..i).map(|k| a[i][k] * b[k]).sum::<f64>()) / a[i][i];
    }
    for i in (0..N).rev() {
        b[i] = (b[i] - (i + 1..N).map(|k| a[k][i] * b[k]).sum::<f64>()) / a[i][i];
    }
    Some(b)
}

/// Eigenvectors (columns, right-handed, orthonormal) and eigenvalues of a symmetric matrix, by Jacobi's rotations.
pub(super) fn eigen(m: DMat3) -> (DMat3, DVec3) {
    let (mut a, mut q) = (m, DMat3::IDENTITY);
    let scale = m.to_cols_array().iter().fold(0.0_f64, |s, v| s.max(v.abs()));
    for sweep in 0..48 {
        let (i, j) = [(0, 1), (0, 2), (1, 2)][sweep % 3];
        let off = a.col(j)[i];
        if off.abs() <= 1e-15 * scale {
            continue;
        }
        let theta = 0.5 * (2.0 * off).atan2(a.col(i)[i] - a.col(j)[j]);
        let (sin, cos) = theta.sin_cos();
        let mut turn = DMat3::IDENTITY;
        turn.col_mut(i)[i] = cos;
        turn.col_mut(i)[j] = sin;
        turn.col_mut(j)[i] = -sin;
        turn.col_mut(j)[j] = cos;
        a = turn.transpose() * a * turn;
        q *= turn;
    }
    (q, DVec3::new(a.x_axis.x, a.y_axis.y, a.z_axis.z))
}

/// The upper triangular `u` with `u^T u = m`; `None` where `m` is not positive definite.
pub(super) fn cholesky(m: DMat3) -> Option<DMat3> {
    let root = |v: f64| if v > 0.0 && v.is_finite() { Some(v.sqrt()) } else { None };
    let xx = root(m.x_axis.x)?;
    let (xy, xz) = (m.y_axis.x / xx, m.z_axis.x / xx);
    let yy = root(m.y_axis.y - xy * xy)?;
    let yz = (m.z_axis.y - xy * xz) / yy;
    let zz = root(m.z_axis.z - xz * xz - yz * yz)?;
    Some(DMat3::from_cols(DVec3::new(xx, 0.0, 0.0), DVec3::new(xy, yy, 0.0), DVec3::new(xz, yz, zz)))
}
