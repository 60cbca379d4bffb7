//! All files or none: everything is written beside its target first, and renamed when the last one is whole.

use crate::error::{Error, Result};
use std::fs::Permissions;
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use tempfile::{PathPersistError, TempPath};

/// What the process has in folders of the user. Held while a file is made and while files are renamed, so that whoever ends the
/// process from outside finds either all targets replaced or none.
static PENDING: Mutex<Pending> = Mutex::new(Pending { temporary: Vec::new(), written: false });

struct Pending {
    /// What to remove should the process have to end at once.
    temporary: Vec<PathBuf>,
    /// Whether files have been renamed to their targets.
    written: bool,
}

impl Pending {
    fn remove(&self) {
        for path in &self.temporary {
            let _ = std::fs::remove_file(path);
        }
    }
}

fn pending() -> MutexGuard<'static, Pending> {
    PENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes every temporary file of this process, for whoever ends it from outside at once; `tell` hears whether the targets were
/// written already. From then on no file is made or renamed: whoever tries to waits for the end.
pub fn abandon(tell: impl FnOnce(bool)) {
    let pending = pending();
    pending.remove();
    tell(pending.written);
    // What was to be written may have been opened again meanwhile.
    pending.remove();
    std::mem::forget(pending);
}

/// As [`abandon`], for whoever can neither wait nor take memory: what is being renamed at that moment stays.
pub fn abandon_at_once() {
    let pending = match PENDING.try_lock() {
        Ok(pending) => pending,
        Err(TryLockError::Poisoned(error)) => error.into_inner(),
        Err(TryLockError::WouldBlock) => return,
    };
    pending.remove();
    std::mem::forget(pending);
}

/// Files that are written and wait to be renamed to their targets.
#[derive(Debug, Default)]
pub struct Staged {
    files: Vec<(TempPath, PathBuf)>,
    /// Somebody else writes them.
    idle: bool,
}

impl Staged {
    /// Files that are written only by a process that `writes`, not by those that work for it.
    pub fn by(writes: bool) -> Self {
        Staged { idle: !writes, ..Staged::default() }
    }

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
            let _held = pending();
            temporary(target)?;
        }
        Ok(())
    }

    /// Writes a file beside its target by `write`.
    ///
    /// # Errors
    /// What `write` says, with the target's name in place of the temporary one; and when no file can be made there.
    pub fn add(&mut self, target: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        if self.idle {
            return Ok(());
        }
        let mut pending = pending();
        let path = temporary(target)?;
        pending.temporary.push(path.to_path_buf());
        drop(pending);
        write(&path).map_err(|error| match error {
            Error::Write { reason, fix, .. } => Error::Write { target: target.into(), reason, fix },
            Error::Vdb { message, .. } => Error::Vdb { file: target.into(), message },
            other => other,
        })?;
        self.files.push((path, target.into()));
        Ok(())
    }

    /// Renames every file to its target; without `overwrite` all of them or none.
    ///
    /// # Errors
    /// [`Error::Write`] when a target cannot be replaced, or has appeared since [`Staged::check`] and may not be.
    pub fn commit(self, overwrite: bool) -> Result<()> {
        let mut pending = pending();
        let mut placed = Vec::new();
        for (path, target) in self.files {
            if let Err(failed) = rename(path, &target, overwrite) {
                if !overwrite {
                    // These were not there before.
                    placed.iter().for_each(|target| _ = std::fs::remove_file(target));
                }
                let (reason, fix) = match failed.error.kind() {
                    ErrorKind::AlreadyExists => {
                        ("was written by someone else meanwhile".into(), "Use --overwrite to replace it, or name another file")
                    }
                    _ => (failed.error.to_string(), "Check the folder and its permissions"),
                };
                return Err(Error::Write { target, reason, fix: fix.into() });
            }
            placed.push(target);
        }
        *pending = Pending { temporary: Vec::new(), written: true };
        Ok(())
    }
}

fn rename(path: TempPath, target: &Path, overwrite: bool) -> std::result::Result<(), PathPersistError> {
    if overwrite {
        return path.persist(target);
    }
    match path.persist_noclobber(target) {
        // Not every file system can rename without replacing; there a look before has to do.
        Err(failed) if failed.error.kind() != ErrorKind::AlreadyExists && !target.exists() => failed.path.persist(target),
        renamed => renamed,
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
        staged.commit(true).unwrap();
        assert_eq!(std::fs::read_to_string(&a).unwrap(), "new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_target_that_appears_meanwhile_is_kept_and_the_others_are_not_made() {
        let folder = tempfile::tempdir().unwrap();
        let targets = ["a.json", "b.json", "c.json"].map(|name| folder.path().join(name));
        let mut staged = Staged::default();
        targets.iter().for_each(|target| staged.add(target, |p| write_bytes(p, b"new")).unwrap());
        std::fs::write(&targets[1], "theirs").unwrap();
        let error = staged.commit(false).unwrap_err().to_string();
        assert!(error.contains("b.json") && error.contains("--overwrite"), "{error}");
        assert_eq!(std::fs::read_to_string(&targets[1]).unwrap(), "theirs");
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
