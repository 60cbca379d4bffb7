//! Regions as an editable glTF: spheres with their media and photon counts, the sun, lamps, the camera, the surfaces.
//!
//! Blender imports it, and cloudvdb reads it again as the same scene. glTF is Y-up: (x, y, z) -> (x, z, -y).

use super::staged::write_bytes;
use crate::error::Result;
use crate::scene::{Lamp, Medium, Mesh, Region, Scene, Shape, Spot};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use serde_json::{Value, json};
use std::path::Path;

/// From the world (Z up) to glTF (Y up).
const Y_UP: DMat3 = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
/// Lux for a W/m^2, as Blender's exporter and importer have it.
const LUX: f64 = 683.0;

/// Writes regions, and the scene's sun, lamps, camera and surfaces, as GLB.
///
/// # Errors
/// [`crate::Error::Write`].
pub fn write(path: &Path, scene: &Scene, regions: &[Region]) -> Result<()> {
    let mut gltf = Builder::default();
    for region in regions {
        gltf.region(region);
    }
    for surface in &scene.surfaces {
        let [r, g, b] = surface.albedo;
        let material = json!({"name": surface.name, "doubleSided": true, "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}});
        gltf.materials.push(material);
        let mesh = gltf.mesh(&surface.mesh, Some(gltf.materials.len() - 1));
        gltf.nodes.push(json!({"name": surface.name, "mesh": mesh, "extras": {"cloudvdb": {"shape": "surface"}}}));
    }
    gltf.sun(scene);
    scene.lamps.iter().for_each(|lamp| gltf.lamp(lamp));
    gltf.camera(scene);
    write_bytes(path, &gltf.finish(scene))
}

#[derive(Default)]
struct Builder {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    cameras: Vec<Value>,
    lights: Vec<Value>,
    binary: Vec<u8>,
    ball: Option<usize>,
    cube: Option<usize>,
}

impl Builder {
    fn region(&mut self, region: &Region) {
        let mut extras = medium(&region.medium);
        if let Some(photons) = region.photons {
            extras["photons"] = json!(photons);
        }
        let mut node = match &region.shape {
            Shape::Ellipsoid { world_from_unit } => {
                extras["shape"] = json!("sphere");
                let ball = self.ball.unwrap_or_else(|| self.mesh(&icosphere(2), None));
                self.ball = Some(ball);
                let mut node = placed(*world_from_unit);
                node["mesh"] = json!(ball);
                node
            }
            Shape::Slab { centre, half_height, half_extent } => {
                extras["shape"] = json!("slab");
                let cube = self.cube.unwrap_or_else(|| self.mesh(&cube(), None));
                self.cube = Some(cube);
                let mut node = placed(DAffine3 { matrix3: DMat3::from_diagonal(half_extent.extend(*half_height)), translation: *centre });
                node["mesh"] = json!(cube);
                node
            }
            // Voxels have no place in glTF.
            Shape::Grid(_) => return,
            Shape::Mesh(mesh) => {
                extras["shape"] = json!("mesh");
                json!({"mesh": self.mesh(mesh, None)})
            }
        };
        node["name"] = json!(region.name);
        node["extras"] = json!({"cloudvdb": extras});
        self.nodes.push(node);
    }

    fn sun(&mut self, scene: &Scene) {
        let sun = scene.sun;
        let peak = sun.irradiance.iter().copied().fold(0.0, f64::max);
        if peak <= 0.0 {
            return;
        }
        self.lights.push(json!({"type": "directional", "name": "Sun", "intensity": peak * LUX, "color": sun.irradiance.map(|c| c / peak)}));
        // Light travels along the node's -Z.
        let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, (Y_UP * sun.direction).normalize());
        self.nodes.push(json!({"name": "Sun", "rotation": turn.to_array(), "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    }

    fn lamp(&mut self, lamp: &Lamp) {
        let peak = lamp.intensity.iter().copied().fold(0.0, f64::max);
        let mut light = json!({"type": "point", "name": lamp.name, "intensity": peak * LUX, "color": lamp.intensity.map(|c| c / peak)});
        let mut node = json!({
            "name": lamp.name,
            "translation": (Y_UP * lamp.position).to_array(),
            "extras": {"cloudvdb": {"lamp_radius": lamp.radius}},
            "extensions": {"KHR_lights_punctual": {"light": self.lights.len()}},
        });
        if let Some(Spot { axis, cosines }) = lamp.spot {
            let [inner, outer] = cosines.map(|c| c.clamp(-1.0, 1.0).acos());
            light["type"] = json!("spot");
            light["spot"] = json!({"innerConeAngle": inner, "outerConeAngle": outer});
            node["rotation"] = json!(DQuat::from_rotation_arc(DVec3::NEG_Z, (Y_UP * axis).normalize()).to_array());
        }
        self.lights.push(light);
        self.nodes.push(node);
    }

    fn camera(&mut self, scene: &Scene) {
        let Some(camera) = scene.camera else { return };
        let mut perspective = json!({"yfov": camera.yfov, "znear": camera.znear});
        if let Some(aspect) = camera.aspect {
            perspective["aspectRatio"] = json!(aspect);
        }
        if let Some(zfar) = camera.zfar {
            perspective["zfar"] = json!(zfar);
        }
        self.cameras.push(json!({"type": "perspective", "perspective": perspective}));
        // A camera looks along its own -Z in both worlds: only the world is turned.
        let matrix = DMat4::from(DAffine3::from_mat3(Y_UP) * camera.world_from_camera);
        self.nodes.push(json!({"name": "Camera", "camera": 0, "matrix": matrix.to_cols_array()}));
    }

    /// Adds a mesh (its vertices turned to Y up) and returns its index.
    fn mesh(&mut self, mesh: &Mesh, material: Option<usize>) -> usize {
        let positions: Vec<[f32; 3]> = mesh.vertices.iter().map(|&v| (Y_UP * v).as_vec3().to_array()).collect();
        let (min, max) = positions.iter().fold(([f32::MAX; 3], [f32::MIN; 3]), |(lo, hi), p| {
            (std::array::from_fn(|i| lo[i].min(p[i])), std::array::from_fn(|i| hi[i].max(p[i])))
        });
        let position = self.accessor(
            bytemuck::cast_slice(&positions),
            json!({"componentType": 5126, "count": positions.len(), "type": "VEC3", "min": min, "max": max}),
            34962,
        );
        let indices: &[u32] = bytemuck::cast_slice(&mesh.triangles);
        let index =
            self.accessor(bytemuck::cast_slice(indices), json!({"componentType": 5125, "count": indices.len(), "type": "SCALAR"}), 34963);
        let mut primitive = json!({"attributes": {"POSITION": position}, "indices": index});
        if let Some(material) = material {
            primitive["material"] = json!(material);
        }
        self.meshes.push(json!({"primitives": [primitive]}));
        self.meshes.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], mut accessor: Value, target: u32) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len(), "target": target}));
        self.binary.extend_from_slice(bytes);
        accessor["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn finish(self, scene: &Scene) -> Vec<u8> {
        let all: Vec<usize> = (0..self.nodes.len()).collect();
        let mut root = json!({
            "asset": {"version": "2.0", "generator": concat!("cloudvdb ", env!("CARGO_PKG_VERSION"))},
            "scene": 0,
            "scenes": [{"nodes": all, "extras": {"cloudvdb": {"sun_angle": scene.sun.angular_diameter}}}],
            "nodes": self.nodes,
        });
        let lists = [
            ("meshes", self.meshes),
            ("materials", self.materials),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
            ("cameras", self.cameras),
        ];
        for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
            root[name] = Value::Array(list);
        }
        if !self.lights.is_empty() {
            root["extensionsUsed"] = json!(["KHR_lights_punctual"]);
            root["extensions"] = json!({"KHR_lights_punctual": {"lights": self.lights}});
        }
        if !self.binary.is_empty() {
            root["buffers"] = json!([{"byteLength": self.binary.len()}]);
        }
        glb(root.to_string().into_bytes(), self.binary)
    }
}

/// A node's place: translation and scale for a sphere, a matrix for anything else.
fn placed(world_from_unit: DAffine3) -> Value {
    let m = world_from_unit.matrix3;
    let radius = m.x_axis.length();
    let round = m == DMat3::from_diagonal(DVec3::splat(radius));
    if round {
        return json!({"translation": (Y_UP * world_from_unit.translation).to_array(), "scale": DVec3::splat(radius).to_array()});
    }
    let turned = DAffine3 { matrix3: Y_UP * m * Y_UP.transpose(), translation: Y_UP * world_from_unit.translation };
    json!({"matrix": DMat4::from(turned).to_cols_array()})
}

fn medium(medium: &Medium) -> Value {
    if medium.is_grey() {
        json!({"sigma_s": medium.sigma_s[0], "sigma_a": medium.sigma_a[0], "g": medium.g})
    } else {
        json!({"sigma_s": medium.sigma_s, "sigma_a": medium.sigma_a, "g": medium.g})
    }
}

fn cube() -> Mesh {
    let vertices = (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 2.0 - 1.0).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh { vertices, triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect() }
}

/// A unit icosphere; its vertices lie on the sphere.
fn icosphere(subdivisions: u32) -> Mesh {
    let t = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices: Vec<DVec3> = [[-1.0, t], [1.0, t], [-1.0, -t], [1.0, -t]]
        .iter()
        .flat_map(|&[a, b]| [DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)])
        .map(|v| v.normalize())
        .collect();
    // The faces of an icosahedron are the triples of mutually nearest vertices, turned outward.
    let near = |a: DVec3, b: DVec3| a.dot(b) > 0.4;
    let mut triangles = Vec::new();
    for a in 0..12u32 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i| vertices[i as usize]);
                if near(p, q) && near(q, r) && near(r, p) {
                    triangles.push(if p.dot(q.cross(r)) > 0.0 { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..subdivisions {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32, vertices: &mut Vec<DVec3>| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                vertices.len() as u32 - 1
            })
        };
        let mut finer = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let (ab, bc, ca) = (middle(a, b, &mut vertices), middle(b, c, &mut vertices), middle(c, a, &mut vertices));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Mesh { vertices, triangles }
}

/// A GLB container: header, JSON chunk, binary chunk (if any), each padded to 4 bytes.
fn glb(mut json: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let chunks: Vec<(&[u8; 4], &[u8])> = [(b"JSON", &json[..]), (b"BIN\0", &binary[..])].into_iter().filter(|c| !c.1.is_empty()).collect();
    let total = 12 + chunks.iter().map(|c| 8 + c.1.len()).sum::<usize>();
    let mut out = Vec::with_capacity(total);
    out.extend_from_slice(b"glTF");
    out.extend_from_slice(&2u32.to_le_bytes());
    out.extend_from_slice(&(total as u32).to_le_bytes());
    for (kind, data) in chunks {
        out.extend_from_slice(&(data.len() as u32).to_le_bytes());
        out.extend_from_slice(kind);
        out.extend_from_slice(data);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_icosphere_is_closed_round_and_turned_outward() {
        let mesh = icosphere(2);
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (162, 320));
        assert!(mesh.vertices.iter().all(|v| (v.length() - 1.0).abs() < 1e-12));
        assert!(mesh.signed_volume() > 4.0);
        assert!(cube().signed_volume() > 7.9);
    }
}
