//! The sun, lamps and the camera.

use super::{Became, at::At, build::Builder, extras::describe, json, walk::Visit};
use crate::{
    Result,
    scene::{Camera, Lamp, Spot, Sun, lamp::LAMP_RADIUS, light::SUN_ANGLE},
};
use glam::{DAffine3, DMat3, DVec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// Lumens per watt by which glTF's lux become W m^-2, and its candelas W/sr.
const LUMENS_PER_WATT: f64 = 683.0;

impl Builder<'_> {
    /// Takes a node's light: the first directional one is the sun, points and spots are lamps (of that radius, m, where the node says one).
    pub fn light(&mut self, visit: &Visit, index: usize, radius: Option<f64>, at: At) -> Result<()> {
        let lights = self.root.extensions.as_ref().and_then(|e| e.lights.as_ref()).map_or(&[][..], |l| &l.lights);
        let light = lights.get(index).ok_or_else(|| {
            at.error("light", index.to_string(), format!("one of the file's {} lights", lights.len()), "Export the file again")
        })?;
        let seen = self.findings.iter().find(|f| f.became == Became::Sun).map(|f| f.node.clone());
        match (light.kind.as_str(), seen) {
            ("directional", None) => {
                self.scene.sun = sun(light, visit, self.scene_spec.sun_angle, at)?;
                self.found(at.name(), Became::Sun, "the first directional light");
            }
            ("directional", Some(first)) => self.found(at.name(), Became::Ignored, format!("a second sun: {first:?} is the sun")),
            (kind @ ("point" | "spot"), _) => {
                let lamp = lamp(light, visit, radius.unwrap_or(LAMP_RADIUS), at)?;
                if lamp.grey() > 0.0 {
                    self.scene.lamps.push(lamp);
                    self.found(at.name(), Became::Lamp, format!("a {kind} light"));
                } else {
                    self.found(at.name(), Became::Ignored, format!("a {kind} light that is dark"));
                }
            }
            (kind, _) => {
                let why = format!("a {kind} light: glTF has directional, point and spot lights");
                self.found(at.name(), Became::Ignored, why);
            }
        }
        Ok(())
    }

    /// Takes a node's camera: the first perspective one.
    pub fn camera(&mut self, visit: &Visit, index: usize, at: At) -> Result<()> {
        let cameras = &self.root.cameras;
        let camera = cameras.get(index).ok_or_else(|| {
            at.error("camera", index.to_string(), format!("one of the file's {} cameras", cameras.len()), "Export the file again")
        })?;
        match &camera.perspective {
            None => self.found(at.name(), Became::Ignored, "an orthographic camera: only perspective cameras are read"),
            Some(_) if self.scene.camera.is_some() => self.found(at.name(), Became::Ignored, "not the first camera"),
            Some(optics) => {
                self.scene.camera = Some(lens(optics, visit, at)?);
                self.found(at.name(), Became::Camera, "the first perspective camera");
            }
        }
        Ok(())
    }
}

const FIX: &str = "Correct the light in Blender and export again";

/// What a light gives: lux or candela, over 683 lm/W, RGB.
fn strength(light: &json::Light, unit: &str, at: At) -> Result<[f64; 3]> {
    let intensity = match &light.intensity {
        None => 1.0,
        Some(value) => value
            .as_f64()
            .filter(|&v| v >= 0.0 && v <= f64::from(f32::MAX))
            .ok_or_else(|| at.error("light's intensity", describe(value), format!("a number of {unit}, not below 0"), FIX))?,
    };
    let colour = match &light.color {
        None => [1.0; 3],
        Some(colour) => super::walk::numbers(colour, "light's color", at)?,
    };
    if colour.iter().any(|&c| c < 0.0) {
        return Err(at.error("light's color", format!("{colour:?}"), "three numbers not below 0", FIX));
    }
    Ok(colour.map(|c| c * intensity / LUMENS_PER_WATT))
}

/// Along which a node's light travels: its -Z.
fn axis(visit: &Visit, at: At) -> Result<DVec3> {
    let axis = (visit.world.matrix3 * DVec3::NEG_Z).try_normalize();
    axis.ok_or_else(|| at.error("scale", "zero", "a scale other than 0", "Apply the scale of the light and of its parents"))
}

/// The sun out of a directional light.
fn sun(light: &json::Light, visit: &Visit, angle: Option<f64>, at: At) -> Result<Sun> {
    let irradiance = strength(light, "lux", at)?;
    Ok(Sun { direction: axis(visit, at)?, irradiance, angular_diameter: angle.unwrap_or(SUN_ANGLE) })
}

/// A lamp out of a point or spot light. Its scale is of no matter, as KHR_lights_punctual has it.
fn lamp(light: &json::Light, visit: &Visit, radius: f64, at: At) -> Result<Lamp> {
    let intensity = strength(light, "candela", at)?;
    let spot = if light.kind == "spot" { Some(spot(light.spot.as_ref(), axis(visit, at)?, at)?) } else { None };
    Ok(Lamp { name: at.name(), position: visit.world.translation, radius, intensity, spot })
}

fn spot(cone: Option<&json::Spot>, axis: DVec3, at: At) -> Result<Spot> {
    let angle = |said: Option<&serde_json::Value>, name: &str, usual: f64| match said {
        None => Ok(usual),
        Some(value) => value
            .as_f64()
            .filter(|v| (0.0..=FRAC_PI_2 + 1e-6).contains(v))
            .ok_or_else(|| at.error(format!("light's {name}"), describe(value), "an angle in radians from 0 to pi / 2", FIX)),
    };
    let inner = angle(cone.and_then(|c| c.inner_cone_angle.as_ref()), "innerConeAngle", 0.0)?;
    let outer = angle(cone.and_then(|c| c.outer_cone_angle.as_ref()), "outerConeAngle", FRAC_PI_4)?;
    if outer <= 0.0 || inner > outer {
        let found = format!("an inner angle of {inner} and an outer one of {outer}");
        return Err(at.error("light's spot", found, "an inner angle not above the outer one, which is above 0", FIX));
    }
    Ok(Spot { axis, cosines: [inner.cos(), outer.cos()] })
}

/// A camera out of a perspective camera; its scale is of no matter.
fn lens(lens: &json::Perspective, visit: &Visit, at: At) -> Result<Camera> {
    let fix = "Correct the camera in Blender and export again";
    let said = |value: Option<f64>| value.map_or("missing".to_owned(), |v| v.to_string());
    let positive = |field: &str, value: Option<f64>| match value {
        Some(v) if !(v > 0.0 && v.is_finite()) => Err(at.error(format!("camera's {field}"), v.to_string(), "a number above 0", fix)),
        other => Ok(other),
    };
    let yfov = lens.yfov.filter(|&v| v > 0.0 && v < std::f64::consts::PI);
    let yfov = yfov.ok_or_else(|| at.error("camera's yfov", said(lens.yfov), "an angle in radians between 0 and pi", fix))?;
    let m = visit.world.matrix3;
    let upright = m.y_axis.try_normalize().zip(m.z_axis.try_normalize()).and_then(|(y, z)| {
        let x = y.cross(z).try_normalize()?;
        Some(DMat3::from_cols(x, z.cross(x), z))
    });
    let matrix3 =
        upright.ok_or_else(|| at.error("scale", "zero", "a scale other than 0", "Apply the scale of the camera and of its parents"))?;
    Ok(Camera {
        world_from_camera: DAffine3 { matrix3, translation: visit.world.translation },
        yfov,
        aspect: positive("aspectRatio", lens.aspect_ratio)?,
        znear: positive("znear", lens.znear)?.unwrap_or(0.1),
        zfar: positive("zfar", lens.zfar)?,
    })
}
