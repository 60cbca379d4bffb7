//! Reads the file itself: JSON, or GLB with its chunks.

use super::{at::file_error, json};
use crate::{Error, Result};
use sha2::{Digest, Sha256};
use std::{io, ops::Range, path::Path};

const AGAIN: &str = "Copy or export the file again";

/// A file, parsed but not yet understood.
pub(super) struct Document {
    bytes: Vec<u8>,
    binary: Option<Range<usize>>,
    pub root: json::Root,
    pub hash: String,
}

impl Document {
    /// The GLB's binary chunk.
    pub fn binary(&self) -> Option<&[u8]> {
        self.bytes.get(self.binary.clone()?)
    }
}

/// Reads and parses a file.
pub(super) fn read(path: &Path) -> Result<Document> {
    let bytes = read_bytes(path)?;
    if bytes.is_empty() {
        return Err(file_error(path, "the file is empty", AGAIN));
    }
    let (text, binary) = if bytes.starts_with(b"glTF") { split_glb(path, &bytes)? } else { (0..bytes.len(), None) };
    let text = bytes.get(text).unwrap_or_default();
    let start = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text).trim_ascii_start();
    if start.first() != Some(&b'{') {
        return Err(file_error(
            path,
            "this is not a glTF file: it begins neither with `glTF` nor with `{`",
            "Export as glTF 2.0 (.glb or .gltf)",
        ));
    }
    let root = json::parse(text).map_err(|error| json_error(path, &error))?;
    match root.asset.as_ref().map(|asset| asset.version.as_deref().unwrap_or("without a version")) {
        Some(version) if version.starts_with("2.") => {}
        Some(version) => return Err(file_error(path, format!("its asset is glTF {version:?}, not 2.0"), "Export as glTF 2.0")),
        None => return Err(file_error(path, "this is JSON, but not a glTF file: it has no `asset`", "Export as glTF 2.0 (.glb or .gltf)")),
    }
    let hash = super::vdb::hex(Sha256::new_with_prefix(&bytes));
    check_extensions(path, &root)?;
    Ok(Document { bytes, binary, root, hash })
}

fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let told = |error: io::Error| match error.kind() {
        io::ErrorKind::NotFound => file_error(path, "there is no such file", "Check the path"),
        io::ErrorKind::PermissionDenied => {
            file_error(path, "the file may not be read (permission denied)", "Give yourself the right to read it")
        }
        _ => file_error(path, format!("the file cannot be read ({error})"), "Check the path and the disk"),
    };
    if std::fs::metadata(path).map_err(told)?.is_dir() {
        return Err(file_error(path, "this is a folder", "Name the .glb or .gltf file in it"));
    }
    std::fs::read(path).map_err(told)
}

fn json_error(path: &Path, error: &serde_json::Error) -> Error {
    match error.classify() {
        serde_json::error::Category::Eof => file_error(path, format!("its JSON ends too early ({error})"), AGAIN),
        serde_json::error::Category::Data => {
            file_error(path, format!("its JSON is not glTF 2.0 ({error})"), "Export the file again, or mend that line")
        }
        _ => file_error(path, format!("its JSON is broken ({error})"), "Export the file again, or mend that line"),
    }
}

/// The ranges of a GLB's JSON and of its binary chunk.
fn split_glb(path: &Path, bytes: &[u8]) -> Result<(Range<usize>, Option<Range<usize>>)> {
    let truncated =
        |needed: u64| file_error(path, format!("the GLB is truncated: it should have {needed} bytes and has {}", bytes.len()), AGAIN);
    let word = |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?)) };
    let (Some(version), Some(length)) = (word(4), word(8)) else { return Err(truncated(20)) };
    if version != 2 {
        return Err(file_error(path, format!("the GLB has version {version}, not 2"), "Export as glTF 2.0"));
    }
    if u64::from(length) > bytes.len() as u64 {
        return Err(truncated(u64::from(length)));
    }
    let end = length as usize;
    let (mut json, mut binary, mut at) = (None, None, 12_usize);
    while at < end {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else { return Err(truncated(at as u64 + 8)) };
        let stop = (at as u64) + 8 + u64::from(size);
        if stop > end as u64 {
            return Err(truncated(stop));
        }
        let chunk = at + 8..stop as usize;
        match &kind.to_le_bytes() {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if binary.is_none() => binary = Some(chunk),
            _ => {} // Readers must skip chunks that they do not know.
        }
        at = stop as usize;
    }
    json.map(|json| (json, binary)).ok_or_else(|| file_error(path, "the GLB has no JSON chunk", AGAIN))
}

/// The extensions that a file may require and still be read.
const UNDERSTOOD: [&str; 4] = ["KHR_lights_punctual", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "CLOUDVDB_metaballs"];

fn check_extensions(path: &Path, root: &json::Root) -> Result<()> {
    for required in root.extensions_required.iter().map(String::as_str) {
        return Err(match required {
            "KHR_draco_mesh_compression" => file_error(path, "the file is Draco-compressed", "Export again with Compression off"),
            "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
                file_error(path, "the file is meshopt-compressed", "Export again without compression (gltfpack: without -c)")
            }
            // Materials and textures do not change where things are.
            _ if UNDERSTOOD.contains(&required) || required.starts_with("KHR_materials_") || required.contains("_texture_") => continue,
            _ => file_error(
                path,
                format!("the file requires the extension {required}, which is not understood"),
                "Export again without that extension",
            ),
        });
    }
    Ok(())
}
