//! Small geometry: bounds, rays, orthonormal bases.

use glam::{DVec3, Vec3};

/// An axis-aligned box in world space; empty where `min > max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The smallest corner.
    pub min: DVec3,
    /// The largest corner.
    pub max: DVec3,
}

impl Bounds {
    /// The box that holds nothing, neutral for [`Bounds::union`].
    pub const EMPTY: Bounds = Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box that holds both.
    pub fn union(self, other: Bounds) -> Bounds {
        Bounds { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The smallest box that also holds the point.
    pub fn include(self, p: DVec3) -> Bounds {
        Bounds { min: self.min.min(p), max: self.max.max(p) }
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        !(self.min.cmple(self.max).all())
    }

    /// Its centre; zero where it is empty.
    pub fn centre(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min + (self.max - self.min) * 0.5 }
    }

    /// Its sides; zero where it is empty.
    pub fn size(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.max - self.min }
    }
}

/// A rectangle in x and y that repeats without end, in the single-precision space of the hot loops.
#[derive(Debug, Clone, Copy)]
pub struct Tile {
    /// Its smallest corner; z as well, where nothing repeats.
    pub min: Vec3,
    /// Its largest corner.
    pub max: Vec3,
}

impl Tile {
    /// Its sides, m.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// A point's image within it.
    pub fn wrapped(&self, p: Vec3) -> Vec3 {
        let size = self.size();
        let fold = |x: f32, min: f32, size: f32| min + (x - min).rem_euclid(size).min(size.next_down());
        Vec3::new(fold(p.x, self.min.x, size.x), fold(p.y, self.min.y, size.y), p.z)
    }

    /// Whether it holds a point, at whatever height.
    pub fn holds(&self, p: Vec3) -> bool {
        p.x >= self.min.x && p.x <= self.max.x && p.y >= self.min.y && p.y <= self.max.y
    }
}

/// A ray in the recentred, single-precision space of the hot loops. `direction` has unit length.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes, unit length.
    pub direction: Vec3,
}

impl Ray {
    /// The point at distance `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// Two unit vectors that complete `n` (unit length) to a right-handed orthonormal basis (Duff et al. 2017).
#[inline]
pub fn basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}
