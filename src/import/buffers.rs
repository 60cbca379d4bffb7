//! The bytes behind a file: the GLB's chunk, data URIs, files beside it. Each is fetched when it is first needed.

use super::{at::At, at::file_error, container::Document, json};
use crate::{Error, Result};
use base64::{Engine, engine::general_purpose};
use percent_encoding::percent_decode_str;
use std::{
    borrow::Cow,
    io::Read,
    path::{Component, Path, PathBuf},
    sync::OnceLock,
};

/// All buffers of a file.
pub(super) struct Buffers<'a> {
    file: &'a Path,
    pub root: &'a json::Root,
    binary: Option<&'a [u8]>,
    loaded: Vec<OnceLock<Cow<'a, [u8]>>>,
}

impl<'a> Buffers<'a> {
    pub fn new(file: &'a Path, document: &'a Document) -> Self {
        let loaded = document.root.buffers.iter().map(|_| OnceLock::new()).collect();
        Buffers { file, root: &document.root, binary: document.binary(), loaded }
    }

    /// The bytes of a buffer, exactly as many as it declares.
    pub fn bytes(&self, index: usize, at: At) -> Result<&[u8]> {
        let (Some(buffer), Some(cell)) = (self.root.buffers.get(index), self.loaded.get(index)) else {
            let count = self.root.buffers.len();
            return Err(at.error("buffer", index.to_string(), format!("one of the file's {count} buffers"), "Export the file again"));
        };
        if let Some(bytes) = cell.get() {
            return Ok(bytes);
        }
        let bytes = self.fetch(index, buffer, at)?;
        Ok(cell.get_or_init(|| bytes))
    }

    fn fetch(&self, index: usize, buffer: &'a json::Buffer, at: At) -> Result<Cow<'a, [u8]>> {
        let declared = usize::try_from(buffer.byte_length).unwrap_or(usize::MAX);
        let (bytes, what) = match buffer.uri.as_deref() {
            None if index == 0 && self.binary.is_some() => {
                (Cow::Borrowed(self.binary.unwrap_or_default()), "the GLB's binary chunk".into())
            }
            None => {
                let reason = format!("buffer {index} (needed by {at}) has no `uri`, and there is no binary chunk for it");
                return Err(file_error(self.file, reason, "Export the file again"));
            }
            Some(uri) if scheme(uri).is_some_and(|s| s.eq_ignore_ascii_case("data")) => {
                (Cow::Owned(self.data_uri(uri, at)?), "its data URI".into())
            }
            Some(uri) => (Cow::Owned(self.external(uri, buffer.byte_length, at)?), format!("{uri:?}")),
        };
        let held = bytes.len();
        if held < declared {
            let reason = format!("buffer {index} (needed by {at}) should have {declared} bytes, but {what} has {held}");
            return Err(file_error(self.file, reason, "Copy or export the file again, with its buffers"));
        }
        Ok(match bytes {
            Cow::Borrowed(bytes) => Cow::Borrowed(bytes.get(..declared).unwrap_or_default()),
            Cow::Owned(mut bytes) => {
                bytes.truncate(declared);
                Cow::Owned(bytes)
            }
        })
    }

    fn data_uri(&self, uri: &str, at: At) -> Result<Vec<u8>> {
        let broken = |why: String| {
            let start: String = uri.chars().take(40).collect();
            file_error(self.file, format!("the data URI {start:?}... (needed by {at}) is broken: {why}"), "Export the file again")
        };
        let (kind, payload) = uri.split_once(',').ok_or_else(|| broken("it has no comma".into()))?;
        let payload = Cow::from(percent_decode_str(payload));
        if !kind.to_ascii_lowercase().ends_with(";base64") {
            return Ok(payload.into_owned());
        }
        let trimmed = payload.trim_ascii_end();
        let unpadded = trimmed.iter().rposition(|&b| b != b'=').map_or(0, |last| last + 1);
        general_purpose::STANDARD_NO_PAD.decode(trimmed.get(..unpadded).unwrap_or_default()).map_err(|e| broken(e.to_string()))
    }

    fn external(&self, uri: &str, declared: u64, at: At) -> Result<Vec<u8>> {
        let path = self.inside(uri, at)?;
        let unreadable = |error: std::io::Error| self.missing(uri, at, &error);
        let file = std::fs::File::open(&path).map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        if !metadata.is_file() {
            return Err(file_error(self.file, format!("the buffer {uri:?} (needed by {at}) is not a file"), "Export the file again"));
        }
        let mut bytes = Vec::new();
        file.take(declared.min(metadata.len())).read_to_end(&mut bytes).map_err(unreadable)?;
        Ok(bytes)
    }

    fn missing(&self, uri: &str, at: At, error: &std::io::Error) -> Error {
        let reason = format!("the buffer {uri:?} (needed by {at}) cannot be read ({error})");
        file_error(self.file, reason, "Put it beside the .gltf file, or export as .glb, which holds all in one")
    }

    /// The path that a URI names, certain to be inside the file's folder.
    fn inside(&self, uri: &str, at: At) -> Result<PathBuf> {
        let outside = || {
            let reason = format!("the buffer {uri:?} (needed by {at}) lies outside the file's folder");
            file_error(self.file, reason, "Put it beside the .gltf file and name it without `..`, or export as .glb")
        };
        let decoded = percent_decode_str(uri).decode_utf8().map_err(|_| outside())?;
        let relative = Path::new(decoded.as_ref());
        let plain = relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if scheme(&decoded).is_some() || decoded.contains('\\') || decoded.contains('\0') || decoded.is_empty() || !plain {
            return Err(outside());
        }
        let folder = match self.file.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let folder = folder.canonicalize().map_err(|e| self.missing(uri, at, &e))?;
        let path = folder.join(relative).canonicalize().map_err(|e| self.missing(uri, at, &e))?;
        // A symbolic link may lead out of the folder.
        if path.starts_with(&folder) { Ok(path) } else { Err(outside()) }
    }
}

/// What stands before the first colon, if it can be a URI's scheme (or a drive's letter).
pub(super) fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let sound = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'-' | b'.'));
    sound.then_some(scheme)
}
