//! Sums over the neighbourhoods of a frame's voxels: what separable kernels are made of.
//!
//! A plane of voxels at one x is dealt with at a time, first along x, then within it along y and z: what lies between stays in the cache.

use super::frame::Frame;
use glam::IVec3;
use rayon::prelude::*;

/// Voxels along a brick, and so the longest reach of a kernel.
pub(super) const SIDE: usize = 8;
/// Voxels of a brick in one plane.
const TILE: usize = SIDE * SIDE;

/// A kernel along an axis.
pub(super) struct Taps {
    /// By powers 0, 1 and 2 of the distance: values at -reach..=reach.
    powers: [Vec<f32>; 3],
}

/// The sums that are wanted: along x by which powers of the distance times the kernel; along y and z which of the sums before, by which power.
pub(super) struct Terms<const X: usize, const Y: usize, const Z: usize> {
    pub x: [usize; X],
    pub y: [(usize, usize); Y],
    pub z: [(usize, usize); Z],
}

type Tile<const N: usize> = [[f32; N]; TILE];

/// The sums in a plane: of each brick there, and whether there are any.
struct Plane<const N: usize, const S: usize> {
    sums: Vec<[Tile<N>; S]>,
    any: Vec<bool>,
}

impl<const N: usize, const S: usize> Plane<N, S> {
    fn new(tiles: usize) -> Self {
        Plane { sums: vec![[[[0.0; N]; TILE]; S]; tiles], any: vec![false; tiles] }
    }

    /// A row of voxels along z of a sum; `None` where there is nothing.
    #[inline]
    fn row(&self, tile: usize, sum: usize, row: usize) -> Option<&[[f32; N]]> {
        self.any[tile].then(|| &self.sums[tile][sum][row * SIDE..(row + 1) * SIDE])
    }
}

impl Taps {
    /// A Gaussian with a standard deviation of `width` voxels that ends after `reach` of them.
    pub fn new(width: f64, reach: usize) -> Self {
        let tap = |i: usize, power: i32| {
            let d = i as f64 - reach as f64;
            ((-0.5 * (d / width).powi(2)).exp() * d.powi(power)) as f32
        };
        Taps { powers: [0, 1, 2].map(|power| (0..=2 * reach).map(|i| tap(i, power)).collect()) }
    }

    /// The mean, over a voxel, of what is interpolated between voxels' centres.
    pub fn interpolated() -> Self {
        Taps { powers: [vec![0.125, 0.75, 0.125], vec![], vec![]] }
    }

    /// What the kernel itself sums to.
    pub fn whole(&self) -> f32 {
        self.powers[0].iter().sum()
    }

    /// Of every voxel on the lines along z that are `needed`, what `finish` makes of the sums around it; `nothing` elsewhere, and where there is
    /// nothing to sum.
    pub fn around<const N: usize, const X: usize, const Y: usize, const Z: usize, R: Copy + Send + Sync>(
        &self,
        frame: &Frame,
        from: &[[f32; N]],
        terms: &Terms<X, Y, Z>,
        needed: &[bool],
        nothing: R,
        finish: impl Fn(usize, [[f32; N]; Z]) -> R + Sync,
    ) -> Vec<R> {
        let lit: Vec<bool> = from.par_chunks_exact(TILE).map(|tile| tile.iter().any(|v| *v != [0.0; N])).collect();
        let mut out = vec![nothing; from.len()];
        let size = frame.size();
        let mut planes: Vec<Vec<(usize, &mut [R])>> = (0..size.x as usize * SIDE).map(|_| Vec::new()).collect();
        for (number, part) in out.chunks_exact_mut(TILE).enumerate() {
            if needed[number * SIDE..(number + 1) * SIDE].contains(&true) {
                planes[frame.bricks[number / SIDE].x as usize * SIDE + number % SIDE].push((number, part));
            }
        }
        let tiles = (size.y * size.z) as usize;
        let room = || (Plane::<N, X>::new(tiles), Plane::<N, Y>::new(tiles));
        planes.into_par_iter().enumerate().for_each_init(room, |(along_x, along_y), (x, parts)| {
            // Bricks of this plane that are asked for, those beside them along z, and those beside these along y.
            let mut wanted = [vec![false; tiles], vec![false; tiles]];
            let places: Vec<[i32; 2]> = parts.iter().map(|(number, _)| frame.bricks[number / SIDE]).map(|b| [b.y, b.z]).collect();
            let tile = |y: i32, z: i32| ((0..size.y).contains(&y) && (0..size.z).contains(&z)).then_some((y * size.z + z) as usize);
            for &[y, z] in &places {
                for z in z - 1..=z + 1 {
                    tile(y, z).into_iter().for_each(|t| wanted[1][t] = true);
                    (y - 1..=y + 1).filter_map(|y| tile(y, z)).for_each(|t| wanted[0][t] = true);
                }
            }
            for t in (0..tiles).filter(|&t| wanted[0][t]) {
                let (y, z) = (t as i32 / size.z, t as i32 % size.z);
                let source = |x: usize| Some(frame.brick(IVec3::new((x / SIDE) as i32, y, z))? * SIDE + x % SIDE).filter(|&part| lit[part]);
                along_x.any[t] = self.sum_x(&terms.x, x, |x| Some(&from[source(x)? * TILE..][..TILE]), &mut along_x.sums[t]);
            }
            for t in (0..tiles).filter(|&t| wanted[1][t]) {
                let (y, z) = (t as i32 / size.z, t as i32 % size.z);
                let beside = [y - 1, y, y + 1].map(|y| tile(y, z).filter(|&t| wanted[0][t] && along_x.any[t]));
                along_y.any[t] = beside.iter().any(Option::is_some);
                if along_y.any[t] {
                    self.sum_y(&terms.y, |part, sum, row| along_x.row(beside[part]?, sum, row), &mut along_y.sums[t]);
                }
            }
            for ((number, part), [y, z]) in parts.into_iter().zip(places) {
                let beside = [z - 1, z, z + 1].map(|z| tile(y, z).filter(|&t| wanted[1][t] && along_y.any[t]));
                if beside.iter().all(Option::is_none) {
                    continue;
                }
                for row in (0..SIDE).filter(|row| needed[number * SIDE + row]) {
                    let values = self.sum_z(&terms.z, |part, sum| along_y.row(beside[part]?, sum, row));
                    for (k, sums) in values.into_iter().enumerate() {
                        let voxel = row * SIDE + k;
                        part[voxel] = finish(number * TILE + voxel, sums);
                    }
                }
            }
        });
        out
    }

    fn reach(&self) -> usize {
        self.powers[0].len() / 2
    }

    /// The sums along x of the voxels of a brick in one plane; whether there are any.
    fn sum_x<'a, const N: usize, const X: usize>(
        &self,
        powers: &[usize; X],
        x: usize,
        source: impl Fn(usize) -> Option<&'a [[f32; N]]>,
        sums: &mut [Tile<N>; X],
    ) -> bool {
        let reach = self.reach();
        let mut any = false;
        for i in reach.saturating_sub(x)..=2 * reach {
            let Some(from) = source(x + i - reach) else { continue };
            if !any {
                *sums = [[[0.0; N]; TILE]; X];
                any = true;
            }
            for (sum, &power) in sums.iter_mut().zip(powers) {
                add(self.powers[power][i], from, sum);
            }
        }
        any
    }

    /// The sums along y of a brick's, from those of the bricks before, here and after.
    fn sum_y<'a, const N: usize, const Y: usize>(
        &self,
        terms: &[(usize, usize); Y],
        row: impl Fn(usize, usize, usize) -> Option<&'a [[f32; N]]>,
        sums: &mut [Tile<N>; Y],
    ) {
        let reach = self.reach();
        for (sum, &(which, power)) in sums.iter_mut().zip(terms) {
            for (y, into) in sum.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
                *into = [[0.0; N]; SIDE];
                for (i, &tap) in self.powers[power].iter().enumerate() {
                    let at = SIDE + y + i - reach;
                    if let Some(from) = row(at / SIDE, which, at % SIDE) {
                        add(tap, from, into);
                    }
                }
            }
        }
    }

    /// The sums along z of a row of a brick, from those of the bricks before, here and after.
    fn sum_z<'a, const N: usize, const Z: usize>(
        &self,
        terms: &[(usize, usize); Z],
        row: impl Fn(usize, usize) -> Option<&'a [[f32; N]]>,
    ) -> [[[f32; N]; Z]; SIDE] {
        let (reach, mut out) = (self.reach(), [[[0.0; N]; Z]; SIDE]);
        for (term, &(which, power)) in terms.iter().enumerate() {
            let mut line = [[0.0; N]; 3 * SIDE];
            for (part, into) in line.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
                if let Some(from) = row(part, which) {
                    into.copy_from_slice(from);
                }
            }
            for (k, out) in out.iter_mut().enumerate() {
                let mut sum = [0.0; N];
                for (tap, from) in self.powers[power].iter().zip(&line[SIDE + k - reach..]) {
                    sum.iter_mut().zip(from).for_each(|(s, f)| *s += tap * f);
                }
                out[term] = sum;
            }
        }
        out
    }
}

/// Adds some values times a tap.
#[inline]
fn add<const N: usize>(tap: f32, from: &[[f32; N]], into: &mut [[f32; N]]) {
    from.as_flattened().iter().zip(into.as_flattened_mut()).for_each(|(f, s)| *s += tap * f);
}
