//! What of the spectrum is followed together: all three channels where the regions' extinction is grey, else each on its own.

use crate::media::Media;
use crate::media::air::Atmosphere;
use crate::scene::{Region, Scene};
use glam::{DVec3, Vec3};

/// Channels that share every free flight.
#[derive(Debug, Clone)]
pub(super) struct Band {
    pub media: Media,
    pub air: Atmosphere,
    /// 1 for each channel that this band stands for.
    pub mask: Vec3,
    /// Of each region: albedo by channel, and mean cosine.
    pub optics: Vec<(Vec3, f64)>,
}

/// The bands of a scene: one where the regions' extinction is grey, three else; their media know the shade of a sun in
/// direction `toward_sun`.
pub(super) fn bands(scene: &Scene, origin: DVec3, toward_sun: Option<Vec3>) -> Vec<Band> {
    let alike = |t: [f64; 3]| t.iter().all(|&c| (c - t[0]).abs() <= 1e-12 * t[0].abs());
    let grey = scene.regions.iter().all(|r| alike(r.medium.sigma_t_rgb()));
    let one = |mask: Vec3, channel: Option<usize>| {
        let regions: Vec<Region> =
            scene.regions.iter().map(|r| Region { medium: channel.map_or(r.medium, |c| r.medium.channel(c)), ..r.clone() }).collect();
        let optics = regions.iter().map(|r| (DVec3::from_array(r.medium.albedo_rgb()).as_vec3(), r.medium.g)).collect();
        let mut media = Media::new(&regions, origin);
        if let Some(toward) = toward_sun {
            media.learn_shade(toward);
        }
        let air = channel.map_or(scene.air, |c| scene.air.coloured(|rgb| [rgb[c]; 3]));
        Band { media, air: Atmosphere::new(&air, origin), mask, optics }
    };
    if grey { vec![one(Vec3::ONE, None)] } else { (0..3).map(|c| one(Vec3::AXES[c], Some(c))).collect() }
}
