//! What a sky may be: even, a gradient, a clear day's, or an image.

use super::{Dome, Scene, medium::luminance};
use glam::{DVec3, Vec3};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};
use std::sync::Arc;

/// Columns and rows of a dome that is computed.
const SIZE: [usize; 2] = [256, 128];
/// How fast a gradient leaves the horizon's colour: the exponent of the sine of the height.
const HAZY: f64 = 0.5;
/// The golden angle, rad.
const GOLDEN: f64 = 2.399_963_229_728_653;
/// The sun's spectral irradiance above the air at 550 nm, W m^-2 nm^-1 (ASTM G173-03).
const SUN_AT_550: f64 = 1.87;
/// The model's radiance is summed over wavelengths, weighted by the eye's sensitivity, whose own sum is this, nm.
const WAVELENGTHS: f64 = 106.857;
/// The optical depth of air at 550 nm straight up.
const MOLECULES_AT_550: f64 = 0.098;

/// A description of the sky.
#[derive(Debug, Clone, PartialEq)]
pub enum Sky {
    /// The same radiance from everywhere, W m^-2 sr^-1, RGB.
    Even([f64; 3]),
    /// From one radiance at the horizon to another at the zenith; `ground` is below the horizon.
    Gradient {
        /// W m^-2 sr^-1, RGB.
        zenith: [f64; 3],
        /// W m^-2 sr^-1, RGB.
        horizon: [f64; 3],
        /// W m^-2 sr^-1, RGB.
        ground: [f64; 3],
    },
    /// A clear day's, about the scene's sun (Hosek and Wilkie 2012), as bright as fits that sun; below the horizon lies ground.
    Clear {
        /// Linke's turbidity, 1 to 10: 2 is very clear, 3 a clear day, 10 haze.
        turbidity: f64,
        /// The albedo of the ground that lights it, RGB.
        albedo: [f64; 3],
        /// What it is multiplied by.
        strength: f64,
    },
    /// An image, turned about the vertical by an angle (rad, against the clock from above).
    Image {
        /// As read.
        dome: Arc<Dome>,
        /// What it is multiplied by, RGB.
        strength: [f64; 3],
        /// The angle.
        turn: f64,
    },
}

impl Sky {
    /// Lays it over a scene whose sun is known.
    ///
    /// # Errors
    /// The sentence that says why it cannot be: a clear sky wants a sun above the horizon.
    pub fn lay(&self, scene: &mut Scene) -> Result<(), String> {
        let [width, height] = SIZE;
        let dome = match self {
            Sky::Even(radiance) => {
                (scene.sky, scene.dome) = (*radiance, None);
                return Ok(());
            }
            Sky::Gradient { zenith, horizon, ground } => Dome::of(width, height, |d| {
                let up = d.z.max(0.0).powf(HAZY);
                if d.z < 0.0 { *ground } else { std::array::from_fn(|c| horizon[c] + (zenith[c] - horizon[c]) * up) }
            }),
            Sky::Clear { turbidity, albedo, strength } => clear(scene, *turbidity, *albedo, *strength)?,
            Sky::Image { dome, strength, turn } => {
                let [width, height] = dome.size();
                let (sin, cos) = turn.sin_cos();
                let back = |d: DVec3| DVec3::new(cos * d.x + sin * d.y, cos * d.y - sin * d.x, d.z);
                Dome::of(width, height, |d| {
                    let found = dome.radiance(back(d).as_vec3()).as_dvec3();
                    (found * DVec3::from_array(*strength)).to_array()
                })
            }
        };
        scene.sky = dome.as_ref().map_or([0.0; 3], Dome::mean);
        scene.dome = dome.map(Arc::new);
        Ok(())
    }
}

/// A clear day's sky about the scene's sun. The model's radiance goes with the sun's irradiance at 550 nm behind the same air: molecules
/// and the aerosol of that turbidity (Preetham et al. 1999, A.1); so it is scaled to the sun that the scene has.
fn clear(scene: &Scene, turbidity: f64, albedo: [f64; 3], strength: f64) -> Result<Option<Dome>, String> {
    let sun = -scene.sun.direction.normalize();
    if sun.z <= 0.0 || !scene.sun.shines() {
        return Err("a clear sky goes with a sun above the horizon, and this one is below it or dark".into());
    }
    let elevation = sun.z.asin();
    let params = SkyParams { elevation: elevation as f32, turbidity: turbidity as f32, albedo: albedo.map(|a| a as f32) };
    let state = SkyState::new(&params).map_err(|error| error.to_string())?;
    let aerosol = (0.04608 * turbidity - 0.04586).max(0.0) * 0.55f64.powf(-1.3);
    // Kasten and Young 1989.
    let mass = 1.0 / (sun.z + 0.50572 * (elevation.to_degrees() + 6.07995).powf(-1.6364));
    let arriving = SUN_AT_550 * (-(MOLECULES_AT_550 + aerosol) * mass).exp();
    let scale = strength * luminance(scene.sun.irradiance) / (arriving * WAVELENGTHS);
    let [width, height] = SIZE;
    let above = |d: DVec3| {
        let (theta, gamma) = (d.z.min(1.0).acos() as f32, Vec3::dot(d.as_vec3(), sun.as_vec3()).clamp(-1.0, 1.0).acos());
        [Channel::R, Channel::G, Channel::B].map(|channel| scale * f64::from(state.radiance(theta, gamma, channel)).max(0.0))
    };
    // Even ground sends back what sun and sky give it.
    let below = level(above).map(|sky| sky / std::f64::consts::PI);
    let sunlit = scene.sun.irradiance.map(|e| e * sun.z / std::f64::consts::PI);
    let ground: [f64; 3] = std::array::from_fn(|c| albedo[c] * (strength * sunlit[c] + below[c]));
    Ok(Dome::of(width, height, |d| if d.z > 0.0 { above(d) } else { ground }))
}

/// What a sky gives level ground, W m^-2, by directions spread evenly.
fn level(radiance: impl Fn(DVec3) -> [f64; 3]) -> [f64; 3] {
    const COUNT: u32 = 4096;
    let mut sum = [0.0; 3];
    for i in 0..COUNT {
        let (z, angle) = ((f64::from(i) + 0.5) / f64::from(COUNT), GOLDEN * f64::from(i));
        let (r, (sin, cos)) = ((1.0 - z * z).sqrt(), angle.sin_cos());
        let light = radiance(DVec3::new(r * cos, r * sin, z));
        sum = std::array::from_fn(|c| sum[c] + z * light[c] * std::f64::consts::TAU / f64::from(COUNT));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn under(sky: &Sky, sun: DVec3) -> Result<Scene, String> {
        let mut scene = Scene::default();
        scene.sun.direction = -sun.normalize();
        sky.lay(&mut scene)?;
        Ok(scene)
    }

    #[test]
    fn a_clear_sky_is_blue_bright_about_the_sun_and_dimmer_than_it() {
        let sky = Sky::Clear { turbidity: 3.0, albedo: [0.2; 3], strength: 1.0 };
        let sun = DVec3::new(0.4, 0.3, 0.8).normalize();
        let scene = under(&sky, sun).unwrap();
        let dome = scene.dome.unwrap();
        let (about, away) = (dome.radiance(sun.as_vec3()), dome.radiance(Vec3::new(-0.6, -0.5, 0.6).normalize()));
        assert!(away.z > 1.5 * away.x && about.y > 2.0 * away.y, "{about} {away}");
        // On level ground a clear day's sky gives a tenth to a third of what its sun does.
        let level = level(|d| dome.radiance(d.as_vec3()).as_dvec3().to_array())[1];
        // What ground of albedo 0.2 sends back.
        let ground = 0.2 * (level + sun.z) / std::f64::consts::PI;
        assert!((f64::from(dome.radiance(Vec3::NEG_Z).y) / ground - 1.0).abs() < 0.01);
        println!("the sky gives {level:.3} of the sun's {:.3} on level ground", sun.z);
        assert!((0.1..0.35).contains(&(level / sun.z)), "{level}");
        assert!(under(&sky, DVec3::new(1.0, 0.0, -0.1)).is_err());
    }

    #[test]
    fn an_image_turns_against_the_clock_and_a_gradient_goes_up() {
        let bright = |d: DVec3| [if d.x > 0.9 { 8.0 } else { 0.1 }; 3];
        let image = Sky::Image { dome: Arc::new(Dome::of(64, 32, bright).unwrap()), strength: [2.0, 1.0, 1.0], turn: 1.0 };
        let dome = under(&image, DVec3::Z).unwrap().dome.unwrap();
        let toward = Vec3::new(1.0f32.cos(), 1.0f32.sin(), 0.0);
        assert!((dome.radiance(toward) - Vec3::new(16.0, 8.0, 8.0)).length() < 1e-3 && dome.radiance(Vec3::NEG_Y).y < 0.2);
        let sky = Sky::Gradient { zenith: [0.0, 0.0, 1.0], horizon: [1.0; 3], ground: [0.2; 3] };
        let dome = under(&sky, DVec3::Z).unwrap().dome.unwrap();
        let at = |z: f32| dome.radiance(Vec3::new((1.0 - z * z).sqrt(), 0.0, z));
        assert!(at(0.99).x < 0.05 && at(0.02).x > 0.8 && (at(-0.5).x - 0.2).abs() < 1e-3 && (at(0.5).z - 1.0).abs() < 1e-3);
    }
}
