//! A script that sets a cloud up in Blender: the volume with its material, the sun, lamps, the sky, the camera, the surfaces.
//!
//! It is data, as JSON, before two pieces of Python: the materials, which the add-on uses too, and the rest of the scene.

use super::emission::EmissionGrid;
use super::staged::write_bytes;
use super::vdb::Voxels;
use crate::bake::{Baked, Term};
use crate::error::Result;
use crate::scene::{Dome, Framed, Lamp, Scene};
use glam::Vec3;
use serde_json::{Map, Value, json};
use std::f32::consts::{PI, TAU};
use std::path::{Path, PathBuf};

/// Modules of the add-on, in the order in which they know each other: in the script all is one.
const MATERIALS: [&str; 2] = [include_str!("../../blender_addon/lobes.py"), include_str!("../../blender_addon/baked.py")];
const STAGE: &str = include_str!("blend/stage.py");

/// Columns and rows of a sky that is not even, as the script has it.
const DOME: [usize; 2] = [128, 64];

/// What is set up.
pub struct Setup<'a> {
    /// The script's own path, and that of the VDB.
    pub target: &'a Path,
    /// The grids' file.
    pub vdb: &'a Path,
    /// The scene with the run's regions.
    pub scene: &'a Scene,
    /// The camera and the size of its picture.
    pub framed: &'a Framed,
    /// The grids.
    pub voxels: &'a Voxels,
}

/// Writes the script.
///
/// # Errors
/// [`crate::Error::Write`].
pub fn write(path: &Path, setup: &Setup) -> Result<()> {
    let lines: Vec<String> = setup.data().as_object().into_iter().flatten().map(|(key, value)| format!("  {key:?}: {value}")).collect();
    let data = lines.join(",\n");
    let own = |line: &&str| !line.starts_with("from .");
    let materials = MATERIALS.iter().flat_map(|module| module.lines()).filter(own).collect::<Vec<_>>().join("\n");
    let text = format!(
        "# Sets a cloud of cloudvdb up in Blender (3.4 and newer):  blender --python THIS\n# Or open it in the Text Editor, and press Run. The VDB belongs beside it.\n# SPDX-License-Identifier: MIT OR Apache-2.0\nCLOUD = r\"\"\"{{\n{data}\n}}\"\"\"\n\n{materials}\n\n\n{STAGE}",
    );
    write_bytes(path, text.as_bytes())
}

impl Setup<'_> {
    fn data(&self) -> Value {
        let Setup { scene, framed, voxels, .. } = self;
        let sun = scene.sun;
        let camera = &framed.camera;
        let rows: Vec<Vec<f64>> = (0..3)
            .map(|row| {
                let m = camera.world_from_camera;
                vec![m.matrix3.row(row).x, m.matrix3.row(row).y, m.matrix3.row(row).z, m.translation[row]]
            })
            .collect();
        let albedo: [f64; 3] = std::array::from_fn(|c| scene.mean(|r| r.medium.albedo_rgb()[c]));
        let bounds = scene.region_bounds();
        let surface = |s: &crate::scene::Surface| {
            let vertices: Vec<[f64; 3]> = s.mesh.vertices.iter().map(|v| v.to_array()).collect();
            json!({"name": s.name, "albedo": s.albedo, "vertices": vertices, "triangles": s.mesh.triangles})
        };
        json!({
            "vdb": beside(self.target, self.vdb),
            "name": self.vdb.file_stem().map(|n| n.to_string_lossy()).unwrap_or_default(),
            "voxel_size": voxels.voxel_size,
            "density": voxels.density_scale,
            "albedo": albedo,
            "anisotropy": scene.mean(|r| r.medium.g),
            "bounds": [bounds.min.to_array(), bounds.max.to_array()],
            "bake": voxels.light().map(light),
            "emission": voxels.emission().iter().map(EmissionGrid::summary).collect::<Vec<_>>(),
            "sun": {"direction": sun.direction.to_array(), "irradiance": sun.irradiance, "angle": sun.angular_diameter},
            "lamps": scene.lamps.iter().map(lamp).collect::<Vec<_>>(),
            "sky": scene.sky,
            "dome": scene.dome.as_deref().map(dome),
            "camera": {"matrix": rows, "yfov": camera.yfov, "near": camera.znear, "far": camera.zfar, "width": framed.width, "height": framed.height},
            "surfaces": scene.surfaces.iter().map(surface).collect::<Vec<_>>(),
        })
    }
}

/// A lamp: W/sr, metres, and of a spot its axis and the cosines of its angles.
fn lamp(lamp: &Lamp) -> Value {
    let spot = lamp.spot.map(|spot| json!({"axis": spot.axis.to_array(), "cosines": spot.cosines}));
    json!({"name": lamp.name, "position": lamp.position.to_array(), "radius": lamp.radius, "intensity": lamp.intensity, "spot": spot})
}

/// The sky by direction, as an image of few rows from the zenith down.
fn dome(dome: &Dome) -> Value {
    let [width, height] = DOME;
    let texel = |i: usize| {
        let (u, v) = (((i % width) as f32 + 0.5) / width as f32, ((i / width) as f32 + 0.5) / height as f32);
        let ((sin, cos), (y, x)) = ((PI * v).sin_cos(), (TAU * (0.5 - u)).sin_cos());
        dome.radiance(Vec3::new(sin * x, sin * y, cos)).to_array().map(|c| format!("{c:.4e}").parse::<f64>().unwrap_or(0.0))
    };
    json!({"width": width, "height": height, "texels": (0..width * height).map(texel).collect::<Vec<_>>()})
}

/// What the material has to know of baked light: of each light its colour and scale, and its grids by what they hold.
fn light(baked: &Baked) -> Value {
    let part = |(number, part): (usize, &crate::integrate::Part)| {
        let mut grids = Map::new();
        for grid in baked.grids.iter().filter(|grid| grid.part == number) {
            let key = match grid.term {
                Term::Light => "light".to_string(),
                Term::Sunlight => "sunlight".to_string(),
                Term::Glow => "glow".to_string(),
                Term::Flow => "flow".to_string(),
                Term::FlowX => "flowx".to_string(),
                Term::FlowY => "flowy".to_string(),
                Term::FlowZ => "flowz".to_string(),
                Term::Harmonic(i) => i.to_string(),
            };
            grids.insert(key, grid.name.clone().into());
        }
        json!({"light": part.light, "scale": part.scale, "tint": part.tint, "glow": baked.lobes[number], "grids": grids})
    };
    json!({"bake": baked.bake, "g": baked.mean_cosine, "parts": baked.parts.iter().enumerate().map(part).collect::<Vec<_>>()})
}

/// The path of the VDB from the script's folder; its own where there is none.
fn beside(script: &Path, vdb: &Path) -> PathBuf {
    let folder = |path: &Path| {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        folder.canonicalize().unwrap_or(folder.into())
    };
    let (from, to) = (folder(script), folder(vdb));
    let name = vdb.file_name().map(PathBuf::from).unwrap_or_default();
    match to.strip_prefix(&from) {
        Ok(way) => way.join(name),
        Err(_) => to.join(name),
    }
}
