//! Lambertian surfaces.

use super::Mesh;

/// A two-sided Lambertian surface.
#[derive(Debug, Clone, Default)]
pub struct Surface {
    /// The node it came from.
    pub name: String,
    /// Its triangles in world space.
    pub mesh: Mesh,
    /// Its diffuse albedo, linear RGB, in [0, 1].
    pub albedo: [f64; 3],
}
