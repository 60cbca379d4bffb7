//! Extinction at a point, and all along a ray: what a march needs, looked up once.

use super::{Media, Scratch};
use crate::bvh::Box3;
use crate::geom::Ray;
use glam::Vec3;

/// A stretch of a ray in one region, along which extinction is a straight line: from `1 - tilt` times its mean to `1 + tilt` times.
#[derive(Debug, Clone, Copy)]
pub(in crate::media) struct Piece {
    pub from: f32,
    pub to: f32,
    /// The mean, 1/m.
    pub sigma: f32,
    /// From -1 to 1.
    pub tilt: f32,
    pub region: u32,
}

impl Piece {
    /// By how much extinction grows along it, 1/m^2.
    fn slope(&self) -> f64 {
        2.0 * f64::from(self.sigma) * f64::from(self.tilt) / (f64::from(self.to) - f64::from(self.from))
    }

    /// The extinction at a distance within it, 1/m.
    fn at(&self, distance: f32) -> f64 {
        f64::from(self.sigma) * (1.0 - f64::from(self.tilt)) + self.slope() * f64::from(distance - self.from)
    }
}

/// The same of all regions together.
#[derive(Debug, Clone, Copy)]
struct Step {
    from: f32,
    to: f32,
    tilt: f32,
    /// Optical depth from the ray's start to here.
    before: f64,
    after: f64,
}

/// The optical depth along a ray, stretch by stretch; kept by the caller so that no ray allocates.
#[derive(Debug, Default)]
pub struct Profile {
    pieces: Vec<Piece>,
    steps: Vec<Step>,
    ends: Vec<End>,
}

/// Where a piece begins or ends: how many more there are, and what that adds to the straight line of the extinction, at distance 0 and per
/// metre.
#[derive(Debug, Clone, Copy)]
struct End {
    at: f32,
    more: i32,
    line: [f64; 2],
}

impl Profile {
    /// The optical depth of the whole.
    pub fn depth(&self) -> f64 {
        self.steps.last().map_or(0.0, |s| s.after)
    }

    /// The integrals of the square of extinction (1/m) and of extinction along the whole.
    pub fn met(&self) -> (f64, f64) {
        // Of a straight line.
        let square =
            |s: &Step| (s.after - s.before).powi(2) * f64::from(1.0 + s.tilt * s.tilt / 3.0) / (f64::from(s.to) - f64::from(s.from));
        (self.steps.iter().map(square).sum(), self.depth())
    }

    /// The distance at which the optical depth from the start is `tau`, below [`Profile::depth`]; `step` is where to look first,
    /// and is moved on: ask for increasing depths.
    pub fn distance(&self, tau: f64, step: &mut usize) -> f32 {
        while *step + 1 < self.steps.len() && self.steps[*step].after <= tau {
            *step += 1;
        }
        let Some(s) = self.steps.get(*step) else { return 0.0 };
        // Of the length, the x with (1 - tilt) x + tilt x^2 = share.
        let (share, tilt) = (((tau - s.before) / (s.after - s.before)).clamp(0.0, 1.0), f64::from(s.tilt));
        let x = 2.0 * share / (1.0 - tilt + ((1.0 - tilt).powi(2) + 4.0 * tilt * share).sqrt()).max(f64::MIN_POSITIVE);
        s.from + (s.to - s.from) * x.min(1.0) as f32
    }

    /// The optical depth from the start up to a distance.
    pub fn until(&self, distance: f32) -> f64 {
        let Some(s) = self.steps[..self.steps.partition_point(|s| s.from < distance)].last() else { return 0.0 };
        let (x, tilt) = (((f64::from(distance) - f64::from(s.from)) / (f64::from(s.to) - f64::from(s.from))).min(1.0), f64::from(s.tilt));
        s.before + (s.after - s.before) * ((1.0 - tilt) * x + tilt * x * x)
    }

    /// The same ray through media of the same shapes, whose extinctions are so many times these.
    pub fn times(&self, ratio: impl Fn(u32) -> f64, out: &mut Profile) {
        out.pieces.clear();
        out.pieces.extend(self.pieces.iter().map(|p| Piece { sigma: (f64::from(p.sigma) * ratio(p.region)) as f32, ..*p }));
        out.settle();
    }

    /// Visits the stretches of `light`, whose extinction stands for what is emitted: what each sends past the extinction of this profile,
    /// and the middle of it, m.
    pub fn pass(&self, light: &Profile, mut visit: impl FnMut(f64, f32)) {
        let slope = |s: &Step| (s.after - s.before) / (f64::from(s.to) - f64::from(s.from));
        let mut at = 0;
        for lit in &light.steps {
            let (sent, mut from) = (slope(lit), lit.from);
            while from < lit.to {
                while self.steps.get(at).is_some_and(|s| s.to <= from) {
                    at += 1;
                }
                let (to, sigma, before) = match self.steps.get(at) {
                    None => (lit.to, 0.0, self.depth()),
                    Some(s) if s.from > from => (s.from.min(lit.to), 0.0, s.before),
                    Some(s) => (s.to.min(lit.to), slope(s), s.before + slope(s) * (f64::from(from) - f64::from(s.from))),
                };
                let length = f64::from(to) - f64::from(from);
                let tau = sigma * length;
                // The mean of what passes from within the stretch.
                let mean = if tau > 1e-6 { -(-tau).exp_m1() / tau } else { 1.0 - 0.5 * tau };
                visit(sent * length * mean * (-before).exp(), from + 0.5 * (to - from));
                from = to;
            }
        }
    }

    /// A region at a distance, with a chance in proportion to its extinction there; `pick` in [0, 1).
    pub fn region(&self, distance: f32, pick: impl FnOnce() -> f64) -> u32 {
        let here = |p: &&Piece| p.from <= distance && distance <= p.to;
        // Pieces are sorted by where they begin.
        let last = self.pieces.partition_point(|p| p.from <= distance);
        let begun = &self.pieces[..last];
        let alone = self.ends.is_empty();
        if alone {
            return begun.last().or(self.pieces.first()).map_or(0, |p| p.region);
        }
        let sum: f64 = begun.iter().filter(here).map(|p| p.at(distance)).sum();
        let (mut left, mut chosen) = (pick() * sum, begun.last().or(self.pieces.first()).map_or(0, |p| p.region));
        for piece in begun.iter().filter(here) {
            chosen = piece.region;
            left -= piece.at(distance);
            if left < 0.0 {
                break;
            }
        }
        chosen
    }

    /// Sorts pieces and adds up those that overlap.
    fn settle(&mut self) {
        self.steps.clear();
        self.ends.clear();
        let sorted = self.pieces.windows(2).all(|w| w[0].to <= w[1].from);
        let mut depth = 0.0;
        if sorted {
            for p in &self.pieces {
                let before = depth;
                depth += f64::from(p.sigma) * (f64::from(p.to) - f64::from(p.from));
                self.steps.push(Step { from: p.from, to: p.to, tilt: p.tilt, before, after: depth });
            }
            return;
        }
        self.pieces.sort_unstable_by(|a, b| a.from.total_cmp(&b.from).then(a.region.cmp(&b.region)));
        for p in &self.pieces {
            let slope = p.slope();
            let line = [f64::from(p.sigma) * (1.0 - f64::from(p.tilt)) - slope * f64::from(p.from), slope];
            self.ends.push(End { at: p.from, more: 1, line });
            self.ends.push(End { at: p.to, more: -1, line: line.map(|part| -part) });
        }
        self.ends.sort_by(|a, b| a.at.total_cmp(&b.at));
        let (mut at, mut line, mut inside) = (0.0f32, [0.0f64; 2], 0);
        for end in &self.ends {
            if end.at > at && inside > 0 {
                let (before, half) = (depth, 0.5 * (f64::from(end.at) - f64::from(at)));
                let sigma = (line[0] + line[1] * (f64::from(at) + half)).max(0.0);
                depth += sigma * 2.0 * half;
                let tilt = if sigma > 0.0 { (line[1] * half / sigma).clamp(-1.0, 1.0) as f32 } else { 0.0 };
                self.steps.push(Step { from: at, to: end.at, tilt, before, after: depth });
            }
            at = end.at;
            inside += end.more;
            line = if inside == 0 { [0.0; 2] } else { [0, 1].map(|i| line[i] + end.line[i]) };
        }
    }
}

impl Media {
    /// Looks up the optical depth along the ray's first `t_max` metres: in closed form in homogeneous regions; in each cell of grids by its
    /// exact mean, and straight from end to end. Behind as much optical depth as `most` first says it is by the mean of each block; grids
    /// end where they alone have as much as it says then.
    pub fn profile(&self, ray: &Ray, t_max: f32, most: (f64, f64), scratch: &mut Scratch, out: &mut Profile) {
        out.pieces.clear();
        if !self.grids_alone() {
            self.intervals(ray, t_max, scratch);
            for i in &scratch.intervals {
                let (from, to) = (i.enter.max(0.0), i.exit.min(t_max));
                if from < to && to.is_finite() {
                    out.pieces.push(Piece { from, to, sigma: self.optics(i.region).sigma_t as f32, tilt: 0.0, region: i.region });
                }
            }
        }
        for grid in &self.grids {
            grid.pieces(ray, t_max, most, |piece| out.pieces.push(piece));
        }
        out.settle();
    }

    /// Extinction at a point, 1/m: of all regions there.
    pub fn extinction(&self, p: Vec3) -> f64 {
        let mut sum = 0.0;
        self.regions_at(p, |_, sigma_t| sum += sigma_t);
        sum
    }

    /// Visits the regions at a point, with the extinction of each there, 1/m.
    pub fn regions_at(&self, p: Vec3, mut visit: impl FnMut(u32, f64)) {
        let query = Box3 { min: p, max: p };
        self.balls.near(&query, |centre, radius, region| {
            if centre.distance_squared(p) <= radius * radius {
                visit(region, self.optics(region).sigma_t);
            }
        });
        let mut one = |region: u32| {
            if self.solids[region as usize].holds(p) {
                visit(region, self.optics(region).sigma_t);
            }
        };
        self.unbounded.iter().for_each(|&region| one(region));
        self.others.overlapping(&query, |region| {
            one(region);
            false
        });
        for grid in &self.grids {
            let density = grid.density(p);
            if density > 0.0 {
                visit(grid.region, self.optics(grid.region).sigma_t * f64::from(density));
            }
        }
    }
}
