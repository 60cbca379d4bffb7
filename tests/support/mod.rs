//! glTF files made in code, for tests.
#![allow(dead_code, missing_docs)]

use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

pub type Points = Vec<[f32; 3]>;
pub type Triangles = Vec<[u32; 3]>;

/// A file in the making: JSON, and the bytes of its only buffer.
#[derive(Clone)]
pub struct Gltf {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Default for Gltf {
    fn default() -> Self {
        let json = json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"name": "Scene", "nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "materials": [], "cameras": [], "buffers": []});
        Gltf { json, bin: Vec::new() }
    }
}

impl Gltf {
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        let (mut min, mut max) = ([f32::MAX; N], [f32::MIN; N]);
        for v in values {
            for i in 0..N {
                min[i] = min[i].min(v[i]);
                max[i] = max[i].max(v[i]);
            }
        }
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": 5126, "count": values.len(), "type": kind, "min": min.to_vec(), "max": max.to_vec()}),
        )
    }

    pub fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": 5125, "count": indices.len(), "type": "SCALAR"}))
    }

    pub fn mesh(&mut self, (points, triangles): &(Points, Triangles)) -> usize {
        let position = self.floats(points);
        let indices = self.indices(triangles.as_flattened());
        self.push("meshes", json!({"primitives": [{"attributes": {"POSITION": position}, "indices": indices}]}))
    }

    /// A root node.
    pub fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// A root node with a mesh of its own.
    pub fn object(&mut self, name: &str, shape: &(Points, Triangles)) -> usize {
        let mesh = self.mesh(shape);
        self.node(json!({"name": name, "mesh": mesh}))
    }

    /// A root node with a sphere of radius 1 and these fields.
    pub fn ball(&mut self, fields: Value) -> usize {
        let index = self.object("Ball", &uv_sphere(16, 8));
        self.set(index, fields);
        index
    }

    pub fn set(&mut self, node: usize, fields: Value) {
        for (key, value) in fields.as_object().unwrap() {
            self.json["nodes"][node][key] = value.clone();
        }
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut root = self.json.clone();
        root["buffers"] = json!([{"byteLength": self.bin.len()}]);
        glb(&serde_json::to_vec(&root).unwrap(), &self.bin)
    }

    pub fn with_uri(&self, uri: &str) -> Vec<u8> {
        let mut root = self.json.clone();
        root["buffers"] = json!([{"byteLength": self.bin.len(), "uri": uri}]);
        serde_json::to_vec(&root).unwrap()
    }
}

pub fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, bin) = (pad(json, b' '), pad(bin, 0));
    let word = |n: usize| (n as u32).to_le_bytes();
    [b"glTF".as_slice(), &word(2), &word(28 + json.len() + bin.len()), &word(json.len()), b"JSON", &json, &word(bin.len()), b"BIN\0", &bin]
        .concat()
}

/// A sphere of radius 1 with a seam, as exporters write it (Y up).
pub fn uv_sphere(segments: usize, rings: usize) -> (Points, Triangles) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..=rings {
        let theta = PI * i as f64 / rings as f64;
        for j in 0..=segments {
            let phi = TAU * j as f64 / segments as f64;
            points.push([theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin()].map(|v| v as f32));
        }
    }
    let row = segments as u32 + 1;
    for i in 0..rings as u32 {
        for j in 0..segments as u32 {
            let (a, b) = (i * row + j, (i + 1) * row + j);
            if i > 0 {
                triangles.push([a, b, a + 1]);
            }
            if i + 1 < rings as u32 {
                triangles.push([a + 1, b, b + 1]);
            }
        }
    }
    (points, triangles)
}

/// An icosphere of radius 1, flat shaded: each triangle has its own vertices. Subdivision 1 is the icosahedron.
pub fn ico_sphere(subdivisions: usize) -> (Points, Triangles) {
    let h = 0.2_f64.sqrt();
    let ring = |z: f64, turn: f64| {
        (0..5).map(move |i| ((TAU * (i as f64 + turn) / 5.0).cos() * 2.0 * h, (TAU * (i as f64 + turn) / 5.0).sin() * 2.0 * h, z))
    };
    let mut corners = vec![(0.0, 0.0, 1.0)];
    corners.extend(ring(h, 0.0));
    corners.extend(ring(-h, 0.5));
    corners.push((0.0, 0.0, -1.0));
    let p = |i: usize| glam::DVec3::from(corners[i]);
    let mut faces = Vec::new();
    for i in 0..5 {
        let (a, b) = (1 + i, 1 + (i + 1) % 5);
        let (c, d) = (6 + i, 6 + (i + 1) % 5);
        faces.extend([[p(0), p(a), p(b)], [p(a), p(c), p(b)], [p(b), p(c), p(d)], [p(11), p(d), p(c)]]);
    }
    for _ in 1..subdivisions {
        let middle = |a: glam::DVec3, b: glam::DVec3| (a + b).normalize();
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let points: Points = faces.iter().flatten().map(|v| v.as_vec3().to_array()).collect();
    let triangles = (0..faces.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (points, triangles)
}

pub fn cube() -> (Points, Triangles) {
    let points = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|b| 2.0 * b as f32 - 1.0)).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    (points, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// A horizontal square of 2 by 2.
pub fn plane() -> (Points, Triangles) {
    (vec![[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]], vec![[0, 1, 2], [0, 2, 3]])
}

/// A surface of revolution about y: (radius, height) pairs; closed by points on the axis.
pub fn lathe(profile: &[(f64, f64)], segments: usize) -> (Points, Triangles) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let row = segments as u32;
    for &(r, y) in profile {
        points.extend((0..segments).map(|j| {
            let phi = TAU * j as f64 / segments as f64;
            [r * phi.cos(), y, -r * phi.sin()].map(|v| v as f32)
        }));
    }
    for i in 0..profile.len() as u32 - 1 {
        for j in 0..row {
            let (a, b) = (i * row + j, i * row + (j + 1) % row);
            triangles.extend([[a, a + row, b], [b, a + row, b + row]]);
        }
    }
    (points, triangles)
}

pub fn torus() -> (Points, Triangles) {
    let profile: Vec<(f64, f64)> = (0..=12).map(|i| (TAU * i as f64 / 12.0).sin_cos()).map(|(s, c)| (2.0 + 0.5 * c, -0.5 * s)).collect();
    lathe(&profile, 24)
}
