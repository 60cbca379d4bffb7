//! A bounding volume hierarchy over boxes: what a ray may touch.

use glam::Vec3;
use smallvec::SmallVec;
use std::ops::Range;

/// A box in single precision.
#[derive(Debug, Clone, Copy)]
pub struct Box3 {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Box3 {
    /// The box of a world-space box relative to `origin`, widened so that rounding to `f32` loses nothing.
    pub fn around(bounds: crate::geom::Bounds, origin: glam::DVec3) -> Self {
        let (min, max) = ((bounds.min - origin).as_vec3(), (bounds.max - origin).as_vec3());
        let pad = min.abs().max(max.abs()) * 4.0 * f32::EPSILON + f32::MIN_POSITIVE;
        Box3 { min: min - pad, max: max + pad }
    }

    /// Whether two boxes share a point.
    pub fn meets(&self, o: &Box3) -> bool {
        self.min.cmple(o.max).all() && o.min.cmple(self.max).all()
    }

    fn union(self, o: Box3) -> Box3 {
        Box3 { min: self.min.min(o.min), max: self.max.max(o.max) }
    }

    /// Whether the ray (by its origin and the reciprocal of its direction, finite) meets the box within [0, t_max].
    #[inline]
    fn hit(&self, origin: Vec3, inv: Vec3, t_max: f32) -> bool {
        let (a, b) = ((self.min - origin) * inv, (self.max - origin) * inv);
        // Plain comparisons are single instructions; nothing here is NaN.
        let low = |x: f32, y: f32| if x < y { x } else { y };
        let high = |x: f32, y: f32| if x > y { x } else { y };
        let enter = high(high(low(a.x, b.x), low(a.y, b.y)), high(low(a.z, b.z), 0.0));
        let exit = low(low(high(a.x, b.x), high(a.y, b.y)), low(high(a.z, b.z), t_max));
        // Robust bound (Ize 2013): the exit distance may be two roundings short.
        enter <= exit * (1.0 + 4.0 * f32::EPSILON)
    }
}

/// The reciprocal of a direction, with axes that it does not move along at 1e30 and not at infinity, whose product with 0 is NaN.
fn finite_reciprocal(direction: Vec3) -> Vec3 {
    let one = |d: f32| if d.abs() < 1e-30 { 1e30f32.copysign(d) } else { 1.0 / d };
    Vec3::new(one(direction.x), one(direction.y), one(direction.z))
}

#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Box3,
    /// An inner node's second child (its first is the next node); a leaf's first item.
    index: u32,
    /// Items of a leaf; 0 for inner nodes.
    count: u32,
}

/// The hierarchy. Balanced by construction: depth is at most log2 of the number of items.
#[derive(Debug, Clone, Default)]
pub struct Bvh {
    nodes: Vec<Node>,
    items: Vec<u32>,
}

impl Bvh {
    /// Builds the hierarchy over the items that have a box, by median splits along the longest axis of the centres, down to
    /// leaves of at most `leaf` items.
    pub fn new(boxes: &[Option<Box3>], leaf: usize) -> Self {
        let items: Vec<u32> = (0..boxes.len() as u32).filter(|&i| boxes[i as usize].is_some()).collect();
        let nowhere = Box3 { min: Vec3::ZERO, max: Vec3::ZERO };
        let boxes: Vec<Box3> = boxes.iter().map(|b| b.unwrap_or(nowhere)).collect();
        let mut bvh = Bvh { nodes: Vec::with_capacity(items.len()), items };
        if !bvh.items.is_empty() {
            bvh.build(&boxes, 0, bvh.items.len(), leaf);
        }
        bvh
    }

    fn build(&mut self, boxes: &[Box3], from: usize, to: usize, leaf: usize) {
        let all = |f: fn(Vec3, Vec3) -> Vec3, start: Vec3, of: fn(&Box3) -> Vec3, items: &[u32]| {
            items.iter().fold(start, |a, &i| f(a, of(&boxes[i as usize])))
        };
        let items = &self.items[from..to];
        let bounds = items.iter().map(|&i| boxes[i as usize]).reduce(Box3::union).unwrap_or(Box3 { min: Vec3::ZERO, max: Vec3::ZERO });
        let node = self.nodes.len();
        self.nodes.push(Node { bounds, index: from as u32, count: (to - from) as u32 });
        if to - from <= leaf {
            return;
        }
        let centre = |b: &Box3| b.min * 0.5 + b.max * 0.5;
        let extent = all(Vec3::max, Vec3::NEG_INFINITY, centre, items) - all(Vec3::min, Vec3::INFINITY, centre, items);
        let axis = if extent.x >= extent.y && extent.x >= extent.z { 0 } else { 1 + usize::from(extent.z > extent.y) };
        let middle = (to - from) / 2;
        self.items[from..to].select_nth_unstable_by(middle, |&a, &b| {
            centre(&boxes[a as usize])[axis].total_cmp(&centre(&boxes[b as usize])[axis]).then(a.cmp(&b))
        });
        self.build(boxes, from, from + middle, leaf);
        self.nodes[node].index = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.build(boxes, from + middle, to, leaf);
    }

    /// All items, leaf by leaf.
    pub fn items(&self) -> &[u32] {
        &self.items
    }

    /// Calls `visit(item, t_max)` for every item whose leaf's box the ray may meet within [0, t_max]. `visit` may shrink `t_max`.
    #[inline]
    pub fn traverse(&self, origin: Vec3, direction: Vec3, t_max: f32, mut visit: impl FnMut(u32, &mut f32)) {
        self.leaves(origin, direction, t_max, |range, t_max| self.items[range].iter().for_each(|&item| visit(item, t_max)));
    }

    /// Calls `visit(range of items(), t_max)` for every leaf whose box the ray may meet within [0, t_max].
    #[inline]
    pub fn leaves(&self, origin: Vec3, direction: Vec3, mut t_max: f32, mut visit: impl FnMut(Range<usize>, &mut f32)) {
        if self.nodes.is_empty() {
            return;
        }
        let inv = finite_reciprocal(direction);
        let mut stack: SmallVec<[u32; 32]> = SmallVec::new();
        let mut current = 0u32;
        loop {
            let node = &self.nodes[current as usize];
            if node.bounds.hit(origin, inv, t_max) {
                if node.count == 0 {
                    stack.push(node.index);
                    current += 1;
                    continue;
                }
                visit(node.index as usize..(node.index + node.count) as usize, &mut t_max);
            }
            match stack.pop() {
                Some(next) => current = next,
                None => return,
            }
        }
    }

    /// Calls `visit` for every item of the leaves that a box meets, until it answers `true`.
    pub fn overlapping(&self, query: &Box3, mut visit: impl FnMut(u32) -> bool) {
        let mut stack: SmallVec<[u32; 64]> = SmallVec::new();
        stack.extend((!self.nodes.is_empty()).then_some(0));
        while let Some(current) = stack.pop() {
            let node = &self.nodes[current as usize];
            if !node.bounds.meets(query) {
                continue;
            }
            if node.count == 0 {
                stack.extend([current + 1, node.index]);
            } else if self.items[node.index as usize..(node.index + node.count) as usize].iter().any(|&i| visit(i)) {
                return;
            }
        }
    }
}
