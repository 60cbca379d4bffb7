//! The photon map: stored photons by region, and trees over them. The only place that names kiddo.

use super::{Photon, bounds};
use crate::bvh::Box3;
use glam::{DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

/// The stored photons, sorted by region once it is finished.
#[derive(Debug, Clone)]
pub struct PhotonMap {
    /// World position of the map's origin; photons are relative to it.
    pub origin: DVec3,
    photons: Vec<Photon>,
    /// The first photon of each region, and their total.
    starts: Vec<usize>,
}

impl PhotonMap {
    /// An empty map with room for `capacity` photons.
    pub fn new(origin: DVec3, capacity: u64) -> Self {
        // Room for what is likely, not for what was asked: a thin scene may never fill it.
        PhotonMap { origin, photons: Vec::with_capacity(capacity.min(1 << 26) as usize), starts: vec![0] }
    }

    /// Adds photons. Those that are not finite are dropped (no tree can hold them).
    pub fn extend(&mut self, photons: &[Photon]) {
        if photons.iter().all(Photon::is_finite) {
            self.photons.extend_from_slice(photons);
        } else {
            self.photons.extend(photons.iter().filter(|p| p.is_finite()));
        }
    }

    /// How many photons are stored.
    pub fn len(&self) -> u64 {
        self.photons.len() as u64
    }

    /// Whether none is.
    pub fn is_empty(&self) -> bool {
        self.photons.is_empty()
    }

    /// Scales every power (to W per stored photon) and sorts the photons by region, in place and in one order only.
    pub fn finish(&mut self, scale: f64) {
        let regions = self.photons.iter().map(|p| p.region() as usize + 1).max().unwrap_or(0);
        let mut starts = vec![0usize; regions + 1];
        for photon in &mut self.photons {
            photon.power = (f64::from(photon.power) * scale) as f32;
            starts[photon.region() as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        // American flag sort: every swap puts one photon into its region's stretch.
        let mut next = starts.clone();
        for region in 0..regions {
            while next[region] < starts[region + 1] {
                let home = self.photons[next[region]].region() as usize;
                if home == region {
                    next[region] += 1;
                } else {
                    self.photons.swap(next[region], next[home]);
                    next[home] += 1;
                }
            }
        }
        self.starts = starts;
    }

    /// All photons, by region.
    pub fn photons(&self) -> &[Photon] {
        &self.photons
    }

    /// The photons that collided in a region.
    pub fn of_region(&self, region: usize) -> &[Photon] {
        match (self.starts.get(region), self.starts.get(region + 1)) {
            (Some(&from), Some(&to)) => &self.photons[from..to],
            _ => &[],
        }
    }
}

impl PhotonMap {
    /// The photons relative to `origin`, in the order of a space-filling curve: what lies close in space lies close in memory.
    pub fn along_curve(self, origin: DVec3) -> Vec<Photon> {
        let shift = (self.origin - origin).as_vec3();
        let mut photons = self.photons;
        for photon in &mut photons {
            photon.position = (Vec3::from_array(photon.position) + shift).to_array();
        }
        let Box3 { min, max } = bounds(&photons);
        let cells = 1023.999 / (max - min).max(Vec3::splat(f32::MIN_POSITIVE));
        let key = |p: &Photon| {
            let position = Vec3::from_array(p.position);
            // Within a cell by whatever tells photons apart, so that the order is one only.
            (interleave((position - min) * cells), position.to_array().map(f32::to_bits), p.direction, p.power.to_bits())
        };
        photons.par_sort_unstable_by(|a, b| key(a).0.cmp(&key(b).0).then_with(|| key(a).cmp(&key(b))));
        photons
    }
}

/// The bits of three numbers below 1024 in turn (Morton's order).
#[inline]
fn interleave(p: Vec3) -> u32 {
    let spread = |x: f32| {
        let x = x as u32;
        let x = (x | x << 16) & 0x0300_00ff;
        let x = (x | x << 8) & 0x0300_f00f;
        let x = (x | x << 4) & 0x030c_30c3;
        (x | x << 2) & 0x0924_9249
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

/// Photons in one tree: what a tree takes while it is built stays small beside all that is stored.
const TREE: usize = 1 << 20;

/// k-d trees over the positions of some photons, of which each holds those that follow one another.
pub struct PhotonTree(Vec<Part>);

struct Part {
    tree: ImmutableKdTree<f32, 3>,
    bounds: Box3,
}

impl std::fmt::Debug for PhotonTree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.0.iter().map(|part| part.tree.size())).finish()
    }
}

impl PhotonTree {
    /// Builds the trees. `None` where kiddo cannot (more points than it can number).
    pub fn new(photons: &[Photon]) -> Option<Self> {
        let one = |(number, photons): (usize, &[Photon])| {
            let first = u32::try_from(number * TREE).ok()?;
            let tree = ImmutableKdTree::new_from_source(photons, |p: &Photon, axis| p.position[axis], |i, _| first + i as u32).ok()?;
            Some(Part { tree, bounds: bounds(photons) })
        };
        photons.chunks(TREE).enumerate().map(one).collect::<Option<Vec<Part>>>().map(PhotonTree)
    }

    /// The number of photons within `radius` metres of `centre` (relative to the map's origin).
    pub fn count_within(&self, centre: Vec3, radius: f32) -> u64 {
        let mut count = 0;
        self.within(centre, radius, |_, _| count += 1);
        count
    }

    /// Calls `visit(squared distance, number of the photon)` for every photon within `radius` metres of `centre`.
    #[inline]
    pub fn within(&self, centre: Vec3, radius: f32, mut visit: impl FnMut(f32, u32)) {
        let query = centre.to_array();
        // Only what rounding cannot bring within reach is passed over.
        let reach = radius * radius * (1.0 + 8.0 * f32::EPSILON);
        for Part { tree, bounds } in &self.0 {
            if centre.distance_squared(centre.clamp(bounds.min, bounds.max)) <= reach {
                tree.query(&query).within::<SquaredEuclidean<f32>>(radius * radius).unsorted().visit(|hit| visit(hit.distance, hit.item));
            }
        }
    }
}
