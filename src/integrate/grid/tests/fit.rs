//! The fits alone.

use super::super::fit::{Fill, Fit, needed};
use super::super::frame::Frame;
use super::*;
use crate::geom::Bounds;
use crate::scene::density::{BRICK_SIDE, BRICK_VOXELS};
use glam::{DMat4, DVec4, IVec3};

/// A cube of 4 x 4 x 4 bricks, and of each voxel the centre.
fn cube() -> (Frame, Vec<Vec3>) {
    let region = ball(DVec3::splat(16.0), 16.0, Medium::with_albedo(1.0, 1.0, 0.0));
    let bounds = Bounds { min: DVec3::ZERO, max: DVec3::splat(32.0) };
    let frame = Frame::new(&[region], DVec3::ZERO, bounds, 1.0, |_| true);
    let centre = |v: usize| {
        let within = IVec3::new(v as i32 >> 6 & 7, v as i32 >> 3 & 7, v as i32 & 7);
        (frame.bricks[v / BRICK_VOXELS] * BRICK_SIDE + within).as_vec3() + 0.5
    };
    let centres = (0..frame.voxels()).map(centre).collect();
    (frame, centres)
}

/// Medium below a slanted plane, at distance 0 from it: a voxel's share and middle by many points.
fn slanted(centres: &[Vec3]) -> Vec<Fill> {
    let normal = Vec3::new(0.3, 0.2, 1.0).normalize();
    let fill = |centre: &Vec3| {
        let (mut share, mut sum) = (0.0, Vec3::ZERO);
        for i in 0..1000 {
            let at = (Vec3::new((i / 100) as f32, (i / 10 % 10) as f32, (i % 10) as f32) + 0.5) / 10.0 - 0.5;
            if (*centre + at - 16.0).dot(normal) < 0.0 {
                (share, sum) = (share + 1e-3, sum + at * 1e-3);
            }
        }
        Fill { share, middle: if share > 0.0 { sum / share } else { sum } }
    };
    centres.iter().map(fill).collect()
}

/// Light that grows evenly is found as it is, up to the boundary and beyond it, whatever the kernel.
#[test]
fn even_slopes_stay() {
    let (frame, centres) = cube();
    let fill = slanted(&centres);
    let light = |p: Vec3| 3.0 + p.dot(Vec3::new(0.1, -0.2, 0.15));
    let gathered: Vec<[f32; 1]> = centres.iter().zip(&fill).map(|(&c, f)| [f.share * light(c + f.middle)]).collect();
    let needed = needed(&frame, &fill);
    for width in [0.1, 0.7, 1.5, 3.0] {
        let fit = Fit::new(&frame, &fill, &needed, width);
        let (smooth, _) = fit.smooth(&gathered);
        let off = |v: usize| (smooth[v][0] / light(centres[v]) - 1.0).abs();
        let near = |v: &usize| fill[*v].share > 0.0 && (centres[*v] - 16.0).abs().max_element() < 8.0;
        let worst = (0..centres.len()).filter(near).map(off).fold(0.0, f32::max);
        println!("kernel of {width}: off by at most {worst:.1e}");
        // What is left is the ridge, and fits of the second round at middles between voxels.
        assert!(worst < 5e-3, "{width}: {worst}");
    }
}

/// The separable sums give what a fit at one voxel, solved the long way, gives.
#[test]
fn the_slow_way_agrees() {
    let (frame, centres) = cube();
    let fill = slanted(&centres);
    let light = |p: Vec3| (0.4 * p.x).sin() + 0.05 * p.z * p.z + (0.3 * p.y).cos();
    let gathered: Vec<[f32; 1]> = centres.iter().zip(&fill).map(|(&c, f)| [f.share * light(c + f.middle)]).collect();
    let needed = needed(&frame, &fill);
    let width = 1.2f64;
    let fit = Fit::new(&frame, &fill, &needed, width);
    let found = fit.once(&gathered);
    let reach = (2.35 * width).ceil() as f32;
    for v in (0..centres.len()).filter(|&v| fill[v].share > 0.0 && (centres[v] - 16.0).abs().max_element() < 6.0).step_by(37) {
        // Normal equations with (1, d) as instruments and (1, d + middle) as what is fitted, in f64.
        let (mut columns, mut b) = ([[0.0f64; 4]; 4], [0.0f64; 4]);
        for (w, c) in centres.iter().enumerate() {
            let d = *c - centres[v];
            if d.abs().max_element() > reach {
                continue;
            }
            let kernel = (-0.5 * f64::from(d.length_squared()) / (width * width)).exp();
            let (row, of) = ([1.0, d.x, d.y, d.z], d + fill[w].middle);
            let column = [1.0, of.x, of.y, of.z];
            for i in 0..4 {
                b[i] += kernel * f64::from(row[i] * gathered[w][0]);
                for j in 0..4 {
                    columns[j][i] += kernel * f64::from(fill[w].share * row[i] * column[j]);
                }
            }
        }
        let slow = (DMat4::from_cols_array_2d(&columns).inverse() * DVec4::from_array(b)).x;
        assert!((f64::from(found[v][0]) - slow).abs() < 5e-3 * slow.abs().max(1.0), "{v}: {} instead of {slow}", found[v][0]);
    }
}
