//! The scene's participating media as rays see them: overlapping homogeneous regions in closed form, voxel grids by null collisions.
//!
//! No marching: the intervals in which a ray is inside each region are computed, their ends sorted, and the sampled
//! optical depth spent from interval to interval. Nothing is carried over from one ray to the next, so there is no
//! state that rounding could corrupt and no epsilon by which a ray restarts.

use crate::bvh::{Box3, Bvh};
use crate::geom::Ray;
use crate::rng::Rng;
use crate::scene::{Region, Shape};
use crate::trimesh::TriMesh;
use balls::Balls;
use cells::Cells;
use glam::{DVec3, Mat3, Vec3};
use grid::Grid;
use intervals::{Interval, ray_slab, ray_unit_ball, spend};
use smallvec::SmallVec;

pub use fire::Fire;
pub use profile::Profile;

/// What a collision needs to know of its region.
#[derive(Debug, Clone, Copy)]
pub struct Optics {
    /// Extinction in 1/m.
    pub sigma_t: f64,
    /// Single-scattering albedo.
    pub albedo: f64,
    /// Mean cosine.
    pub g: f64,
}

#[derive(Debug, Clone)]
enum Solid {
    /// One of [`Balls`], or of the grids.
    Elsewhere,
    Ellipsoid {
        unit_from_world: Mat3,
        centre: Vec3,
    },
    Slab {
        bottom: f32,
        top: f32,
    },
    Mesh(TriMesh),
}

impl Solid {
    /// Whether a point is inside a shape that stands here.
    fn holds(&self, p: Vec3) -> bool {
        match self {
            Solid::Ellipsoid { unit_from_world, centre } => (*unit_from_world * (p - *centre)).length_squared() <= 1.0,
            Solid::Slab { bottom, top } => *bottom <= p.z && p.z <= *top,
            Solid::Mesh(mesh) => mesh.holds(p),
            Solid::Elsewhere => false,
        }
    }
}

/// Room for the intervals of one ray; kept by the caller so that no flight allocates.
#[derive(Debug, Default)]
pub struct Scratch {
    intervals: SmallVec<[Interval; 32]>,
    ends: SmallVec<[(f32, f32); 64]>,
    crossings: Vec<(f64, i32)>,
    /// Collisions in grids that were considered, accepted or not.
    pub tentative: u64,
    /// Samples above their majorant, which would bias a flight: none, by construction.
    pub violations: u64,
}

/// Where a free flight ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Flight {
    /// In a collision with the region of that index.
    Collision {
        /// Distance flown, m.
        distance: f32,
        /// The region that the photon collided in, chosen in proportion to extinction where regions overlap.
        region: u32,
        /// Extinction of all homogeneous regions there, 1/m; 0 where it was a grid and this is not known.
        sigma_t: f64,
    },
    /// Out of all media, or at the end of the stretch that was asked for.
    Passed,
}

/// All regions of a scene, compiled: relative to `origin`, in single precision.
#[derive(Debug, Clone, Default)]
pub struct Media {
    solids: Vec<Solid>,
    optics: Vec<Optics>,
    balls: Balls,
    /// Short cuts among spheres; empty where there are other shapes too.
    cells: Cells,
    /// Over everything else that has bounds.
    others: Bvh,
    /// Slabs have no bounds: every ray looks at them.
    unbounded: Vec<u32>,
    grids: Vec<Grid>,
}

impl Media {
    /// Compiles the regions, relative to `origin` (world space).
    pub fn new(regions: &[Region], origin: DVec3) -> Self {
        let mut balls = Vec::new();
        let solids: Vec<Solid> = regions.iter().enumerate().map(|(i, r)| compile(i as u32, &r.shape, origin, &mut balls)).collect();
        let of = |kind: fn(&Solid) -> bool| (0..regions.len() as u32).filter(|&i| kind(&solids[i as usize])).collect::<Vec<u32>>();
        let unbounded = of(|s| matches!(s, Solid::Slab { .. }));
        let bounded = |i: usize| {
            matches!(solids[i], Solid::Ellipsoid { .. } | Solid::Mesh(_)).then(|| Box3::around(regions[i].shape.bounds(), origin))
        };
        let optics: Vec<Optics> =
            regions.iter().map(|r| Optics { sigma_t: r.medium.sigma_t(), albedo: r.medium.albedo(), g: r.medium.g }).collect();
        Media {
            cells: if balls.len() == regions.len() && !balls.is_empty() { Cells::new(&balls, &optics) } else { Cells::default() },
            balls: Balls::new(&balls),
            others: Bvh::new(&(0..regions.len()).map(bounded).collect::<Vec<_>>(), 2),
            grids: regions.iter().zip(0..).filter_map(|(r, i)| grid(i, r, origin)).collect(),
            solids,
            optics,
            unbounded,
        }
    }

    /// The optical properties of a region.
    #[inline]
    pub fn optics(&self, region: u32) -> Optics {
        self.optics[region as usize]
    }

    /// Flies along `ray`, at most `t_max` metres, to the first collision.
    ///
    /// Homogeneous regions are crossed in closed form until `tau`, an exponential optical depth, is spent; each grid has a
    /// flight of its own by null collisions, and the shortest counts: the first of independent Poisson processes. `hint` as
    /// in [`Media::fly_regions`].
    #[inline]
    pub fn fly(&self, ray: &Ray, t_max: f32, tau: f64, hint: f64, rng: &mut Rng, scratch: &mut Scratch) -> Flight {
        let mut flight =
            if self.grids_alone() { Flight::Passed } else { self.fly_regions(ray, t_max, tau, hint, || rng.uniform(), scratch) };
        let mut reach = if let Flight::Collision { distance, .. } = flight { distance } else { t_max };
        for grid in &self.grids {
            if let Some(distance) = grid.fly(ray, reach, rng, scratch) {
                reach = distance;
                flight = Flight::Collision { distance, region: grid.region, sigma_t: 0.0 };
            }
        }
        flight
    }

    /// Prepares [`Media::sunlight`] for a sun in direction `toward`.
    pub fn learn_shade(&mut self, toward: Vec3) {
        self.grids.iter_mut().for_each(|grid| grid.learn_shade(toward));
    }

    /// The transmittance from `p` in direction `toward`, a point of the sun's disc; an unbiased estimate.
    ///
    /// Homogeneous regions in closed form. In a grid, what [`Media::learn_shade`] says serves as a control variate: it is always
    /// counted, and what the exact transmittance differs by is looked at with a probability that grows with `weight`, what
    /// full light would contribute compared with what is usual.
    pub fn sunlight(&self, p: Vec3, toward: Vec3, weight: f32, rng: &mut Rng, scratch: &mut Scratch) -> f64 {
        let ray = Ray { origin: p, direction: toward };
        let clear = (-self.depth_of_regions(&ray, f32::INFINITY, scratch)).exp();
        let depth = self.grids.iter().try_fold(0.0, |sum, grid| Some(sum + grid.shade(p)?));
        let exact = |rng: &mut Rng| self.grids.iter().fold(clear, |left, grid| left * grid.transmittance(&ray, f32::INFINITY, rng));
        let Some(depth) = depth.filter(|_| !self.grids.is_empty()) else { return exact(rng) };
        let guess = clear * f64::from((-depth).exp());
        let look = (LOOK * f64::from(weight) * guess + LEAST).min(1.0);
        if rng.uniform() < look { guess + (exact(rng) - guess) / look } else { guess }
    }

    /// The transmittance along the ray's first `t_max` metres; where there are grids an unbiased estimate.
    pub fn clear(&self, ray: &Ray, t_max: f32, rng: &mut Rng, scratch: &mut Scratch) -> f64 {
        let clear = (-self.depth_of_regions(ray, t_max, scratch)).exp();
        self.grids.iter().fold(clear, |left, grid| if left > 0.0 { left * grid.transmittance(ray, t_max, rng) } else { 0.0 })
    }

    /// Flies through the homogeneous regions along `ray`, at most `t_max` metres, until `tau` of optical depth is spent.
    ///
    /// `hint` is a lower bound of the extinction where the ray starts (0 if unknown): the flight looks only as far as
    /// that extinction lets it, and farther only when the ray leaves earlier. `pick` in [0, 1) chooses the region where
    /// several overlap.
    pub fn fly_regions(&self, ray: &Ray, t_max: f32, tau: f64, hint: f64, pick: impl FnOnce() -> f64, scratch: &mut Scratch) -> Flight {
        if let Some(near) = self.cells.near(ray.origin) {
            let reach = self.cells.margin.min(t_max);
            scratch.intervals.clear();
            near.intervals(ray, reach, &mut scratch.intervals);
            if let Some(distance) = spend(scratch, &self.optics, near.sigma_t, reach, tau) {
                return self.collision(distance, near.full, pick, scratch);
            }
        }
        let reach = (tau / hint * 2.0) as f32;
        if self.cells.is_empty() && reach < t_max {
            // Twice as far as the extinction here would need: it may fall along the way.
            self.intervals(ray, reach, scratch);
            if let Some(distance) = spend(scratch, &self.optics, 0.0, reach, tau) {
                return self.collision(distance, &[], pick, scratch);
            }
        }
        self.intervals(ray, t_max, scratch);
        match spend(scratch, &self.optics, 0.0, t_max, tau) {
            Some(distance) => self.collision(distance, &[], pick, scratch),
            None => Flight::Passed,
        }
    }

    /// The optical depth along `ray` over its first `t_max` metres.
    pub fn optical_depth(&self, ray: &Ray, t_max: f32, scratch: &mut Scratch) -> f64 {
        self.depth_of_regions(ray, t_max, scratch) + self.grids.iter().fold(0.0, |sum, grid| sum + grid.optical_depth(ray, t_max))
    }

    /// Where the ray first meets the bounds of any region (0 within them): its shape, or the box of its voxels.
    pub fn entrance(&self, ray: &Ray, scratch: &mut Scratch) -> Option<f32> {
        self.within(ray, f32::INFINITY, scratch);
        scratch.intervals.iter().map(|i| i.enter.max(0.0)).min_by(f32::total_cmp)
    }

    /// How much of the ray's first `t_max` metres lies within the bounds of any region, m.
    pub fn length_inside(&self, ray: &Ray, t_max: f32, scratch: &mut Scratch) -> f64 {
        self.within(ray, t_max, scratch);
        scratch.intervals.sort_unstable_by(|a, b| a.enter.total_cmp(&b.enter));
        let (mut sum, mut until) = (0.0, 0.0f32);
        for i in &scratch.intervals {
            let (from, to) = (i.enter.max(until), i.exit.min(t_max));
            if to > from {
                sum += f64::from(to) - f64::from(from);
                until = to;
            }
        }
        sum
    }

    /// Fills `scratch.intervals` as [`Media::intervals`] does, and with the boxes of grids.
    fn within(&self, ray: &Ray, t_max: f32, scratch: &mut Scratch) {
        self.intervals(ray, t_max, scratch);
        for grid in &self.grids {
            let (enter, exit) = grid.voxel_box(ray);
            if enter < exit && exit > 0.0 && enter < t_max {
                scratch.intervals.push(Interval { enter, exit, region: grid.region });
            }
        }
    }

    /// Whether there is nothing that has a closed form.
    #[inline]
    fn grids_alone(&self) -> bool {
        self.solids.len() == self.grids.len()
    }

    fn depth_of_regions(&self, ray: &Ray, t_max: f32, scratch: &mut Scratch) -> f64 {
        if self.grids_alone() {
            return 0.0;
        }
        self.intervals(ray, t_max, scratch);
        let length = |i: &Interval| f64::from(i.exit.min(t_max)) - f64::from(i.enter.max(0.0));
        // A level ray is in a layer for ever; without extinction that costs nothing, and 0 x inf would be NaN.
        let depth = |i: &Interval| if self.optics(i.region).sigma_t > 0.0 { length(i) * self.optics(i.region).sigma_t } else { 0.0 };
        scratch.intervals.iter().map(depth).fold(0.0, |sum, depth| sum + depth)
    }

    /// Whether any region is a voxel grid: those have no stretches of even extinction.
    pub fn has_grids(&self) -> bool {
        !self.grids.is_empty()
    }

    /// The stretches of the ray's first `t_max` metres inside each homogeneous region, as (enter, exit, region), by where
    /// they begin.
    pub fn crossings(&self, ray: &Ray, t_max: f32, scratch: &mut Scratch, out: &mut Vec<(f32, f32, u32)>) {
        self.intervals(ray, t_max, scratch);
        out.clear();
        out.extend(scratch.intervals.iter().map(|i| (i.enter.max(0.0), i.exit.min(t_max), i.region)));
        out.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    }

    /// Fills `scratch.intervals` with the stretches of the ray inside regions that begin before `t_max` and end after 0.
    fn intervals(&self, ray: &Ray, t_max: f32, scratch: &mut Scratch) {
        scratch.intervals.clear();
        let (intervals, crossings) = (&mut scratch.intervals, &mut scratch.crossings);
        let mut one = |region: u32| {
            let mut keep = |enter: f32, exit: f32| {
                // Written so that NaN (a grazing ray through its own origin) is dropped.
                if enter < exit && exit > 0.0 && enter < t_max {
                    intervals.push(Interval { enter, exit, region });
                }
            };
            match &self.solids[region as usize] {
                Solid::Elsewhere => {}
                Solid::Ellipsoid { unit_from_world, centre } => {
                    let (enter, exit) = ray_unit_ball(*unit_from_world * (ray.origin - *centre), *unit_from_world * ray.direction);
                    keep(enter, exit);
                }
                Solid::Slab { bottom, top } => {
                    let (enter, exit) = ray_slab(ray.origin.z, ray.direction.z, *bottom, *top);
                    keep(enter, exit);
                }
                Solid::Mesh(mesh) => mesh.inside(ray, crossings, keep),
            }
        };
        self.unbounded.iter().for_each(|&region| one(region));
        self.others.traverse(ray.origin, ray.direction, t_max, |region, _| one(region));
        self.balls.intervals(ray, t_max, intervals);
    }

    /// The collision at `distance`, its region in proportion to extinction among `full` and the intervals that hold it.
    fn collision(&self, distance: f32, full: &[u32], pick: impl FnOnce() -> f64, scratch: &Scratch) -> Flight {
        let here = || {
            let partial = scratch.intervals.iter().filter(|i| i.enter <= distance && distance <= i.exit).map(|i| i.region);
            full.iter().copied().chain(partial)
        };
        let (count, sigma_t) = here().fold((0, 0.0), |(n, sum), region| (n + 1, sum + self.optics(region).sigma_t));
        let mut left = if count > 1 { pick() * sigma_t } else { 0.0 };
        let mut chosen = scratch.intervals.first().map_or(0, |i| i.region);
        for region in here() {
            chosen = region;
            left -= self.optics(region).sigma_t;
            if left < 0.0 {
                break;
            }
        }
        Flight::Collision { distance, region: chosen, sigma_t }
    }
}

/// The chance to look exactly at sunlight, over the share of it that is expected to arrive; and the least chance.
const LOOK: f64 = 0.3;
const LEAST: f64 = 0.05;

fn grid(index: u32, region: &Region, origin: DVec3) -> Option<Grid> {
    let Shape::Grid(grid) = &region.shape else { return None };
    Some(Grid::new(index, grid, region.medium.sigma_t(), origin))
}

fn compile(index: u32, shape: &Shape, origin: DVec3, balls: &mut Vec<(Vec3, f32, u32)>) -> Solid {
    match shape {
        Shape::Ellipsoid { world_from_unit } => {
            let m = world_from_unit.matrix3;
            let centre = (world_from_unit.translation - origin).as_vec3();
            let axes = [m.x_axis, m.y_axis, m.z_axis];
            let radius = axes[0].length();
            let round = (0..3).all(|i| {
                (axes[i].length() - radius).abs() <= 1e-9 * radius && axes[i].dot(axes[(i + 1) % 3]).abs() <= 1e-9 * radius * radius
            });
            if round {
                balls.push((centre, radius as f32, index));
                Solid::Elsewhere
            } else {
                Solid::Ellipsoid { unit_from_world: m.inverse().as_mat3(), centre }
            }
        }
        Shape::Slab { centre, half_height, .. } => {
            let z = centre.z - origin.z;
            Solid::Slab { bottom: (z - half_height) as f32, top: (z + half_height) as f32 }
        }
        Shape::Mesh(mesh) => Solid::Mesh(TriMesh::new(&[mesh], origin)),
        Shape::Grid(_) => Solid::Elsewhere,
    }
}

pub mod air;
mod balls;
mod cells;
mod fire;
mod grid;
mod intervals;
mod mass;
mod profile;
#[cfg(test)]
mod tests;
