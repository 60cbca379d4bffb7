//! How large voxels are.

use crate::error::{Error, Result};
use crate::geom::Bounds;
use crate::scene::{Region, Shape};
use glam::DVec3;

/// A voxel size for these regions: `asked`, or a third of the smallest half extent or 1/128 of the longest side, whichever is
/// finer, coarsened where more than `max_voxels` would be active. The second value says whether it was coarsened.
///
/// # Errors
/// [`Error::TooManyVoxels`] where `asked` does not fit.
pub fn voxel_size(regions: &[Region], asked: Option<f64>, max_voxels: u64) -> Result<(f64, bool)> {
    let smallest = regions.iter().map(|r| r.shape.smallest_half_extent()).fold(f64::INFINITY, f64::min);
    let longest = regions.iter().fold(Bounds::EMPTY, |b, r| b.union(r.shape.bounds())).size().max_element();
    let finest = (smallest / 3.0).min(longest / 128.0);
    let size = asked.unwrap_or(finest);
    fitting(size, asked, max_voxels, |size| active_voxels(regions, size))
}

/// `size`, or where `active(size)` voxels are more than `max_voxels` the next coarser one that fits. The second value says whether
/// it was coarsened.
///
/// # Errors
/// [`Error::TooManyVoxels`] where a size was `asked` for and does not fit.
pub fn fitting(size: f64, asked: Option<f64>, max_voxels: u64, active: impl Fn(f64) -> f64) -> Result<(f64, bool)> {
    let needed = active(size);
    if needed <= max_voxels as f64 {
        return Ok((size, false));
    }
    let (mut low, mut high) = (size, size * 2.0);
    while active(high) > max_voxels as f64 && high < f64::MAX / 2.0 {
        (low, high) = (high, high * 2.0);
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if active(middle) > max_voxels as f64 { low = middle } else { high = middle }
    }
    let fitting = round_up(high);
    match asked {
        Some(voxel_size) => Err(Error::TooManyVoxels { voxel_size, voxels: needed, max_voxels, fitting }),
        None => Ok((fitting, true)),
    }
}

/// About how many voxels of that size would be active: each region's volume grown by half a voxel, at most the whole bounds.
pub(super) fn active_voxels(regions: &[Region], size: f64) -> f64 {
    let grown = |s: DVec3| (s / size + 1.0).element_product();
    let one = |shape: &Shape| match shape {
        Shape::Ellipsoid { .. } => grown(shape.bounds().size()).min(shape.volume() / size.powi(3) + surface_voxels(shape, size)),
        _ => grown(shape.bounds().size()),
    };
    let bounds = regions.iter().fold(Bounds::EMPTY, |b, r| b.union(r.shape.bounds()));
    // Indices are 32-bit.
    if bounds.size().max_element() / size > f64::from(1 << 30) {
        return f64::INFINITY;
    }
    regions.iter().map(|r| one(&r.shape)).sum::<f64>().min(grown(bounds.size()))
}

/// The voxels that an ellipsoid's surface adds to its volume, about.
fn surface_voxels(shape: &Shape, size: f64) -> f64 {
    let half = shape.bounds().size() * 0.5 / size;
    std::f64::consts::PI * 4.0 / 3.0 * ((half + 0.5).element_product() - half.element_product()) + 1.0
}

/// To three significant digits, upward.
fn round_up(x: f64) -> f64 {
    let unit = 10f64.powi(x.log10().floor() as i32 - 2);
    // Through text, so that the number prints as short as it is.
    format!("{:.2e}", (x / unit).ceil() * unit).parse().unwrap_or(x)
}
