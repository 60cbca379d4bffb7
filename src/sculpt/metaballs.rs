//! Metaballs, as Blender evaluates them.
//!
//! An element's field is `stiffness * (1 - r^2 / R^2)^3` inside its radius R and 0 outside, where r is the distance to its centre, or
//! to the segment, rectangle or box that capsules, planes and cubes spread the centre to; ellipsoids measure r in units of their half
//! axes. Negative elements subtract. The fields of a family are summed, and its surface is where the sum is the threshold.

use crate::geom::Bounds;
use glam::{DAffine3, DVec3};

/// Stiffness beyond this changes nothing, as in Blender.
const STIFFEST: f64 = 10.0;

/// The kinds of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementKind {
    /// About a point.
    Ball,
    /// About a segment along x.
    Capsule,
    /// About a rectangle in x and y.
    Plane,
    /// A ball whose half axes are its sizes, times the radius.
    Ellipsoid,
    /// About a box.
    Cube,
}

/// One element of a family.
#[derive(Debug, Clone)]
pub struct Element {
    /// To where its radius is 1.
    unit_from_world: DAffine3,
    /// Half of what its centre is spread to there, along each axis.
    spread: DVec3,
    /// The radius in the world, m: that of the ball of equal volume, where the element is scaled unevenly.
    world_radius: f64,
    /// Below 0 where it is negative.
    stiffness: f64,
    bounds: Bounds,
}

impl Element {
    /// An element: where its own space (Blender's, Z up) is in the world, its radius there, its stiffness (below 0 where it is
    /// negative), and its half lengths along its axes (an ellipsoid's are factors of the radius). `world_from_element` is not singular,
    /// the radius and an ellipsoid's sizes are above 0.
    pub fn new(kind: ElementKind, world_from_element: DAffine3, radius: f64, stiffness: f64, size: DVec3) -> Self {
        let (spread, stretched) = match kind {
            ElementKind::Ball => (DVec3::ZERO, DVec3::ONE),
            ElementKind::Capsule => (DVec3::X * size, DVec3::ONE),
            ElementKind::Plane => (size.with_z(0.0), DVec3::ONE),
            ElementKind::Cube => (size, DVec3::ONE),
            ElementKind::Ellipsoid => (DVec3::ZERO, size),
        };
        let world_from_unit = world_from_element * DAffine3::from_scale(radius * stretched);
        let spread = spread / radius;
        let corner = |i: usize| {
            let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            world_from_unit.transform_point3((spread + 1.0) * DVec3::new(sign(0), sign(1), sign(2)))
        };
        Element {
            unit_from_world: world_from_unit.inverse(),
            spread,
            world_radius: world_from_unit.matrix3.determinant().abs().cbrt(),
            stiffness: stiffness.clamp(-STIFFEST, STIFFEST),
            bounds: (0..8).fold(Bounds::EMPTY, |b, i| b.include(corner(i))),
        }
    }

    /// 1 - r^2 at a point of the unit space: above 0 inside.
    fn inside(&self, q: DVec3) -> f64 {
        1.0 - (q - q.clamp(-self.spread, self.spread)).length_squared()
    }

    /// Its field at a point of the world.
    pub fn field(&self, p: DVec3) -> f64 {
        let inside = self.inside(self.unit_from_world.transform_point3(p)).max(0.0);
        self.stiffness * inside * inside * inside
    }

    /// Whether its field may be other than 0 within `radius` of a point of the world.
    pub fn reaches(&self, p: DVec3, radius: f64) -> bool {
        let (q, m) = (self.unit_from_world.transform_point3(p), self.unit_from_world.matrix3);
        // The norm of a matrix is at most the root of the largest sum of a row of its square: exact for a turned and scaled one.
        let square = m.transpose() * m;
        let norm = (0..3).map(|i| square.row(i).abs().element_sum()).fold(0.0, f64::max).sqrt();
        (q - q.clamp(-self.spread, self.spread)).length() < 1.0 + radius * norm
    }

    /// The box outside which its field is 0.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }
}

/// A family: elements whose fields are summed.
#[derive(Debug, Clone)]
pub struct Metaballs {
    /// The field on the surface, not below 0.
    pub threshold: f64,
    /// The elements.
    pub elements: Vec<Element>,
}

/// Points of a row.
pub const ROW: usize = 8;

/// A family's field at the points of a row, and the lone balls that would make it there.
#[derive(Debug, Clone, Copy, Default)]
pub struct Row {
    /// The sums of the fields.
    pub field: [f64; ROW],
    /// The fields above 0, summed with their elements' radii (m) and stiffnesses as weights.
    positive: [f64; ROW],
    radii: [f64; ROW],
    stiffnesses: [f64; ROW],
}

impl Row {
    /// Adds an element to the points `start`, `start + step` and so on.
    pub fn add(&mut self, element: &Element, start: DVec3, step: DVec3) {
        let (at, by) = (element.unit_from_world.transform_point3(start), element.unit_from_world.matrix3 * step);
        let along = |k: usize| k as f64;
        let inside: [f64; ROW] = if element.spread == DVec3::ZERO {
            let (c, b, a) = (1.0 - at.length_squared(), -2.0 * at.dot(by), -by.length_squared());
            std::array::from_fn(|k| c + along(k) * (b + along(k) * a))
        } else {
            std::array::from_fn(|k| element.inside(at + along(k) * by))
        };
        let field = inside.map(|u| {
            let u = u.max(0.0);
            element.stiffness * u * u * u
        });
        add(&mut self.field, &field, 1.0);
        if element.stiffness > 0.0 {
            add(&mut self.positive, &field, 1.0);
            add(&mut self.radii, &field, element.world_radius);
            add(&mut self.stiffnesses, &field, element.stiffness);
        }
    }

    /// The radius and the stiffness of the lone ball at a point, means over the elements by their fields; `None` where nothing adds to
    /// the field.
    pub fn ball(&self, k: usize) -> Option<(f64, f64)> {
        (self.positive[k] > 0.0).then(|| (self.radii[k] / self.positive[k], self.stiffnesses[k] / self.positive[k]))
    }
}

/// Adds `by * terms` to `sums`.
fn add(sums: &mut [f64; ROW], terms: &[f64; ROW], by: f64) {
    for (sum, term) in sums.iter_mut().zip(terms) {
        *sum += by * term;
    }
}

impl Metaballs {
    /// The field at a point of the world.
    pub fn field(&self, p: DVec3) -> f64 {
        self.elements.iter().map(|e| e.field(p)).sum()
    }

    /// How much of the field above the threshold makes the full density: as much as there is at the middle of a lone element, the
    /// stiffest; a tenth of its field where that is more, as with elements so soft that only several of them show.
    pub fn span(&self) -> f64 {
        let core = self.elements.iter().map(|e| e.stiffness).fold(f64::MIN_POSITIVE, f64::max);
        (core - self.threshold).max(0.1 * core)
    }

    /// The box outside which the field is not above 0.
    pub fn bounds(&self) -> Bounds {
        self.elements.iter().filter(|e| e.stiffness > 0.0).fold(Bounds::EMPTY, |b, e| b.union(e.bounds))
    }

    /// The mean radius in the world at which an element alone would show, m; `None` where none would.
    pub fn mean_visible(&self) -> Option<f64> {
        let visible = self.elements.iter().filter_map(|e| visible_radius(e.world_radius, self.threshold, e.stiffness));
        let (count, sum) = visible.fold((0, 0.0), |(n, sum), r| (n + 1, sum + r));
        (count > 0).then(|| sum / f64::from(count))
    }

    /// The smallest radius in the world at which an element alone would show, m; `None` where none would.
    pub fn smallest_visible(&self) -> Option<f64> {
        let visible = |e: &Element| visible_radius(e.world_radius, self.threshold, e.stiffness);
        self.elements.iter().filter_map(visible).reduce(f64::min)
    }
}

/// The radius at which a lone ball's field is the threshold; `None` where it never is.
pub fn visible_radius(radius: f64, threshold: f64, stiffness: f64) -> Option<f64> {
    let inside = 1.0 - (threshold / stiffness).cbrt();
    (stiffness > 0.0 && inside > 0.0).then(|| radius * inside.sqrt())
}
