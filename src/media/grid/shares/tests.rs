//! Bounds against the samples themselves.

use super::*;
use crate::rng::{Rng, Stage};

#[test]
fn every_sample_lies_between_its_bounds() {
    let mut rng = Rng::new(8, Stage::Regions, 0);
    let most = [0.0, 1e-45, 1e-38, 3e-36, 1e-20, 1.0, 7e10, f32::MAX];
    let draw = |most: f32, rng: &mut Rng| match (rng.uniform() * 4.0) as u32 {
        0 => 0.0,
        1 => most,
        // Just at and beside a whole number of parts.
        2 => (most / 255.0 * (rng.uniform_f32() * 256.0).floor()).min(most).next_down().max(0.0),
        _ => most * rng.uniform_f32(),
    };
    let samples: Vec<f32> = most.iter().flat_map(|&most| (0..BRICK_VOXELS).map(|_| draw(most, &mut rng)).collect::<Vec<_>>()).collect();
    let shares = Shares::new(&samples);
    for (i, &sample) in samples.iter().enumerate() {
        let (brick, voxel) = (i / BRICK_VOXELS, (i % BRICK_VOXELS) as i32);
        // Anywhere on the lattice: only the place within the brick counts.
        let at = IVec3::new(voxel >> 6, voxel >> 3 & 7, voxel & 7) + IVec3::new(8, 640, 16);
        let (least, largest) = shares.bounds(brick, at);
        assert!(least.is_nan() || least <= sample, "{sample:e} of {:e}: not {least:e}", most[brick]);
        assert!(sample <= largest, "{sample:e} of {:e}: not {largest:e}", most[brick]);
        if (1e-30..1e30).contains(&most[brick]) {
            assert!(largest - least <= 2.001 / 255.0 * most[brick], "{least:e} to {largest:e} of {:e}", most[brick]);
        }
    }
    assert_eq!(shares.bounds(most.len(), IVec3::ZERO), (0.0, 0.0));
}
