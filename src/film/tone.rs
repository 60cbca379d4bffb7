//! From radiance to a display: AgX, the view transform that Blender shows a new scene with.
//!
//! Troy Sobotka's AgX in Eary Chow's form (github.com/EaryChow/AgX_LUT_Gen, `AgXBaseRec2020.py`), from whose tables
//! Blender has its own since 4.0. A preview looks as the EXR does once it is opened there. Eary Chow's corrections for
//! colours outside of Rec. 709 are left out: a pure red or a saturated orange differs from Blender by up to 0.04, grey by
//! 0.001. A curve for each channel alone would turn a blue sky violet and a low sun yellow, which the matrices prevent.

/// Linear Rec. 709 to Rec. 2020 (ITU-R BT.2087), and from there by AgX's inset to the primaries in which the curve acts.
const INSET: [[f64; 3]; 3] =
    [[0.544814747, 0.373787398, 0.081397855], [0.140416948, 0.754137554, 0.105445498], [0.08881042, 0.178871756, 0.732317824]];
/// AgX's outset to linear Rec. 2020, and back to Rec. 709.
const OUTSET: [[f64; 3]; 3] =
    [[1.964887411, -0.855988495, -0.108898916], [-0.299313364, 1.326397964, -0.0270846], [-0.164352743, -0.23818397, 1.402536713]];
/// The radiance of mid-grey: it stays what it is.
const GREY: f64 = 0.18;
/// Stops below and above mid-grey at which black and white are reached.
const STOPS: [f64; 2] = [10.0, 6.5];
/// The curve's slope at mid-grey, and the power of its toe and its shoulder.
const SLOPE: f64 = 2.4;
const POWER: f64 = 1.5;
/// What the curve's values are raised to for linear light.
const DISPLAY: f64 = 2.4;

/// The colour of a display (sRGB, encoded, 0 to 1) for a radiance (linear Rec. 709, 1 being a white surface in the light for which the
/// picture is exposed). Greys become greys, brighter ones with more light; black is 0, white is reached at 16.3.
///
/// Negative values and those that are not numbers count as none, infinite ones as more than enough.
pub fn agx(radiance: [f64; 3]) -> [f64; 3] {
    // `max` gives back its other argument for NaN; beyond 1e30 all is white, and nothing overflows.
    let light = times(&INSET, radiance.map(|c| c.clamp(0.0, 1e30).max(0.0)));
    times(&OUTSET, light.map(|c| curve(((c / GREY).log2() + STOPS[0]) / (STOPS[0] + STOPS[1])).powf(DISPLAY))).map(srgb)
}

/// The curve between black and white: `x` is the exposure's logarithm, 0 to 1.
fn curve(x: f64) -> f64 {
    let pivot = [STOPS[0] / (STOPS[0] + STOPS[1]), GREY.powf(1.0 / DISPLAY)];
    // The branches end there too, but for a rounding.
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    let x = x - pivot[0];
    // One branch of t / (1 + t^p)^(1/p), scaled so that it ends `height` above the pivot, `width` from it.
    let branch = |width: f64, height: f64| {
        let rise = SLOPE * width;
        let scale = rise / ((rise / height).powf(POWER) - 1.0).powf(1.0 / POWER);
        let t = SLOPE * x.abs() / scale;
        scale * t / (1.0 + t.powf(POWER)).powf(1.0 / POWER)
    };
    if x < 0.0 { pivot[1] - branch(pivot[0], pivot[1]) } else { pivot[1] + branch(1.0 - pivot[0], 1.0 - pivot[1]) }
}

/// The encoding of IEC 61966-2-1.
fn srgb(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

fn times(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(radiance: f64) -> f64 {
        agx([radiance; 3])[1]
    }

    #[test]
    fn black_mid_grey_and_white_are_where_they_should_be() {
        assert_eq!(agx([0.0; 3]), [0.0; 3]);
        assert!((grey(GREY) - srgb(GREY)).abs() < 1e-6, "{}", grey(GREY));
        assert!((grey(GREY * 2f64.powf(6.5)) - 1.0).abs() < 1e-6);
        assert!((grey(1e9) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn greys_stay_grey_rise_and_roll_off() {
        let steps: Vec<f64> = (-120..=80).map(|i| 2f64.powf(f64::from(i) / 10.0)).collect();
        for pair in steps.windows(2) {
            let [a, b] = [grey(pair[0]), grey(pair[1])];
            assert!(a <= b && b - a < 0.016, "{pair:?}: {a} {b}");
            assert!(agx([pair[0]; 3]).iter().all(|c| (c - a).abs() < 1e-6));
        }
        // Each stop above white gains less than the one before.
        let gains: Vec<f64> = (0..4).map(|i| grey(2f64.powi(i + 1)) - grey(2f64.powi(i))).collect();
        assert!(gains.windows(2).all(|g| g[1] < g[0]) && gains[3] > 0.0, "{gains:?}");
    }

    /// What Blender 4.5 writes as PNG for these radiances, with its view transform AgX.
    #[test]
    fn it_is_blenders() {
        let blender = [
            ([0.02; 3], [0.1250; 3]),
            ([0.1; 3], [0.3402; 3]),
            ([0.5; 3], [0.6652; 3]),
            ([1.0; 3], [0.7710; 3]),
            ([4.0; 3], [0.9137; 3]),
            ([16.0; 3], [0.9986; 3]),
            ([1.0, 0.9, 0.7], [0.7706, 0.7534, 0.7226]),
            ([0.18, 0.02, 0.02], [0.4468, 0.1297, 0.1140]),
            ([0.05, 0.1, 0.3], [0.2276, 0.3705, 0.5788]),
            ([0.1, 0.2, 0.6], [0.3794, 0.5129, 0.7145]),
            ([0.0, 0.0, 1.0], [0.0790, 0.3376, 0.8215]),
            ([4.0, 1.0, 0.2], [0.9564, 0.7626, 0.6643]),
        ];
        for (radiance, shown) in blender {
            let ours = agx(radiance);
            let allowed = if radiance[0] == radiance[2] { 0.0012 } else { 0.03 };
            assert!(ours.iter().zip(shown).all(|(a, b)| (a - b).abs() < allowed), "{radiance:?}: {ours:?} {shown:?}");
        }
    }

    #[test]
    fn colours_keep_their_order() {
        // A low sun and a blue sky at any exposure: red stays above green above blue, and the other way round.
        for stops in -8..8 {
            let [r, g, b] = agx([1.0, 0.6, 0.3].map(|c| c * 2f64.powi(stops)));
            assert!(r >= g && g >= b, "{stops}: {r} {g} {b}");
            let [r, g, b] = agx([0.2, 0.4, 1.0].map(|c| c * 2f64.powi(stops)));
            assert!(b >= g && g >= r, "{stops}: {r} {g} {b}");
        }
    }

    #[test]
    fn what_is_no_radiance_is_shown_all_the_same() {
        assert_eq!(agx([-1.0, f64::NAN, f64::NEG_INFINITY]), [0.0; 3]);
        assert!(agx([f64::INFINITY; 3]).iter().all(|c| (c - 1.0).abs() < 1e-6));
        for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -0.0, f64::MIN_POSITIVE] {
            assert!(agx([odd, 0.5, 0.1]).iter().all(|c| (0.0..=1.0).contains(c)), "{odd}");
        }
    }
}
