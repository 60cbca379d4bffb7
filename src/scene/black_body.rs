//! Black bodies: what heat looks like.

#[cfg(test)]
use std::f64::consts::PI;

/// Planck's constant (J s), the speed of light (m/s), Boltzmann's constant (J/K): exact in the SI of 2019.
const H: f64 = 6.626_070_15e-34;
const C: f64 = 299_792_458.0;
const K: f64 = 1.380_649e-23;
/// Wavelengths that are summed over, m: the first, the step, how many. The functions below vary over tens of nanometres.
const FIRST: f64 = 360e-9;
const STEP: f64 = 10e-9;
const COUNT: usize = 48;

/// The radiance of a black body at a temperature in kelvin, W m^-2 sr^-1, linear RGB (Rec. 709 primaries): Planck's law weighed by the colour
/// matching functions of CIE 1931. Its luminance is what the eye sees of its watts: 1/683 of what photometers call cd/m^2, in which sunlight
/// on the ground has some 146 W/m^2. What is redder than the primaries (below 1,900 K) has 0 blue, and its luminance in what is left.
pub fn black_body(kelvin: f64) -> [f64; 3] {
    if kelvin <= 0.0 {
        return [0.0; 3];
    }
    let (mut x, mut y, mut z) = (0.0, 0.0, 0.0);
    for i in 0..COUNT {
        let wavelength = FIRST + STEP * i as f64;
        let sent = STEP * planck(wavelength, kelvin);
        let [mx, my, mz] = matching(wavelength * 1e9);
        (x, y, z) = (x + sent * mx, y + sent * my, z + sent * mz);
    }
    // IEC 61966-2-1: from XYZ to linear RGB.
    let rgb = [
        3.240_625_5 * x - 1.537_208 * y - 0.498_628_6 * z,
        -0.968_930_7 * x + 1.875_756_1 * y + 0.041_517_5 * z,
        0.055_710_1 * x - 0.204_021_1 * y + 1.056_995_9 * z,
    ];
    let kept = rgb.map(|c| c.max(0.0));
    let whole = super::medium::luminance(kept);
    if whole > 0.0 { kept.map(|c| c * y / whole) } else { kept }
}

/// Planck's law: radiance per wavelength, W m^-3 sr^-1.
fn planck(wavelength: f64, kelvin: f64) -> f64 {
    2.0 * H * C * C / wavelength.powi(5) / (H * C / (wavelength * K * kelvin)).exp_m1()
}

/// The colour matching functions of CIE 1931 at a wavelength in nm, by the lobes of Wyman, Sloan and Shirley (2013, JCGT 2(2), listing 1).
fn matching(wavelength: f64) -> [f64; 3] {
    let lobe = |peak: f64, below: f64, above: f64| {
        let t = (wavelength - peak) * if wavelength < peak { below } else { above };
        (-0.5 * t * t).exp()
    };
    [
        0.362 * lobe(442.0, 0.0624, 0.0374) + 1.056 * lobe(599.8, 0.0264, 0.0323) - 0.065 * lobe(501.1, 0.0490, 0.0382),
        0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322),
        1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725),
    ]
}

/// All that a black body radiates, W m^-2 sr^-1 (Stefan and Boltzmann).
#[cfg(test)]
fn whole(kelvin: f64) -> f64 {
    2.0 * PI.powi(4) * K.powi(4) / (15.0 * H.powi(3) * C * C) * kelvin.powi(4)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published chromaticities of the Planckian locus: CIE illuminant A (2,856 K by today's constants), and Wyszecki and Stiles (1982) table 1(3.11).
    #[test]
    fn its_colour_is_on_the_planckian_locus() {
        for (kelvin, x, y) in [(2856.0, 0.4476, 0.4074), (2000.0, 0.5267, 0.4133), (4000.0, 0.3805, 0.3768), (6500.0, 0.3135, 0.3237)] {
            let [r, g, b] = black_body(kelvin);
            let (cx, cy, cz) = (
                0.412_39 * r + 0.357_58 * g + 0.180_48 * b,
                0.212_64 * r + 0.715_17 * g + 0.072_19 * b,
                0.019_33 * r + 0.119_19 * g + 0.950_53 * b,
            );
            let (fx, fy) = (cx / (cx + cy + cz), cy / (cx + cy + cz));
            assert!((fx - x).abs() < 0.003 && (fy - y).abs() < 0.003, "{kelvin} K: {fx} {fy}");
        }
    }

    /// Luminous efficacy of a black body: 683 lm/W times the part of its watts that the eye sees. 4,000 K: 54.7 lm/W; 7,000 K: 95 lm/W (Wikipedia,
    /// "Luminous efficacy", after black-body visible spectrum).
    #[test]
    fn its_luminance_is_what_the_eye_sees_of_its_watts() {
        for (kelvin, efficacy) in [(4000.0, 54.7), (7000.0, 95.0)] {
            let found = 683.0 * super::super::medium::luminance(black_body(kelvin)) / whole(kelvin);
            assert!((found / efficacy - 1.0).abs() < 0.03, "{kelvin} K: {found} lm/W");
        }
    }

    #[test]
    fn any_temperature_has_a_colour() {
        assert_eq!((black_body(0.0), black_body(-5.0)), ([0.0; 3], [0.0; 3]));
        let mut last = 0.0;
        for i in 1..200 {
            let rgb = black_body(10.0 * 1.06f64.powi(i));
            let grey = super::super::medium::luminance(rgb);
            assert!(rgb.iter().all(|c| c.is_finite() && *c >= 0.0) && grey >= last);
            last = grey;
        }
    }
}
