//! The volume radiance estimate (thesis eqs 23, 30): light scattered at a point, from the n stored photons nearest to it.

use crate::geom::Tile;
use crate::integrate::lobe::Lobe;
use crate::media::Media;
use crate::photon::{GROUPS, Model, Nearest, Neighbourhood, Photon, unpack_direction};
use glam::Vec3;
use std::f64::consts::PI;

/// Stored photons as a volume radiance estimate.
#[derive(Debug)]
pub(super) struct Gather {
    nearest: Nearest,
    model: Model,
    /// The strongest photon, W.
    strongest: f32,
    /// The same of every eighth photon: where as many of these lie is twice as far.
    wide: Option<Box<Gather>>,
}

/// Sums are of whole numbers, of which the strongest photon in the phase function's peak is 2^38: the same in whatever order.
const WHOLE: f64 = (1u64 << 38) as f64;

/// Every eighth photon, of eight times the power.
pub(super) fn thinned(photons: &[Photon]) -> Vec<Photon> {
    let mut thinned: Vec<Photon> = photons.iter().step_by(8).copied().collect();
    thinned.iter_mut().for_each(|photon| photon.power *= 8.0);
    thinned
}

/// What scatters at a point, by groups of paths.
pub(super) type Groups = [f64; GROUPS];

impl Gather {
    /// Estimates of `estimate` photons each; `photons` and `tile` as in [`Nearest::new`].
    pub(super) fn new(photons: Vec<Photon>, estimate: u64, model: Model, tile: Option<Tile>) -> Self {
        let wide = Gather::of(thinned(&photons), estimate, model, tile, None);
        Gather::of(photons, estimate, model, tile, Some(Box::new(wide)))
    }

    fn of(photons: Vec<Photon>, estimate: u64, model: Model, tile: Option<Tile>, wide: Option<Box<Gather>>) -> Self {
        let strongest = photons.iter().map(|p| p.power).fold(0.0, f32::max);
        Gather { nearest: Nearest::new(photons, estimate, tile), model, strongest, wide }
    }

    /// Estimates by every eighth photon, of as many, and so from twice as far.
    pub(super) fn wide(&self) -> Option<&Gather> {
        self.wide.as_deref()
    }

    /// Where photons are looked for.
    #[cfg(test)]
    pub(super) fn nearest(&self) -> &Nearest {
        &self.nearest
    }

    /// Photons in an estimate.
    pub(super) fn estimate(&self) -> u64 {
        self.nearest.count() as u64
    }

    /// The light that leaves `p` in direction `outward` (of travel), scattered by a mean cosine `g`, per unit of optical depth
    /// and of albedo: W m^-2 sr^-1, by groups whose sum it is.
    ///
    /// Physical: the n - 1 nearest photons over the optical mass within the n-th's distance, without bias where light is even,
    /// wherever regions end or overlap. To the letter: all n over 4/3 pi r^3, at a point of extinction `sigma_t`.
    ///
    /// Near the boundary of a sphere of optical radius 4 (300,000 photons, n = 200), 0, 0.25, 0.5 and 1 search radii deep, light
    /// without the correction is off by -46, -32, -18 and -2 % on the lit side and -44, -28, -14 and -1 % in the shade; with it by
    /// +11, +2, -2 and -2 %, and +21, +11, +5 and -1 % (each 1 to 2). What is left is that light differs across half a ball: it falls as its radius.
    pub(super) fn scattered(&self, p: Vec3, outward: Vec3, g: f64, sigma_t: f64, media: &Media, hood: &mut Neighbourhood) -> Groups {
        let Some(radius) = self.nearest.find(p, hood) else { return [0.0; GROUPS] };
        let (count, mass) = match self.model {
            Model::Physical => (self.nearest.count() - 1, media.mass_within(self.nearest.wrapped(p), radius)),
            Model::Hura2006 => (self.nearest.count(), 4.0 / 3.0 * PI * f64::from(radius).powi(3) * sigma_t),
        };
        let lobe = Lobe::new(g, outward);
        let most = f64::from(self.strongest) * f64::from(lobe.peak());
        // No medium where photons are: rounding at a region's rim.
        if mass <= 0.0 || most <= 0.0 {
            return [0.0; GROUPS];
        }
        let (mut sums, whole) = ([0i64; GROUPS], WHOLE / most);
        for photon in self.nearest.found(hood).take(count) {
            sums[photon.group()] += (f64::from(photon.power * lobe.value(unpack_direction(photon.direction))) * whole) as i64;
        }
        sums.map(|sum| sum as f64 / (whole * mass))
    }
}
