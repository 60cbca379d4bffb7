//! Where in a file something is wrong: the beginning of every sentence about it.

use crate::Error;
use std::{fmt, path::Path};

/// A place in a file. Cheap to copy; words are made only where something is wrong.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub file: &'a Path,
    /// `node`, `material`, `scene`.
    pub kind: &'static str,
    pub index: usize,
    pub name: Option<&'a str>,
}

impl At<'_> {
    /// The error that says what a field holds, what it may hold, and what to do.
    pub fn error(self, field: impl Into<String>, found: impl Into<String>, expected: impl Into<String>, fix: impl Into<String>) -> Error {
        Error::Node {
            file: self.file.to_path_buf(),
            node: self.to_string(),
            field: field.into(),
            found: found.into(),
            expected: expected.into(),
            fix: fix.into(),
        }
    }

    /// Its name, or its number where it has none.
    pub fn name(self) -> String {
        self.name.map_or_else(|| format!("{} {}", self.kind, self.index), str::to_owned)
    }
}

impl fmt::Display for At<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.name {
            Some(name) => write!(f, "{} {name:?}", self.kind),
            None => write!(f, "{} {} (unnamed)", self.kind, self.index),
        }
    }
}

/// The error of a whole file.
pub(super) fn file_error(file: &Path, reason: impl Into<String>, fix: impl Into<String>) -> Error {
    Error::File { file: file.to_path_buf(), reason: reason.into(), fix: fix.into() }
}
