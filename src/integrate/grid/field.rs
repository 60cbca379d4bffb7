//! Light that has scattered more than once, in voxels.
//!
//! Photons are followed as in pass 1, and at even distances along every flight leave in the voxel they are in what they would send
//! toward the camera: power times distance times phase function over volume, an unbiased estimate of the mean, over the medium in the
//! voxel, of the integral of radiance times phase function (a track-length estimator). Each order of scattering is smoothed over a distance
//! that fits it ([`super::fit`]), and rays look the sum up. What smoothing costs is told by the comparison with
//! [`crate::integrate::Integrator::Path`].

use super::basis::Basis;
use super::deposit::{Gathered, gather};
use super::fit::{Fit, needed};
use super::orders::{Orders, Through};
use super::space::Space;
use crate::bvh::Box3;
use crate::error::Result;
use crate::media::Media;
use crate::photon::{GROUPS, SimilarMedia, Tracer};
use crate::progress::Progress;
use crate::scene::{Scene, medium::luminance};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// What each group of photons brings, W m^-2 sr^-1.
pub(super) type Groups = [f32; GROUPS];
/// As many groups as are smoothed at once: what memory that takes.
const LANES: usize = 8;

/// What a field is for.
pub(super) struct Request<'a> {
    pub scene: &'a Scene,
    pub media: &'a Media,
    pub basis: Basis,
    pub orders: Orders,
    /// Of the local space, in the world.
    pub origin: DVec3,
    /// Whether light in a box is asked for.
    pub seen: &'a (dyn Fn(Box3) -> bool + Sync),
    /// The first item of [`Tracer::follow`], and the seed.
    pub first: u64,
    pub seed: u64,
    /// Voxels at most, and how much wider than usual.
    pub voxels: usize,
    pub coarser: f64,
}

/// Light that was looked up, summed over places.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Found {
    /// Luminance by groups.
    pub groups: Groups,
    /// By channel, all groups together.
    pub rgb: Vec3,
    /// By how much smoothing may be off, as a luminance.
    pub doubt: f32,
}

impl Found {
    /// Adds what else was found.
    pub fn add(&mut self, other: &Found) {
        self.groups.iter_mut().zip(other.groups).for_each(|(sum, group)| *sum += group);
        self.rgb += other.rgb;
        self.doubt += other.doubt;
    }

    /// By what luminance is to be multiplied for the colour of the whole.
    pub fn tint(&self) -> Vec3 {
        let whole: f32 = self.groups.iter().sum();
        if whole > 0.0 { (self.rgb / whole).clamp(Vec3::ZERO, Vec3::splat(VIVID)) } else { Vec3::ONE }
    }
}

/// The largest that a channel can be of a luminance: blue alone.
const VIVID: f32 = 1.0 / 0.0722;

/// The luminance of a colour.
pub(super) fn grey(rgb: Vec3) -> f32 {
    luminance(rgb.as_dvec3().to_array()) as f32
}

/// Light in voxels.
#[derive(Debug)]
pub(super) struct Field {
    basis: Basis,
    orders: Orders,
    space: Space,
    /// How many items of photons each group has brought; the first item, and the seed.
    items: u64,
    first: u64,
    seed: u64,
    coarser: f64,
    /// What is seen through the scene's own media, and through similar ones; without voxels where nothing is.
    own: Stored,
    similar: Stored,
    /// Whether a voxel has medium around it.
    lit: Vec<bool>,
}

/// Light of each voxel and number of the basis, per unit of optical depth of the media through which it is seen, and of albedo.
#[derive(Debug, Default)]
struct Stored {
    /// Luminance by groups, and the channels of all groups together.
    light: Vec<Groups>,
    rgb: Vec<[f32; 3]>,
    /// By how much smoothing may be off there, all groups together.
    doubt: Vec<f32>,
}

impl Field {
    /// Voxels for the light of a scene, which is dark yet.
    pub(super) fn new(request: Request) -> Self {
        let Request { first, seed, coarser, .. } = request;
        let space = Space::new(&request);
        let Request { basis, orders, .. } = request;
        Field { basis, orders, space, items: 0, first, seed, coarser, own: Stored::default(), similar: Stored::default(), lit: vec![] }
    }

    /// Whether some of its light is seen through the scene's own media.
    pub(super) fn seen_through_own(&self) -> bool {
        !self.own.light.is_empty()
    }

    /// The media through which the rest is seen, where they are not the scene's own.
    pub(super) fn similar(&self) -> Option<&SimilarMedia> {
        self.orders.similar()
    }

    /// By what share of itself its light may be off for that.
    pub(super) fn off(&self) -> f32 {
        self.orders.off()
    }

    /// Follows so many photons, and smooths their light.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(super) fn brighten(&mut self, (tracer, media): (&Tracer, &Media), photons: u64, progress: &dyn Progress) -> Result<()> {
        let mut gathered = Gathered::empty(&self.space, &self.basis, self.orders.count(), tracer.tint().is_none());
        self.items = photons.div_ceil(GROUPS as u64 * Tracer::PATHS);
        gather((tracer, media, &self.basis, &self.orders), &self.space, (self.first, self.items), self.seed, &mut gathered, progress)?;
        let crowd = self.photons() as f64 / (tracer.silhouette() * self.space.usual.powi(2));
        progress.begin("smoothing", self.orders.count() as u64);
        let (Space { frame, fill, usual, .. }, numbers) = (&self.space, self.basis.len());
        let needed = needed(frame, fill);
        (self.own, self.similar) = (Stored::default(), Stored::default());
        let mut colours = [vec![], vec![]];
        self.lit = vec![true; frame.voxels()];
        // Each group is an estimate of its own; their mean is the field.
        let each = (1.0 / self.photons() as f64) as f32;
        for (class, (gathered, colour_of)) in gathered.light.iter().zip(&gathered.colour).enumerate() {
            progress.check()?;
            let (stored, colour) = match self.orders.through(class) {
                Through::Own => (&mut self.own, &mut colours[0]),
                Through::Similar => (&mut self.similar, &mut colours[1]),
            };
            stored.light.resize(frame.voxels() * numbers, [0.0; GROUPS]);
            stored.doubt.resize(frame.voxels() * numbers, 0.0);
            colour.resize(frame.voxels() * numbers, [0.0f32; 2]);
            progress.at(class as u64);
            let fit = Fit::new(frame, fill, &needed, self.coarser * self.orders.kernel(class, crowd, *usual) / f64::from(frame.step));
            self.lit.iter_mut().enumerate().for_each(|(voxel, lit)| *lit &= fit.holds(voxel));
            for number in 0..numbers {
                if !colour_of.is_empty() {
                    let one: Vec<[f32; 2]> = (0..frame.voxels()).map(|i| colour_of[i * numbers + number].map(|c| each * c)).collect();
                    for (sum, add) in colour.iter_mut().skip(number).step_by(numbers).zip(fit.smooth(&one).0) {
                        *sum = [sum[0] + add[0], sum[1] + add[1]];
                    }
                }
                for first in (0..GROUPS).step_by(LANES) {
                    let part =
                        |i: usize| -> [f32; LANES] { std::array::from_fn(|lane| each * gathered[i * numbers + number][first + lane]) };
                    let one: Vec<[f32; LANES]> = (0..frame.voxels()).into_par_iter().map(part).collect();
                    let (smooth, last) = fit.smooth(&one);
                    for (sum, add) in stored.light.iter_mut().skip(number).step_by(numbers).zip(smooth) {
                        sum[first..].iter_mut().zip(add).for_each(|(s, a)| *s += a);
                    }
                    for (sum, add) in stored.doubt.iter_mut().skip(number).step_by(numbers).zip(last) {
                        *sum += add.iter().sum::<f32>();
                    }
                }
            }
        }
        // The three channels of a luminance of which red and blue are known.
        let rgb = |(groups, [red, blue]): (&Groups, [f32; 2])| {
            let whole: f32 = groups.iter().sum();
            match tracer.tint() {
                Some(tint) => (tint * whole).to_array(),
                None => [red, (whole - 0.2126 * red - 0.0722 * blue) / 0.7152, blue],
            }
        };
        for (stored, colour) in [&mut self.own, &mut self.similar].into_iter().zip(colours) {
            stored.rgb = stored.light.iter().zip(colour).map(rgb).collect();
        }
        Ok(())
    }

    /// Paths that have been followed.
    pub(super) fn photons(&self) -> u64 {
        self.items * GROUPS as u64 * Tracer::PATHS
    }

    /// Adds `share`, by channel, of the light that scattering with mean cosine `g` at `p` sends into `outward`, per unit of optical depth
    /// and of albedo, as far as it is seen through such media. In the field of a camera `outward` is the way to it.
    #[inline]
    pub(super) fn scattered(&self, through: Through, (p, outward): (Vec3, Vec3), g: f64, share: Vec3, into: &mut Found) {
        let stored = if through == Through::Own { &self.own } else { &self.similar };
        let (mut whole, mut found, mut count) = (0.0f32, [(0usize, 0.0f32); 8], 0);
        self.space.frame.around(p, |voxel, weight| {
            if self.lit[voxel] {
                whole += weight;
                found[count] = (voxel, weight);
                count += 1;
            }
        });
        if whole <= 0.0 {
            return;
        }
        let numbers = self.basis.len();
        let of_grey = grey(share);
        for &(voxel, weight) in &found[..count] {
            let weight = weight / whole;
            self.basis.shares(g, outward, |number, part| {
                let (place, part) = (voxel * numbers + number, weight * part);
                into.groups.iter_mut().zip(&stored.light[place]).for_each(|(s, &l)| *s += of_grey * part * l);
                into.rgb += share * part * Vec3::from_array(stored.rgb[place]);
                into.doubt += of_grey * part * stored.doubt[place];
            });
        }
    }

    /// Voxels.
    pub(super) fn voxels(&self) -> u64 {
        self.space.frame.voxels() as u64
    }
}
