//! All files or none: everything is written beside its target first, and renamed when the last one is whole.

use crate::error::{Error, Result};
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use tempfile::TempPath;

/// What to remove should the process have to end at once.
static TEMPORARY: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
static RENAMING: AtomicBool = AtomicBool::new(false);

/// Removes every temporary file of this process, for whoever ends it from outside. `false` while files are being renamed:
/// then the run is over in a moment, and must not be stopped between two targets.
pub fn abandon() -> bool {
    if RENAMING.load(Ordering::SeqCst) {
        return false;
    }
    for path in TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
        let _ = std::fs::remove_file(path);
    }
    true
}

/// Files that are written and wait to be renamed to their targets.
#[derive(Debug, Default)]
pub struct Staged {
    files: Vec<(TempPath, PathBuf)>,
}

impl Staged {
    /// Looks at the targets before any work is done for them.
    ///
    /// # Errors
    /// [`Error::Write`] where a target exists and may not be overwritten, is no regular file, or its folder is missing;
    /// [`Error::Usage`] where two targets are one.
    pub fn check(targets: &[PathBuf], overwrite: bool) -> Result<()> {
        for (i, target) in targets.iter().enumerate() {
            let wrong = |reason: &str, fix: &str| Err(Error::Write { target: target.clone(), reason: reason.into(), fix: fix.into() });
            let place = |t: &Path| (folder(t).canonicalize().ok(), t.file_name().map(std::ffi::OsStr::to_os_string));
            if targets[..i].iter().any(|t| t == target || place(t) == place(target)) {
                return Err(Error::Usage(format!("-o {} is given twice: name each target once", target.display())));
            }
            match std::fs::metadata(target) {
                Ok(meta) if meta.is_dir() => return wrong("is a folder", "Name a file in it"),
                Ok(meta) if !meta.is_file() => return wrong("is not a regular file", "Name a file"),
                Ok(_) if !overwrite => return wrong("exists already", "Use --overwrite to replace it, or name another file"),
                _ => {}
            }
            let folder = folder(target);
            if !folder.is_dir() {
                return wrong(&format!("there is no folder {}", folder.display()), "Make it first, or name another one");
            }
            // Whether the folder takes a file is known only by making one.
            temporary(target)?;
        }
        Ok(())
    }

    /// Writes a file beside its target by `write`.
    ///
    /// # Errors
    /// What `write` says, with the target's name in place of the temporary one; and when no file can be made there.
    pub fn add(&mut self, target: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        let path = temporary(target)?;
        TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_path_buf());
        write(&path).map_err(|error| match error {
            Error::Write { reason, fix, .. } => Error::Write { target: target.into(), reason, fix },
            Error::Vdb { message, .. } => Error::Vdb { file: target.into(), message },
            other => other,
        })?;
        self.files.push((path, target.into()));
        Ok(())
    }

    /// Renames every file to its target.
    ///
    /// # Errors
    /// [`Error::Write`] when a target cannot be replaced.
    pub fn commit(self) -> Result<()> {
        RENAMING.store(true, Ordering::SeqCst);
        let renamed = self.files.into_iter().try_for_each(|(path, target)| {
            path.persist(&target).map_err(|e| Error::Write {
                target,
                reason: e.error.to_string(),
                fix: "Check the folder and its permissions".into(),
            })
        });
        TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner).clear();
        RENAMING.store(false, Ordering::SeqCst);
        renamed
    }
}

/// Writes bytes, with the words for a full disk.
///
/// # Errors
/// [`Error::Write`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|e| Error::Write {
        target: path.into(),
        reason: format!("cannot be written ({e})"),
        fix: "Free some space, or name another folder".into(),
    })
}

fn folder(target: &Path) -> &Path {
    target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn temporary(target: &Path) -> Result<TempPath> {
    let name = target.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    tempfile::Builder::new()
        .prefix(&format!(".{name}."))
        .suffix(".part")
        .permissions(Permissions::from_mode(0o666))
        .tempfile_in(folder(target))
        .map(tempfile::NamedTempFile::into_temp_path)
        .map_err(|e| Error::Write {
            target: target.into(),
            reason: format!("its folder takes no file ({e})"),
            fix: "Check the folder's permissions, or name another one".into(),
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_file_leaves_every_target_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.json"), folder.path().join("b.json"));
        std::fs::write(&a, "old").unwrap();
        let mut staged = Staged::default();
        staged.add(&a, |p| write_bytes(p, b"new")).unwrap();
        let error = staged.add(&b, |p| Err(Error::Write { target: p.into(), reason: "no".into(), fix: "Fix".into() })).unwrap_err();
        assert!(error.to_string().starts_with(&b.display().to_string()), "{error}");
        drop(staged);
        assert_eq!(std::fs::read_to_string(&a).unwrap(), "old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn committed_files_replace_their_targets() {
        let folder = tempfile::tempdir().unwrap();
        let a = folder.path().join("a.json");
        std::fs::write(&a, "old").unwrap();
        let mut staged = Staged::default();
        staged.add(&a, |p| write_bytes(p, b"new")).unwrap();
        staged.commit().unwrap();
        assert_eq!(std::fs::read_to_string(&a).unwrap(), "new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn targets_are_looked_at_before_any_work() {
        let folder = tempfile::tempdir().unwrap();
        let there = folder.path().join("there.vdb");
        std::fs::write(&there, "").unwrap();
        let says = |target: PathBuf, overwrite| Staged::check(&[target], overwrite).map_err(|e| e.to_string());
        assert!(says(there.clone(), false).unwrap_err().contains("--overwrite"));
        assert!(says(there.clone(), true).is_ok());
        assert!(says(folder.path().into(), true).unwrap_err().contains("is a folder"));
        assert!(says("/dev/null".into(), true).unwrap_err().contains("regular file"));
        assert!(says(folder.path().join("no/x.vdb"), false).unwrap_err().contains("no folder"));
        assert!(matches!(Staged::check(&[there.clone(), there], true), Err(Error::Usage(_))));
    }
}
