//! Import of glTF and GLB: what is found, what is said, and what bad input gets.

use crate::support::*;
use cloudvdb::{
    Error, Result,
    import::{Became, ImportOptions, Layout, load},
    progress::Silent,
    scene::{Overrides, Region, Shape, VoxelGrid},
    sculpt::{DetailRequest, Genus},
};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::{fs, path::Path};

fn read(name: &str, bytes: &[u8], options: &ImportOptions) -> Result<Layout> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    load(&path, options, &Silent)
}

fn import(gltf: &Gltf) -> Layout {
    read("layout.glb", &gltf.glb(), &ImportOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// The sentence about a file that is refused: it names the file, and ends with a fix.
#[track_caller]
fn sentence(result: Result<Layout>) -> String {
    let error = result.expect_err("this must be refused");
    assert_eq!(error.exit_code(), 1);
    let (Error::File { fix, .. } | Error::Node { fix, .. }) = &error else { panic!("{error:?}") };
    assert!(!fix.is_empty());
    error.to_string()
}

#[track_caller]
fn refused(gltf: &Gltf, words: &[&str]) {
    told(&sentence(read("layout.glb", &gltf.glb(), &ImportOptions::default())), "layout.glb", words);
}

#[track_caller]
fn told(sentence: &str, file: &str, words: &[&str]) {
    for word in [file].iter().chain(words) {
        assert!(sentence.contains(word), "{word:?} is missing in: {sentence}");
    }
}

fn became<'a>(layout: &'a Layout, node: &str) -> (Became, &'a str) {
    let finding = layout.findings.iter().find(|f| f.node == node).unwrap_or_else(|| panic!("no finding for {node}"));
    (finding.became, &finding.why)
}

/// The half axes, longest first, and the centre.
fn axes(shape: &Shape) -> ([f64; 3], DVec3) {
    let Shape::Ellipsoid { world_from_unit } = shape else { panic!("{shape:?}") };
    let m = world_from_unit.matrix3;
    let mut lengths = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
    lengths.sort_by(|a, b| b.total_cmp(a));
    (lengths, world_from_unit.translation)
}

#[track_caller]
fn near(a: impl AsRef<[f64]>, b: impl AsRef<[f64]>) {
    let (a, b) = (a.as_ref(), b.as_ref());
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 2e-6 * b.abs().max(1.0)), "{a:?} is not {b:?}");
}

#[test]
fn spheres_have_the_radius_of_their_vertices() {
    let shapes = [uv_sphere(8, 6), uv_sphere(16, 8), uv_sphere(32, 16), ico_sphere(1), ico_sphere(2), ico_sphere(3), ico_sphere(5)];
    for (i, shape) in shapes.iter().enumerate() {
        let mut gltf = Gltf::default();
        let node = gltf.object("Cloud", shape);
        gltf.set(node, json!({"translation": [1.0, 2.0, 3.0], "scale": [2.5, 2.5, 2.5]}));
        let layout = import(&gltf);
        assert_eq!(became(&layout, "Cloud").0, Became::Region, "shape {i}");
        let (lengths, centre) = axes(&layout.scene.regions[0].shape);
        near(lengths, [2.5; 3]);
        near(centre.to_array(), [1.0, -3.0, 2.0]); // (x, y, z) is (x, -z, y).
    }
}

#[test]
fn ellipsoids_are_the_same_with_their_scale_applied_or_not() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.4, 0.5);
    let (size, place) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(5.0, -4.0, 7.0));
    let mut gltf = Gltf::default();
    gltf.ball(json!({"scale": size.to_array(), "rotation": turn.to_array(), "translation": place.to_array()}));
    let (points, triangles) = uv_sphere(16, 8);
    let applied = points.iter().map(|&p| (place + turn * (size * glam::Vec3::from(p).as_dvec3())).as_vec3().to_array()).collect();
    gltf.object("Applied", &(applied, triangles));
    let layout = import(&gltf);
    let [a, b] = &layout.scene.regions[..] else { panic!() };
    for region in [a, b] {
        near(axes(&region.shape).0, [3.0, 2.0, 1.0]);
        near(axes(&region.shape).1.to_array(), [5.0, -7.0, -4.0]);
    }
    near(a.shape.bounds().size().to_array(), b.shape.bounds().size().to_array());
}

#[test]
fn other_forms_are_no_spheres() {
    let cylinder = lathe(&[(0.0, 1.0), (1.0, 1.0), (1.0, -1.0), (0.0, -1.0)], 32);
    let cone = lathe(&[(0.0, 1.0), (1.0, -1.0), (0.0, -1.0)], 32);
    let half: Vec<(f64, f64)> = (0..=8).map(|i| (f64::from(i) * std::f64::consts::FRAC_PI_2 / 8.0).sin_cos()).collect();
    let closed_half = [half.as_slice(), &[(0.0, 0.0)]].concat();
    let octahedron = lathe(&[(0.0, 1.0), (1.0, 0.0), (0.0, -1.0)], 4);
    let shapes = [
        ("Cube", cube(), "closed"),
        ("Torus", torus(), "closed"),
        ("Cylinder", cylinder, "closed"),
        ("Cone", cone, "closed"),
        ("Octahedron", octahedron, "closed"),
        ("Dome", lathe(&closed_half, 16), "closed"),
        ("Open dome", lathe(&half, 16), "open"),
        ("Plane", plane(), "flat"),
    ];
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    for (name, shape, _) in &shapes {
        gltf.object(name, shape);
    }
    let layout = import(&gltf);
    for (name, _, why) in &shapes {
        let (kind, because) = became(&layout, name);
        assert_eq!(kind, Became::Surface, "{name}");
        assert!(because.contains(why), "{name}: {because}");
    }
    assert!(layout.notes.iter().any(|n| n.contains("albedo 0.8") && n.contains("\"Cube\" and 7 more")));
    let volumes = read("layout.glb", &gltf.glb(), &ImportOptions { mesh_volumes: true, ..Default::default() }).unwrap();
    assert_eq!(volumes.scene.regions.len(), 7);
    let cube = volumes.scene.regions.iter().find(|r| r.name == "Cube").unwrap();
    assert!(matches!(&cube.shape, Shape::Mesh(mesh) if (mesh.signed_volume() - 8.0).abs() < 1e-9));
}

#[test]
fn parents_instances_and_shared_meshes() {
    let mut gltf = Gltf::default();
    let mesh = gltf.mesh(&uv_sphere(16, 8));
    let child = gltf.push("nodes", json!({"name": "Child", "mesh": mesh, "translation": [1, 0, 0]}));
    gltf.node(json!({"name": "Parent", "children": [child], "scale": [2, 2, 2], "translation": [0, 10, 0]}));
    gltf.node(json!({"name": "Twin", "mesh": mesh, "matrix": [3,0,0,0, 0,3,0,0, 0,0,3,0, 0,0,-5,1]}));
    let moves = gltf.floats(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]]);
    let scales = gltf.floats(&[[1.0; 3], [2.0; 3], [3.0; 3]]);
    let turns = gltf.view(&[[0_i16, 0, 0, 32767]; 3].as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    let turns = gltf.push("accessors", json!({"bufferView": turns, "componentType": 5122, "normalized": true, "count": 3, "type": "VEC4"}));
    gltf.node(json!({"name": "Many", "mesh": mesh, "extensions": {"EXT_mesh_gpu_instancing":
        {"attributes": {"TRANSLATION": moves, "SCALE": scales, "ROTATION": turns}}}}));
    let layout = import(&gltf);
    let names: Vec<&str> = layout.scene.regions.iter().map(|r| r.name.as_str()).collect();
    assert_eq!(names, ["Child", "Twin", "Many[0]", "Many[1]", "Many[2]"]);
    near(axes(&layout.scene.regions[0].shape).0, [2.0; 3]);
    near(axes(&layout.scene.regions[0].shape).1.to_array(), [2.0, 0.0, 10.0]);
    near(axes(&layout.scene.regions[1].shape).1.to_array(), [0.0, 5.0, 0.0]);
    near(axes(&layout.scene.regions[4].shape).0, [3.0; 3]);
    near(axes(&layout.scene.regions[4].shape).1.to_array(), [0.0, 0.0, 2.0]);
}

#[test]
fn shapes_by_extras() {
    let mut gltf = Gltf::default();
    gltf.node(json!({"name": "S", "scale": [2, 2, 2], "extras": {"cloudvdb": {"shape": "sphere", "radius": 1.5}}}));
    gltf.node(json!({"name": "Text", "extras": {"cloudvdb": "{\"shape\": \"sphere\"}"}}));
    gltf.node(json!({"name": "M", "extras": {"cloudvdb": {"shape": "metaball", "radius": 2.0}}}));
    gltf.node(json!({"name": "L", "translation": [0, 4, 0], "extras": {"cloudvdb": {"shape": "slab", "half_height": 0.5}}}));
    let deck = gltf.object("Deck", &cube());
    gltf.set(deck, json!({"scale": [30, 2, 10], "extras": {"cloudvdb": "slab"}}));
    let solid = gltf.object("Solid", &cube());
    gltf.set(solid, json!({"extras": {"cloudvdb": {"shape": "mesh"}}}));
    let around = gltf.object("Around", &cube());
    gltf.set(around, json!({"extras": {"cloudvdb": {"shape": "sphere"}}}));
    gltf.ball(json!({"name": "Wall", "extras": {"cloudvdb": {"shape": "surface"}}}));
    gltf.ball(json!({"name": "Nothing", "extras": {"cloudvdb": "ignore"}, "scale": [0, 0, 0]}));
    let layout = import(&gltf);
    let shape = |name: &str| &layout.scene.regions.iter().find(|r| r.name == name).unwrap().shape;
    near(axes(shape("S")).0, [3.0; 3]);
    near(axes(shape("Text")).0, [1.0; 3]);
    near(axes(shape("M")).0, [2.0 * (1.0 - 0.3_f64.cbrt()).sqrt(); 3]);
    near(axes(shape("Around")).0, [3.0_f64.sqrt(); 3]);
    assert!(matches!(shape("L"), Shape::Slab { centre, half_height, half_extent }
        if *centre == DVec3::new(0.0, 0.0, 4.0) && *half_height == 0.5 && half_extent.x == 2.0));
    assert!(matches!(shape("Deck"), Shape::Slab { half_height, half_extent, .. }
        if *half_height == 2.0 && half_extent.x == 30.0 && half_extent.y == 10.0));
    assert!(matches!(shape("Solid"), Shape::Mesh(_)));
    assert_eq!(became(&layout, "Wall").0, Became::Surface);
    assert_eq!(became(&layout, "Nothing").0, Became::Ignored);
}

fn grid(region: &Region) -> &VoxelGrid {
    let Shape::Grid(grid) = &region.shape else { panic!("{:?}", region.shape) };
    grid
}

fn metaballs(name: &str, at: [f64; 3], elements: Value) -> Value {
    json!({"name": name, "translation": at, "extensions": {"CLOUDVDB_metaballs": {"threshold": 0.6, "elements": elements}}})
}

/// 4 pi R^3 times the integral of u^2 (2 (1 - u^2)^3 - 0.6) / 1.4 over what is visible.
fn lone_ball(radius: f64) -> f64 {
    let u: f64 = (1.0 - 0.3_f64.cbrt()).sqrt();
    let field = u.powi(3) / 3.0 - 3.0 * u.powi(5) / 5.0 + 3.0 * u.powi(7) / 7.0 - u.powi(9) / 9.0;
    4.0 * std::f64::consts::PI * radius.powi(3) * (2.0 * field - 0.6 * u.powi(3) / 3.0) / 1.4
}

#[test]
fn metaballs_become_one_grid_where_their_family_is() {
    let mut gltf = Gltf::default();
    let ball = json!([{"type": "BALL", "co": [1, 2, 3], "radius": 2, "stiffness": 2}]);
    gltf.node(metaballs("Mball", [0.0, 1.0, 0.0], ball));
    let layout = import(&gltf);
    let [region] = &layout.scene.regions[..] else { panic!() };
    let visible = 2.0 * (1.0 - 0.3_f64.cbrt()).sqrt();
    assert!((grid(region).integral() / lone_ball(2.0) - 1.0).abs() < 2e-3);
    let bounds = grid(region).bounds();
    assert!((bounds.centre() - DVec3::new(1.0, -3.0, 3.0)).length() < 0.05 && (bounds.size().x - 2.0 * visible).abs() < 0.1, "{bounds:?}");
    assert!(layout.notes.iter().any(|n| n.contains("one voxel grid")), "{:?}", layout.notes);
    assert!((region.medium.sigma_t() * grid(region).thickest() - 40.0).abs() < 2.0);

    // Numbered objects are one family, whose threshold is the lowest number's, in whatever order they stand in the file.
    let mut gltf = Gltf::default();
    let mut other = metaballs("Mball.001", [3.0, 0.0, 0.0], json!([{"radius": 1}, {"radius": 1, "negative": true}]));
    other["extensions"]["CLOUDVDB_metaballs"]["threshold"] = json!(0.1);
    other["extras"] = json!({"cloudvdb": {"sigma_t": 5.0}});
    gltf.node(other);
    let mut first = metaballs("Mball", [0.0, 0.0, 0.0], json!([{"radius": 2}]));
    first["extras"] = json!({"cloudvdb": {"sigma_t": 7.0}});
    gltf.node(first);
    let layout = import(&gltf);
    let [region] = &layout.scene.regions[..] else { panic!() };
    assert_eq!((region.name.as_str(), region.medium.sigma_t()), ("Mball", 7.0));
    assert!((grid(region).integral() / lone_ball(2.0) - 1.0).abs() < 2e-3, "the two of the other object cancel");

    let mut gltf = Gltf::default();
    gltf.node(metaballs("Soft", [0.0; 3], json!([{"radius": 2, "stiffness": 0.5}])));
    refused(&gltf, &["no region"]);
}

#[test]
fn detail_is_the_commands_the_nodes_or_the_scenes() {
    let mut gltf = Gltf::default();
    gltf.json["scenes"][0]["extras"] = json!({"cloudvdb": {"medium": "smoke", "detail": {"genus": "humilis", "size": 0.5, "octaves": 2}}});
    let own = gltf.ball(json!({"name": "Own"}));
    gltf.ball(json!({"name": "Scene"}));
    gltf.ball(json!({"name": "Other", "translation": [3, 0, 0]}));
    gltf.ball(json!({"name": "Plain", "extras": {"cloudvdb": {"detail": "none"}}}));
    gltf.set(own, json!({"extras": {"cloudvdb": {"detail": {"genus": "cirrus", "strength": 0.5, "seed": 4}}}}));
    let few = ImportOptions { max_voxels: 200_000, ..Default::default() };
    let names = |options: &ImportOptions| -> Vec<String> {
        let layout = read("layout.glb", &gltf.glb(), options).unwrap();
        layout.scene.regions.iter().map(|r| format!("{} {}", r.name, matches!(r.shape, Shape::Grid(_)))).collect()
    };
    assert_eq!(names(&few), ["Plain false", "Own true", "Scene and 1 more true"]);
    assert_eq!(names(&ImportOptions { detail: Some(None), ..few.clone() }).len(), 4);
    let congestus = Some(Some(DetailRequest::new(Genus::Congestus)));
    assert_eq!(names(&ImportOptions { detail: congestus, ..few }), ["Own and 3 more true"]);
    for (detail, words) in [
        (json!("fog"), &["detail is \"fog\"", "humilis"][..]),
        (json!(1), &["detail is 1", "none, one of"]),
        (json!({"strength": 1}), &["detail.genus is missing"]),
        (json!({"genus": "cirrus", "octaves": 1.5}), &["detail.octaves is 1.5", "whole number"]),
        (json!({"genus": "cirrus", "strength": -1}), &["detail.strength is -1"]),
    ] {
        let mut gltf = Gltf::default();
        gltf.ball(json!({"name": "Ball", "extras": {"cloudvdb": {"detail": detail}}}));
        refused(&gltf, words);
    }
}

#[test]
fn what_differs_in_extinction_alone_shares_a_grid_and_keeps_its_mass() {
    let mut gltf = Gltf::default();
    for (x, sigma) in [(0, 4.0), (5, 1.0)] {
        let medium = json!({"sigma_t": sigma, "albedo": 0.9, "falloff": 0.5});
        gltf.ball(json!({"name": "Ball", "translation": [x, 0, 0], "extras": {"cloudvdb": medium}}));
    }
    let layout = import(&gltf);
    let [region] = &layout.scene.regions[..] else { panic!() };
    // 4 pi times the integral of r^2 min(1, 2 (1 - r)).
    let one = 4.0 * std::f64::consts::PI * (0.125 / 3.0 + 2.0 * ((1.0 - 0.125) / 3.0 - (1.0 - 0.0625) / 4.0));
    assert!((region.optical_mass() / (5.0 * one) - 1.0).abs() < 5e-3, "{} {}", region.optical_mass(), 5.0 * one);
    assert_eq!(region.medium.sigma_t(), 4.0);
}

#[test]
fn meshes_may_be_soft_and_odd() {
    let mut gltf = Gltf::default();
    let soft = gltf.object("Soft", &cube());
    gltf.set(soft, json!({"extras": {"cloudvdb": {"shape": "mesh", "falloff": 0.5}}}));
    let layout = read("layout.glb", &gltf.glb(), &ImportOptions { max_voxels: 1_000_000, ..Default::default() }).unwrap();
    let [region] = &layout.scene.regions[..] else { panic!() };
    // A cube of side 2, whose density rises over half a metre: the mean volume of the cubes at depths from 0 to that.
    let n = 1000;
    let sides = |i: i32| (2.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n) * 0.5).powi(3);
    let integral = (0..n).map(sides).sum::<f64>() / f64::from(n);
    assert!((grid(region).integral() / integral - 1.0).abs() < 5e-3, "{} {integral}", grid(region).integral());

    // Two cubes in one mesh, half through each other: their union.
    let mut gltf = Gltf::default();
    let mut both = cube();
    let first = both.0.len() as u32;
    let second = cube();
    both.0.extend(second.0.iter().map(|p| [p[0] + 1.0, p[1], p[2]]));
    both.1.extend(second.1.iter().map(|t| t.map(|v| v + first)));
    let tangled = gltf.object("Tangled", &both);
    gltf.set(tangled, json!({"extras": {"cloudvdb": {"shape": "mesh"}}}));
    let layout = read("layout.glb", &gltf.glb(), &ImportOptions { max_voxels: 1_000_000, ..Default::default() }).unwrap();
    assert!(layout.notes.iter().any(|n| n.contains("passes through itself")), "{:?}", layout.notes);
    assert!((grid(&layout.scene.regions[0]).integral() / 12.0 - 1.0).abs() < 0.02, "{}", grid(&layout.scene.regions[0]).integral());

    // A face of twelve is missing: too much to mend.
    let mut gltf = Gltf::default();
    let mut open = cube();
    open.1.truncate(10);
    let open = gltf.object("Open", &open);
    gltf.set(open, json!({"extras": {"cloudvdb": {"shape": "mesh"}}}));
    refused(&gltf, &["open: 4 edges", "Fill Holes"]);
}

#[test]
fn layouts_are_repeated_as_grids() {
    let mut gltf = Gltf::default();
    gltf.ball(json!({"name": "A", "translation": [0, 0, 0]}));
    gltf.ball(json!({"name": "B", "translation": [3, 1, 1]}));
    let options = ImportOptions { overrides: Overrides { periodic: true, ..Default::default() }, ..Default::default() };
    let layout = read("layout.glb", &gltf.glb(), &options).unwrap();
    let [region] = &layout.scene.regions[..] else { panic!() };
    assert!(grid(region).periodic);
    near((grid(region).bounds().size().truncate()).to_array(), [5.0, 3.0]);
    assert!((grid(region).integral() / (8.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 3e-3);
}

#[test]
fn media_from_node_material_scene_and_default() {
    let mut gltf = Gltf::default();
    gltf.json["scenes"][0]["extras"] = json!({"cloudvdb": {"medium": {"preset": "smoke"}, "sun_angle": 0.02, "sky": [1, 2, 3], "atmosphere": ["clear", {"preset": "haze", "top": 500}]}});
    let material = gltf.push("materials", json!({"name": "Fog", "extras": {"cloudvdb": {"sigma_t": 2.0, "albedo": 0.75, "g": 0.5}}}));
    let of = |gltf: &mut Gltf, name: &str, extras: Value| gltf.ball(json!({"name": name, "extras": {"cloudvdb": extras}}));
    of(&mut gltf, "Node", json!({"sigma_s": [0.1, 0.2, 0.3], "sigma_a": 0.4, "g": -0.5}));
    of(&mut gltf, "Partial", json!({"preset": "cumulus", "g": 0.8}));
    let fog = of(&mut gltf, "Material", json!({"g": 0.1}));
    let mesh = gltf.json["nodes"][fog]["mesh"].as_u64().unwrap() as usize;
    gltf.json["meshes"][mesh]["primitives"][0]["material"] = json!(material);
    gltf.ball(json!({"name": "Scene"}));
    let layout = import(&gltf);
    let medium = |name: &str| layout.scene.regions.iter().find(|r| r.name == name).unwrap().medium;
    assert_eq!((medium("Node").sigma_s, medium("Node").sigma_a, medium("Node").g), ([0.1, 0.2, 0.3], [0.4; 3], -0.5));
    assert_eq!((medium("Partial").sigma_t(), medium("Partial").g), (0.06, 0.8));
    assert_eq!((medium("Material").sigma_s, medium("Material").sigma_a, medium("Material").g), ([1.5; 3], [0.5; 3], 0.1));
    assert_eq!((medium("Scene").sigma_s[0], medium("Scene").g), (0.6, 0.5));
    assert_eq!(layout.scene.sun.angular_diameter, 0.02);
    let tops: Vec<f64> = layout.scene.air.layers().map(|layer| layer.top).collect();
    assert_eq!(tops, [240_000.0, 36_000.0, 500.0]);
    assert_eq!(layout.scene.sky, [1.0, 2.0, 3.0]);

    let mut gltf = Gltf::default();
    gltf.ball(json!({"name": "Small"}));
    gltf.ball(json!({"name": "Large", "scale": [4, 4, 4]}));
    let layout = import(&gltf);
    let medium = layout.scene.regions[0].medium;
    near([medium.sigma_t() * 8.0, medium.albedo(), medium.g], [40.0, 0.9999, 0.86]);
    assert!(layout.notes.iter().any(|n| n.contains("\"Large\"") && n.contains("optical depth 40")));
}

/// Candela over 683 lm/W, a spot's light along its -Z; and where there are lamps, no sun is assumed.
#[test]
fn points_and_spots_are_lamps() {
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 1366.0, "color": [1, 0.5, 0.25]},
        {"type": "spot", "intensity": 683.0, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}},
        {"type": "point", "intensity": 0.0}]}});
    let light = |i: usize| json!({"KHR_lights_punctual": {"light": i}});
    gltf.node(json!({"name": "Point", "translation": [1, 2, 3], "scale": [5, 5, 5], "extensions": light(0),
                     "extras": {"cloudvdb": {"lamp_radius": 0.25}}}));
    gltf.node(json!({"name": "Spot", "extensions": light(1)}));
    gltf.node(json!({"name": "Dark", "extensions": light(2)}));
    let layout = import(&gltf);
    let [point, spot] = &layout.scene.lamps[..] else { panic!("{:?}", layout.scene.lamps) };
    near(point.position.to_array(), [1.0, -3.0, 2.0]);
    near(point.intensity, [2.0, 1.0, 0.5]);
    assert_eq!((point.radius, spot.radius, point.spot), (0.25, 0.1, None));
    let cone = spot.spot.unwrap();
    near(cone.axis.to_array(), [0.0, 1.0, 0.0]);
    assert_eq!(cone.cosines, [0.2f64.cos(), 0.5f64.cos()]);
    assert_eq!(became(&layout, "Dark").0, Became::Ignored);
    assert_eq!(layout.scene.sun.irradiance, [0.0; 3]);
    assert!(layout.notes.iter().any(|n| n.contains("none is assumed")), "{:?}", layout.notes);
}

#[test]
fn sun_camera_and_ground() {
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    let material = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.5, 0.2, 1.0], "baseColorTexture": {"index": 7}}});
    gltf.push("materials", material);
    let ground = gltf.object("Ground", &plane());
    let mesh = gltf.json["nodes"][ground]["mesh"].as_u64().unwrap() as usize;
    gltf.json["meshes"][mesh]["primitives"][0]["material"] = json!(0);
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "directional", "intensity": 1366.0, "color": [1, 0.5, 0.25]}, {"type": "point"}]}});
    gltf.json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    let light = |i: usize| json!({"KHR_lights_punctual": {"light": i}});
    gltf.node(json!({"name": "Sun", "rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0, 0, std::f64::consts::FRAC_1_SQRT_2], "extensions": light(0)}));
    gltf.node(json!({"name": "Sun 2", "extensions": light(0)}));
    gltf.node(json!({"name": "Lamp", "extensions": light(1)}));
    gltf.push("cameras", json!({"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 2, "znear": 1}}));
    gltf.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1, "aspectRatio": 2}}));
    gltf.node(json!({"name": "Ortho", "camera": 0}));
    gltf.node(json!({"name": "Cam", "camera": 1, "scale": [2, 2, 2], "translation": [0, 0, 10]}));
    gltf.node(json!({"name": "MetaBall.001"}));
    let layout = import(&gltf);
    near(layout.scene.sun.direction.to_array(), [0.0, 0.0, -1.0]);
    near(layout.scene.sun.irradiance, [2.0, 1.0, 0.5]);
    let camera = layout.scene.camera.unwrap();
    near(camera.world_from_camera.transform_vector3(DVec3::NEG_Z).to_array(), [0.0, 1.0, 0.0]);
    near(camera.world_from_camera.transform_vector3(DVec3::Y).to_array(), [0.0, 0.0, 1.0]);
    assert_eq!((camera.yfov, camera.aspect), (0.5, Some(2.0)));
    near(layout.scene.surfaces[0].albedo, [0.1, 0.5, 0.2]);
    near(layout.scene.surfaces[0].mesh.bounds().size().to_array(), [2.0, 2.0, 0.0]);
    for (node, kind) in
        [("Sun", Became::Sun), ("Sun 2", Became::Ignored), ("Lamp", Became::Lamp), ("Ortho", Became::Ignored), ("Cam", Became::Camera)]
    {
        assert_eq!(became(&layout, node).0, kind, "{node}");
    }
    assert!(layout.notes.iter().any(|n| n.contains("MetaBall.001") && n.contains("Convert > Mesh")));
    assert!(layout.notes.iter().any(|n| n.contains("Textures")));
}

#[test]
fn regions_are_picked_by_name() {
    let mut gltf = Gltf::default();
    gltf.ball(json!({"name": "Cloud.001"}));
    let below = gltf.ball(json!({"name": "Inner"}));
    gltf.json["scenes"][0]["nodes"] = json!([0]);
    gltf.node(json!({"name": "Clouds", "children": [below]}));
    gltf.ball(json!({"name": "Moon"}));
    let options = |pattern: &str| ImportOptions { regions: Some(pattern.into()), ..Default::default() };
    let layout = read("layout.glb", &gltf.glb(), &options("Cl?ud*")).unwrap();
    assert_eq!(layout.scene.regions.len(), 2);
    assert_eq!(became(&layout, "Moon"), (Became::Surface, "sphere-like, but no name on its path matches --regions"));
    told(&sentence(read("layout.glb", &gltf.glb(), &options("Fog*"))), "layout.glb", &["no region", "3 surfaces", "Fog*"]);
}

#[test]
fn buffers_come_from_files_and_data_uris() {
    use base64::Engine;
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    fs::create_dir(folder.path().join("sub dir")).unwrap();
    fs::write(folder.path().join("sub dir/b.bin"), &gltf.bin).unwrap();
    let load_with = |uri: &str| {
        fs::write(&path, gltf.with_uri(uri)).unwrap();
        load(&path, &ImportOptions::default(), &Silent)
    };
    let data = base64::engine::general_purpose::STANDARD.encode(&gltf.bin);
    let percent: String = gltf.bin.iter().map(|b| format!("%{b:02x}")).collect();
    for uri in ["sub%20dir/b.bin", &format!("data:application/octet-stream;base64,{data}"), &format!("data:,{percent}")] {
        let layout = load_with(uri).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(layout.scene.regions.len(), 1);
        assert_eq!(layout.source_hash.len(), 64);
    }
    let outside = tempfile::tempdir().unwrap();
    fs::write(outside.path().join("b.bin"), &gltf.bin).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(outside.path().join("b.bin"), folder.path().join("link.bin")).unwrap();
    let absolute = outside.path().join("b.bin").display().to_string();
    for uri in [
        "../b.bin",
        "%2e%2e/b.bin",
        "/etc/passwd",
        "file:///etc/passwd",
        "https://x/b.bin",
        "sub dir/../../b.bin",
        "link.bin",
        &absolute,
        "a\\..\\b",
    ] {
        told(&sentence(load_with(uri)), "a.gltf", &["\"Ball\"", uri.split('\\').next().unwrap(), "outside the file's folder"]);
    }
    told(&sentence(load_with("gone.bin")), "a.gltf", &["\"gone.bin\"", "\"Ball\"", "cannot be read"]);
    told(&sentence(load_with("sub dir")), "a.gltf", &["\"sub dir\""]);
    told(&sentence(load_with("data:;base64,!!")), "a.gltf", &["data URI"]);
    fs::write(folder.path().join("short.bin"), b"1234").unwrap();
    told(&sentence(load_with("short.bin")), "a.gltf", &["has 4", "Copy or export"]);
}

#[test]
fn files_that_are_no_gltf() {
    let options = ImportOptions::default();
    told(&sentence(load(Path::new("/no/such/cloud.glb"), &options, &Silent)), "cloud.glb", &["no such file"]);
    let folder = tempfile::tempdir().unwrap();
    told(&sentence(load(folder.path(), &options, &Silent)), folder.path().to_str().unwrap(), &["folder"]);
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    let whole = gltf.glb();
    let mut old = whole.clone();
    old[4] = 1;
    let cases: [(&[u8], &str); 10] = [
        (b"", "empty"),
        (b"PK\x03\x04", "not a glTF"),
        (b"glTF", "truncated"),
        (&whole[..40], "truncated"),
        (&whole[..whole.len() - 1], "truncated"),
        (&old, "version 1"),
        (b"{\"asset\": {\"version\": \"2.0\"}, ", "ends too early"),
        (b"{\"asset\": }", "broken"),
        (b"{\"a\": 1}", "no `asset`"),
        (b"{\"asset\": {\"version\": \"1.0\"}}", "1.0"),
    ];
    for (bytes, words) in cases {
        told(&sentence(read("bad.glb", bytes, &options)), "bad.glb", &[words]);
    }
    for (extension, words) in [("KHR_draco_mesh_compression", "Draco"), ("EXT_meshopt_compression", "meshopt"), ("X_y", "X_y")] {
        let mut gltf = gltf.clone();
        gltf.json["extensionsRequired"] = json!([extension]);
        refused(&gltf, &[words, "Export again with"]);
    }
}

#[test]
fn nothing_found_says_what_a_region_can_be() {
    let mut gltf = Gltf::default();
    gltf.object("Ground", &plane());
    gltf.object("Box", &cube());
    refused(&gltf, &["no region", "2 surfaces", "sphere-like mesh", "cloudvdb", "metaball", "--mesh-volumes"]);
    refused(&Gltf::default(), &["no region"]);
    let mut gltf = Gltf::default();
    gltf.node(json!({"name": "Mball.002"}));
    refused(&gltf, &["no region", "Mball.002", "drops metaballs"]);
}

#[test]
fn transforms_without_meaning() {
    let ball = |fields: Value| {
        let mut gltf = Gltf::default();
        gltf.ball(fields);
        gltf
    };
    for fields in [
        json!({"translation": [0, null, 0]}),
        json!({"scale": [1e39, 1, 1]}),
        json!({"rotation": [0, 0, null, 1]}),
        json!({"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, null, 0, 0, 1]}),
    ] {
        refused(&ball(fields), &["node \"Ball\"", "NaN or infinite", "transform"]);
    }
    let mut text = String::from_utf8(ball(json!({"name": "NaN \\\" Infinity", "translation": [0, 12345, 0]})).with_uri("x")).unwrap();
    for word in ["NaN", "-Infinity", "1e999"] {
        text = text.replace("12345", word);
        told(&sentence(read("a.gltf", text.as_bytes(), &ImportOptions::default())), "a.gltf", &["node \"NaN ", "NaN or infinite"]);
        text = text.replace(&format!("[0,{word},0]"), "[0,12345,0]");
    }
    refused(&ball(json!({"scale": [0, 1, 1]})), &["node \"Ball\"", "scale", "zero", "Ctrl-A"]);
    refused(&ball(json!({"scale": [-1, 1, 1]})), &["node \"Ball\"", "scale", "mirrored", "Ctrl-A"]);
    refused(&ball(json!({"translation": [1, 2]})), &["node \"Ball\"", "2 numbers"]);
    refused(&ball(json!({"rotation": [0, 0, 0, 0]})), &["node \"Ball\"", "quaternion"]);
    refused(&ball(json!({"children": [0]})), &["node \"Ball\"", "below itself"]);
    refused(&ball(json!({"children": [99]})), &["node 99"]);
    refused(&ball(json!({"mesh": 99})), &["node \"Ball\"", "mesh is 99"]);
    let mut gltf = ball(json!({}));
    gltf.node(json!({"name": "Tiny", "scale": [0, 0, 0]}));
    gltf.object("Mirror", &plane());
    gltf.set(2, json!({"scale": [-1, 1, 1]}));
    assert_eq!(import(&gltf).scene.surfaces.len(), 1);
}

#[test]
fn extras_without_meaning() {
    let cases = [
        (json!({"shape": "sphere", "radius": 0}), vec!["radius is 0", "above 0"]),
        (json!({"shape": "sphere", "radius": -1.5}), vec!["radius is -1.5"]),
        (json!({"shape": "sphere", "radius": "2"}), vec!["radius is the string \"2\"", "number"]),
        (json!({"shape": "blob"}), vec!["shape is \"blob\"", "sphere, metaball, slab, mesh, ignore, surface"]),
        (json!({"shape": 3}), vec!["shape is 3", "a string"]),
        (json!({"g": 1.0}), vec!["g is 1", "between -1 and 1"]),
        (json!({"g": -1}), vec!["g is -1"]),
        (json!({"sigma_s": -0.1}), vec!["sigma_s is -0.1", "not below 0"]),
        (json!({"sigma_a": [1, 2]}), vec!["sigma_a is a list of 2"]),
        (json!({"sigma_t": null}), vec!["sigma_t is null"]),
        (json!({"sigma_t": 1, "sigma_s": 1}), vec!["sigma_t", "beside"]),
        (json!({"albedo": 1.5}), vec!["albedo is 1.5", "from 0 to 1"]),
        (json!({"preset": "fluff"}), vec!["preset is \"fluff\"", "cumulus, stratus"]),
        (json!({"shape": "metaball", "stiffness": 0.1}), vec!["stiffness is 0.1", "threshold"]),
        (json!("fluffy"), vec!["\"fluffy\"", "not JSON"]),
        (json!([1]), vec!["a list of 1", "an object"]),
        (json!({"shape": "slab", "half_height": -1}), vec!["half_height is -1"]),
    ];
    for (extras, words) in cases {
        let mut gltf = Gltf::default();
        gltf.ball(json!({"extras": {"cloudvdb": extras}}));
        refused(&gltf, &[&["node \"Ball\"", "cloudvdb"], &words[..]].concat());
    }
    let mut gltf = Gltf::default();
    gltf.ball(json!({"rotation": [0.1, 0, 0, 0.995], "extras": {"cloudvdb": "slab"}}));
    refused(&gltf, &["node \"Ball\"", "tilted by 11.", "vertical"]);
    let mut gltf = Gltf::default();
    let open = gltf.object("Sheet", &lathe(&[(1.0, 1.0), (2.0, 0.0)], 8));
    gltf.set(open, json!({"extras": {"cloudvdb": "mesh"}}));
    refused(&gltf, &["node \"Sheet\"", "open: 16 edges", "Fill Holes"]);
    let mut gltf = Gltf::default();
    gltf.node(json!({"name": "E", "extras": {"cloudvdb": "slab"}}));
    refused(&gltf, &["node \"E\"", "half_height is missing"]);
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    gltf.push("materials", json!({"name": "Fog", "extras": {"cloudvdb": {"sigma_s": -1}}}));
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    refused(&gltf, &["material \"Fog\"", "sigma_s is -1"]);
    let mut gltf = Gltf::default();
    gltf.node(json!({"name": "Mball", "extensions": {"CLOUDVDB_metaballs": {"elements": [{"radius": 0}]}}}));
    refused(&gltf, &["node \"Mball\"", "elements[0].radius is 0"]);
}

#[test]
fn accessors_out_of_bounds() {
    let mut good = Gltf::default();
    good.ball(json!({}));
    let spoil = |change: &dyn Fn(&mut Value)| {
        let mut gltf = good.clone();
        change(&mut gltf.json);
        gltf
    };
    refused(&spoil(&|j| j["accessors"][0]["count"] = json!(100_000)), &["node \"Ball\"", "positions", "out of bounds", "export"]);
    refused(&spoil(&|j| j["accessors"][0]["count"] = json!(u64::MAX)), &["node \"Ball\"", "out of bounds"]);
    refused(&spoil(&|j| j["accessors"][0]["byteOffset"] = json!(u64::MAX)), &["node \"Ball\"", "out of bounds"]);
    refused(&spoil(&|j| j["accessors"][0]["type"] = json!("VEC2")), &["node \"Ball\"", "VEC3"]);
    refused(&spoil(&|j| j["accessors"][0]["componentType"] = json!(1)), &["node \"Ball\"", "component type 1"]);
    refused(&spoil(&|j| j["bufferViews"][0]["byteLength"] = json!(1_u64 << 40)), &["node \"Ball\"", "buffer view 0, out of bounds"]);
    refused(&spoil(&|j| j["bufferViews"][0]["byteStride"] = json!(4)), &["node \"Ball\"", "stride"]);
    refused(&spoil(&|j| j["bufferViews"][0]["buffer"] = json!(7)), &["node \"Ball\"", "buffer is 7"]);
    refused(&spoil(&|j| j["accessors"][1]["componentType"] = json!(5126)), &["node \"Ball\"", "indices"]);
    refused(&spoil(&|j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(9)), &["node \"Ball\"", "accessor 9"]);
    refused(&spoil(&|j| j["meshes"][0]["primitives"][0]["indices"] = json!(9)), &["node \"Ball\"", "accessor 9"]);
    refused(&spoil(&|j| j["meshes"][0]["primitives"][0]["mode"] = json!(9)), &["node \"Ball\"", "mode"]);
    let count = good.json["accessors"][0]["count"].as_u64().unwrap();
    let mut gltf = good.clone();
    let at = gltf.json["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
    gltf.bin[at..at + 4].copy_from_slice(&(count as u32).to_le_bytes());
    refused(&gltf, &["node \"Ball\"", "indices", "less than the number of vertices"]);
    let mut gltf = good.clone();
    gltf.bin[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    refused(&gltf, &["node \"Ball\"", "position of vertex 0", "NaN"]);
    let mut gltf = good.clone();
    gltf.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    refused(&gltf, &["node \"Ball\"", "no data"]);
}

#[test]
fn strips_fans_quantised_and_sparse_positions() {
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    let points = gltf.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]);
    for (mode, name) in [(5, "Strip"), (6, "Fan"), (1, "Lines")] {
        let mesh = gltf.push("meshes", json!({"primitives": [{"attributes": {"POSITION": points}, "mode": mode}]}));
        gltf.node(json!({"name": name, "mesh": mesh}));
    }
    let (shape, triangles) = ico_sphere(3);
    let bytes: Vec<u8> =
        shape.iter().flat_map(|p| [p[0], p[1], p[2], 0.0].map(|v| (v * 32767.0).round() as i16)).flat_map(i16::to_le_bytes).collect();
    let view = gltf.view(&bytes);
    gltf.json["bufferViews"][view]["byteStride"] = json!(8);
    let quantised = gltf
        .push("accessors", json!({"bufferView": view, "componentType": 5122, "normalized": true, "count": shape.len(), "type": "VEC3"}));
    let indices = gltf.indices(triangles.as_flattened());
    let mesh = gltf.push("meshes", json!({"primitives": [{"attributes": {"POSITION": quantised}, "indices": indices}]}));
    gltf.node(json!({"name": "Quantised", "mesh": mesh}));
    gltf.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let places = gltf.view(&[3, 0, 0, 0]);
    let news = gltf.view(&[2.0_f32, 0.0, 3.0].map(f32::to_le_bytes).concat());
    let sparse = gltf.push(
        "accessors",
        json!({"componentType": 5126, "count": 4, "type": "VEC3", "sparse": {"count": 1,
        "indices": {"bufferView": places, "componentType": 5121}, "values": {"bufferView": news}}}),
    );
    let mesh = gltf.push("meshes", json!({"primitives": [{"attributes": {"POSITION": sparse}, "mode": 5}]}));
    gltf.node(json!({"name": "Sparse", "mesh": mesh}));
    let layout = import(&gltf);
    let surface = |name: &str| &layout.scene.surfaces.iter().find(|s| s.name == name).unwrap().mesh;
    assert_eq!((surface("Strip").triangles.len(), surface("Fan").triangles.len()), (2, 2));
    near(surface("Sparse").bounds().size().to_array(), [2.0, 3.0, 0.0]);
    assert_eq!(became(&layout, "Lines").0, Became::Ignored);
    let quantised = layout.scene.regions.iter().find(|r| r.name == "Quantised").unwrap();
    assert!(axes(&quantised.shape).0.iter().all(|r| (r - 1.0).abs() < 1e-4));
}

#[test]
fn the_order_of_nodes_is_of_no_matter() {
    let mut gltf = Gltf::default();
    gltf.ball(json!({"name": "A"}));
    gltf.object("B", &cube());
    gltf.node(json!({"name": "C", "extras": {"cloudvdb": "sphere"}}));
    let told = |gltf: &Gltf| {
        let mut all: Vec<String> = import(gltf).findings.iter().map(|f| format!("{f:?}")).collect();
        all.sort();
        all
    };
    let before = told(&gltf);
    gltf.json["nodes"].as_array_mut().unwrap().reverse();
    assert_eq!(before, told(&gltf));
}

#[test]
fn deep_trees_do_not_overflow() {
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    let mut nodes: Vec<Value> = vec![gltf.json["nodes"][0].clone()];
    nodes.extend((0..200_000).map(|i| json!({"children": [i]})));
    gltf.json["nodes"] = json!(nodes);
    gltf.json["scenes"][0]["nodes"] = json!([200_000]);
    assert_eq!(import(&gltf).scene.regions.len(), 1);
}

#[test]
fn agrees_with_the_gltf_crate() {
    let mut gltf = Gltf::default();
    let object = gltf.object("Torus", &torus());
    gltf.set(object, json!({"rotation": [0.5, 0.5, 0.5, 0.5], "translation": [1, 2, 3], "scale": [1, 2, 3]}));
    gltf.ball(json!({}));
    let bytes = gltf.glb();
    let twin = gltf::Gltf::from_slice(&bytes).unwrap();
    let node = twin.nodes().next().unwrap();
    let matrix = glam::Mat4::from_cols_array_2d(&node.transform().matrix()).as_dmat4();
    let reader = node.mesh().unwrap().primitives().next().unwrap();
    let reader = reader.reader(|_| twin.blob.as_deref());
    let points: Vec<DVec3> = reader.read_positions().unwrap().map(|p| matrix.transform_point3(glam::Vec3::from(p).as_dvec3())).collect();
    let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    let layout = import(&gltf);
    let mesh = &layout.scene.surfaces[0].mesh;
    for (i, corner) in mesh.triangles.iter().flatten().zip(&indices) {
        let expected = points[*corner as usize];
        near(mesh.vertices[*i as usize].to_array(), [expected.x, -expected.z, expected.y]);
    }
    assert_eq!(mesh.triangles.len() * 3, indices.len());
}

fn busy() -> Gltf {
    let mut gltf = Gltf::default();
    gltf.json["scenes"][0]["extras"] = json!({"cloudvdb": {"medium": {"preset": "smoke"}, "sun_angle": 0.02}});
    gltf.object("Ico", &ico_sphere(1));
    gltf.object("Box", &cube());
    let moves = gltf.floats(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    gltf.node(json!({"name": "Many", "mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}}}));
    gltf.node(json!({"name": "Slab", "extras": {"cloudvdb": {"shape": "slab", "half_height": 1.0, "sigma_s": [1, 2, 3]}}}));
    gltf.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}));
    gltf.node(json!({"name": "Cam", "camera": 0, "rotation": [0, 0, 0, 1]}));
    gltf
}

proptest! {
    // Voxels take time: fewer cases, and coarse ones.
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..Default::default() })]

    #[test]
    fn no_digits_of_metaballs_make_it_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 1..8)) {
        let mut gltf = Gltf::default();
        let elements = json!([{"radius": 1.25, "co": [1.5, 2.5, 3.5]}, {"type": "CUBE", "radius": 2.5, "size": [1.5, 0.5, 2.5], "stiffness": 3.5}]);
        let mut node = metaballs("Mball", [1.5, 2.5, 3.5], elements);
        node["extras"] = json!({"cloudvdb": {"detail": {"genus": "congestus", "size": 1.5, "octaves": 2, "strength": 1.5}}});
        gltf.node(node);
        let mut text = serde_json::to_vec(&gltf.json).unwrap();
        let digits: Vec<usize> = (0..text.len()).filter(|&i| text[i].is_ascii_digit()).collect();
        for (place, byte) in changes {
            text[digits[place.index(digits.len())]] = byte;
        }
        let _ = read("fuzz.gltf", &text, &ImportOptions { max_voxels: 20_000, ..Default::default() });
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..Default::default() })]

    #[test]
    fn no_bytes_make_it_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()), mesh_volumes: bool) {
        let mut bytes = busy().glb();
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        let _ = read("fuzz.glb", &bytes, &ImportOptions { mesh_volumes, max_voxels: 20_000, ..Default::default() });
    }

    #[test]
    fn no_digits_make_it_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 1..8)) {
        let gltf = busy();
        let mut text = serde_json::to_vec(&gltf.json).unwrap();
        let digits: Vec<usize> = (0..text.len()).filter(|&i| text[i].is_ascii_digit()).collect();
        for (place, byte) in changes {
            text[digits[place.index(digits.len())]] = byte;
        }
        let mut root: Value = serde_json::from_slice(&text).unwrap_or(gltf.json);
        root["buffers"] = json!([{"byteLength": gltf.bin.len()}]);
        let _ = read("fuzz.glb", &glb(&serde_json::to_vec(&root).unwrap(), &gltf.bin), &ImportOptions { max_voxels: 20_000, ..Default::default() });
    }
}
