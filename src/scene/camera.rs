//! A perspective camera, as glTF describes it.

use glam::DAffine3;

/// A perspective camera in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The camera looks along its local -Z, with +Y up.
    pub world_from_camera: DAffine3,
    /// The vertical angle of view in radians.
    pub yfov: f64,
    /// Width over height of the picture, where the file fixes it.
    pub aspect: Option<f64>,
    /// The near clipping distance in metres.
    pub znear: f64,
    /// The far clipping distance in metres, where there is one.
    pub zfar: Option<f64>,
}
