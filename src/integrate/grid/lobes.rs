//! What of the light that media send into all directions goes into lobes, and what into harmonics.

use super::basis::{DEGREE, HARMONICS, harmonics};
use super::plain::APART;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Numbers of a place before its harmonics: sunlight that scatters once, the lobe about it, that about the flow, and the flow along x, y, z.
pub(super) const LOBES: usize = 6;
/// The lobe about the flow has no larger mean cosine.
const NARROWEST: f64 = 0.9;

/// Sunlight at a place.
pub(super) struct Sunlight {
    /// Where it travels, and its irradiance there, W m^-2.
    pub way: Vec3,
    pub arrives: f64,
    /// The mean cosine of what scatters once, and of the lobe of what scatters twice; this is 0 where there are no lobes.
    pub mean_cosine: f64,
    pub lobe: f64,
}

impl Sunlight {
    /// The numbers of a bake, in units of `scale`: sunlight, lobes and harmonics. `here` has of each region its share of the extinction, its
    /// albedo and mean cosine; `light` is that of the field: its harmonics, and those of degrees 0 and 1 of each class that is kept apart.
    pub(super) fn with_others(&self, here: &[(f64, f64, f64)], light: Option<&[f32]>, scale: f64, into: &mut [f32]) {
        let (lobe, count) = (self.lobe, into.len() - LOBES);
        let along = harmonics(self.way);
        let mut sun = 0.0;
        let mut out = [0.0f64; HARMONICS];
        // By class kept apart: the flow of what scatters that often, its first moment, and the whole of it.
        let mut flows = [(DVec3::ZERO, 0.0); APART];
        for &(share, albedo, g) in here {
            let once = share * albedo * self.arrives;
            sun += once;
            for i in 0..count {
                let l = DEGREE[i] as i32;
                // Sunlight scattered once goes by the mean cosine of all; what the region's own differs by is in the harmonics.
                out[i] += once * (g.powi(l) - self.mean_cosine.powi(l)) * f64::from(along[i]);
                if let Some(light) = light {
                    out[i] += share * albedo * g.powi(l) * f64::from(light[i]);
                }
            }
            for (flow, low) in flows.iter_mut().zip(light.into_iter().flat_map(|light| light[count..].chunks_exact(4))) {
                flow.0 += share * albedo * g * moment(&low[1..]);
                flow.1 += share * albedo * f64::from(low[0]) * (4.0 * PI).sqrt();
            }
        }
        let mut lobes = [0.0f64; LOBES];
        lobes[0] = sun;
        if lobe > 0.0 {
            // Light that scatters a second time does so about the sun's, that of the third and fourth about the way in which it flows. What
            // their moments of degree 0 to the last are is not the harmonics' any more.
            let glow = (flows[0].0.dot(self.way.as_dvec3()) / lobe).max(0.0);
            let (flow, mean) = flows[1];
            let narrow = of_flow(flow.length(), mean);
            let axis = harmonics(flow.normalize_or_zero().as_vec3());
            for i in 0..count {
                let l = DEGREE[i] as i32;
                out[i] -= glow * lobe.powi(l) * f64::from(along[i]);
                if narrow > 0.0 {
                    out[i] -= mean * narrow.powi(l) * f64::from(axis[i]);
                }
            }
            lobes[1] = glow;
            if narrow > 0.0 {
                lobes[2..].copy_from_slice(&[mean, flow.x, flow.y, flow.z]);
            }
        }
        into.iter_mut().zip(lobes.into_iter().chain(out)).for_each(|(into, value)| *into = (value / scale) as f32);
    }
}

/// The integral of radiance times direction, from its harmonics of degree 1.
fn moment(first: &[f32]) -> DVec3 {
    let [y, z, x] = [0, 1, 2].map(|i| f64::from(first[i]));
    DVec3::new(x, y, z) * (4.0 * PI / 3.0).sqrt()
}

/// The mean cosine of the lobe about the flow of light, from the length of the flow and the whole of the light; 0 without any.
pub fn of_flow(flow: f64, whole: f64) -> f64 {
    if whole > 0.0 { (flow / whole).min(NARROWEST) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::phase::{henyey_greenstein, one_minus_cos};

    /// What is sent has the moments of the light, each scattered once more, whatever goes into lobes: by quadrature over all directions.
    #[test]
    fn lobes_and_harmonics_together_have_the_moments_of_the_light() {
        let (g, albedo, arrives) = (0.8, 0.9, 2.0);
        let sunlight = Sunlight { way: Vec3::new(0.6, 0.0, -0.8), arrives, mean_cosine: g, lobe: g * g };
        // Harmonics of all light; then those of degrees 0 and 1 of what scatters twice, and three or four times.
        let mut light: Vec<f32> = vec![3.0, 0.4, -0.9, 0.5, 0.1, -0.2, 0.3, 0.1, -0.3, 0.2, 0.1, -0.1, 0.15, 0.2, -0.25, 0.1];
        light.extend([0.7, 0.1, -0.3, 0.2, 0.9, 0.5, -0.2, 0.1]);
        let mut into = [0.0f32; LOBES + HARMONICS];
        sunlight.with_others(&[(1.0, albedo, g)], Some(&light), 1.0, &mut into);
        assert!(into[1] > 0.1 && into[2] > 0.1, "there are lobes: {into:?}");
        let flow = Vec3::new(into[3], into[4], into[5]);
        let narrow = of_flow(flow.length().into(), into[2].into());
        let (rows, columns) = (400, 200);
        let mut sums = [0.0f64; HARMONICS];
        for i in 0..rows * columns {
            let z = ((i / columns) as f32 + 0.5) / rows as f32 * 2.0 - 1.0;
            let (sin, cos) = ((i % columns) as f32 / columns as f32 * std::f32::consts::TAU).sin_cos();
            let way = Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let y = harmonics(way);
            let mut sent = f64::from(into[1]) * henyey_greenstein(sunlight.lobe, one_minus_cos(way, sunlight.way));
            sent += f64::from(into[2]) * henyey_greenstein(narrow, one_minus_cos(way, flow.normalize()));
            sent += (0..HARMONICS).map(|i| f64::from(into[LOBES + i] * y[i])).sum::<f64>();
            sums.iter_mut().zip(y).for_each(|(sum, y)| *sum += sent * f64::from(y) * 4.0 * PI / f64::from((rows * columns) as u32));
        }
        for i in 0..HARMONICS {
            let wanted = albedo * g.powi(DEGREE[i] as i32) * f64::from(light[i]);
            assert!((sums[i] - wanted).abs() < 2e-3, "{i}: {} instead of {wanted}", sums[i]);
        }
        assert!((f64::from(into[0]) - albedo * arrives).abs() < 1e-6);
    }
}
