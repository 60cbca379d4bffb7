//! Orders of scattering: what has scattered alike often is smoothed alike; and in what media it is followed.

use super::aspect::{Aspect, FEWEST};
use crate::photon::SimilarMedia;
use crate::scene::{Region, Scene};
use glam::DVec3;

/// The last order of each class of light, and the usual standard deviation of its kernel in mean free paths.
const ALL: [(u64, f64); 5] = [(2, 0.55), (4, 0.8), (8, 1.2), (16, 1.7), (u64::MAX, 2.4)];
/// The same of light for surfaces and air, which see it from afar and all at once.
const AFAR: [(u64, f64); 2] = [(4, 0.8), (u64::MAX, 1.7)];
/// The same where light is followed in similar media: that of the first [`FEWEST`] scatterings in the scene's own, and what scattered in others,
/// which count fewer.
const SIMILAR: [(u64, f64); 3] = [(FEWEST, 0.8), (FEWEST + 2, 1.2), (u64::MAX, 2.2)];
/// Media may be as far from the scene's as this where so many photons start over each square mean free path, and less by this power of their
/// number where they are more, so that what that is off by falls as noise does; and no farther than [`FARTHEST`].
const FAR: f64 = 0.9;
const FEW: f64 = 84.0;
const NEARER: f64 = 0.1;
const FARTHEST: f64 = 0.97;
/// By how much light in the farthest may be off: so much it was found to be, in blocks of pixels, against the path tracer. It falls about as this
/// power of how far they are.
const OFF: f64 = 0.016;
const FALLS: i32 = 5;
/// Below so many photons over a square mean free path kernels grow by another power of their number, and never to more than so many times.
const SPARSE: f64 = 25.0;
const FASTER: f64 = 0.3;
const WIDEST: f64 = 3.5;
/// No kernel is narrower for the sake of a peak than so many mean free paths.
const NARROW: f64 = 0.1;

/// No kernel is wider than this part of the distance over which light that is absorbed on its way falls to 1/e (the diffusion length).
const FADING: f64 = 0.5;

/// Through which media light is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Through {
    Own,
    Similar,
}

/// How the orders of a field are dealt with.
#[derive(Debug)]
pub(super) struct Orders {
    /// With how far they are ([`crate::scene::Similar::to`]).
    similar: Option<(SimilarMedia, f64)>,
    /// Scatterings in the scene's own media before similar ones pass for them: light of fewer orders is seen through its own, too.
    own: u64,
    classes: Vec<(u64, f64)>,
    /// The widest kernel of light that keeps a peak, m.
    sharp: f64,
    /// The widest kernel for light that is absorbed on its way, in mean free paths.
    fading: f64,
}

impl Orders {
    /// All of them in the scene's own media.
    pub fn own(scene: &Scene) -> Self {
        let length = |r: &Region| 1.0 / (3.0 * (1.0 - r.medium.albedo()) * (1.0 - r.medium.albedo() * r.medium.g)).sqrt();
        let fading = FADING * scene.regions.iter().map(length).fold(f64::INFINITY, f64::min);
        Orders { similar: None, own: u64::MAX, classes: ALL.to_vec(), sharp: f64::INFINITY, fading }
    }

    /// The same for light that is not looked at but lights surfaces and air.
    pub fn afar(scene: &Scene) -> Self {
        Orders { classes: AFAR.to_vec(), ..Orders::own(scene) }
    }

    /// After so many scatterings in similar media, where the scene has peaked phase functions: the nearer to its own, the more photons start over
    /// each square mean free path (`crowd`).
    pub fn similarly(scene: &Scene, origin: DVec3, crowd: f64, aspect: &Aspect) -> Self {
        let part = (FAR * (FEW / crowd).powf(NEARER)).min(FARTHEST);
        let Some(similar) = SimilarMedia::of(scene, part, origin) else { return Orders { sharp: aspect.sharp, ..Orders::own(scene) } };
        let own = aspect.own;
        let mut classes = SIMILAR.to_vec();
        if own > FEWEST {
            let width = |order: u64| ALL.iter().find(|(last, _)| *last >= order).map_or(0.0, |class| class.1);
            let lasts = [2, 4.min(own - 1), own - 1, own + 2];
            classes = lasts.map(|last| (last, width(last.min(own)))).to_vec();
            classes.dedup_by_key(|class| class.0);
            classes.push(SIMILAR[2]);
        }
        Orders { similar: Some((similar, part)), own, classes, sharp: aspect.sharp, ..Orders::own(scene) }
    }

    /// How far the similar media are from the scene's.
    pub fn part(&self) -> Option<f64> {
        self.similar.as_ref().map(|similar| similar.1)
    }

    /// By what share of itself light in similar media may be off.
    pub fn off(&self) -> f32 {
        self.part().map_or(0.0, |part| OFF * (part / FARTHEST).powi(FALLS)) as f32
    }

    /// How many classes there are.
    pub fn count(&self) -> usize {
        self.classes.len()
    }

    /// The standard deviation of a class's kernel, m, where extinction is `usual` (1/m) and so many photons start over each square mean free path.
    /// The kernel that is best grows slowly as they get fewer: with twicing its bias falls as a high power of its width. Where they are very
    /// few, pixels are wider than mean free paths, and it grows faster. Light that keeps a peak, the wider the more often it has scattered, is
    /// smoothed over less than shows; but not over less than [`NARROW`] free paths.
    pub fn kernel(&self, class: usize, crowd: f64, usual: f64) -> f64 {
        let through = self.through(class);
        let (fine, power, sparse) = if through == Through::Similar { (100.0, 1.0 / 8.0, SPARSE) } else { (200.0, 1.0 / 11.0, 0.0) };
        let faster = (sparse / crowd).max(1.0).powf(FASTER);
        let free_paths = self.classes[class].1 * ((fine / crowd).powf(power).clamp(0.4, 2.0) * faster).min(WIDEST);
        let wide = free_paths.min(self.fading) / usual;
        let before = if class == 0 { 1 } else { self.classes[class - 1].0 };
        wide.min((self.sharp * (before as f64).sqrt()).max(NARROW / usual))
    }

    /// The class of an order of scattering.
    #[inline]
    pub fn class(&self, order: u64) -> usize {
        self.classes.iter().filter(|&&(last, _)| last < order).count()
    }

    /// Through which media a class is seen.
    pub fn through(&self, class: usize) -> Through {
        if self.similar.is_none() || self.classes[class].0 < self.own { Through::Own } else { Through::Similar }
    }

    /// In which media light scatters for the last time that has scattered so often, and through which it is seen.
    #[inline]
    pub fn last(&self, order: u64) -> (Through, Through) {
        let side = |own: bool| if own { Through::Own } else { Through::Similar };
        (side(order <= self.own), side(order < self.own))
    }

    /// The similar media.
    #[inline]
    pub fn similar(&self) -> Option<&SimilarMedia> {
        self.similar.as_ref().map(|similar| &similar.0)
    }

    /// The media that light meets that has scattered so often, where they are not the scene's own.
    #[inline]
    pub fn met(&self, events: u64) -> Option<&SimilarMedia> {
        self.similar().filter(|_| events >= self.own)
    }
}
