//! Settings beside photons and samples, one at a time: photons in an estimate, the march's step, the size of voxels.

use super::Setting;
use crate::error::Result;
use crate::export::vdb::{GridName, VdbOptions, Voxels};
use crate::integrate::{Integrator, photon::PhotonSettings};
use crate::progress::Progress;
use crate::scene::{Medium, Region, Scene, Shape, VoxelGrid};
use crate::voxelise::{Up, voxel_size};
use std::fmt;
use std::sync::Arc;

/// What is not as usual.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Change {
    /// Photons in an estimate of `photon`, which takes the square root of their number.
    Estimate(u64),
    /// The optical depth of its march's first step.
    Step(f64),
    /// The layout as voxels of this size, m, as a `.vdb` holds it.
    Voxels(f64),
}

/// Times the usual number in an estimate, the usual step, the usual voxels; and in a quick study.
const ESTIMATES: [&[f64]; 2] = [&[0.25, 4.0], &[4.0]];
const STEPS: [&[f64]; 2] = [&[0.2, 5.0], &[5.0]];
const SIZES: [&[f64]; 2] = [&[1.0, 2.0, 4.0], &[1.0, 4.0]];
/// The most voxels.
const MOST: u64 = 30_000_000;

impl Change {
    /// The settings of an integrator of which one thing is not as usual.
    pub(super) fn of(integrator: Integrator, scene: &Scene, work: u64, quick: bool) -> Vec<Setting> {
        let quick = usize::from(quick);
        let changes: Vec<Change> = match integrator {
            Integrator::Path => Vec::new(),
            Integrator::Photon => {
                let estimates = ESTIMATES[quick].iter().map(|by| Change::Estimate(((work as f64).sqrt() * by).round().max(1.0) as u64));
                estimates.chain(STEPS[quick].iter().map(|by| Change::Step(PhotonSettings::default().step * by))).collect()
            }
            Integrator::Grid => {
                let usual = voxel_size(&scene.regions, None, MOST).ok().filter(|_| one_medium(&scene.regions).is_some());
                usual.map_or(Vec::new(), |(size, _)| SIZES[quick].iter().map(|by| Change::Voxels(rounded(size * by))).collect())
            }
        };
        changes.into_iter().map(|change| Setting { integrator, work, change: Some(change) }).collect()
    }
}

impl fmt::Display for Change {
    fn fmt(&self, to: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Change::Estimate(n) => write!(to, "{n} in an estimate"),
            Change::Step(step) => write!(to, "steps of {step:.2} optical depths"),
            Change::Voxels(size) => write!(to, "voxels of {size} m"),
        }
    }
}

/// Three digits.
fn rounded(size: f64) -> f64 {
    format!("{size:.2e}").parse().unwrap_or(size)
}

/// The densest medium of regions, of which the others are thinner; `None` where they differ in more, or are grids, whose voxels are
/// what they are.
fn one_medium(regions: &[Region]) -> Option<Medium> {
    let densest = regions.iter().map(|r| r.medium).max_by(|a, b| a.sigma_t().total_cmp(&b.sigma_t()))?;
    let alike = |region: &Region| {
        let share = region.medium.sigma_t() / densest.sigma_t();
        let near = |a: f64, b: f64| (a - share * b).abs() <= 1e-9 * densest.sigma_t();
        let (medium, shape) = (&region.medium, &region.shape);
        medium.g == densest.g
            && (0..3).all(|c| near(medium.sigma_s[c], densest.sigma_s[c]) && near(medium.sigma_a[c], densest.sigma_a[c]))
            && !matches!(shape, Shape::Grid(_))
    };
    (densest.sigma_t() > 0.0 && regions.iter().all(alike)).then_some(densest)
}

/// The scene with its regions as voxels.
///
/// # Errors
/// [`crate::Error::TooManyVoxels`], [`crate::Error::Interrupted`].
pub(super) fn voxels(scene: &Scene, size: f64, progress: &dyn Progress) -> Result<Scene> {
    let options = VdbOptions { voxel_size: Some(size), max_voxels: MOST, up: Up::Z, half: false, grids: vec![GridName::Density] };
    let voxels = Voxels::new(scene, &scene.regions, &options, progress)?;
    let mut made = scene.clone();
    if let Some((bricks, medium)) = voxels.density().zip(one_medium(&scene.regions)) {
        let (low, high) = bricks.extent();
        let shape = Shape::Grid(Arc::new(VoxelGrid::new(bricks.clone(), low, high, false)));
        made.regions = vec![Region { name: "voxels".into(), shape, medium, photons: None }];
    }
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use glam::DVec3;

    fn scene(sigma: [f64; 2], albedo: [f64; 2]) -> Scene {
        let region = |i: usize| {
            let shape = Shape::sphere(DVec3::new(1.5 * i as f64, 0.0, 0.0), 1.0 + i as f64);
            Region { name: "ball".into(), shape, medium: Medium::with_albedo(sigma[i], albedo[i], 0.5), photons: None }
        };
        Scene { regions: (0..2).map(region).collect(), ..Scene::default() }
    }

    /// Voxels have the layout's optical mass and its medium, also where one region is thinner.
    #[test]
    fn voxels_hold_what_the_layout_holds() {
        let layout = scene([3.0, 1.0], [0.9, 0.9]);
        for size in [0.1, 0.3] {
            let made = voxels(&layout, size, &Silent).unwrap();
            assert_eq!((made.regions.len(), made.regions[0].medium), (1, layout.regions[0].medium));
            assert!((made.optical_mass() / layout.optical_mass() - 1.0).abs() < 1e-3, "{}", made.optical_mass() / layout.optical_mass());
        }
    }

    #[test]
    fn settings_differ_in_one_thing_and_media_that_differ_in_more_stay_as_they_are() {
        let of = |integrator, scene: &Scene| Change::of(integrator, scene, 90_000, false);
        let layout = scene([3.0, 1.0], [0.9, 0.9]);
        let photon = of(Integrator::Photon, &layout);
        assert!(
            photon.iter().any(|s| s.change == Some(Change::Estimate(75))) && photon.iter().any(|s| s.change == Some(Change::Step(0.5)))
        );
        assert_eq!((of(Integrator::Grid, &layout).len(), of(Integrator::Path, &layout).len()), (3, 0));
        assert!(of(Integrator::Grid, &scene([3.0, 1.0], [0.9, 0.8])).is_empty());
    }
}
