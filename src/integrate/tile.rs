//! Tiles of pixels: camera rays, their mean by layer, and how well it is known.

use super::lens::{Lens, Stratum, View};
use crate::film::{NOTHING, Pixel};
use crate::media::Scratch;
use crate::photon::GROUPS;
use crate::progress::{Parcel, Parcels, Progress, put};
use crate::rng::Rng;
use crate::scene::medium::luminance;
use glam::{DVec3, Vec3};

/// Samples of a pixel that also measure the transmittance, exactly along each ray.
const CLEAR: u32 = 8;

/// The most strata that a pixel's samples are dealt to, as a power of two.
const MOST_STRATA: u32 = 4;

/// Samples of a pixel that also look for photons twice as wide.
const WIDER: u32 = 4;

/// How a path reached the camera: the layer that its light belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layer {
    VolumeDirect,
    VolumeIndirect,
    Surface,
    Environment,
}

impl Layer {
    /// The layer of light from something of the layer `own` that is met, and that what is behind shines through.
    pub(super) fn beside(self, own: Layer) -> Layer {
        if self == Layer::Environment { own } else { self }
    }

    /// The layer of light that also passed an `event` behind what this one stands for.
    pub(super) fn then(self, event: Layer) -> Layer {
        match self {
            Layer::Environment => event,
            Layer::VolumeDirect => Layer::VolumeIndirect,
            other => other,
        }
    }
}

/// What one camera ray brings.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Arrival {
    /// Radiance by [`Layer`].
    pub light: [Vec3; 4],
    /// What of it each group of stored photons has brought.
    pub groups: [Vec3; GROUPS],
    /// By how much what photons have brought may be off for another reason than noise.
    pub doubt: Vec3,
    /// What of each group would differ, in luminance, had its photons been looked for twice as wide; where that was asked.
    pub wider: [f32; GROUPS],
    /// The mean distance to the first event, m, times the chance of one; and that chance.
    pub depth: (f64, f64),
    /// The transmittance along it up to a surface or to its end, and the chance of a surface, where that is found on the way.
    pub clear: (f64, f64),
    pub collisions: u64,
    pub truncated: u64,
}

impl Arrival {
    /// The ray's first event, if it has had none.
    #[inline]
    pub(super) fn event(&mut self, distance: f32) {
        if self.depth.1 == 0.0 {
            self.depth = (distance.into(), 1.0);
        }
    }

    /// Adds what another channel brings, tinted, of stored photons too.
    pub(super) fn add_stored(&mut self, other: &Arrival, tint: Vec3) {
        self.add(other, tint);
        for (sum, light) in self.groups.iter_mut().zip(other.groups) {
            *sum += light * tint;
        }
        self.doubt += other.doubt * tint;
        let grey = luminance(tint.as_dvec3().to_array()) as f32;
        for (sum, wider) in self.wider.iter_mut().zip(other.wider) {
            *sum += wider * grey;
        }
    }

    /// Adds what another channel brings, tinted, without stored photons.
    pub(super) fn add(&mut self, other: &Arrival, tint: Vec3) {
        for (sum, light) in self.light.iter_mut().zip(other.light) {
            *sum += light * tint;
        }
        self.depth = (self.depth.0 + other.depth.0, self.depth.1 + other.depth.1);
        self.clear = (self.clear.0 + other.clear.0, self.clear.1 + other.clear.1);
        self.collisions += other.collisions;
        self.truncated += other.truncated;
    }
}

/// How light is followed along camera rays.
pub(super) trait Transport: Sync {
    /// Room that a tile keeps from ray to ray.
    type Room: Default + Send;

    /// Whether samples are dealt to strata in turn.
    const DEALT: bool = false;

    /// Whether stored photons bring light.
    const STORED: bool = true;

    /// Whether stored photons blur: then some samples are asked what twice as wide a look would find, and each pixel's
    /// [`Pixel::bias`] is for [`crate::film::Film::spread_blur`].
    const BLURS: bool = false;

    /// Says whether the next ray is to be looked at twice as wide too.
    fn widen(_room: &mut Self::Room, _wider: bool) {}

    /// What arrives along a camera ray.
    fn arrival(&self, view: &View, rng: &mut Rng, room: &mut Self::Room) -> Arrival;

    /// The transmittance along a camera ray, which has brought what it brings, up to a surface, or to the end; and whether there is a
    /// surface.
    fn clear(&self, view: &View, brought: &Arrival, room: &mut Self::Room) -> (f64, bool);

    /// The room's part that media use.
    fn scratch(room: &Self::Room) -> &Scratch;
}

/// What a tile gives; nothing where it was left early.
#[derive(Debug, Default)]
pub(super) struct Done {
    pub pixels: Vec<Pixel>,
    pub collisions: u64,
    pub truncated: u64,
    pub violations: u64,
}

impl Parcel for Done {
    fn pack(&self, into: &mut Vec<u8>) {
        put(&self.pixels, into);
        put(&[self.collisions, self.truncated, self.violations], into);
    }

    fn unpack(from: &mut Parcels) -> Option<Self> {
        let pixels = from.take()?;
        let [collisions, truncated, violations] = from.some()?;
        Some(Done { pixels, collisions, truncated, violations })
    }
}

/// A tile at work.
#[derive(Debug, Default)]
pub(super) struct Tile<Room> {
    pub pixels: Vec<Pixel>,
    pub collisions: u64,
    pub truncated: u64,
    pub room: Room,
}

impl<Room> Tile<Room> {
    /// Without its room.
    pub(super) fn done(self, violations: u64) -> Done {
        Done { pixels: self.pixels, collisions: self.collisions, truncated: self.truncated, violations }
    }

    /// Renders one pixel: all its samples, summed in f64.
    pub(super) fn pixel<T: Transport<Room = Room>>(
        &mut self,
        transport: &T,
        lens: &Lens,
        (x, y): (u32, u32),
        spp: u32,
        rng: &mut Rng,
        progress: &dyn Progress,
    ) {
        // As many strata as have an even share of at least two.
        let bits = if T::DEALT { spp.trailing_zeros().min((spp / 2).max(1).ilog2()).min(MOST_STRATA) } else { 0 };
        let turns = if bits > 0 { rng.bits() } else { 0 };
        let (strata, across, down) = (1u32 << bits, 1u32 << bits.div_ceil(2), 1u32 << (bits / 2));
        let mut light = [DVec3::ZERO; 4];
        let mut between = [(DVec3::ZERO, DVec3::ZERO); 1 << MOST_STRATA];
        let (mut photons, mut doubt) = (Photons::default(), DVec3::ZERO);
        let (mut depth, mut events) = (0.0f64, 0.0f64);
        let (mut through, mut opaque) = (0.0f64, 0u32);
        let (mut blur, every) = (Blur::default(), (spp / WIDER).max(1));
        for sample in 0..spp {
            if sample % 64 == 63 && progress.cancelled() {
                break;
            }
            let number = sample % strata;
            let at = |whole: u32, (part, of): (u32, u32), u: f32| whole as f32 + (part as f32 + u) / of as f32;
            let view = lens.view(at(x, (number % across, across), rng.uniform_f32()), at(y, (number / across, down), rng.uniform_f32()));
            let view = View { stratum: Stratum { number, bits, turns }, ..view };
            let wider = T::BLURS && sample.is_multiple_of(every);
            if T::BLURS {
                T::widen(&mut self.room, wider);
            }
            let arrival = transport.arrival(&view, rng, &mut self.room);
            if sample < CLEAR {
                let (share, surface) = transport.clear(&view, &arrival, &mut self.room);
                (through, opaque) = (through + share, opaque + u32::from(surface));
            }
            if wider {
                blur.add(&arrival.wider);
            }
            let mut sum = DVec3::ZERO;
            for (layer, arrived) in light.iter_mut().zip(arrival.light) {
                *layer += arrived.as_dvec3();
                sum += arrived.as_dvec3();
            }
            if T::STORED {
                photons.add(&arrival.groups);
            }
            doubt += arrival.doubt.as_dvec3();
            let (far, chance) = arrival.depth;
            (depth, events) = (depth + f64::from(view.near) * chance + far * f64::from(view.cos), events + chance);
            self.collisions += arrival.collisions;
            self.truncated += arrival.truncated;
            let (first, second) = &mut between[number as usize];
            (*first, *second) = (*first + sum, *second + sum * sum);
        }
        let n = f64::from(spp);
        let rgb = |sum: DVec3| (sum / n).as_vec3().to_array();
        let each = n / f64::from(strata);
        // Of the mean of each stratum, and so of the mean of them all.
        let variance = |&(sum, squares): &(DVec3, DVec3)| (squares / each - (sum / each) * (sum / each)).max(DVec3::ZERO) / (each - 1.0);
        let count = strata as usize;
        let between_samples = between[..count].iter().map(variance).sum::<DVec3>() / (count * count) as f64;
        // A quarter is left where the photons' part, which may come out below zero, would take all.
        let of_photons = photons.variance(n);
        let noise = (between_samples + of_photons).max(0.25 * between_samples);
        let error = (noise + (doubt / n).powf(2.0)).to_array().map(f64::sqrt);
        let clear = f64::from(spp.min(CLEAR));
        self.pixels.push(Pixel {
            volume_direct: rgb(light[0]),
            volume_indirect: rgb(light[1]),
            surface: rgb(light[2]),
            environment: rgb(light[3]),
            // One sample does not know its error.
            standard_error: if spp > 1 { DVec3::from_array(error).as_vec3().to_array() } else { [f32::INFINITY; 3] },
            photon_noise: luminance(of_photons.max(DVec3::ZERO).to_array().map(f64::sqrt)) as f32,
            bias: if T::BLURS { blur.square() } else { luminance((doubt / n).abs().to_array()) as f32 },
            transmittance: (through / clear) as f32,
            opaque: (f64::from(opaque) / clear) as f32,
            depth: if events > 0.0 { (depth / events) as f32 } else { NOTHING },
        });
    }
}

/// The light of stored photons by their groups, of which each is an independent estimate of its share.
#[derive(Default)]
struct Photons {
    sums: [DVec3; GROUPS],
    /// Squared differences of the groups within each sample, summed.
    within: DVec3,
}

impl Photons {
    fn add(&mut self, groups: &[Vec3; GROUPS]) {
        let groups = groups.map(|g| g.as_dvec3());
        self.within += apart(&groups);
        for (sum, group) in self.sums.iter_mut().zip(groups) {
            *sum += group;
        }
    }

    /// What the noise of photons adds to the variance of the mean of `n` samples: what the groups differ by alike in different
    /// samples. What they differ by in one sample alone is among what samples scatter by.
    fn variance(&self, n: f64) -> DVec3 {
        let groups = GROUPS as f64;
        let between = apart(&self.sums) - self.within;
        between * (groups / (groups - 1.0)) / (n * (n - 1.0).max(1.0))
    }
}

/// By how much light differs where photons are looked for twice as wide. What they blur grows with the distance within which they are
/// found, so that it is as much.
#[derive(Default)]
struct Blur {
    photons: Photons,
    count: f64,
    sum: f64,
    squares: f64,
}

impl Blur {
    fn add(&mut self, wider: &[f32; GROUPS]) {
        self.photons.add(&wider.map(Vec3::splat));
        let all: f64 = wider.iter().map(|&w| f64::from(w)).sum();
        self.count += 1.0;
        self.sum += all;
        self.squares += all * all;
    }

    /// The square of the difference without what noise makes of it: right in the mean, and below zero now and then.
    fn square(&self) -> f32 {
        if self.count < 2.0 {
            return 0.0;
        }
        let mean = self.sum / self.count;
        let between = (self.squares / self.count - mean * mean).max(0.0) / (self.count - 1.0);
        let noise = (between + self.photons.variance(self.count).x).max(0.25 * between);
        (mean * mean - noise) as f32
    }
}

/// Squared differences of the groups from their mean, summed.
fn apart(groups: &[DVec3; GROUPS]) -> DVec3 {
    let mean = groups.iter().copied().sum::<DVec3>() / GROUPS as f64;
    groups.iter().map(|&g| (g - mean) * (g - mean)).sum()
}
