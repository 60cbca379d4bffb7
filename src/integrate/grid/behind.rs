//! What shows what light in similar media sends toward a camera, in a medium that has the scene's own extinction.
//!
//! Along a camera ray radiance L through similar media, of `ratio` times the extinction, grows by ratio (J - L) per unit of the scene's own
//! optical depth, where J is what they send. A medium of the scene's extinction that sends q makes it grow by q - L: by the same where
//! q = ratio J + (1 - ratio) L. So next to J goes L, what arrives from behind a point on its way to the camera.

use super::space::Space;
use crate::geom::Ray;
use crate::media::Media;
use crate::photon::SimilarMedia;
use crate::scene::density::BRICK_VOXELS;
use crate::trimesh::TriMesh;
use glam::Vec3;
use rayon::prelude::*;

/// Steps of the march, in voxels; and the transmittance below which nothing is seen.
const STEP: f32 = 1.5;
const OPAQUE: f32 = 0.003;

/// Radiance at the voxels' centres that similar media behind them send toward `eye`. `sent` is what a region sends there, per unit of their optical
/// depth and of albedo: of a voxel's number, for a mean cosine.
pub(super) fn behind(
    space: &Space,
    (media, similar): (&Media, &SimilarMedia),
    surfaces: &TriMesh,
    eye: Vec3,
    sent: impl Fn(usize, f64) -> f32 + Sync,
) -> Vec<f32> {
    let (frame, step) = (&space.frame, space.frame.step);
    let centre = |voxel: usize| {
        let within = Vec3::new((voxel >> 6 & 7) as f32, (voxel >> 3 & 7) as f32, (voxel & 7) as f32);
        frame.corner(voxel / BRICK_VOXELS) + (within + 0.5) * step
    };
    // Of each voxel, per voxel's length: optical depth, and what it sends.
    let of_voxel = |(voxel, fill): (usize, &super::fit::Fill)| {
        let mut here = [0.0f32; 2];
        if fill.share > 0.0 {
            media.regions_at(centre(voxel) + fill.middle * step, |region, sigma_t| {
                let depth = (sigma_t * similar.ratio(region)) as f32 * step * fill.share;
                let albedo = similar.media.optics(region).albedo as f32;
                here = [here[0] + depth, here[1] + depth * albedo * sent(voxel, media.optics(region).g)];
            });
        }
        here
    };
    let medium: Vec<[f32; 2]> = space.fill.par_iter().enumerate().map(of_voxel).collect();
    let one = |voxel: usize| {
        let p = centre(voxel);
        let Some(direction) = (p - eye).try_normalize() else { return 0.0 };
        let ray = Ray { origin: p, direction };
        let reach =
            if surfaces.is_empty() { f32::INFINITY } else { surfaces.nearest(&ray, f32::INFINITY).map_or(f32::INFINITY, |hit| hit.t) };
        let reach = frame.leaves(&ray).min(reach);
        let (mut light, mut clear, mut at) = (0.0f32, 1.0f32, 0.0f32);
        while at < reach && clear > OPAQUE {
            let length = (STEP * step).min(reach - at);
            let [mut depth, mut emitted] = [0.0f32; 2];
            frame.around(ray.at(at + 0.5 * length), |voxel, weight| {
                (depth, emitted) = (depth + weight * medium[voxel][0], emitted + weight * medium[voxel][1]);
            });
            if depth > 0.0 {
                let kept = (-depth * length / step).exp();
                light += clear * emitted / depth * (1.0 - kept);
                clear *= kept;
            }
            at += STEP * step;
        }
        light
    };
    (0..frame.voxels()).into_par_iter().map(one).collect()
}
