//! The film: what each pixel has received, by the way the light came.

mod around;
pub mod tone;

use crate::scene::medium::luminance;

/// The depth of a pixel whose rays meet nothing, as Cycles writes it.
pub const NOTHING: f32 = 1e10;

/// What a pixel has received: radiance in W m^-2 sr^-1, linear RGB, the mean over the pixel's square (box filter).
#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Pixel {
    /// Light that scattered once, in a medium, on its way to the camera.
    pub volume_direct: [f32; 3],
    /// Light whose last event before the camera was a medium's, and that scattered more than once.
    pub volume_indirect: [f32; 3],
    /// Light that came from a surface.
    pub surface: [f32; 3],
    /// The sky, seen through whatever is before it.
    pub environment: [f32; 3],
    /// The standard error (one sigma) of the sum of the four; by [`crate::integrate::Integrator::Grid`] with what smoothing may be off, by
    /// [`crate::integrate::Integrator::Photon`] with what photons blur.
    pub standard_error: [f32; 3],
    /// What of that is noise of photons, which they all share, in luminance; 0 where none are stored.
    pub photon_noise: f32,
    /// What of that is no noise but what smoothing may be off, or photons blur, in luminance.
    pub bias: f32,
    /// The share of light from behind all media, or from the surface that is met, that reaches the camera unscattered.
    pub transmittance: f32,
    /// The share of rays that end at a surface.
    pub opaque: f32,
    /// The mean distance along the camera's axis to the first event in a medium or on a surface, m; [`NOTHING`] without one.
    pub depth: f32,
}

impl Pixel {
    /// A pixel of which nothing is known.
    pub const UNKNOWN: Pixel = Pixel {
        volume_direct: [0.0; 3],
        volume_indirect: [0.0; 3],
        surface: [0.0; 3],
        environment: [0.0; 3],
        standard_error: [f32::INFINITY; 3],
        photon_noise: 0.0,
        bias: 0.0,
        transmittance: 1.0,
        opaque: 0.0,
        depth: NOTHING,
    };

    /// All light.
    pub fn combined(&self) -> [f32; 3] {
        std::array::from_fn(|c| self.volume_direct[c] + self.volume_indirect[c] + self.surface[c] + self.environment[c])
    }

    /// How much of the pixel is covered, 0 to 1: what neither passes the media nor misses the surfaces.
    pub fn coverage(&self) -> f32 {
        1.0 - self.transmittance * (1.0 - self.opaque)
    }
}

/// A picture: rows from the top, pixels from the left.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels, row by row.
    pub pixels: Vec<Pixel>,
    /// Whether there is a sky: then the picture is opaque, and else its alpha is [`Pixel::coverage`].
    pub sky: bool,
}

impl Film {
    /// How opaque a pixel of this film is, 0 to 1: wholly before a sky, and else by its [`Pixel::coverage`].
    pub fn alpha(&self, pixel: &Pixel) -> f32 {
        if self.sky { 1.0 } else { pixel.coverage() }
    }

    /// The mean luminance over the picture.
    pub fn mean(&self) -> f64 {
        self.pixels.iter().map(|p| grey(p.combined())).sum::<f64>() / self.pixels.len() as f64
    }

    /// The relative standard error of a pixel: the root of the mean squared one, over the mean luminance.
    ///
    /// Pixels are weighed alike; those that receive nothing and know it do not make it smaller. `None` where no pixel receives
    /// light, or an error is not known.
    pub fn relative_error(&self) -> Option<f64> {
        self.relative(|p| grey(p.standard_error).powi(2))
    }

    /// What of [`Film::relative_error`] is noise.
    pub fn relative_noise(&self) -> Option<f64> {
        self.relative(|p| (grey(p.standard_error).powi(2) - f64::from(p.bias).powi(2)).max(0.0))
    }

    /// What of it is noise of photons.
    pub fn relative_photon_noise(&self) -> Option<f64> {
        self.relative(|p| f64::from(p.photon_noise).powi(2))
    }

    /// What of it is no noise but what smoothing may be off, or photons blur.
    pub fn relative_bias(&self) -> Option<f64> {
        self.relative(|p| f64::from(p.bias).powi(2))
    }

    /// The root of the mean of squares over pixels that receive light, over their mean luminance.
    fn relative(&self, square: impl Fn(&Pixel) -> f64) -> Option<f64> {
        let lit = self.pixels.iter().filter(|p| grey(p.combined()) > 0.0);
        let (n, error, sum) = lit.fold((0.0, 0.0, 0.0), |(n, error, sum), p| (n + 1.0, error + square(p), sum + grey(p.combined())));
        Some((error / n).sqrt() / (sum / n)).filter(|error| error.is_finite() && sum > 0.0)
    }
}

fn grey(rgb: [f32; 3]) -> f64 {
    luminance(rgb.map(f64::from))
}
