//! Our field on the surfaces that Blender made: `tests/data/metaballs.json`, written by `tests/python/metaball_families.py`.

use super::*;
use crate::sculpt::Metaballs;
use std::path::Path;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn point(value: &Value) -> DVec3 {
    let [x, y, z] = [0, 1, 2].map(|i| number(&value[i]));
    DVec3::new(x, y, z)
}

/// A family, read as the importer reads its nodes; and the smallest radius of its elements in the world.
fn family(nodes: &[Value]) -> (Metaballs, f64) {
    let (mut all, mut radius) = (Metaballs { threshold: 0.0, elements: Vec::new() }, f64::INFINITY);
    for (index, node) in nodes.iter().enumerate() {
        let matrix: Vec<f64> = node["matrix"].as_array().unwrap().iter().map(number).collect();
        let world = Z_UP * DAffine3::from_mat4(glam::DMat4::from_cols_slice(&matrix));
        let at = At { file: Path::new("families"), kind: "node", index, name: node["name"].as_str() };
        let balls = read(&node["extensions"]["CLOUDVDB_metaballs"], &world, at).unwrap();
        assert_eq!((balls.family.as_str(), balls.number), ("Cloud", index as u64));
        if index == 0 {
            all.threshold = balls.threshold;
        }
        let stretch = world.matrix3.determinant().cbrt();
        for element in node["extensions"]["CLOUDVDB_metaballs"]["elements"].as_array().unwrap() {
            radius = radius.min(number(&element["radius"]) * stretch);
        }
        all.elements.extend(balls.elements);
    }
    (all, radius)
}

#[test]
fn the_threshold_passes_through_every_vertex_of_blenders_mesh() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/metaballs.json");
    let data: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let families = data["families"].as_array().unwrap();
    let (mut worst, mut vertices) = (0.0f64, 0);
    let mut kinds = std::collections::BTreeSet::new();
    for one in families {
        let nodes = one["nodes"].as_array().unwrap();
        let (balls, radius) = family(nodes);
        for element in nodes.iter().flat_map(|n| n["extensions"]["CLOUDVDB_metaballs"]["elements"].as_array().unwrap()) {
            kinds.insert((element["type"].as_str().unwrap().to_owned(), element["negative"].as_bool().unwrap()));
        }
        for vertex in one["vertices"].as_array().unwrap() {
            let p = point(vertex);
            // The distance to the surface, to first order.
            let h = 1e-4;
            let slope = DVec3::AXES.map(|a| (balls.field(p + h * a) - balls.field(p - h * a)) / (2.0 * h));
            let distance = (balls.field(p) - balls.threshold).abs() / DVec3::from_array(slope).length();
            worst = worst.max(distance / radius);
            vertices += 1;
        }
    }
    assert_eq!(kinds.len(), 10, "every kind, added and subtracted: {kinds:?}");
    assert!(families.len() >= 50 && vertices > 2000, "{} families, {vertices} vertices", families.len());
    assert!(worst < 0.005, "a vertex is {worst} radii off the surface");
}

#[test]
fn names_are_split_as_blender_splits_them() {
    let expected = [("Mball", ("Mball", 0)), ("Mball.001", ("Mball", 1)), ("a.b.12", ("a.b", 12)), ("a.b", ("a.b", 0)), (".7", ("", 7))];
    for (name, parts) in expected {
        assert_eq!(split(name), parts);
    }
}
