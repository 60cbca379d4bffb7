//! The n nearest of the stored photons, exactly, and quickly where the points asked for lie close together.

use super::map::PhotonTree;
use super::{Photon, bounds};
use crate::bvh::Box3;
use crate::geom::Tile;
use glam::Vec3;

/// Photons are looked for so much farther than the last ones were found.
const MARGIN: f32 = 1.06;
/// Points closer together than this share of that distance find theirs in one neighbourhood.
const CLOSE: f32 = 0.5;

/// Stored photons and the tree over them, to be asked for the n nearest of a point.
#[derive(Debug)]
pub struct Nearest {
    photons: Vec<Photon>,
    tree: Option<PhotonTree>,
    count: usize,
    /// Distances below this are rounding, m.
    floor: f32,
    /// Across which all photons are, m.
    span: f32,
    /// Where photons repeat horizontally.
    tile: Option<Tile>,
}

/// The photons around a point, kept for the points after it.
#[derive(Debug, Default)]
pub struct Neighbourhood {
    centre: Vec3,
    /// Every photon within this of the centre is in `kept`, if any is.
    radius: f32,
    kept: Vec<(Vec3, u32)>,
    /// The photons of the point asked last, by [`key`]; the nearest first as far as they were asked for.
    order: Vec<u64>,
}

impl Nearest {
    /// The `count` nearest (all, where there are fewer) of photons in the order of [`super::PhotonMap::along_curve`]; `tile` as in
    /// [`super::Tracer::tile`].
    pub fn new(photons: Vec<Photon>, count: u64, tile: Option<Tile>) -> Self {
        let Box3 { min, max } = bounds(&photons);
        let span = if photons.is_empty() { 0.0 } else { (max - min).length() };
        let floor = if photons.is_empty() { 0.0 } else { 4.0 * f32::EPSILON * min.abs().max(max.abs()).max_element() };
        let tree = if photons.is_empty() { None } else { PhotonTree::new(&photons) };
        let count = (count.max(1) as usize).min(photons.len());
        // The cube of a distance still has to be a number.
        Nearest { photons, tree, count, floor: floor.max(1e-12), span, tile }
    }

    /// How many are asked for.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The least distance that is told, m: what is nearer differs by rounding alone.
    pub fn floor(&self) -> f32 {
        self.floor
    }

    /// The photons that were found last, in no order but for the last, which is the farthest.
    #[inline]
    pub fn found<'a>(&'a self, hood: &'a Neighbourhood) -> impl ExactSizeIterator<Item = &'a Photon> {
        hood.order.iter().map(|&key| &self.photons[key as u32 as usize])
    }

    /// Looks for the nearest photons of `p`: the distance of the farthest of them, m. `None` without photons, and at no point.
    ///
    /// Exact, whatever was asked before: a neighbourhood is used again only where it holds all that lie nearer than the last.
    pub fn find(&self, p: Vec3, hood: &mut Neighbourhood) -> Option<f32> {
        let tree = self.tree.as_ref().filter(|_| p.is_finite())?;
        let p = self.wrapped(p);
        let away = p.distance(hood.centre);
        if hood.kept.len() >= self.count && away < hood.radius {
            hood.order.clear();
            hood.order.extend(hood.kept.iter().map(|&(q, i)| key(q.distance_squared(p), i)));
            let found = hood.select(self.count);
            // With room for the rounding of distances.
            if found + away <= hood.radius * (1.0 - 8.0 * f32::EPSILON) {
                return Some(found.max(self.floor));
            }
        }
        // As far as was found last; from even photons in a cube at first. Farther where the next point is likely to be close by.
        let share = (self.count as f32 / self.photons.len() as f32).cbrt();
        let last = if hood.order.is_empty() { 0.5 * self.span * share } else { hood.farthest() };
        let keep = away < CLOSE * last;
        let mut radius = (last * MARGIN + if keep { away } else { 0.0 }).max(self.floor);
        loop {
            hood.order.clear();
            hood.kept.clear();
            for shift in self.images(p, radius) {
                tree.within(p - shift, radius, |distance2, i| {
                    hood.order.push(key(distance2, i));
                    if keep {
                        hood.kept.push((Vec3::from_array(self.photons[i as usize].position) + shift, i));
                    }
                });
            }
            if hood.order.len() >= self.count {
                break;
            }
            let short = self.count as f32 / (hood.order.len() as f32 + 0.5);
            radius *= (MARGIN * short.cbrt()).min(4.0);
        }
        (hood.centre, hood.radius) = (p, radius);
        Some(hood.select(self.count).max(self.floor))
    }

    /// A point's image within the tile, where there is one.
    pub fn wrapped(&self, p: Vec3) -> Vec3 {
        self.tile.map_or(p, |tile| tile.wrapped(p))
    }

    /// By how much photons are to be shifted for all their images within `radius` of `p`.
    fn images(&self, p: Vec3, radius: f32) -> impl Iterator<Item = Vec3> {
        let range = |axis: usize| match self.tile {
            None => (0, 0),
            Some(tile) => {
                let number = |x: f32| ((x - tile.min[axis]) / tile.size()[axis]).floor() as i32;
                (number(p[axis] - radius), number(p[axis] + radius))
            }
        };
        let ((x0, x1), (y0, y1)) = (range(0), range(1));
        let size = self.tile.map_or(Vec3::ZERO, |tile| tile.size());
        (x0..=x1).flat_map(move |x| (y0..=y1).map(move |y| Vec3::new(x as f32 * size.x, y as f32 * size.y, 0.0)))
    }
}

impl Neighbourhood {
    /// Puts the `n` nearest first; the distance of the n-th.
    fn select(&mut self, n: usize) -> f32 {
        self.order.select_nth_unstable(n - 1);
        self.order.truncate(n);
        self.farthest()
    }

    /// The distance of the last photon that was asked for.
    fn farthest(&self) -> f32 {
        self.order.last().map_or(0.0, |&key| f32::from_bits((key >> 32) as u32).sqrt())
    }
}

/// Orders by distance and then by number: a float that is not negative orders as its bits do.
#[inline]
fn key(distance2: f32, number: u32) -> u64 {
    u64::from(distance2.to_bits()) << 32 | u64::from(number)
}

#[cfg(test)]
mod tests;
