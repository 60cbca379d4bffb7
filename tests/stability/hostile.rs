//! Bytes from anywhere: the corpus of `tests/fuzz`, every file of it as it is and changed at random; and what no mutation finds.
//!
//! Coverage-guided, for as long as one likes: `make fuzz`. What that found is kept in the corpus, and told in its README.

#[path = "../fuzz/drive.rs"]
mod drive;

use crate::support::Gltf;
use cloudvdb::Error;
use cloudvdb::import::{ImportOptions, load};
use cloudvdb::progress::Silent;
use cloudvdb::rng::{Rng, Stage};
use serde_json::{Value, json};
use std::path::Path;

/// The files of a target's corpus, in the order of their names.
fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus").join(target);
    let mut paths: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(paths.len() > 3, "{}: a corpus", folder.display());
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// What a fuzzer does to bytes, without looking: flips, numbers that matter, pieces moved, doubled, cut, put in from another file.
fn changed(bytes: &[u8], other: &[u8], rng: &mut Rng) -> Vec<u8> {
    const NUMBERS: [&[u8]; 12] = [
        &[0xff; 8],
        &[0; 8],
        &[0xff; 4],
        &[0, 0, 0, 0x80],
        &[0xff, 0xff, 0xff, 0x7f],
        &[0, 0, 0xc0, 0x7f],
        &[0, 0, 0x80, 0x7f],
        b"-1",
        b"1e308",
        b"null",
        b"[]",
        b"99999999999",
    ];
    let mut below = |n: usize| (rng.uniform() * n as f64) as usize;
    let mut bytes = bytes.to_vec();
    for _ in 0..1 + below(4) {
        let at = below(bytes.len().max(1));
        let end = (at + 1 + below(32)).min(bytes.len());
        match below(7) {
            _ if bytes.is_empty() => bytes.push(below(256) as u8),
            0 => bytes[at] ^= 1 << below(8),
            1 => bytes[at] = below(256) as u8,
            2 => {
                let number = NUMBERS[below(NUMBERS.len())];
                let end = (at + number.len()).min(bytes.len());
                bytes.splice(at..end, number.iter().copied());
            }
            3 => drop(bytes.drain(at..end)),
            4 => {
                let piece = bytes[at..end].to_vec();
                let to = below(bytes.len());
                bytes.splice(to..to, piece);
            }
            5 if !other.is_empty() => {
                let from = below(other.len());
                let piece = &other[from..(from + 1 + below(64)).min(other.len())];
                bytes.splice(at..end, piece.iter().copied());
            }
            _ => bytes.truncate(at),
        }
    }
    bytes
}

/// Replays a corpus, and so many changes to it.
fn replay(target: &str, stream: u64, changes: usize, drive: impl Fn(&[u8])) {
    let files = corpus(target);
    files.iter().for_each(|file| drive(file));
    let mut rng = Rng::new(9, Stage::Regions, stream);
    for i in 0..changes {
        let other = &files[(rng.uniform() * files.len() as f64) as usize];
        drive(&changed(&files[i % files.len()], other, &mut rng));
    }
}

#[test]
fn layouts_from_anywhere() {
    replay("gltf", 1, 150, drive::gltf);
}

#[test]
fn extras_from_anywhere() {
    replay("extras", 2, 300, drive::extras);
}

#[test]
fn volumes_from_anywhere() {
    replay("vdb", 3, 600, drive::vdb);
}

/// A refusal, and what it says.
fn refused(name: &str, bytes: &[u8], words: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile.glb");
    std::fs::write(&path, bytes).unwrap();
    match load(&path, &ImportOptions::default(), &Silent) {
        Err(Error::File { reason, fix, .. }) => assert!(reason.contains(words) && !fix.is_empty(), "{name}: {reason}. {fix}"),
        Err(error) => assert!(error.to_string().contains(words), "{name}: {error}"),
        Ok(layout) => panic!("{name}: {} regions", layout.scene.regions.len()),
    }
}

fn text(root: &Value) -> Vec<u8> {
    serde_json::to_vec(root).unwrap()
}

#[test]
fn more_than_a_file_holds() {
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    let whole = gltf.json.clone();
    let mut vast = gltf.clone();
    vast.json["accessors"][0]["count"] = json!(1_u64 << 40);
    refused("an accessor of a terabyte", &vast.glb(), "out of bounds");
    vast.json = whole.clone();
    vast.json["accessors"][0] = json!({"componentType": 5126, "count": 1_u64 << 32, "type": "VEC3"});
    refused("an accessor without data", &vast.glb(), "no data");
    vast.json["accessors"][0]["sparse"] =
        json!({"count": 1, "indices": {"bufferView": 0, "componentType": 5125}, "values": {"bufferView": 0}});
    refused("a sparse one of gigabytes", &vast.glb(), "no data");
    vast.json = whole.clone();
    vast.json["accessors"][0]["byteOffset"] = json!(u64::MAX - 2);
    refused("an offset that wraps around", &vast.glb(), "out of bounds");
    vast.json = whole;
    vast.json["bufferViews"][0]["byteLength"] = json!(1_u64 << 50);
    refused("a view of a petabyte", &vast.glb(), "out of bounds");
}

#[test]
fn trees_without_end() {
    let file =
        |nodes: Value, roots: Value| text(&json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes}));
    refused("its own child", &file(json!([{"children": [0]}]), json!([0])), "below itself");
    refused("a ring of three", &file(json!([{"children": [1]}, {"children": [2]}, {"children": [0]}]), json!([0])), "below itself");
    refused("a diamond", &file(json!([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {}]), json!([0])), "two nodes");
    let chain: String = (1..300_000).map(|i| format!("{{\"children\":[{i}]}},")).collect();
    let chain = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{chain}{{}}]}}");
    refused("300,000 nodes, each below the last", chain.as_bytes(), "no region");
    let deep = |open: &str, close: &str| {
        let (open, close) = (open.repeat(200_000), close.repeat(200_000));
        format!("{{\"asset\": {{\"version\": \"2.0\"}}, \"nodes\": [{{\"extras\": {open}{close}}}]}}")
    };
    refused("brackets 200,000 deep", deep("[", "]").as_bytes(), "recursion limit");
    refused("braces 200,000 deep", deep("{\"a\":", "}").as_bytes(), "recursion limit");
    // Instances of instances are not in glTF, but a million of one are.
    let mut gltf = Gltf::default();
    let ball = gltf.ball(json!({}));
    gltf.set(ball, json!({"extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}}));
    gltf.json["accessors"].as_array_mut().unwrap().push(json!({"componentType": 5126, "count": 1_u64 << 33, "type": "VEC3"}));
    let last = gltf.json["accessors"].as_array().unwrap().len() - 1;
    gltf.set(ball, json!({"extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": last}}}}));
    refused("8 billion instances", &gltf.glb(), "no data");
}

/// Buffers that lie outside the folder, however they are named.
#[cfg(unix)]
#[test]
fn what_lies_elsewhere_stays_there() {
    let outside = tempfile::tempdir().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let secret = outside.path().join("secret.bin");
    let mut gltf = Gltf::default();
    gltf.ball(json!({}));
    std::fs::write(&secret, &gltf.bin).unwrap();
    std::os::unix::fs::symlink(&secret, folder.path().join("link.bin")).unwrap();
    std::os::unix::fs::symlink(outside.path(), folder.path().join("door")).unwrap();
    std::os::unix::fs::symlink("ring.bin", folder.path().join("ring.bin")).unwrap();
    let absolute = secret.to_str().unwrap().to_string();
    let up = format!("../{}/secret.bin", outside.path().file_name().unwrap().to_str().unwrap());
    let dotted = up.replace("..", "%2e%2E");
    let url = format!("file://{absolute}");
    for uri in
        [&absolute, &up, &dotted, &url, "link.bin", "door/secret.bin", "ring.bin", "..\\secret.bin", "/dev/zero", "/proc/self/mem", "."]
    {
        let path = folder.path().join("layout.gltf");
        std::fs::write(&path, gltf.with_uri(uri)).unwrap();
        let error = load(&path, &ImportOptions::default(), &Silent).expect_err(uri).to_string();
        let told = ["outside the file's folder", "cannot be read", "not a file"];
        assert!(told.iter().any(|words| error.contains(words)), "{uri}: {error}");
        assert_eq!(error.contains("cannot be read"), uri == "ring.bin", "{uri}: {error}");
    }
}
