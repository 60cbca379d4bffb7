//! A sky that is not the same everywhere: radiance over all directions.

use glam::{DVec3, Vec3};
use std::f32::consts::{PI, TAU};

/// Radiance by latitude and longitude: rows of texels from the zenith down, the middle of a row toward +X and its left half toward +Y, as
/// Blender lays an equirectangular environment texture. Between the texels' middles it is interpolated.
#[derive(Debug, Clone, PartialEq)]
pub struct Dome {
    width: usize,
    height: usize,
    /// W m^-2 sr^-1, RGB.
    texels: Vec<[f32; 3]>,
    /// The chance that a direction drawn lies in a row or one above; of each row, that it lies in a column or one to the left.
    rows: Vec<f32>,
    columns: Vec<f32>,
}

impl Dome {
    /// Out of rows of texels, none of them negative or not finite; `None` where none is above 0, or where they do not fill the rows.
    pub fn new(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Option<Self> {
        if width == 0 || height == 0 || texels.len() != width * height || !texels.iter().flatten().all(|&v| v >= 0.0 && v.is_finite()) {
            return None;
        }
        let mut dome = Dome { width, height, texels, rows: Vec::with_capacity(height), columns: Vec::with_capacity(width * height) };
        // As bright as anything that is interpolated in a texel may be.
        let brightest = |row: usize, column: usize| {
            let around = (0..9).map(|i| {
                let y = (row + i / 3).saturating_sub(1).min(height - 1);
                let x = (column + width + i % 3 - 1) % width;
                dome.texels[y * width + x].into_iter().fold(0.0, f32::max)
            });
            around.fold(0.0, f32::max)
        };
        let (mut rows, mut columns, mut whole) = (Vec::new(), Vec::new(), 0.0f64);
        for row in 0..height {
            let first = columns.len();
            let mut sum = 0.0f64;
            for column in 0..width {
                sum += f64::from(brightest(row, column));
                columns.push(sum);
            }
            columns[first..].iter_mut().for_each(|c| *c = if sum > 0.0 { *c / sum } else { 1.0 });
            whole += sum * dome.solid_angle(row);
            rows.push(whole);
        }
        if whole <= 0.0 {
            return None;
        }
        dome.rows = rows.into_iter().map(|r| (r / whole) as f32).collect();
        dome.columns = columns.into_iter().map(|c| c as f32).collect();
        Some(dome)
    }

    /// Out of a function of the direction, which has unit length and is in the world.
    pub fn of(width: usize, height: usize, radiance: impl Fn(DVec3) -> [f64; 3]) -> Option<Self> {
        let texel = |i: usize| {
            let u = ((i % width) as f64 + 0.5) / width as f64;
            let v = ((i / width) as f64 + 0.5) / height as f64;
            let ((sin, cos), (across, along)) = ((std::f64::consts::PI * v).sin_cos(), (std::f64::consts::TAU * (0.5 - u)).sin_cos());
            radiance(DVec3::new(sin * along, sin * across, cos)).map(|c| c as f32)
        };
        Dome::new(width, height, (0..width * height).map(texel).collect())
    }

    /// The solid angle of each texel of a row.
    fn solid_angle(&self, row: usize) -> f64 {
        let z = |row: usize| (std::f64::consts::PI * row as f64 / self.height as f64).cos();
        std::f64::consts::TAU * (z(row) - z(row + 1)) / self.width as f64
    }

    /// Texels from the left and from the top of a direction of unit length.
    fn place(&self, direction: Vec3) -> (f32, f32) {
        let u = 0.5 - direction.y.atan2(direction.x) / TAU;
        let v = direction.z.clamp(-1.0, 1.0).acos() / PI;
        (u * self.width as f32, v * self.height as f32)
    }

    /// The radiance that comes from a direction of unit length, W m^-2 sr^-1.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let (x, y) = self.place(direction);
        let (x, y) = (x - 0.5, (y - 0.5).clamp(0.0, self.height as f32 - 1.0));
        let (left, top) = (x.floor(), y.floor().min((self.height.max(2) - 2) as f32));
        let (fx, fy) = (x - left, (y - top).min(1.0));
        let texel = |dx: usize, dy: usize| {
            let column = (left as isize + dx as isize).rem_euclid(self.width as isize) as usize;
            let row = (top as usize + dy).min(self.height - 1);
            Vec3::from_array(self.texels[row * self.width + column])
        };
        texel(0, 0).lerp(texel(1, 0), fx).lerp(texel(0, 1).lerp(texel(1, 1), fx), fy)
    }

    /// A direction from which light comes, drawn about as the light is strong, by two uniform numbers; with its density, 1/sr.
    pub fn sample(&self, u: f32, v: f32) -> (Vec3, f32) {
        let row = self.rows.partition_point(|&c| c <= v).min(self.height - 1);
        let before = if row > 0 { self.rows[row - 1] } else { 0.0 };
        let along = ((v - before) / (self.rows[row] - before)).clamp(0.0, 1.0);
        let columns = &self.columns[row * self.width..][..self.width];
        let column = columns.partition_point(|&c| c <= u).min(self.width - 1);
        let left = if column > 0 { columns[column - 1] } else { 0.0 };
        let across = ((u - left) / (columns[column] - left)).clamp(0.0, 1.0);
        // Even in solid angle within the texel.
        let z = |row: usize| (PI * row as f32 / self.height as f32).cos();
        let cos = z(row) + (z(row + 1) - z(row)) * along;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (y, x) = (TAU * (0.5 - (column as f32 + across) / self.width as f32)).sin_cos();
        (Vec3::new(sin * x, sin * y, cos), self.density(row, column))
    }

    /// The density of [`Dome::sample`] in a direction of unit length, 1/sr.
    pub fn density_of(&self, direction: Vec3) -> f32 {
        let (x, y) = self.place(direction);
        self.density((y as usize).min(self.height - 1), (x.max(0.0) as usize).min(self.width - 1))
    }

    fn density(&self, row: usize, column: usize) -> f32 {
        let share = |at: usize, of: &[f32]| of[at] - if at > 0 { of[at - 1] } else { 0.0 };
        let columns = &self.columns[row * self.width..][..self.width];
        share(row, &self.rows) * share(column, columns) / self.solid_angle(row) as f32
    }

    /// The mean over all directions, RGB.
    pub fn mean(&self) -> [f64; 3] {
        let mut sum = DVec3::ZERO;
        for (row, texels) in self.texels.chunks(self.width).enumerate() {
            sum += texels.iter().map(|&t| Vec3::from_array(t).as_dvec3()).sum::<DVec3>() * self.solid_angle(row);
        }
        (sum / (4.0 * std::f64::consts::PI)).to_array()
    }

    /// The brightest channel anywhere, over that of the mean.
    pub fn contrast(&self) -> f64 {
        let mean = self.mean().into_iter().fold(0.0, f64::max);
        f64::from(self.texels.iter().flatten().copied().fold(0.0, f32::max)) / mean
    }

    /// Whether all directions have the colour of the mean.
    pub fn has_one_colour(&self) -> bool {
        let mean = DVec3::from_array(self.mean()).as_vec3();
        self.texels.iter().all(|&t| {
            let texel = Vec3::from_array(t);
            let scale = texel.max_element() / mean.max_element();
            (texel - mean * scale).abs().max_element() <= 1e-5 * texel.max_element()
        })
    }

    /// The same in other colours; `None` where nothing is left.
    pub fn coloured(&self, of: impl Fn([f64; 3]) -> [f64; 3]) -> Option<Self> {
        let texels = self.texels.iter().map(|t| of(t.map(f64::from)).map(|c| c as f32)).collect();
        Dome::new(self.width, self.height, texels)
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Rng, Stage};

    fn spotted() -> Dome {
        let spot = DVec3::new(0.3, -0.6, 0.5).normalize();
        Dome::of(64, 32, |d| [1.0 + d.z, 1.0, 0.5].map(|c: f64| c + if d.dot(spot) > 0.97 { 400.0 } else { 0.0 })).unwrap()
    }

    /// The mean of radiance over density is the whole light, by two ways of drawing: even, and the dome's own.
    #[test]
    fn what_is_drawn_weighs_what_it_is_drawn_for() {
        let dome = spotted();
        let (n, mut rng) = (200_000, Rng::new(1, Stage::Render, 0));
        let (mut own, mut even) = ([0.0f64; 2], [0.0f64; 2]);
        for _ in 0..n {
            let (direction, density) = dome.sample(rng.uniform_f32(), rng.uniform_f32());
            assert!((dome.density_of(direction) / density - 1.0).abs() < 1e-3 || near_an_edge(&dome, direction));
            let x = f64::from(dome.radiance(direction).x / density);
            own = [own[0] + x, own[1] + x * x];
            let x = 4.0 * std::f64::consts::PI * f64::from(dome.radiance(crate::sampling::uniform_sphere(&mut rng)).x);
            even = [even[0] + x, even[1] + x * x];
        }
        let found = [own, even].map(|[sum, squares]| {
            let mean = sum / f64::from(n);
            (mean, ((squares / f64::from(n) - mean * mean) / f64::from(n)).sqrt())
        });
        let z = (found[0].0 - found[1].0) / found[0].1.hypot(found[1].1);
        println!("{found:?}: z = {z:.2}");
        assert!(z.abs() < 4.0 && found[0].1 < 0.2 * found[1].1, "a direction is not drawn as the light is strong");
    }

    /// Rounding may put a direction that was drawn at a texel's edge into the next texel.
    fn near_an_edge(dome: &Dome, direction: Vec3) -> bool {
        let (x, y) = dome.place(direction);
        [x, y].into_iter().any(|at| (at - at.round()).abs() < 1e-3)
    }

    #[test]
    fn an_even_dome_is_even() {
        let dome = Dome::of(16, 8, |_| [0.5, 1.0, 2.0]).unwrap();
        let mut rng = Rng::new(2, Stage::Render, 0);
        for _ in 0..1000 {
            let (direction, density) = dome.sample(rng.uniform_f32(), rng.uniform_f32());
            assert!((density * 4.0 * PI - 1.0).abs() < 1e-4 && (dome.radiance(direction) - Vec3::new(0.5, 1.0, 2.0)).length() < 1e-5);
        }
        assert!(dome.has_one_colour() && (dome.contrast() - 1.0).abs() < 1e-6 && (dome.mean()[2] - 2.0).abs() < 1e-6);
        assert!(!spotted().has_one_colour());
    }

    #[test]
    fn what_is_no_sky_is_none() {
        assert!(Dome::new(2, 1, vec![[0.0; 3]; 2]).is_none() && Dome::new(2, 1, vec![[1.0; 3]; 3]).is_none());
        assert!(Dome::new(1, 1, vec![[f32::NAN; 3]]).is_none() && Dome::new(1, 1, vec![[1.0; 3]]).is_some());
    }
}
