//! VDB files as scenes, bare and named by nodes of glTF: which grids become regions, where, with which media; what is refused.

use cloudvdb::import::{Became, ImportOptions, Layout, load};
use cloudvdb::progress::Silent;
use cloudvdb::scene::{BrickGrid, Overrides, Shape, Sun, VoxelGrid};
use cloudvdb::vdb::{GridOut, Meta, write};
use cloudvdb::{Error, Result};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Two bricks side by side, samples of `value` at every other place, voxels of half a metre.
fn bricks(value: f32) -> BrickGrid {
    let values = (0..1024).map(|i| if i % 2 == 0 { value } else { 0.0 }).collect();
    BrickGrid { world_from_index: DAffine3::from_scale(DVec3::splat(0.5)), origins: vec![[-8, 0, 0], [0, 0, 0]], values }
}

fn out<'a>(name: &'a str, bricks: &'a BrickGrid, metadata: &'a [(String, Meta)]) -> GridOut<'a> {
    GridOut { name, bricks, half: false, metadata }
}

/// Writes the grids to a file and reads it as a scene.
fn read(grids: &[GridOut], metadata: &[(String, Meta)], options: &ImportOptions) -> Result<Layout> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.VDB");
    write(&path, grids, metadata).unwrap();
    load(&path, options, &Silent)
}

fn plain(grids: &[GridOut]) -> Result<Layout> {
    read(grids, &[], &ImportOptions::default())
}

fn grid(layout: &Layout, region: usize) -> &VoxelGrid {
    let Shape::Grid(grid) = &layout.scene.regions[region].shape else { panic!("no grid") };
    grid
}

#[track_caller]
fn refused(result: Result<Layout>, words: &[&str]) {
    let error = result.expect_err("this must be refused");
    let sentence = error.to_string();
    for word in words {
        assert!(sentence.contains(word), "{word:?} is missing in: {sentence}");
    }
}

fn noted(layout: &Layout, words: &str) -> bool {
    layout.notes.iter().any(|n| n.contains(words))
}

fn text(key: &str, value: &str) -> (String, Meta) {
    (key.into(), Meta::Text(value.into()))
}

fn float(key: &str, value: f64) -> (String, Meta) {
    (key.into(), Meta::Float(value))
}

#[test]
fn a_grid_of_densities_is_a_region_as_thick_as_a_cloud() {
    let (density, other) = (bricks(2.0), bricks(1.0));
    let layout = plain(&[out("temperature", &other, &[]), out("density", &density, &[])]).unwrap();
    assert_eq!(layout.scene.regions.len(), 1);
    let region = &layout.scene.regions[0];
    assert_eq!(region.name, "density");
    assert_eq!(grid(&layout, 0).bricks, density);
    // Samples are active at even z only.
    assert_eq!((grid(&layout, 0).min, grid(&layout, 0).max), ([-8, 0, 0], [7, 7, 6]));
    let bounds = region.shape.bounds();
    assert_eq!((bounds.min, bounds.max), (DVec3::new(-4.25, -0.25, -0.25), DVec3::new(3.75, 3.75, 3.25)));
    // The thickest column: 16 samples of 2 along x, half a metre each.
    assert!((region.shape.thickness() - 16.0).abs() < 1e-12);
    assert!((region.medium.sigma_t() * region.shape.thickness() - 40.0).abs() < 1e-9);
    assert!((region.medium.albedo() - 0.9999).abs() < 1e-12 && region.medium.g == 0.86);
    assert!(noted(&layout, "--sigma-t") && noted(&layout, "--sun"));
    assert_eq!(layout.scene.sun, Sun::default());
    let became: Vec<_> = layout.findings.iter().map(|f| (f.node.as_str(), f.became)).collect();
    assert_eq!(became, [("temperature", Became::Ignored), ("density", Became::Region)]);
    assert!(layout.findings[0].why.contains("not named \"density\""));
    assert_eq!(layout.source_hash.len(), 64);
}

#[test]
fn all_grids_of_the_name_are_regions() {
    let (a, b) = (bricks(1.0), bricks(3.0));
    let layout = plain(&[out("density", &a, &[]), out("density", &b, &[])]).unwrap();
    let names: Vec<_> = layout.scene.regions.iter().map(|r| r.name.as_str()).collect();
    assert_eq!(names, ["density[0]", "density[1]"]);
    assert_eq!((&grid(&layout, 0).bricks, &grid(&layout, 1).bricks), (&a, &b));
    let options = ImportOptions { grid: Some("smoke".into()), ..ImportOptions::default() };
    let layout = read(&[out("density", &a, &[]), out("smoke", &b, &[])], &[], &options).unwrap();
    assert_eq!(&grid(&layout, 0).bricks, &b);
}

#[test]
fn what_cloudvdb_wrote_into_the_metadata_counts() {
    let density = bricks(1.0);
    let scale = [float("density_scale", 25.0)];
    let file = [
        float("albedo", 0.5),
        float("g", -0.25),
        text("sun_direction", "0 0 -2"),
        text("sun_irradiance", "1 2 3"),
        float("sun_angle", 0.01),
    ];
    let layout = read(&[out("density", &density, &scale)], &file, &ImportOptions::default()).unwrap();
    let medium = layout.scene.regions[0].medium;
    assert_eq!((medium.sigma_s, medium.sigma_a, medium.g), ([12.5; 3], [12.5; 3], -0.25));
    assert_eq!(layout.scene.sun, Sun { direction: DVec3::NEG_Z, irradiance: [1.0, 2.0, 3.0], angular_diameter: 0.01 });
    assert!(layout.notes.is_empty(), "{:?}", layout.notes);

    let overrides = Overrides { sigma_t: Some(4.0), g: Some(0.1), sun: Some(DVec3::X), sky: Some([0.5; 3]), ..Overrides::default() };
    let options = ImportOptions { overrides, ..ImportOptions::default() };
    let layout = read(&[out("density", &density, &scale)], &file, &options).unwrap();
    let medium = layout.scene.regions[0].medium;
    assert_eq!((medium.sigma_t(), medium.albedo(), medium.g), (4.0, 0.5, 0.1));
    assert_eq!((layout.scene.sun.direction, layout.scene.sun.irradiance, layout.scene.sky), (DVec3::X, [1.0, 2.0, 3.0], [0.5; 3]));
    // What is given needs no assumption.
    let layout = read(&[out("density", &density, &[])], &[], &options).unwrap();
    assert!(layout.notes.is_empty(), "{:?}", layout.notes);

    let broken =
        [float("albedo", 1.5), float("g", f64::NAN), text("sun_direction", "up"), text("sun_irradiance", "1 2"), float("sun_angle", -1.0)];
    let layout = read(&[out("density", &density, &scale)], &broken, &ImportOptions::default()).unwrap();
    assert_eq!((layout.scene.regions[0].medium.g, layout.scene.sun), (0.86, Sun::default()));
    for key in ["albedo", "sun_direction", "sun_irradiance", "sun_angle"] {
        assert!(noted(&layout, &format!("{key:?}")), "{key}: {:?}", layout.notes);
    }
}

#[test]
fn negative_samples_are_counted_and_none() {
    let mut density = bricks(1.0);
    (density.values[0], density.values[2]) = (-0.5, -3.0);
    let layout = plain(&[out("density", &density, &[])]).unwrap();
    assert!(noted(&layout, "2 samples") && noted(&layout, "-3"), "{:?}", layout.notes);
    assert!(grid(&layout, 0).bricks.values.iter().all(|&v| v >= 0.0));
    assert!((grid(&layout, 0).integral() - 510.0 / 8.0).abs() < 1e-12);
    let options = ImportOptions { overrides: Overrides { periodic: true, ..Overrides::default() }, ..ImportOptions::default() };
    assert!(read(&[out("density", &density, &[])], &[], &options).unwrap().scene.regions[0].shape.is_endless());
}

#[test]
fn what_is_no_cloud_is_refused() {
    let (density, empty) = (bricks(1.0), bricks(0.0));
    refused(plain(&[out("density", &empty, &[])]), &["cloud.VDB", "\"density\"", "empty", "--grid"]);
    refused(plain(&[out("density", &bricks(-1.0), &[])]), &["empty"]);
    // A stray voxel far off, along one axis or all: no table could hold what lies between.
    for far in [[1 << 20, 0, 0], [1 << 20; 3], [1 << 15; 3]] {
        let mut stray = bricks(1.0);
        stray.origins.push(far);
        stray.values.extend_from_within(..512);
        refused(plain(&[out("density", &stray, &[])]), &["\"density\"", "too large to look through", "stray voxels"]);
    }
    refused(plain(&[out("smoke", &density, &[])]), &["no grid \"density\"", "\"smoke\"", "--grid"]);
    let mut turned = density.clone();
    turned.world_from_index.matrix3 = DMat3::from_quat(DQuat::from_rotation_x(0.2));
    let periodic = ImportOptions { overrides: Overrides { periodic: true, ..Overrides::default() }, ..ImportOptions::default() };
    refused(read(&[out("density", &turned, &[])], &[], &periodic), &["cloud.VDB", "--periodic", "horizontal"]);
    let patterned = ImportOptions { regions: Some("*".into()), ..ImportOptions::default() };
    refused(read(&[out("density", &density, &[])], &[], &patterned), &["--regions", "--grid"]);
    let named = ImportOptions { grid: Some("density".into()), ..ImportOptions::default() };
    let error = load(Path::new("scenes/cumulus.gltf"), &named, &Silent).unwrap_err();
    assert!(matches!(error, Error::Usage(_)) && error.to_string().contains("--grid density"), "{error}");
}

/// A tile whose columns are empty in part, as OpenVDB's own Python writes it: active zeros count for its size.
#[test]
fn active_zeros_are_part_of_a_tile() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tile.vdb");
    let script = format!(
        "import pyopenvdb as openvdb\n\
         g = openvdb.FloatGrid(0.0)\ng.name = 'density'\n\
         g.fill((0, 0, 0), (31, 3, 7), 0.0, True)\n\
         g.fill((0, 0, 0), (4, 3, 7), 1.0, True)\n\
         l = openvdb.createLevelSetSphere(3.0, (0, 0, 0), 0.5)\nl.name = 'ball'\n\
         n = openvdb.FloatGrid(0.0)\nn.name = 'nan'\nn.fill((0, 0, 0), (2, 2, 2), float('nan'), True)\n\
         openvdb.write({path:?}, grids=[g, l, n])\n"
    );
    let python = |code: &str| std::process::Command::new("/usr/bin/python3").args(["-c", code]).output();
    if !python("import pyopenvdb").is_ok_and(|output| output.status.success()) {
        println!("skipped: /usr/bin/python3 cannot import pyopenvdb (Debian: python3-openvdb)");
        return;
    }
    let output = python(&script).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let layout = load(&path, &ImportOptions::default(), &Silent).unwrap();
    assert_eq!((grid(&layout, 0).min, grid(&layout, 0).max), ([0; 3], [31, 3, 7]));
    assert_eq!(grid(&layout, 0).integral(), 5.0 * 4.0 * 8.0);
    let named = |name: &str| ImportOptions { grid: Some(name.into()), ..ImportOptions::default() };
    refused(load(&path, &named("ball"), &Silent), &["\"ball\"", "level set", "fog volume"]);
    refused(load(&path, &named("nan"), &Silent), &["\"nan\"", "27 samples", "not finite"]);
    for (name, words) in [("ball", ["level set", "fog volume"]), ("nan", ["27 samples", "not finite"])] {
        let (_folder, layout) = beside(&json!({"shape": "vdb", "file": &path, "grid": name}), &json!({}), &[], &[]);
        refused(load(&layout, &ImportOptions::default(), &Silent), &[["layout.gltf", "node \"Smoke\""], words].concat());
    }
}

/// A glTF with one node that names `cloud.vdb`, which holds these grids; and the folder in which both are.
fn beside(extras: &Value, node: &Value, grids: &[GridOut], metadata: &[(String, Meta)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("cloud.vdb"), grids, metadata).unwrap();
    let path = folder.path().join("layout.gltf");
    let mut named = json!({"name": "Smoke", "extras": {"cloudvdb": extras}});
    named.as_object_mut().unwrap().extend(node.as_object().unwrap().clone());
    let gltf = json!({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [named]});
    std::fs::write(&path, gltf.to_string()).unwrap();
    (folder, path)
}

fn read_beside(extras: &Value, node: &Value, grids: &[GridOut], metadata: &[(String, Meta)]) -> Result<Layout> {
    let (_folder, path) = beside(extras, node, grids, metadata);
    load(&path, &ImportOptions::default(), &Silent)
}

#[test]
fn a_node_places_the_vdb_that_it_names() {
    let density = bricks(2.0);
    let vdb = json!({"shape": "vdb", "file": "cloud.vdb"});
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.4, 0.5);
    let node = json!({"translation": [1.0, 2.0, 3.0], "rotation": turn.to_array(), "scale": [1.0, -2.0, 3.0]});
    let layout = read_beside(&vdb, &node, &[out("density", &density, &[])], &[]).unwrap();
    assert_eq!((layout.scene.regions.len(), layout.scene.regions[0].name.as_str()), (1, "Smoke"));
    let found = &grid(&layout, 0).bricks;
    assert_eq!((&found.origins, &found.values), (&density.origins, &density.values));
    for index in [DVec3::ZERO, DVec3::X, DVec3::new(3.0, -4.0, 5.0)] {
        // By hand: half a metre a voxel, Z up to Y up, the node, Y up to Z up.
        let p = 0.5 * index;
        let node = turn * (DVec3::new(1.0, -2.0, 3.0) * DVec3::new(p.x, p.z, -p.y)) + DVec3::new(1.0, 2.0, 3.0);
        let expected = DVec3::new(node.x, -node.z, node.y);
        assert!(found.world_from_index.transform_point3(index).abs_diff_eq(expected, 1e-12));
    }
    // Nobody says a medium: optical depth 40 along the thickest column.
    let region = &layout.scene.regions[0];
    assert!((region.medium.sigma_t() * region.shape.thickness() - 40.0).abs() < 1e-9);
    assert!((region.medium.albedo() - 0.9999).abs() < 1e-12 && region.medium.g == 0.86);
    assert_eq!(layout.findings[0].became, Became::Region);
    assert!(layout.findings[0].why.contains("its extras name the VDB \"cloud.vdb\""), "{:?}", layout.findings);
    // As it is, where the node is not moved.
    let still = read_beside(&vdb, &json!({}), &[out("density", &density, &[])], &[]).unwrap();
    assert_eq!(grid(&still, 0).bricks, density);
}

#[test]
fn a_node_knows_more_of_the_medium_than_its_vdb() {
    let (a, b) = (bricks(1.0), bricks(3.0));
    let (scale, file) = ([float("density_scale", 25.0)], [float("albedo", 0.5), float("g", -0.25)]);
    let medium = |more: Value| {
        let mut extras = json!({"shape": "vdb", "file": "cloud.vdb"});
        extras.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let layout = read_beside(&extras, &json!({}), &[out("density", &a, &scale), out("smoke", &b, &[])], &file).unwrap();
        let m = layout.scene.regions[0].medium;
        (m.sigma_t(), m.albedo(), m.g, grid(&layout, 0).bricks == b)
    };
    assert_eq!(medium(json!({})), (25.0, 0.5, -0.25, false));
    assert_eq!(medium(json!({"sigma_t": 8})), (8.0, 0.5, -0.25, false));
    assert_eq!(medium(json!({"albedo": 0.25, "g": 0.5})), (25.0, 0.25, 0.5, false));
    assert_eq!(medium(json!({"sigma_s": 3, "sigma_a": 1, "grid": "smoke"})), (4.0, 0.75, -0.25, true));
    // Grids that share the name are regions all.
    let both = read_beside(
        &json!({"shape": "vdb", "file": "cloud.vdb"}),
        &json!({}),
        &[out("density", &a, &scale), out("density", &b, &scale)],
        &[],
    );
    let names: Vec<_> = both.unwrap().scene.regions.into_iter().map(|r| r.name).collect();
    assert_eq!(names, ["Smoke[0]", "Smoke[1]"]);
}

#[test]
fn the_hash_covers_the_vdb_that_is_named() {
    let vdb = json!({"shape": "vdb", "file": "cloud.vdb"});
    let hash = |value: f32| {
        let layout = read_beside(&vdb, &json!({}), &[out("density", &bricks(value), &[])], &[]).unwrap();
        assert_eq!((layout.source_hash.len(), layout.volumes.len()), (64, 1));
        layout.source_hash
    };
    assert_eq!(hash(1.0), hash(1.0));
    assert_ne!(hash(1.0), hash(2.0));
}

#[test]
fn vdbs_that_cannot_be_named_are_refused() {
    let (density, empty) = (bricks(1.0), bricks(0.0));
    let refuse = |extras: Value, words: &[&str]| {
        let grids = [out("density", &density, &[]), out("nothing", &empty, &[])];
        refused(read_beside(&extras, &json!({}), &grids, &[]), &[&["layout.gltf", "node \"Smoke\"", "expected"], words].concat());
    };
    let named = |file: &str| json!({"shape": "vdb", "file": file});
    refuse(json!("vdb"), &["extras.cloudvdb.file", "missing", "\"smoke.vdb\""]);
    refuse(named("gone.vdb"), &["\"gone.vdb\"", "cannot be read", "No such file"]);
    refuse(named("."), &["no file"]);
    refuse(named("layout.gltf"), &["OpenVDB says"]);
    for url in ["https://clouds.org/a.vdb", "file:///tmp/a.vdb", "data:,x"] {
        refuse(named(url), &["a URL", "by its path"]);
    }
    refuse(named("//cloud.vdb"), &[".blend"]);
    refuse(json!({"shape": "vdb", "file": "cloud.vdb", "grid": "smoke"}), &["extras.cloudvdb.grid", "\"smoke\"", "\"density\" (float)"]);
    refuse(json!({"shape": "vdb", "file": "cloud.vdb", "grid": "nothing"}), &["empty"]);
    refuse(json!({"shape": "vdb", "file": 7}), &["extras.cloudvdb.file", "a string"]);
    let flat = json!({"scale": [1, 0, 1]});
    refused(read_beside(&named("cloud.vdb"), &flat, &[out("density", &density, &[])], &[]), &["Smoke", "scale", "zero"]);
    // A path from the root is as good as another.
    let (folder, _) = beside(&named("cloud.vdb"), &json!({}), &[out("density", &density, &[])], &[]);
    let whole = folder.path().join("cloud.vdb");
    assert!(read_beside(&named(whole.to_str().unwrap()), &json!({}), &[], &[]).is_ok());
    // A file without a shape is no region, and a note says what is missing.
    refuse_quietly(&json!({"file": "cloud.vdb"}), &density);
}

fn refuse_quietly(extras: &Value, density: &BrickGrid) {
    refused(read_beside(extras, &json!({}), &[out("density", density, &[])], &[]), &["no region", "{\"shape\": \"vdb\""]);
}

/// The job of a VDB: its grid comes out again, as it is and by the duality, and what cannot be of grids is refused.
#[test]
fn a_vdb_goes_through_the_pipeline() {
    use cloudvdb::export::vdb::{GridName, VdbOptions};
    use cloudvdb::pipeline::{Job, Picture, run, usual_density};
    use cloudvdb::plan::Density;
    use cloudvdb::progress::Silent;
    use cloudvdb::voxelise::Up;
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.vdb");
    write(&input, &[out("density", &bricks(1.0), &[float("density_scale", 25.0)])], &[]).unwrap();
    assert_eq!((usual_density(&input), usual_density(Path::new("a.glb"))), (Density::Source, Density::Duality));
    let job = |name: &str, density| Job {
        input: input.clone(),
        outputs: vec![folder.path().join(name)],
        overwrite: false,
        import: ImportOptions::default(),
        density,
        photons: 1000,
        duality: Default::default(),
        vdb: VdbOptions { voxel_size: None, max_voxels: 1 << 20, up: Up::Z, half: false, grids: vec![GridName::Density] },
        bake: cloudvdb::pipeline::Baking { checked: true, ..Default::default() },
        picture: Picture::default(),
        dry_run: false,
    };
    let report = run(&job("out.vdb", Density::Source), &Silent).unwrap();
    assert!((report.optical_mass.source - 25.0 * 64.0).abs() < 1e-9);
    let written = &report.vdb.as_ref().unwrap().grids[0];
    assert!((written.optical_mass / report.optical_mass.source - 1.0).abs() < 1e-9, "{}", written.optical_mass);
    // In its own lattice, sample by sample.
    let again = cloudvdb::vdb::VdbFile::open(&folder.path().join("out.vdb")).unwrap();
    assert_eq!((again.read_float("density").unwrap(), report.vdb.as_ref().unwrap().voxel_size), (bricks(1.0), 0.5));
    let sentence = |job: &Job| run(job, &Silent).unwrap_err().to_string();
    assert!(sentence(&job("out.glb", Density::Source)).contains("glTF"));
    assert!(sentence(&job("in.vdb", Density::Source)).contains("--overwrite"));
    let mut dry = Job { dry_run: true, ..job("out.png", Density::Source) };
    assert!(run(&dry, &Silent).unwrap().render.is_none());
    dry.picture.view.position = Some(DVec3::new(-0.25, 1.75, 1.5));
    assert!(sentence(&dry).contains("in.vdb: the camera"), "{}", sentence(&dry));

    // The same grid, named by a node: what it cannot do yet goes by what the scene holds.
    let layout = folder.path().join("layout.gltf");
    let node = json!({"name": "Smoke", "extras": {"cloudvdb": {"shape": "vdb", "file": "in.vdb"}}});
    let gltf = json!({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [node]});
    std::fs::write(&layout, gltf.to_string()).unwrap();
    let named = |name: &str, density| Job { input: layout.clone(), ..job(name, density) };
    let refused = sentence(&named("out.glb", Density::Duality));
    assert!(["layout.gltf", "\"Smoke\"", "glTF can hold no voxel grid"].iter().all(|word| refused.contains(word)), "{refused}");
    assert!(sentence(&named("out.glb", Density::Source)).contains("glTF can hold no voxel grid"));
    let over = sentence(&Job { overwrite: true, ..named("in.vdb", Density::Source) });
    assert!(over.contains("a VDB that the layout names"), "{over}");
    let report = run(&named("named.vdb", Density::Source), &Silent).unwrap();
    assert!((report.optical_mass.source - 25.0 * 64.0).abs() < 1e-9);
}

/// The duality of a VDB: mass is kept, and what is made is a medium like any other.
#[test]
fn the_duality_of_a_vdb_is_written_lit_and_balanced() {
    use cloudvdb::export::vdb::{GridName, VdbOptions};
    use cloudvdb::integrate::Integrator;
    use cloudvdb::photon::Model;
    use cloudvdb::pipeline::{BalanceJob, Job, Picture, balance, run};
    use cloudvdb::plan::Density;
    use cloudvdb::progress::Silent;
    use cloudvdb::regions::Duality;
    use cloudvdb::voxelise::Up;
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.vdb");
    // A cloud of 24^3 voxels: dense within, a hundredth of it at the rim.
    let (mut origins, mut values) = (Vec::new(), Vec::new());
    for brick in 0..27 {
        let origin = [brick / 9 * 8, brick / 3 % 3 * 8, brick % 3 * 8];
        origins.push(origin);
        values.extend((0..512).map(|v: i32| {
            let at = DVec3::new(f64::from(origin[0] + (v >> 6)), f64::from(origin[1] + (v >> 3 & 7)), f64::from(origin[2] + (v & 7)));
            let r = (at - 11.5).length() / 11.5;
            if r < 1.0 { 10f64.powf(-2.0 * r * r) as f32 } else { 0.0 }
        }));
    }
    let cloud = BrickGrid { world_from_index: DAffine3::from_scale(DVec3::splat(0.5)), origins, values };
    write(&input, &[out("density", &cloud, &[float("density_scale", 8.0)])], &[]).unwrap();
    let job = |name: &str, model| Job {
        input: input.clone(),
        outputs: vec![folder.path().join(name)],
        overwrite: false,
        import: ImportOptions::default(),
        density: Density::Duality,
        photons: 20_000,
        duality: Duality { model, ..Duality::default() },
        vdb: VdbOptions { voxel_size: None, max_voxels: 1 << 22, up: Up::Z, half: false, grids: vec![GridName::Density] },
        bake: cloudvdb::pipeline::Baking { checked: true, ..Default::default() },
        picture: Picture { spp: Some(4), ..Picture::default() },
        dry_run: false,
    };
    for model in [Model::Physical, Model::Hura2006] {
        let report = run(&job(&format!("{model:?}.vdb"), model), &Silent).unwrap();
        let (mass, source) = (report.optical_mass, &report.regions.sources[0]);
        assert!((mass.written - source.synthesised).abs() < 1e-5 * mass.source, "{mass:?}");
        assert_eq!(mass.missing, mass.source - source.synthesised);
        let share = mass.written / mass.source;
        assert!(
            if model == Model::Physical { (share - 1.0).abs() < 5e-3 } else { share > 0.7 && share <= 1.0 + 1e-6 },
            "{model:?} {share}"
        );
        let grid = &report.vdb.as_ref().unwrap().grids[0];
        assert!((grid.optical_mass / mass.written - 1.0).abs() < 5e-3, "{grid:?}");
        assert_eq!((report.regions.synthesised as u64, report.regions.sticking_out), (source.regions, 0.0));
        assert!(source.regions > 3 && source.candidates > source.regions, "{source:?}");
        let error = report.error.unwrap();
        let (before, after) = (error.sunlight_through_layout, error.sunlight_through_regions);
        assert!(error.photon_density > 0.0 && report.energy.is_some());
        assert!(after.value - before.value > 3.0 * before.se.hypot(after.se), "between balls there is nothing: {before:?} {after:?}");
    }
    // A picture of it, by light itself and by stored photons, but not to the letter.
    let mut picture = job("out.exr", Model::Physical);
    picture.picture.view.size = Some([24, 16]);
    assert!(run(&picture, &Silent).unwrap().render.is_some());
    picture.picture.integrator = Some(Integrator::Photon);
    picture.overwrite = true;
    assert!(run(&picture, &Silent).unwrap().render.is_some());
    picture.duality.model = Model::Hura2006;
    let refused = run(&picture, &Silent).unwrap_err().to_string();
    assert!(refused.contains("the thesis marches homogeneous regions only"), "{refused}");
    // Where light goes: all of it somewhere.
    let job = BalanceJob { input, import: ImportOptions::default(), density: Density::Duality, photons: 20_000, seed: 1 };
    let flux = balance(&job, &Silent).unwrap().flux;
    let sum: f64 =
        [flux.up, flux.down_direct, flux.down_diffuse, flux.absorbed_medium, flux.absorbed_surface].iter().map(|e| e.value).sum();
    assert!((1.0 - sum).abs() < 1e-9 && flux.up.value > 0.0 && flux.mean_scatterings.value > 1.0, "{flux:?}");
}
