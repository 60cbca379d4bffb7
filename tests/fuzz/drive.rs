//! What is done with bytes from anywhere, and what must hold whatever they are: no panic, no crash, and an answer that means something.
#![allow(dead_code, clippy::unwrap_used)]

use cloudvdb::import::{ImportOptions, Layout, load};
use cloudvdb::integrate::flux::flux;
use cloudvdb::plan::{Density, Plan};
use cloudvdb::progress::{Progress, Silent};
use cloudvdb::vdb::{VdbFile, examine};
use cloudvdb::voxelise::{Up, voxel_size, voxelise};
use cloudvdb::{Error, doctor};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicI64, Ordering};

/// Stops whoever has asked so many times whether to stop: light in an endless medium ends, the same way each time.
struct Patience(AtomicI64);

impl Progress for Patience {
    fn begin(&self, _: &'static str, _: u64) {}
    fn at(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        self.0.fetch_sub(1, Ordering::Relaxed) <= 0
    }
}

/// A file of that name with these bytes, in a folder that lasts as long as the process.
fn file(name: &str, bytes: &[u8]) -> PathBuf {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let path = FOLDER.get_or_init(|| tempfile::tempdir().unwrap()).path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// A refusal names the reason and the fix.
fn sentence(error: &Error) {
    let text = error.to_string();
    assert!(text.len() > 20 && !text.contains("panicked"), "{text:?}");
    assert!(matches!(error.exit_code(), 1 | 2), "{text}");
}

fn options() -> ImportOptions {
    ImportOptions { mesh_volumes: true, max_voxels: 1 << 9, ..ImportOptions::default() }
}

/// Imports, and takes what comes out of it as far as light.
fn import(path: &Path) {
    match load(path, &options(), &Silent) {
        Ok(layout) => sound(&layout),
        Err(error) => sentence(&error),
    }
}

fn sound(layout: &Layout) {
    let scene = &layout.scene;
    assert!(!scene.regions.is_empty() && !layout.findings.is_empty());
    for region in &scene.regions {
        let (medium, bounds) = (&region.medium, region.shape.bounds());
        assert!(medium.sigma_s.iter().chain(&medium.sigma_a).all(|s| s.is_finite() && *s >= 0.0), "{region:?}");
        assert!(medium.g.abs() < 1.0 && bounds.min.is_finite() && bounds.max.is_finite(), "{region:?}");
        let mass = region.optical_mass();
        assert!(mass.is_finite() && mass >= 0.0, "{mass}");
    }
    let sun = &scene.sun;
    assert!((sun.direction.length() - 1.0).abs() < 1e-6 && sun.irradiance.iter().all(|e| e.is_finite() && *e >= 0.0), "{sun:?}");
    if scene.regions.len() > 100 {
        return;
    }
    let plan = Plan::for_scene(scene, Density::Source);
    match flux(scene, &plan, 16, 1, &Patience(AtomicI64::new(100))) {
        Ok(f) => {
            let parts = [f.up, f.down_direct, f.down_diffuse, f.absorbed_medium, f.absorbed_surface];
            let sum = parts.iter().map(|e| e.value).fold(0.0, |sum, share| sum + share);
            assert!((sum - 1.0).abs() < 1e-5 && parts.iter().all(|e| e.value >= 0.0), "{f:?}");
        }
        Err(Error::Interrupted) => {}
        Err(error) => sentence(&error),
    }
    match voxel_size(&scene.regions, None, 1 << 9).and_then(|(size, _)| voxelise(&scene.regions, size, 1.0, Up::Z, &Silent)) {
        Ok(grid) => assert!(grid.values.iter().all(|v| v.is_finite() && *v >= 0.0)),
        Err(error) => sentence(&error),
    }
}

/// A `.glb` or a `.gltf`.
pub fn gltf(bytes: &[u8]) {
    import(&file("fuzz.glb", bytes));
}

/// What users write into custom properties: after a byte that says where, JSON.
pub fn extras(bytes: &[u8]) {
    let Some((&place, text)) = bytes.split_first() else { return };
    let Ok(value) = serde_json::from_slice::<serde_json::Value>(text) else { return };
    let mut root: serde_json::Value = serde_json::from_str(TEMPLATE).unwrap();
    match place % 5 {
        0 => root["nodes"][0]["extras"]["cloudvdb"] = value,
        1 => root["nodes"][1]["extensions"]["CLOUDVDB_metaballs"] = value,
        2 => root["materials"][0]["extras"]["cloudvdb"] = value,
        3 => root["scenes"][0]["extras"]["cloudvdb"] = value,
        _ => root["nodes"][2]["extensions"]["KHR_lights_punctual"] = value,
    }
    import(&file("fuzz.gltf", &serde_json::to_vec(&root).unwrap()));
}

/// An octahedron, a node for metaballs, and a sun.
const TEMPLATE: &str = r#"{
    "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"name": "Scene", "nodes": [0, 1, 2], "extras": {}}],
    "nodes": [{"name": "Ball", "mesh": 0, "extras": {}}, {"name": "Mball", "extensions": {}}, {"name": "Sun", "extensions": {}}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
    "materials": [{"name": "Cloud", "extras": {}}],
    "extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 3}]}},
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5121, "count": 24, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 72}, {"buffer": 0, "byteOffset": 72, "byteLength": 24}],
    "buffers": [{"byteLength": 96, "uri": "data:;base64,AACAPwAAAAAAAAAAAACAvwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAgL8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAIC/AAIEAgEEAQMEAwAEAgAFAQIFAwEFAAMF"}]}"#;

/// A `.vdb`, as the doctor and as the main job read it.
pub fn vdb(bytes: &[u8]) {
    let path = file("fuzz.vdb", bytes);
    match doctor::examine(&path) {
        Ok(report) => assert!(report.json().starts_with('{') && !report.table().is_empty()),
        Err(error) => sentence(&error),
    }
    if let Err(error) = examine(&path) {
        sentence(&error);
    }
    match VdbFile::open(&path) {
        Ok(file) => {
            for index in 0..file.grids().len().min(8) {
                match file.read_whole_at(index) {
                    Ok(grid) => assert_eq!(grid.bricks.values.len(), grid.bricks.origins.len() * 512),
                    Err(error) => sentence(&error),
                }
            }
        }
        Err(error) => sentence(&error),
    }
    import(&path);
}
