//! What a user says about media, light and repetition beside a file: it overrides what the file says.

use super::{Air, Medium, Region, Scene, Shape, Wishes};
use crate::error::{Error, Result};
use glam::DVec3;
use std::sync::Arc;

/// Values that replace a scene's own. What is missing stays as it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Overrides {
    /// Extinction of every region in 1/m (of a sample of 1 where it is a grid), above 0. Albedo is kept.
    pub sigma_t: Option<f64>,
    /// Single-scattering albedo of every region, each in [0, 1], RGB. Extinction is kept.
    pub albedo: Option<[f64; 3]>,
    /// Mean cosine of every region's phase function, in (-1, 1).
    pub g: Option<f64>,
    /// The direction in which the sun's light travels, of any length but 0.
    #[serde(serialize_with = "list")]
    pub sun: Option<DVec3>,
    /// The angular diameter of the sun's disc in radians, in [0, pi).
    pub sun_angle: Option<f64>,
    /// The sun's irradiance on a plane across its light, W m^-2, RGB, not below 0.
    pub irradiance: Option<[f64; 3]>,
    /// The sky's radiance, W m^-2 sr^-1, RGB, not below 0.
    pub sky: Option<[f64; 3]>,
    /// The air.
    pub air: Option<Air>,
    /// What is wished of the scene's effects.
    pub wishes: Wishes,
    /// Whether grids are repeated along x and y without end.
    pub periodic: bool,
}

/// A vector as a list of three numbers.
fn list<S: serde::Serializer>(vector: &Option<DVec3>, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    serde::Serialize::serialize(&vector.map(|v| v.to_array()), serializer)
}

impl Overrides {
    /// Replaces what is said.
    ///
    /// # Errors
    /// [`Error::Scene`] where the scene cannot be repeated: a region is no grid, or a grid does not stand upright.
    pub fn apply(&self, scene: &mut Scene) -> Result<()> {
        for region in &mut scene.regions {
            region.medium = self.medium(region.medium);
            if self.periodic {
                repeat(region)?;
            }
        }
        if let Some(direction) = self.sun.and_then(DVec3::try_normalize) {
            scene.sun.direction = direction;
        }
        scene.sun.angular_diameter = self.sun_angle.unwrap_or(scene.sun.angular_diameter);
        scene.sun.irradiance = self.irradiance.unwrap_or(scene.sun.irradiance);
        scene.sky = self.sky.unwrap_or(scene.sky);
        scene.air = self.air.unwrap_or(scene.air);
        scene.wishes = self.wishes;
        Ok(())
    }

    /// A region's medium, with what is said about media replaced.
    pub fn medium(&self, old: Medium) -> Medium {
        let mut new = old;
        if self.sigma_t.is_some() || self.albedo.is_some() {
            for c in 0..3 {
                let own = old.sigma_s[c] + old.sigma_a[c];
                let sigma_t = self.sigma_t.unwrap_or(own);
                // A channel without extinction has no albedo of its own: the medium's mean one will do, or a cloud's.
                let kept = match old.sigma_t() {
                    _ if own > 0.0 => old.sigma_s[c] / own,
                    mean if mean > 0.0 => old.albedo(),
                    _ => Medium::preset("cumulus").map_or(1.0, |m| m.albedo()),
                };
                let albedo = self.albedo.map_or(kept, |a| a[c]);
                (new.sigma_s[c], new.sigma_a[c]) = (sigma_t * albedo, sigma_t * (1.0 - albedo));
            }
        }
        new.g = self.g.unwrap_or(old.g);
        new
    }
}

/// How far from upright an axis of a repeated grid may lean: rounding.
const LEAN: f64 = 1e-6;

fn repeat(region: &mut Region) -> Result<()> {
    let refused = |reason: String, fix: &str| Err(Error::Scene { reason, fix: fix.into() });
    let grid = match &mut region.shape {
        // It goes on without end as it is.
        Shape::Slab { .. } => return Ok(()),
        Shape::Grid(grid) => grid,
        Shape::Ellipsoid { .. } | Shape::Mesh(_) => {
            let reason = format!("--periodic xy repeats voxel grids, and region {:?} is none", region.name);
            return refused(reason, "Read it from a layout, whose regions become one grid");
        }
    };
    let [x, y, z] = {
        let m = grid.bricks.world_from_index.matrix3;
        [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize_or_zero)
    };
    if x.z.abs().max(y.z.abs()).max(z.x.abs()).max(z.y.abs()) > LEAN {
        let reason = format!(
            "--periodic xy repeats a grid along its own x and y, which must be horizontal, and its z vertical; those of {:?} are not (its transform turns or leans)",
            region.name
        );
        return refused(reason, "Resample it to a grid whose transform scales and moves only");
    }
    Arc::make_mut(grid).periodic = true;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{BrickGrid, VoxelGrid};
    use glam::{DAffine3, DQuat};

    fn of(shape: Shape, medium: Medium) -> Scene {
        Scene { regions: vec![Region { name: "r".into(), shape, medium, photons: None }], ..Scene::default() }
    }

    fn grid(world_from_index: DAffine3) -> Shape {
        let bricks = BrickGrid { world_from_index, origins: vec![[0; 3]], values: vec![1.0; 512] };
        Shape::Grid(Arc::new(VoxelGrid::new(bricks, [0; 3], [7; 3], false)))
    }

    #[test]
    fn extinction_keeps_albedo_and_albedo_extinction() {
        let medium = Medium { sigma_s: [3.0, 1.0, 0.0], sigma_a: [1.0, 1.0, 2.0], g: 0.5 };
        let changed = |overrides: Overrides| {
            let mut scene = of(Shape::sphere(DVec3::ZERO, 1.0), medium);
            overrides.apply(&mut scene).unwrap();
            scene.regions[0].medium
        };
        assert_eq!(changed(Overrides::default()), medium);
        let denser = changed(Overrides { sigma_t: Some(8.0), ..Overrides::default() });
        assert_eq!(denser, Medium { sigma_s: [6.0, 4.0, 0.0], sigma_a: [2.0, 4.0, 8.0], g: 0.5 });
        let whiter = changed(Overrides { albedo: Some([1.0, 0.5, 0.25]), g: Some(-0.3), ..Overrides::default() });
        assert_eq!(whiter, Medium { sigma_s: [4.0, 1.0, 0.5], sigma_a: [0.0, 1.0, 1.5], g: -0.3 });
    }

    #[test]
    fn the_sun_and_the_sky_are_replaced_part_by_part() {
        let mut scene = of(Shape::sphere(DVec3::ZERO, 1.0), Medium::grey(1.0, 0.0, 0.0));
        let sun = scene.sun;
        Overrides { sun: Some(DVec3::new(0.0, 0.0, -9.0)), sky: Some([0.1, 0.2, 0.3]), ..Overrides::default() }.apply(&mut scene).unwrap();
        assert_eq!((scene.sun.direction, scene.sun.irradiance, scene.sky), (DVec3::NEG_Z, sun.irradiance, [0.1, 0.2, 0.3]));
        Overrides { irradiance: Some([3.0; 3]), sun_angle: Some(0.0), ..Overrides::default() }.apply(&mut scene).unwrap();
        assert_eq!((scene.sun.direction, scene.sun.irradiance, scene.sun.angular_diameter), (DVec3::NEG_Z, [3.0; 3], 0.0));
    }

    #[test]
    fn upright_grids_alone_are_repeated() {
        let periodic = Overrides { periodic: true, ..Overrides::default() };
        let turned = |axis: DVec3, angle: f64| DAffine3::from_quat(DQuat::from_axis_angle(axis, angle));
        let medium = Medium::grey(1.0, 0.0, 0.0);
        for (transform, fine) in [
            (DAffine3::from_scale(DVec3::new(1.0, 2.0, -3.0)), true),
            (turned(DVec3::Z, 0.4), true),
            (turned(DVec3::X, 0.01), false),
            (turned(DVec3::Y, std::f64::consts::FRAC_PI_2), false),
        ] {
            let mut scene = of(grid(transform), medium);
            assert_eq!(periodic.apply(&mut scene).is_ok(), fine, "{transform:?}");
            assert_eq!(scene.regions[0].shape.is_endless(), fine);
        }
        let refused = periodic.apply(&mut of(Shape::sphere(DVec3::ZERO, 1.0), medium)).unwrap_err();
        assert!(refused.to_string().contains("repeats voxel grids"));
    }
}
