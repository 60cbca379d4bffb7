//! Light from all sides, of which photons that fly toward the camera matter most: a region that scatters forward sends on what comes from
//! behind it.

use super::trace::Tracer;
use crate::bvh::Box3;
use crate::geom::basis;
use crate::rng::Rng;
use crate::sampling::around;
use crate::scene::Scene;
use crate::scene::phase::{henyey_greenstein, one_minus_cos, sample_henyey_greenstein};
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// The share of photons that are sent toward the camera.
const SHARE: f64 = 0.25;
/// Phase functions with a mean cosine below this have no peak worth aiming at.
const PEAKED: f64 = 0.3;
/// Balls around what the camera sees are halved until their radii are less than this part of their distances, or so many.
const NEAR: f32 = 0.3;
const BALLS: usize = 64;

/// The lines along which light passes the regions on its way to a camera.
#[derive(Debug, Clone)]
pub(super) struct Eye {
    balls: Arc<[Ball]>,
}

/// A ball around some of what the camera sees.
#[derive(Debug, Clone, Copy)]
struct Ball {
    centre: Vec3,
    radius: f32,
    /// The way to the camera, and the mean cosine about it.
    axis: Vec3,
    g: f64,
    /// What share of the lines is for it.
    chance: f64,
}

impl Eye {
    /// For what a camera at `eye` sees of some boxes; `framed` says whether it may see anything of a ball. `None` where no peak is worth it.
    fn of(mut boxes: Vec<Box3>, eye: Vec3, g: f64, framed: impl Fn(Vec3, f32) -> bool) -> Option<Self> {
        let wide = |b: &Box3| 0.5 * (b.max - b.min).length() / (0.5 * (b.min + b.max) - eye).length().max(f32::MIN_POSITIVE);
        boxes.retain(|b| framed(0.5 * (b.min + b.max), 0.5 * (b.max - b.min).length()));
        // Many become one, and what is wide is halved.
        if boxes.len() > BALLS {
            boxes = vec![boxes.iter().fold(boxes[0], |all, b| Box3 { min: all.min.min(b.min), max: all.max.max(b.max) })];
        }
        while boxes.len() < BALLS {
            let Some((widest, _)) = boxes.iter().map(wide).enumerate().filter(|b| b.1 > NEAR).max_by(|a, b| a.1.total_cmp(&b.1)) else {
                break;
            };
            let Box3 { min, max } = boxes.swap_remove(widest);
            let axis = Vec3::AXES[(max - min).max_position()];
            let middle = (0.5 * (min + max)) * axis;
            let halves = [Box3 { min, max: max * (1.0 - axis) + middle }, Box3 { min: min * (1.0 - axis) + middle, max }];
            boxes.extend(halves.into_iter().filter(|b| framed(0.5 * (b.min + b.max), 0.5 * (b.max - b.min).length())));
        }
        let ball = |b: &Box3| {
            let (centre, radius) = (0.5 * (b.min + b.max), 0.5 * (b.max - b.min).length());
            let (axis, distance) = ((eye - centre).try_normalize()?, (eye - centre).length());
            // From close by the ways of its parts differ.
            Some(Ball {
                centre,
                radius,
                axis,
                g: g * f64::from(distance / (distance + radius)),
                chance: f64::from(wide(b)).min(1.0).powi(2),
            })
        };
        let mut balls: Vec<Ball> = boxes.iter().filter_map(ball).filter(|ball| ball.g > PEAKED && ball.radius > 0.0).collect();
        let whole: f64 = balls.iter().map(|ball| ball.chance).sum();
        balls.iter_mut().for_each(|ball| ball.chance /= whole);
        (!balls.is_empty()).then(|| Eye { balls: balls.into() })
    }

    /// A direction, and a point that a line along it goes through.
    fn sample(&self, rng: &mut Rng) -> (Vec3, Vec3) {
        let mut left = rng.uniform();
        let picked = self.balls.iter().find(|ball| {
            left -= ball.chance;
            left < 0.0
        });
        let Ball { centre, radius, axis, g, .. } = *picked.unwrap_or(&self.balls[0]);
        let (cos, sin) = sample_henyey_greenstein(g, rng.uniform());
        let direction = around(axis, cos as f32, sin as f32, rng.uniform_f32());
        let ((u, v), rho, (sin, cos)) = (basis(direction), radius * rng.uniform_f32().sqrt(), (TAU * rng.uniform()).sin_cos());
        (direction, centre + (u * cos as f32 + v * sin as f32) * rho)
    }

    /// The density of such lines, 1/(m^2 sr).
    fn density(&self, direction: Vec3, point: Vec3) -> f64 {
        let of = |ball: &Ball| {
            if across(direction, ball.centre - point).length_squared() > ball.radius * ball.radius {
                return 0.0;
            }
            ball.chance * henyey_greenstein(ball.g, one_minus_cos(ball.axis, direction)) / (PI * f64::from(ball.radius).powi(2))
        };
        self.balls.iter().map(of).sum()
    }

    /// A direction, and a point that a line along it goes through; `others` draws them, with a density `pdf`, where they are not toward the
    /// camera. With the density of the mixture, 1/(m^2 sr).
    pub fn mixed(
        eye: Option<&Eye>,
        rng: &mut Rng,
        others: impl FnOnce(&mut Rng) -> (Vec3, Vec3),
        pdf: impl FnOnce(Vec3, Vec3) -> f64,
    ) -> (Vec3, Vec3, f64) {
        let toward = eye.filter(|_| rng.uniform() < SHARE);
        let (direction, point) = if let Some(eye) = toward { eye.sample(rng) } else { others(rng) };
        let pdf = pdf(direction, point);
        (direction, point, eye.map_or(pdf, |eye| SHARE * eye.density(direction, point) + (1.0 - SHARE) * pdf))
    }
}

/// The point of a line along `direction` that is nearest to the origin.
pub(super) fn across(direction: Vec3, point: Vec3) -> Vec3 {
    point - direction * point.dot(direction)
}

impl Tracer {
    /// The tracer of photons for a camera at `eye`, relative to the scene's origin: of the sky's and the air's, those that pass what it sees
    /// are sent toward it more often. `framed` says whether it may see anything of a ball.
    pub fn seen_from(mut self, scene: &Scene, origin: DVec3, eye: Vec3, framed: impl Fn(Vec3, f32) -> bool) -> Self {
        let g = scene.regions.iter().map(|r| r.medium.g).fold(0.0, f64::max);
        let bounds = |b: crate::geom::Bounds| Box3 { min: (b.min - origin).as_vec3(), max: (b.max - origin).as_vec3() };
        let boxes = scene.regions.iter().map(|r| bounds(r.shape.bounds())).collect();
        self.eye = self.emitter.aim().and_then(|_| Eye::of(boxes, eye, g, framed));
        self
    }
}
