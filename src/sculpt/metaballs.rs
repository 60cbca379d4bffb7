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
    kind: ElementKind,
    element_from_world: DAffine3,
    radius: f64,
    /// The radius in the world, m: that of the ball of equal volume, where the element is scaled unevenly.
    world_radius: f64,
    /// Below 0 where it is negative.
    stiffness: f64,
    size: DVec3,
    bounds: Bounds,
}

impl Element {
    /// An element: where its own space (Blender's, Z up) is in the world, its radius there, its stiffness (below 0 where it is
    /// negative), and its half lengths along its axes (an ellipsoid's are factors of the radius). `world_from_element` is not singular,
    /// the radius and an ellipsoid's sizes are above 0.
    pub fn new(kind: ElementKind, world_from_element: DAffine3, radius: f64, stiffness: f64, size: DVec3) -> Self {
        let half = match kind {
            ElementKind::Ball => DVec3::splat(radius),
            ElementKind::Capsule => DVec3::new(radius + size.x, radius, radius),
            ElementKind::Plane => DVec3::new(radius + size.x, radius + size.y, radius),
            ElementKind::Cube => size + radius,
            ElementKind::Ellipsoid => size * radius,
        };
        let corner = |i: usize| {
            let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            world_from_element.transform_point3(half * DVec3::new(sign(0), sign(1), sign(2)))
        };
        let stretch = world_from_element.matrix3.determinant().abs().cbrt();
        let mean = if kind == ElementKind::Ellipsoid { size.element_product().abs().cbrt() } else { 1.0 };
        Element {
            kind,
            element_from_world: world_from_element.inverse(),
            radius,
            world_radius: radius * stretch * mean,
            stiffness: stiffness.clamp(-STIFFEST, STIFFEST),
            size,
            bounds: (0..8).fold(Bounds::EMPTY, |b, i| b.include(corner(i))),
        }
    }

    /// Its field at a point of the world.
    pub fn field(&self, p: DVec3) -> f64 {
        let q = self.element_from_world.transform_point3(p);
        // What is left of a coordinate beyond a half length.
        let beyond = |x: f64, half: f64| x - x.clamp(-half, half);
        let q = match self.kind {
            ElementKind::Ball => q,
            ElementKind::Capsule => DVec3::new(beyond(q.x, self.size.x), q.y, q.z),
            ElementKind::Plane => DVec3::new(beyond(q.x, self.size.x), beyond(q.y, self.size.y), q.z),
            ElementKind::Cube => q - q.clamp(-self.size, self.size),
            ElementKind::Ellipsoid => q / self.size,
        };
        let inside = 1.0 - q.length_squared() / (self.radius * self.radius);
        if inside > 0.0 { self.stiffness * inside * inside * inside } else { 0.0 }
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

/// A family's field at a point, and the lone ball that would make it there.
#[derive(Debug, Clone, Copy, Default)]
pub struct Look {
    /// The sum of the fields.
    pub field: f64,
    /// The fields above 0, summed with their elements' radii (m) and stiffnesses as weights.
    positive: f64,
    radii: f64,
    stiffnesses: f64,
}

impl Look {
    /// Adds an element.
    pub fn add(&mut self, element: &Element, p: DVec3) {
        let field = element.field(p);
        self.field += field;
        if field > 0.0 {
            self.positive += field;
            self.radii += field * element.world_radius;
            self.stiffnesses += field * element.stiffness;
        }
    }

    /// The radius and the stiffness of the lone ball, means over the elements by their fields; `None` where nothing adds to the field.
    pub fn ball(&self) -> Option<(f64, f64)> {
        (self.positive > 0.0).then(|| (self.radii / self.positive, self.stiffnesses / self.positive))
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
