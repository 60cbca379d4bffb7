//! Emission: where photons start, aimed at what they can hit.
//!
//! On a plane perpendicular to the sunlight, the silhouette of all regions is drawn as a mask; photons start
//! uniformly over its cells, so that almost none misses. Light that reaches a region only by way of a surface starts
//! outside the mask, more densely near the regions. Together the two strata cover every path that matters exactly once.

use super::aim::Aim;
use crate::geom::{Bounds, Ray, basis};
use crate::rng::Rng;
use crate::sampling::uniform_disc;
use crate::scene::medium::luminance;
use crate::scene::{Scene, Shape, Sun};
use crate::trimesh::TriMesh;
use glam::{DVec3, IVec3, Vec2, Vec3};

/// Cells of the silhouette's mask along its longer side.
const MASK_CELLS: f32 = 512.0;
/// Samples along the sides of a grid's blocks, whose shadows make up its own.
const BLOCK: i32 = 4;

/// Starts photons.
#[derive(Debug, Clone)]
pub struct Emitter {
    pub(super) axis: Vec3,
    pub(super) sin_alpha: f32,
    pub(super) irradiance: f64,
    pub(super) target: Target,
}

#[derive(Debug, Clone)]
pub(super) enum Target {
    /// A rectangle in x and y at height `top`, under which slabs lie.
    Tile {
        min: Vec2,
        size: Vec2,
        top: f32,
    },
    Silhouette(Silhouette),
}

#[derive(Debug, Clone)]
pub(super) struct Silhouette {
    /// The plane's axes; it goes through the scene's origin.
    u: Vec3,
    v: Vec3,
    corner: Vec2,
    cell: f32,
    width: usize,
    mask: Vec<bool>,
    cells: Vec<u32>,
    /// The same in Morton's order.
    curve: Vec<u32>,
    /// How far upstream of the plane photons start, beyond every region.
    upstream: f32,
    /// How far upstream lies everything, surfaces included.
    far: f32,
    /// Whether any surface lies upstream of a region, and may shade it.
    shaded: bool,
    /// What surfaces aim at.
    aim: Aim,
    /// Photons that start outside the silhouette to bounce off surfaces.
    skirt: Option<Skirt>,
}

/// Density 1 / (2 pi r^2) (1 + rho^2/r^2)^(-3/2) around the centre: the light that a point at distance rho on level
/// ground can send to the regions falls like rho^-3.
#[derive(Debug, Clone)]
struct Skirt {
    centre: Vec2,
    radius: f32,
    probability: f64,
    min: Vec2,
    max: Vec2,
}

/// A photon on its way.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// Where it starts and where it goes.
    pub ray: Ray,
    /// Its weight in W: to be divided by the number of photons emitted. Zero where the stratum does not reach.
    pub power: f64,
    /// What the power counts in each channel; 1 where photons have no colour.
    pub tint: Vec3,
    /// Whether it is aimed at a region. Light that is aimed at surfaces counts once they send it toward one.
    pub counted: bool,
    /// Whether it is not sunlight on its first flight.
    pub scattered: bool,
    /// Whether it is light of the air ([`super::air`]).
    pub from_air: bool,
}

impl Emitter {
    /// An emitter for the scene's sun, its regions and, where light bounces, its surfaces; relative to `origin`.
    pub fn new(scene: &Scene, origin: DVec3, sun_disc: bool, bounces: bool) -> Self {
        let Sun { direction, angular_diameter, .. } = scene.sun;
        let sin_alpha = if sun_disc { (angular_diameter * 0.5).sin() as f32 } else { 0.0 };
        let axis = direction.as_vec3().normalize();
        let slabs = scene.regions.iter().any(|r| r.shape.is_endless());
        let target =
            if slabs { tile(scene, origin, axis) } else { Target::Silhouette(silhouette(scene, origin, axis, sin_alpha, bounces)) };
        Emitter { axis, sin_alpha, irradiance: scene.sun.grey_irradiance(), target }
    }

    /// The same where the sun shines; else that of one with 1 W m^-2.
    pub(super) fn bright(&self) -> Self {
        Emitter { irradiance: if self.irradiance > 0.0 { self.irradiance } else { 1.0 }, ..self.clone() }
    }

    /// What surfaces aim at; `None` where regions have no end.
    pub(super) fn aim(&self) -> Option<&Aim> {
        match &self.target {
            Target::Tile { .. } => None,
            Target::Silhouette(s) => Some(&s.aim),
        }
    }

    /// The weight of photons that are aimed at regions, W.
    pub(super) fn base_power(&self) -> f64 {
        self.irradiance * self.area()
    }

    /// The area, across the sunlight, over which photons start that are aimed at regions, m^2.
    pub fn area(&self) -> f64 {
        match &self.target {
            Target::Tile { size, .. } => f64::from(size.x) * f64::from(size.y) * f64::from(-self.axis.z).max(0.0),
            Target::Silhouette(s) => s.area(),
        }
    }

    /// Starts one photon. `surfaces` are looked at upstream, so that what shades the regions from afar does. `along` in [0, 1) says where
    /// on a curve through the silhouette, so that photons may be spread evenly; anywhere where it does not.
    pub fn emit(&self, rng: &mut Rng, surfaces: &TriMesh, along: Option<f64>) -> Start {
        let direction =
            if self.sin_alpha > 0.0 { uniform_disc(self.axis, self.sin_alpha, rng.uniform_f32(), rng.uniform_f32()) } else { self.axis };
        match &self.target {
            Target::Tile { min, size, top } => {
                let p = *min + *size * Vec2::new(rng.uniform_f32(), rng.uniform_f32());
                let power = self.irradiance * f64::from(size.x) * f64::from(size.y) * f64::from(-direction.z).max(0.0);
                let ray = Ray { origin: p.extend(*top), direction };
                Start { ray, power, tint: Vec3::ONE, counted: true, scattered: false, from_air: false }
            }
            Target::Silhouette(s) => s.emit(rng, direction, self.irradiance, surfaces, along),
        }
    }
}

impl Silhouette {
    fn emit(&self, rng: &mut Rng, direction: Vec3, irradiance: f64, surfaces: &TriMesh, along: Option<f64>) -> Start {
        let aside = self.skirt.as_ref().filter(|s| rng.uniform() < s.probability);
        let (p, upstream, area) = match aside {
            None => {
                let number = |share: f64| ((share * self.cells.len() as f64) as usize).min(self.cells.len() - 1);
                let cell = along.map_or_else(|| self.cells[number(rng.uniform())], |along| self.curve[number(along)]);
                let corner = Vec2::new((cell as usize % self.width) as f32, (cell as usize / self.width) as f32);
                let p = self.corner + (corner + Vec2::new(rng.uniform_f32(), rng.uniform_f32())) * self.cell;
                (p, self.upstream, self.area())
            }
            Some(skirt) => {
                let (p, pdf) = skirt.sample(rng);
                let outside = p.cmplt(skirt.min).any() || p.cmpgt(skirt.max).any() || self.covers(p);
                (p, self.far, if outside { 0.0 } else { 1.0 / (skirt.probability * pdf) })
            }
        };
        let plane = self.u * p.x + self.v * p.y;
        let mut origin = plane - direction * upstream;
        if self.shaded && aside.is_none() && surfaces.nearest(&Ray { origin, direction: -direction }, f32::INFINITY).is_some() {
            origin = plane - direction * self.far;
        }
        let (ray, power) = (Ray { origin, direction }, irradiance * area);
        Start { ray, power, tint: Vec3::ONE, counted: aside.is_none(), scattered: false, from_air: false }
    }

    /// The mask's area over the share of photons that start over it, m^2.
    fn area(&self) -> f64 {
        self.cells.len() as f64 * f64::from(self.cell).powi(2) / (1.0 - self.skirt.as_ref().map_or(0.0, |s| s.probability))
    }

    /// Whether the mask holds the point of the plane.
    fn covers(&self, p: Vec2) -> bool {
        let c = (p - self.corner) / self.cell;
        let (x, y) = (c.x.floor(), c.y.floor());
        let height = self.mask.len() / self.width;
        x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < height as f32 && self.mask[y as usize * self.width + x as usize]
    }
}

impl Skirt {
    fn sample(&self, rng: &mut Rng) -> (Vec2, f64) {
        let p = aside(self.radius, rng);
        (self.centre + p, aside_density(self.radius, p.length()))
    }
}

/// A point of a plane with density 1 / (2 pi r^2) (1 + rho^2/r^2)^(-3/2) around 0.
pub(super) fn aside(radius: f32, rng: &mut Rng) -> Vec2 {
    let c = 1.0 / (1.0 - rng.uniform());
    let rho = f64::from(radius) * (c * c - 1.0).max(0.0).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * rng.uniform()).sin_cos();
    Vec2::new((rho * cos) as f32, (rho * sin) as f32)
}

/// That density, 1/m^2.
pub(super) fn aside_density(radius: f32, rho: f32) -> f64 {
    let (r2, rho2) = (f64::from(radius).powi(2), f64::from(rho).powi(2));
    (1.0 + rho2 / r2).powf(-1.5) / (std::f64::consts::TAU * r2)
}

/// Slabs go on for ever: light is started over their tile. Beside other regions the tile is widened by three times the
/// height and the shear of the light, from which nearly all light can still come.
fn tile(scene: &Scene, origin: DVec3, axis: Vec3) -> Target {
    let bounds = scene.region_bounds();
    let alone = scene.regions.iter().all(|r| r.shape.is_endless());
    let height = bounds.size().z;
    let slope = (DVec3::new(axis.x.into(), axis.y.into(), 0.0) / f64::from(axis.z).min(-1e-3)).abs();
    let margin = if alone { DVec3::ZERO } else { (DVec3::splat(3.0) + slope) * height };
    let (min, max) = ((bounds.min - margin - origin).as_vec3(), (bounds.max + margin - origin).as_vec3());
    // Above everything, so that a roof shades what lies under it.
    let highest = scene.surfaces.iter().fold(scene.region_support(), |b, s| b.union(s.mesh.bounds())).max.z;
    let top = max.z.max((highest - origin.z) as f32);
    Target::Tile { min: min.truncate(), size: (max - min).truncate(), top: top + top.abs() * 1e-6 }
}

/// How far a box reaches from `origin`, m.
pub(super) fn reach(b: Bounds, origin: DVec3) -> f32 {
    ((b.min - origin).abs().max((b.max - origin).abs())).length() as f32 * 1.001 + f32::MIN_POSITIVE
}

fn silhouette(scene: &Scene, origin: DVec3, axis: Vec3, sin_alpha: f32, bounces: bool) -> Silhouette {
    let (u, v) = basis(axis);
    let bounds = scene.region_bounds();
    let everything = scene.surfaces.iter().fold(bounds, |b, s| b.union(s.mesh.bounds()));
    let upstream = reach(scene.region_support(), origin);
    // The sun's disc spreads by the tangent of its half angle over the distance between a region and the plane, and a slanted
    // ray has the farther to go. Of a disc as wide as the sky, the last millionth of its light is left out.
    let cos_alpha = (1.0 - sin_alpha * sin_alpha).max(1e-6).sqrt();
    let tan_alpha = sin_alpha / cos_alpha;
    let spread = tan_alpha * upstream;
    let mut discs: Vec<(Vec2, Vec2, bool)> = Vec::new();
    scene.regions.iter().for_each(|r| project(&r.shape, origin, u, v, spread, &mut discs));
    let corner = discs.iter().fold(Vec2::INFINITY, |m, d| m.min(d.0 - d.1));
    let far_corner = discs.iter().fold(Vec2::NEG_INFINITY, |m, d| m.max(d.0 + d.1));
    let cell = ((far_corner - corner).max_element() / MASK_CELLS).max(f32::MIN_POSITIVE);
    let width = ((far_corner.x - corner.x) / cell) as usize + 1;
    let height = ((far_corner.y - corner.y) / cell) as usize + 1;
    let mut mask = vec![false; width * height];
    for (centre, half, round) in discs {
        let (c, h) = ((centre - corner) / cell, half / cell);
        for y in ((c.y - h.y).floor().max(0.0) as usize)..(((c.y + h.y).floor() as usize + 1).min(height)) {
            // The widest the disc gets within this row of cells.
            let dy = if (y as f32) > c.y { y as f32 - c.y } else { (c.y - (y + 1) as f32).max(0.0) } / h.y;
            let w = if round { h.x * (1.0 - dy * dy).max(0.0).sqrt() } else { h.x };
            let from = (c.x - w).floor().max(0.0) as usize;
            let to = ((c.x + w).floor() as usize + 1).min(width);
            mask[y * width + from.min(to)..y * width + to].fill(true);
        }
    }
    let cells: Vec<u32> = (0..mask.len() as u32).filter(|&i| mask[i as usize]).collect();
    let mut curve = cells.clone();
    curve.sort_by_key(|&cell| morton(cell % width as u32) | morton(cell / width as u32) << 1);
    let far = reach(everything, origin);
    let height = |p: DVec3| (p - origin).dot(-scene.sun.direction);
    // Turned by the sun's disc, a vertex at the far end rises by at most the disc's share of its distance.
    let tilt = f64::from(sin_alpha * far);
    let shaded = scene.surfaces.iter().flat_map(|s| &s.mesh.vertices).any(|&v| height(v) + tilt > -f64::from(upstream));
    let ball = |shape: &Shape| {
        let size = if is_sphere(shape) { shape.smallest_half_extent() } else { shape.bounds().size().length() * 0.5 };
        (shape.centre() - origin).length() + size
    };
    let aim = Aim { radius: upstream.min(scene.regions.iter().map(|r| ball(&r.shape)).fold(0.0, f64::max) as f32 * 1.0001) };
    let brightest = scene.surfaces.iter().map(|s| luminance(s.albedo)).fold(0.0, f64::max).clamp(0.0, 1.0) as f32;
    let skirt = (bounces && !scene.surfaces.is_empty()).then(|| {
        let (centre, radius) = ((corner + far_corner) * 0.5, (far_corner - corner).length() * 0.5);
        let corners = (0..8).map(|i| {
            let pick =
                |axis: usize| if i >> axis & 1 == 0 { everything.min[axis] - origin[axis] } else { everything.max[axis] - origin[axis] };
            let p = Vec3::new(pick(0) as f32, pick(1) as f32, pick(2) as f32);
            Vec2::new(p.dot(u), p.dot(v))
        });
        let (min, max) = corners.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
        let grow = Vec2::splat(tan_alpha * far);
        // A ball over endless ground of albedo a gets 2 a times the light of its cross-section from below: so many photons,
        // for the two kinds to be about as strong.
        let (below, area) = (2.0 * brightest * std::f32::consts::PI * aim.radius * aim.radius, cells.len() as f32 * cell * cell);
        Skirt { centre, radius, probability: f64::from((below / (below + area)).min(0.8)), min: min - grow, max: max + grow }
    });
    let (upstream, far) = (upstream / cos_alpha, far / cos_alpha);
    Silhouette { u, v, corner, cell, width, mask, cells, curve, upstream, far, shaded, aim, skirt }
}

/// The bits of a number below 2^16 at every second place.
fn morton(x: u32) -> u32 {
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

/// A shape's shadow on the plane, in parts: centre, half extents, and whether it is an ellipse along the axes of the plane (else a
/// rectangle).
fn project(shape: &Shape, origin: DVec3, u: Vec3, v: Vec3, spread: f32, out: &mut Vec<(Vec2, Vec2, bool)>) {
    // Rounding to f32 must not clip the rim.
    let mut cast = |c: Vec3, half: Vec2, round: bool| {
        out.push((Vec2::new(c.dot(u), c.dot(v)), half * 1.0001 + spread + c.length() * 4.0 * f32::EPSILON, round));
    };
    let centre = (shape.bounds().centre() - origin).as_vec3();
    match shape {
        Shape::Ellipsoid { world_from_unit } => {
            let m = world_from_unit.matrix3.transpose();
            let half = Vec2::new((m * u.as_dvec3()).length() as f32, (m * v.as_dvec3()).length() as f32);
            let round = (half.x - half.y).abs() <= 1e-5 * half.x && is_round(world_from_unit.matrix3);
            cast(centre, half, round);
        }
        // Of each block what holds anything, and a sample more all around.
        Shape::Grid(grid) => {
            let world = grid.bricks.world_from_index;
            let across = |w: Vec3, half: DVec3| half.dot((world.matrix3.transpose() * w.as_dvec3()).abs()) as f32;
            for (brick, &first) in grid.bricks.origins.iter().enumerate() {
                for (low, high) in filled_blocks(grid.bricks.brick(brick)) {
                    let middle = IVec3::from_array(first).as_dvec3() + 0.5 * (low + high).as_dvec3();
                    let half = 0.5 * (high - low).as_dvec3() + 1.0;
                    cast((world.transform_point3(middle) - origin).as_vec3(), Vec2::new(across(u, half), across(v, half)), false);
                }
            }
        }
        _ => {
            let h = (shape.bounds().size() * 0.5).as_vec3();
            cast(centre, Vec2::new(h.dot(u.abs()), h.dot(v.abs())), false);
        }
    }
}

/// Of a brick's blocks that hold anything, the first and the last of the samples that do, along each axis.
fn filled_blocks(samples: &[f32]) -> impl Iterator<Item = (IVec3, IVec3)> {
    let mut blocks = [(IVec3::MAX, IVec3::MIN); 8];
    for (i, _) in samples.iter().enumerate().filter(|(_, s)| **s != 0.0) {
        let at = IVec3::new(i as i32 >> 6, i as i32 >> 3 & 7, i as i32 & 7);
        let block = at / BLOCK;
        let (low, high) = &mut blocks[(block.x << 2 | block.y << 1 | block.z) as usize];
        (*low, *high) = (low.min(at), high.max(at));
    }
    blocks.into_iter().filter(|(low, high)| low.cmple(*high).all())
}

fn is_sphere(shape: &Shape) -> bool {
    matches!(shape, Shape::Ellipsoid { world_from_unit } if is_round(world_from_unit.matrix3))
}

fn is_round(m: glam::DMat3) -> bool {
    let gram = m.transpose() * m;
    let r2 = gram.x_axis.x;
    (gram - glam::DMat3::from_diagonal(DVec3::splat(r2))).to_cols_array().iter().all(|e| e.abs() <= 1e-5 * r2)
}
