//! Which camera takes a picture, and of which size: what a user asks for, over what the scene has.

use super::camera::{FOV, vertical};
use super::{Camera, Scene};
use crate::error::{Error, Result};
use glam::DVec3;

/// Pixels in a row, where nobody says it.
const WIDTH: u32 = 640;
/// Rows, where no camera says its aspect either.
const HEIGHT: u32 = 360;
/// The most pixels along a side.
pub const LONGEST: u32 = 16384;
/// Aspects that differ by less than this share are the same.
const SAME: f64 = 0.01;

/// What a user asks of the camera; what is missing is the scene's own, or chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct View {
    /// Where it stands, m.
    pub position: Option<DVec3>,
    /// What it looks at, m.
    pub target: Option<DVec3>,
    /// The horizontal angle of view in radians.
    pub xfov: Option<f64>,
    /// Width and height of the picture in pixels.
    pub size: Option<[u32; 2]>,
}

/// A camera, and the size of the picture that it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Framed {
    /// The camera.
    pub camera: Camera,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What was assumed, in sentences.
    pub notes: Vec<String>,
}

impl View {
    /// The camera for a scene: the scene's own, or one that frames its regions, changed as asked. A position without a target looks
    /// at the centre of the regions; a picture without a size is 640 pixels wide, and as high as the camera's aspect says.
    ///
    /// # Errors
    /// [`Error::Scene`] where the camera would stand on what it looks at.
    pub fn frame(&self, scene: &Scene) -> Result<Framed> {
        let own = scene.camera.and_then(|c| c.aspect);
        let high = |aspect: f64| (f64::from(WIDTH) / aspect).round().clamp(1.0, f64::from(LONGEST)) as u32;
        let [width, height] = self.size.unwrap_or([WIDTH, own.map_or(HEIGHT, high)]);
        let aspect = f64::from(width) / f64::from(height);
        let chosen = if aspect >= 1.0 { vertical(FOV, aspect) } else { FOV };
        let asked = self.xfov.map(|xfov| vertical(xfov, aspect));
        let yfov = asked.or(scene.camera.map(|c| c.yfov)).unwrap_or(chosen);

        let mut notes = Vec::new();
        if let Some(own) = own.filter(|own| self.size.is_some() && asked.is_none() && (aspect / own - 1.0).abs() > SAME) {
            notes.push(format!(
                "--size {width}x{height} has the aspect {aspect:.3}, and the scene's camera {own:.3}: its vertical angle of view is kept, and more or less is seen at the sides."
            ));
        }
        if scene.camera.is_none() && self.position.is_none() {
            notes.push("No camera is given: one is placed that frames the regions. Say otherwise with --camera and --look-at.".into());
        }
        let bounds = scene.flames.iter().fold(scene.region_bounds(), |bounds, flame| bounds.union(flame.shape.bounds()));
        let there = || {
            scene.camera.unwrap_or_else(|| {
                let endless = scene.regions.iter().any(|r| r.shape.is_endless());
                Camera::framing(bounds, aspect, yfov, scene.sun.direction, endless)
            })
        };
        let camera = match (self.position, self.target) {
            (None, None) => Some(there()),
            (None, Some(target)) => there().turned_to(target),
            (Some(position), target) => Camera::look_at(position, target.unwrap_or(bounds.centre()), yfov)
                .map(|c| scene.camera.map_or(c, |own| Camera { znear: own.znear, zfar: own.zfar, ..c })),
        };
        let camera = camera.ok_or_else(|| Error::Scene {
            reason: "the camera stands on the very point that it looks at".into(),
            fix: "Say --camera X,Y,Z and --look-at X,Y,Z with two different points".into(),
        })?;
        Ok(Framed { camera: Camera { yfov, aspect: Some(aspect), ..camera }, width, height, notes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Medium, Region, Shape};

    fn ball() -> Scene {
        let shape = Shape::sphere(DVec3::new(1.0, 2.0, 3.0), 2.0);
        Scene { regions: vec![Region { name: "b".into(), shape, medium: Medium::grey(1.0, 0.0, 0.0), photons: None }], ..Scene::default() }
    }

    fn with_camera(aspect: Option<f64>) -> Scene {
        let camera = Camera::look_at(DVec3::new(0.0, -20.0, 0.0), DVec3::ZERO, 0.4).map(|c| Camera { aspect, zfar: Some(99.0), ..c });
        Scene { camera, ..ball() }
    }

    fn forward(camera: &Camera) -> DVec3 {
        camera.world_from_camera.matrix3 * DVec3::NEG_Z
    }

    #[test]
    fn sizes_follow_the_camera() {
        let size = |view: View, scene: &Scene| {
            let framed = view.frame(scene).unwrap();
            (framed.width, framed.height, framed.notes.len())
        };
        assert_eq!(size(View::default(), &ball()), (640, 360, 1));
        assert_eq!(size(View::default(), &with_camera(None)), (640, 360, 0));
        assert_eq!(size(View::default(), &with_camera(Some(2.0))), (640, 320, 0));
        assert_eq!(size(View::default(), &with_camera(Some(1e-9))), (640, LONGEST, 0));
        let asked = View { size: Some([300, 200]), ..View::default() };
        assert_eq!(size(asked, &with_camera(Some(1.5))), (300, 200, 0));
        assert_eq!(size(asked, &with_camera(Some(2.0))), (300, 200, 1));
        assert_eq!(size(View { xfov: Some(0.5), ..asked }, &with_camera(Some(2.0))), (300, 200, 0));
    }

    #[test]
    fn what_is_asked_for_changes_the_camera_that_is_there() {
        let scene = with_camera(None);
        let own = View::default().frame(&scene).unwrap().camera;
        assert_eq!((own.yfov, own.zfar), (0.4, Some(99.0)));
        let position = DVec3::new(1.0, 2.0, 50.0);
        let from = View { position: Some(position), ..View::default() }.frame(&scene).unwrap().camera;
        assert!((forward(&from) - DVec3::NEG_Z).length() < 1e-12, "to the centre of the regions");
        assert_eq!((from.world_from_camera.translation, from.yfov), (position, 0.4));
        let to = View { target: Some(DVec3::new(0.0, -20.0, 5.0)), ..View::default() }.frame(&scene).unwrap().camera;
        assert!((forward(&to) - DVec3::Z).length() < 1e-12 && to.world_from_camera.translation.y == -20.0);
        let wide = View { xfov: Some(1.0), size: Some([200, 100]), ..View::default() }.frame(&scene).unwrap().camera;
        assert!((wide.yfov - 2.0 * (0.5f64.tan() / 2.0).atan()).abs() < 1e-12);
        assert_eq!(wide.world_from_camera, own.world_from_camera);
        let onto = View { position: Some(DVec3::new(1.0, 2.0, 3.0)), ..View::default() };
        assert!(onto.frame(&scene).unwrap_err().to_string().contains("--look-at"));
        // The framed camera turns too, and a narrow lens stands farther away.
        let turned = View { target: Some(DVec3::ZERO), ..View::default() }.frame(&ball()).unwrap().camera;
        assert_eq!(turned.world_from_camera.translation, View::default().frame(&ball()).unwrap().camera.world_from_camera.translation);
        let far = |xfov| {
            let framed = View { xfov: Some(xfov), ..View::default() }.frame(&ball()).unwrap();
            framed.camera.world_from_camera.translation.distance(DVec3::new(1.0, 2.0, 3.0))
        };
        assert!(far(0.1) > 4.0 * far(0.5));
    }
}
