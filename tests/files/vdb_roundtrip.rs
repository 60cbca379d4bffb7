//! VDB files: what is written comes back, in this reader and in OpenVDB's own Python module; damaged files are errors.

use std::fs;
use std::path::Path;
use std::process::Command;

use cloudvdb::Error;
use cloudvdb::scene::BrickGrid;
use cloudvdb::vdb::{Carried, GridOut, Meta, VdbFile, write, write_beside};
use glam::{DAffine3, DMat3, DQuat, DVec3};

fn scaled(size: f64) -> DAffine3 {
    DAffine3::from_scale(DVec3::splat(size))
}

fn skewed() -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        DVec3::new(0.1, 0.25, 0.5),
        DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7),
        DVec3::new(-4.0, 5.5, 100.0),
    )
}

/// A ball of `bricks` bricks across: constant inside, a ramp outside it, zero outside.
fn ball(world_from_index: DAffine3, bricks: i32, first: i32) -> BrickGrid {
    let radius = f64::from(bricks) * 4.0;
    let (mut origins, mut values) = (Vec::new(), Vec::new());
    let side = |n: i32| (0..n).map(move |i| (first + i) * 8);
    for x in side(bricks) {
        for y in side(bricks) {
            for z in side(bricks) {
                origins.push([x, y, z]);
                for v in 0..512 {
                    let p = DVec3::new(f64::from(x + (v >> 6)), f64::from(y + (v >> 3) % 8), f64::from(z + v % 8));
                    let r = (p - DVec3::splat(f64::from(first) * 8.0 + radius)).length() / radius;
                    values.push(if r < 0.6 { 2.5 } else { (7.0 * (1.0 - r)).max(0.0) as f32 });
                }
            }
        }
    }
    BrickGrid { world_from_index, origins, values }
}

/// The grid without the bricks that hold nothing, which a VDB does not keep.
fn trimmed(grid: &BrickGrid) -> BrickGrid {
    let kept: Vec<_> = (0..grid.origins.len()).filter(|&i| grid.brick(i).iter().any(|&v| v != 0.0)).collect();
    BrickGrid {
        world_from_index: grid.world_from_index,
        origins: kept.iter().map(|&i| grid.origins[i]).collect(),
        values: kept.iter().flat_map(|&i| grid.brick(i).to_vec()).collect(),
    }
}

fn out<'a>(name: &'a str, bricks: &'a BrickGrid) -> GridOut<'a> {
    GridOut { name, bricks, half: false, metadata: &[] }
}

fn there_and_back(path: &Path, grid: &BrickGrid, half: bool) -> BrickGrid {
    write(path, &[GridOut { half, ..out("density", grid) }], &[]).unwrap();
    VdbFile::open(path).unwrap().read_float("density").unwrap()
}

fn dir() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn full_floats_come_back_bit_for_bit() {
    let dir = dir();
    let path = dir.path().join("ball.vdb");
    for grid in [ball(scaled(0.5), 6, 0), ball(scaled(0.5), 5, -3), ball(skewed(), 4, -1000)] {
        let back = there_and_back(&path, &grid, false);
        let kept = trimmed(&grid);
        assert!(back.world_from_index.abs_diff_eq(grid.world_from_index, 1e-12), "{:?}", back.world_from_index);
        assert_eq!(BrickGrid { world_from_index: kept.world_from_index, ..back }, kept);
    }
}

#[test]
fn half_floats_come_back_to_half_precision_in_less_room() {
    let dir = dir();
    let path = dir.path().join("ball.vdb");
    let grid = trimmed(&ball(scaled(0.5), 6, -2));
    there_and_back(&path, &grid, false);
    let full = fs::metadata(&path).unwrap().len();
    let back = there_and_back(&path, &grid, true);
    assert!(fs::metadata(&path).unwrap().len() < full * 3 / 4);
    assert_eq!(back.origins, grid.origins);
    for (&a, &b) in back.values.iter().zip(&grid.values) {
        assert!((a - b).abs() <= b * 2f32.powi(-11) + 2f32.powi(-25), "{b} came back as {a}");
    }
    let info = VdbFile::open(&path).unwrap().grids()[0].clone();
    assert!(info.saved_as_half);
    assert_eq!((info.name.as_str(), info.value_type.as_str(), info.class.as_str()), ("density", "float", "fog volume"));
    assert_eq!(info.active_voxels, grid.active_voxels());
}

#[test]
fn bricks_of_one_value_are_tiles_and_expand_again() {
    let dir = dir();
    let path = dir.path().join("box.vdb");
    // 16^3 bricks fill one node of the tree, which becomes one tile itself; a brick outside it stays a tile of its own.
    let side = || (0..16).map(|i| i * 8);
    let mut origins: Vec<_> = side().flat_map(|x| side().flat_map(move |y| side().map(move |z| [x, y, z]))).collect();
    origins.push([128, 0, 0]);
    let grid = BrickGrid { world_from_index: scaled(1.0), values: vec![0.75; origins.len() * 512], origins };
    assert_eq!(there_and_back(&path, &grid, true), grid);
    assert!(fs::metadata(&path).unwrap().len() < 20_000);
    assert_eq!(VdbFile::open(&path).unwrap().grids()[0].active_voxels, grid.values.len() as u64);
}

#[test]
fn bricks_that_lie_far_apart_come_back() {
    let dir = dir();
    let path = dir.path().join("far.vdb");
    // Each in a branch of the root of its own, among them the first and the last that there is.
    let at = [i32::MIN, -5 * 4096, 0, 4096, 1 << 20, i32::MAX - 4095];
    let origins: Vec<_> = at.iter().flat_map(|&x| at.iter().flat_map(move |&y| [[x, y, -4096], [x, y, 1 << 24]])).collect();
    let values = (0..origins.len() * 512).map(|i| (i % 13) as f32).collect();
    let grid = BrickGrid { world_from_index: scaled(1.0), origins, values };
    for half in [false, true] {
        assert_eq!(there_and_back(&path, &grid, half), grid);
    }
    assert!(cloudvdb::doctor::examine(&path).unwrap().json().contains("\"density\""));
}

#[test]
fn an_empty_grid_one_voxel_and_signed_zeros() {
    let dir = dir();
    let path = dir.path().join("small.vdb");
    let empty = BrickGrid { world_from_index: scaled(0.1), origins: vec![], values: vec![] };
    assert_eq!(there_and_back(&path, &empty, true), empty);
    let nothing = BrickGrid { origins: vec![[0, 0, 0]], values: vec![-0.0; 512], ..empty.clone() };
    assert_eq!(there_and_back(&path, &nothing, false), empty);
    let mut values = vec![-0.0; 512];
    values[511] = f32::MIN_POSITIVE;
    let one = BrickGrid { origins: vec![[i32::MIN, -8, i32::MAX - 7]], values, ..empty };
    let back = there_and_back(&path, &one, false);
    assert_eq!(back, one);
    assert!(back.values.iter().all(|v| v.is_sign_positive()));
    assert_eq!(VdbFile::open(&path).unwrap().grids()[0].active_voxels, 1);
}

#[test]
fn grids_of_another_file_come_along_with_the_same_bytes_each_time() {
    let dir = dir();
    let [from, one, two] = ["from.vdb", "one.vdb", "two.vdb"].map(|name| dir.path().join(name));
    let (heat, cloud) = (trimmed(&ball(skewed(), 4, -2)), trimmed(&ball(scaled(0.5), 3, 0)));
    let own = [("artist".to_string(), Meta::Text("somebody".into()))];
    let half = GridOut { half: true, metadata: &own, ..out("heat", &heat) };
    write(&from, &[out("density", &cloud), half, out("source", &heat)], &[]).unwrap();
    let others = || VdbFile::open(&from).unwrap().carried(|info| info.name != "density");
    let (others, notes): (Carried, _) = others().beside(&["density", "source"], None);
    assert!(notes.len() == 1 && notes[0].contains("\"source\""), "{notes:?}");
    for path in [&one, &two] {
        write_beside(path, &[out("density", &cloud)], &others, &[]).unwrap();
    }
    assert_eq!(fs::read(&one).unwrap(), fs::read(&two).unwrap());
    let (before, after) = (VdbFile::open(&from).unwrap(), VdbFile::open(&one).unwrap());
    assert_eq!(after.grids().iter().map(|info| info.name.as_str()).collect::<Vec<_>>(), ["density", "heat"]);
    assert_eq!(after.grids()[1], before.grids()[1]);
    assert_eq!(after.read_float("heat").unwrap(), before.read_float("heat").unwrap());
    // Cut within what comes along: the sentence is about the file that it comes from.
    let whole = fs::read(&from).unwrap();
    fs::write(&from, &whole[..whole.len() / 2]).unwrap();
    let error = write_beside(&two, &[], &others, &[]).unwrap_err();
    assert!(matches!(&error, Error::File { file, .. } if *file == from) && error.to_string().contains("\"heat\""), "{error}");
}

#[test]
fn several_grids_with_metadata() {
    let dir = dir();
    let path = dir.path().join("several.vdb");
    let (cloud, source) = (trimmed(&ball(scaled(0.5), 3, 0)), trimmed(&ball(skewed(), 2, -1)));
    let of = |pairs: &[(&str, Meta)]| -> Vec<_> { pairs.iter().map(|(key, value)| (key.to_string(), value.clone())).collect() };
    let own = of(&[("g", Meta::Float(0.86)), ("photons", Meta::Int(1 << 40)), ("unit", Meta::Text("1/m, wölkchen".into()))]);
    let file = of(&[("creator", Meta::Text("cloudvdb".into())), ("seed", Meta::Int(-7))]);
    write(&path, &[GridOut { half: true, metadata: &own, ..out("density", &cloud) }, out("source", &source), out("source", &cloud)], &file)
        .unwrap();
    let vdb = VdbFile::open(&path).unwrap();
    assert_eq!(vdb.metadata(), file);
    assert_eq!(
        vdb.grids().iter().map(|g| (g.name.as_str(), g.saved_as_half)).collect::<Vec<_>>(),
        [("density", true), ("source", false), ("source", false)]
    );
    assert_eq!(vdb.grids()[0].metadata, own);
    assert!(vdb.grids()[1].world_from_index.unwrap().abs_diff_eq(skewed(), 1e-12));
    assert_eq!(vdb.read_float("source").unwrap().values, source.values);
    assert_eq!(vdb.read_float_at(2).unwrap(), cloud);
    let message = vdb.read_float("temperature").unwrap_err().to_string();
    assert!(message.contains("\"temperature\"") && message.contains("\"density\" (float)") && message.contains("\"source\""), "{message}");
    assert!(vdb.read_float_at(3).is_err());
}

#[test]
fn no_grid_at_all() {
    let dir = dir();
    let path = dir.path().join("none.vdb");
    write(&path, &[], &[]).unwrap();
    let message = VdbFile::open(&path).unwrap().read_float("density").unwrap_err().to_string();
    assert!(message.contains("no grid at all"), "{message}");
}

#[test]
fn what_a_vdb_cannot_say_is_refused() {
    let dir = dir();
    let path = dir.path().join("refused.vdb");
    let good = ball(scaled(1.0), 2, 0);
    let refused = |grid: &BrickGrid, half: bool, metadata: &[(String, Meta)], word: &str| {
        let error = write(&path, &[GridOut { half, metadata, ..out("density", grid) }], &[]).unwrap_err();
        assert!(matches!(error, Error::Write { .. }) && error.to_string().contains(word), "{error}");
        assert!(!path.exists());
    };
    let with = |value: f32| {
        let mut grid = good.clone();
        grid.values[3] = value;
        grid
    };
    refused(&with(f32::NAN), false, &[], "finite");
    refused(&with(f32::NEG_INFINITY), true, &[], "finite");
    refused(&with(-1e5), true, &[], "--float32");
    refused(&good, false, &[("class".into(), Meta::Int(1))], "OpenVDB");
    refused(&BrickGrid { origins: good.origins.iter().rev().copied().collect(), ..good.clone() }, false, &[], "follows");
    refused(&BrickGrid { origins: vec![[1, 0, 0]], values: vec![1.0; 512], ..good.clone() }, false, &[], "multiple");
    refused(&BrickGrid { values: vec![1.0; 5], ..good.clone() }, false, &[], "samples");
    refused(
        &BrickGrid { world_from_index: DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO }, ..good.clone() },
        false,
        &[],
        "inverted",
    );
}

#[test]
fn targets_that_cannot_be_written() {
    // Small enough to fit into buffers, and large enough not to.
    for bricks in [1, 24] {
        let grid = ball(scaled(1.0), bricks, 0);
        let error = write(Path::new("/dev/full"), &[out("density", &grid)], &[]).unwrap_err();
        assert!(matches!(error, Error::Write { .. }) && error.to_string().contains("No space left"), "{error}");
    }
    for path in ["/nowhere/at/all.vdb", "/", "/proc/version"] {
        let error = write(Path::new(path), &[], &[]).unwrap_err();
        assert!(matches!(error, Error::Write { .. }) && error.to_string().starts_with(path), "{error}");
    }
}

#[test]
fn files_that_are_no_vdb() {
    let dir = dir();
    let path = dir.path().join("file.vdb");
    for (bytes, word) in [(&b"glTF, this is something else altogether"[..], "not a VDB"), (b"", "too early"), (b" BDV", "too early")] {
        fs::write(&path, bytes).unwrap();
        let error = VdbFile::open(&path).unwrap_err();
        assert!(matches!(error, Error::Vdb { .. }) && error.to_string().contains(word), "{error}");
    }
    for path in [dir.path().join("missing.vdb"), dir.path().to_path_buf()] {
        assert!(matches!(VdbFile::open(&path), Err(Error::File { .. })));
    }
}

/// Opens a file and reads every float grid: whatever happens, it must happen as a value.
fn read_all(path: &Path) -> cloudvdb::Result<Vec<BrickGrid>> {
    let vdb = VdbFile::open(path)?;
    (0..vdb.grids().len()).map(|i| vdb.read_float_at(i)).collect()
}

fn sample_file(path: &Path) -> Vec<u8> {
    let (cloud, source) = (ball(scaled(0.5), 2, -1), ball(skewed(), 1, 0));
    let metadata = [("creator".to_string(), Meta::Text("cloudvdb".into())), ("seed".to_string(), Meta::Int(1))];
    write(path, &[GridOut { half: true, ..out("density", &cloud) }, out("source", &source)], &metadata).unwrap();
    fs::read(path).unwrap()
}

#[test]
fn every_truncation_is_an_error() {
    let dir = dir();
    let path = dir.path().join("cut.vdb");
    let whole = sample_file(&path);
    read_all(&path).unwrap();
    let step = (whole.len() / 3000).max(1);
    for length in (0..whole.len()).step_by(step).chain(whole.len().saturating_sub(200)..whole.len()) {
        fs::write(&path, &whole[..length]).unwrap();
        let error = read_all(&path).expect_err(&format!("{length} bytes of {} were read as if whole", whole.len()));
        assert!(matches!(error, Error::Vdb { .. }), "{length}: {error}");
    }
}

#[test]
fn damaged_files_never_crash() {
    let dir = dir();
    let path = dir.path().join("damaged.vdb");
    let whole = sample_file(&path);
    let mut state = 1u64;
    let mut next = |n: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % n
    };
    for _ in 0..1500 {
        let mut bytes = whole.clone();
        for _ in 0..=next(3) {
            let at = next(bytes.len() - 8);
            match next(4) {
                0 => bytes[at] = next(256) as u8,
                1 => bytes[at..at + 4].fill(0xff),
                2 => bytes[at..at + 8].copy_from_slice(&(-(next(1 << 30) as i64)).to_le_bytes()),
                _ => bytes[at] ^= 1 << next(8),
            }
        }
        fs::write(&path, &bytes).unwrap();
        if let Ok(grids) = read_all(&path) {
            assert!(grids.iter().all(|grid| grid.values.len() == grid.origins.len() * 512));
        }
    }
}

#[test]
fn chunks_that_lie_about_their_size_are_refused() {
    let dir = dir();
    let path = dir.path().join("chunk.vdb");
    let whole = sample_file(&path);
    // The last blosc chunk: 8 bytes of size, then blosc's header, with the same size in its last four bytes.
    let size = |at: usize| u64::from_le_bytes(whole[at - 8..at].try_into().unwrap());
    let own = |at: usize| u64::from(u32::from_le_bytes(whole[at + 12..at + 16].try_into().unwrap()));
    let at = (8..whole.len() - 16).rev().find(|&at| whole[at..at + 2] == [2, 1] && size(at) == own(at)).unwrap();
    let refused = |mut bytes: Vec<u8>| {
        bytes.resize(bytes.len() + (1 << 20), 0x41);
        fs::write(&path, &bytes).unwrap();
        let message = read_all(&path).unwrap_err().to_string();
        assert!(message.contains("a chunk of the wrong size") || message.contains("too early"), "{message}");
    };
    for lie in [-(1i64 << 20), -2048, i64::MIN, i64::MAX, 1 << 40, 1 << 19, 5] {
        let mut bytes = whole.clone();
        bytes[at - 8..at].copy_from_slice(&lie.to_le_bytes());
        refused(bytes);
    }
    let mut bytes = whole.clone();
    bytes[at + 12..at + 16].copy_from_slice(&(1u32 << 19).to_le_bytes());
    refused(bytes);
}

#[test]
fn a_file_without_an_index_is_read_in_order() {
    let dir = dir();
    let path = dir.path().join("stream.vdb");
    let mut bytes = sample_file(&path);
    let indexed = read_all(&path).unwrap();
    assert_eq!(std::mem::replace(&mut bytes[20], 0), 1);
    fs::write(&path, &bytes).unwrap();
    assert_eq!(read_all(&path).unwrap(), indexed);
}

/// Runs a script in Debian's Python with its OpenVDB module; `None`, with a notice, where that is not installed.
fn pyopenvdb(script: &str, path: &Path) -> Option<String> {
    let python = |code: &str| Command::new("/usr/bin/python3").args(["-c", code]).arg(path).output();
    let there = python("import pyopenvdb").is_ok_and(|output| output.status.success());
    if !there && std::env::var_os("CI").is_none() {
        println!("skipped: /usr/bin/python3 cannot import pyopenvdb (Debian: python3-openvdb)");
        return None;
    }
    let output = python(&format!("import sys, json, pyopenvdb as vdb\npath = sys.argv[1]\n{script}")).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

#[test]
fn openvdb_itself_reads_what_is_written() {
    let dir = dir();
    let path = dir.path().join("out.vdb");
    let (cloud, source) = (ball(skewed(), 4, -2), ball(DAffine3::from_translation(DVec3::Z) * scaled(0.25), 2, 0));
    let own = [("sigma_t".to_string(), Meta::Float(0.04))];
    write(&path, &[GridOut { half: true, metadata: &own, ..out("density", &cloud) }, out("source", &source)], &[]).unwrap();
    let script = r#"
found = []
for grid in vdb.readAll(path)[0]:
    points = [(1, 2, 3), (-7, 11, 0.5)]
    total = sum(i["value"] * i["count"] for i in ({"value": x.value, "count": x.count} for x in grid.citerOnValues()))
    found.append([grid.name, grid.gridClass, grid.saveFloatAsHalf, grid.activeVoxelCount(), total, grid.transform.typeName,
                  [list(grid.transform.indexToWorld(p)) for p in points], grid.metadata.get("sigma_t")])
print(json.dumps(sorted(found)))"#;
    let Some(text) = pyopenvdb(script, &path) else { return };
    let found: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (row, grid, half, map, name) in
        [(&found[0], &cloud, true, "AffineMap", "density"), (&found[1], &source, false, "UniformScaleTranslateMap", "source")]
    {
        assert_eq!((row[0].as_str(), row[1].as_str(), row[2].as_bool()), (Some(name), Some("fog volume"), Some(half)), "{row}");
        assert_eq!(row[3].as_u64().unwrap(), grid.active_voxels());
        let sum: f64 = grid.values.iter().map(|&v| f64::from(v)).sum();
        assert!((row[4].as_f64().unwrap() / sum - 1.0).abs() < if half { 1e-4 } else { 1e-9 }, "{row}, expected {sum}");
        assert_eq!(row[5], map);
        for (i, point) in [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-7.0, 11.0, 0.5)].into_iter().enumerate() {
            let world: Vec<f64> = row[6][i].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
            assert!(grid.world_from_index.transform_point3(point).abs_diff_eq(DVec3::from_slice(&world), 1e-9), "{row}");
        }
    }
    assert_eq!(found[0][7].as_f64(), Some(0.04));
}

#[test]
fn what_openvdb_writes_is_read() {
    let dir = dir();
    let path = dir.path().join("in.vdb");
    let script = r#"
a = vdb.FloatGrid(); a.name = "density"; a.fill((0, 0, 0), (9, 9, 9), 0.5); a.gridClass = "fog volume"
b = vdb.createLevelSetSphere(radius=4, voxelSize=0.5); b.name = "surface"
c = vdb.BoolGrid(); c.name = "mask"; c.fill((0, 0, 0), (1, 1, 1), True)
d = vdb.FloatGrid(background=1.0); d.name = "huge"; d.fill((0, 0, 0), (8191, 4095, 4095), 2.0)
e = vdb.FloatGrid(); e.name = "frustum"; e.transform = vdb.createFrustumTransform((0, 0, 0), (10, 10, 10), 0.5, 10)
f = a.copy(); f.name = "moved"; f.transform = vdb.createLinearTransform(2.0)
vdb.write(path, [a, b, c, d, e, f], {"vector": (1.0, 2.0, 3.0), "yes": True})
print(b.activeVoxelCount())"#;
    let Some(text) = pyopenvdb(script, &path) else { return };
    let vdb = VdbFile::open(&path).unwrap();
    let grid = vdb.read_float("density").unwrap();
    assert_eq!((grid.origins.len(), grid.active_voxels(), grid.integral()), (8, 1000, 500.0));
    // A grid that shares another's tree.
    let moved = vdb.read_float("moved").unwrap();
    assert_eq!((&moved.values, moved.integral()), (&grid.values, 4000.0));
    assert_eq!(vdb.grids().iter().find(|g| g.name == "surface").unwrap().class, "level set");
    let active = text.trim().parse::<u64>().unwrap();
    assert_eq!(vdb.grids().iter().find(|g| g.name == "surface").unwrap().active_voxels, active);
    // The six voxels in which the axes meet the sphere are active and exactly 0.
    assert_eq!(vdb.read_float("surface").unwrap().active_voxels(), active - 6);
    let message = |name: &str| vdb.read_float(name).unwrap_err().to_string();
    assert!(message("mask").contains("bool") && message("mask").contains("\"density\""), "{}", message("mask"));
    assert!(message("huge").contains("2147483648 voxels"), "{}", message("huge"));
    assert!(message("frustum").contains("not affine"), "{}", message("frustum"));
    assert_eq!(vdb.metadata().iter().find(|(key, _)| key == "yes").unwrap().1, Meta::Int(1));

    // A level set has a background other than 0: the case where OpenVDB's half-read nodes hold no valid pointers.
    let script = r#"
b = vdb.createLevelSetSphere(radius=4, voxelSize=0.5); b.name = "surface"
vdb.write(path, [b])"#;
    pyopenvdb(script, &path).unwrap();
    let whole = fs::read(&path).unwrap();
    for length in (0..whole.len()).step_by(whole.len() / 500) {
        fs::write(&path, &whole[..length]).unwrap();
        assert!(read_all(&path).is_err(), "{length} bytes of {}", whole.len());
    }
}

#[test]
fn equal_grids_make_equal_files() {
    let folder = dir();
    let bricks = ball(scaled(0.1), 4, 0);
    let grid = GridOut { name: "density", bricks: &bricks, half: true, metadata: &[] };
    let files: Vec<Vec<u8>> = ["a.vdb", "b.vdb"]
        .map(|name| {
            write(&folder.path().join(name), &[grid], &[]).unwrap();
            std::fs::read(folder.path().join(name)).unwrap()
        })
        .to_vec();
    assert_eq!(files[0], files[1]);
    let uuid = std::str::from_utf8(&files[0][21..57]).unwrap();
    assert!(uuid.chars().enumerate().all(|(i, c)| if [8, 13, 18, 23].contains(&i) { c == '-' } else { c.is_ascii_hexdigit() }), "{uuid}");
}
