//! Bare VDB files as scenes: which grids become regions, with which media, sun and bounds; and what is refused.
#![allow(clippy::unwrap_used)]

use cloudvdb::import::{Became, ImportOptions, Layout, load};
use cloudvdb::scene::{BrickGrid, Overrides, Shape, Sun, VoxelGrid};
use cloudvdb::vdb::{GridOut, Meta, write};
use cloudvdb::{Error, Result};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::path::Path;

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
    load(&path, options)
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
    refused(plain(&[out("smoke", &density, &[])]), &["no grid \"density\"", "\"smoke\"", "--grid"]);
    let mut turned = density.clone();
    turned.world_from_index.matrix3 = DMat3::from_quat(DQuat::from_rotation_x(0.2));
    let periodic = ImportOptions { overrides: Overrides { periodic: true, ..Overrides::default() }, ..ImportOptions::default() };
    refused(read(&[out("density", &turned, &[])], &[], &periodic), &["cloud.VDB", "--periodic", "horizontal"]);
    let patterned = ImportOptions { regions: Some("*".into()), ..ImportOptions::default() };
    refused(read(&[out("density", &density, &[])], &[], &patterned), &["--regions", "--grid"]);
    let named = ImportOptions { grid: Some("density".into()), ..ImportOptions::default() };
    let error = load(Path::new("scenes/cumulus.gltf"), &named).unwrap_err();
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
    let layout = load(&path, &ImportOptions::default()).unwrap();
    assert_eq!((grid(&layout, 0).min, grid(&layout, 0).max), ([0; 3], [31, 3, 7]));
    assert_eq!(grid(&layout, 0).integral(), 5.0 * 4.0 * 8.0);
    let named = |name: &str| ImportOptions { grid: Some(name.into()), ..ImportOptions::default() };
    refused(load(&path, &named("ball")), &["\"ball\"", "level set", "fog volume"]);
    refused(load(&path, &named("nan")), &["\"nan\"", "27 samples", "not finite"]);
}

/// The job of a VDB: its grid comes out again, and what is not there yet is refused.
#[test]
fn a_vdb_goes_through_the_pipeline() {
    use cloudvdb::export::vdb::{GridName, VdbOptions};
    use cloudvdb::export::voxelise::Up;
    use cloudvdb::pipeline::{Job, Picture, run, usual_density};
    use cloudvdb::plan::Density;
    use cloudvdb::progress::Silent;
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
        picture: Picture::default(),
        dry_run: false,
    };
    let report = run(&job("out.vdb", Density::Source), &Silent).unwrap();
    assert!((report.optical_mass.source - 25.0 * 64.0).abs() < 1e-9);
    let written = &report.vdb.as_ref().unwrap().grids[0];
    assert!((written.optical_mass / report.optical_mass.source - 1.0).abs() < 2e-3, "{}", written.optical_mass);
    let sentence = |job: &Job| run(job, &Silent).unwrap_err().to_string();
    assert!(sentence(&job("dual.vdb", Density::Duality)).contains("not there yet"));
    assert!(sentence(&job("out.glb", Density::Source)).contains("glTF"));
    assert!(sentence(&job("in.vdb", Density::Source)).contains("--overwrite"));
    let mut dry = Job { dry_run: true, ..job("out.png", Density::Source) };
    assert!(run(&dry, &Silent).unwrap().render.is_none());
    dry.picture.view.position = Some(DVec3::new(-0.25, 1.75, 1.5));
    assert!(sentence(&dry).contains("in.vdb: the camera"), "{}", sentence(&dry));
}
