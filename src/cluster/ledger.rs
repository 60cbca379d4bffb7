//! A checkpoint: what is done of a run, item by item, in one file that only grows. A record that was cut counts as not there.

use crate::error::{Error, Result};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 24] = b"cloudvdb checkpoint v1\n\0";
/// Of the magic and whose checkpoint it is; of what stands before a record's bytes (meeting, item, length) and behind them (check).
const HEADER: u64 = 24 + 32;
const HEAD: usize = 24;
const CHECK: usize = 8;

/// What is done of a run.
pub struct Ledger {
    path: PathBuf,
    file: File,
    /// Of each meeting: items, with where their bytes are and how many.
    known: HashMap<u64, Vec<(u64, u64, usize)>>,
}

impl Ledger {
    /// Opens the checkpoint of a run, or begins it.
    ///
    /// # Errors
    /// [`Error::Write`] where the file is none, is another run's, is in use, or cannot be written.
    pub fn open(path: &Path, run: [u8; 32]) -> Result<Self> {
        let wrong = |reason: String, fix: &str| Error::Write { target: path.into(), reason, fix: fix.into() };
        let failed = |e: std::io::Error| failed(path, &e);
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                return Err(wrong("is the checkpoint of a run that goes on right now".into(), "Wait for it, or name another file"));
            }
            // Not every file system has locks.
            Err(TryLockError::Error(_)) | Ok(()) => {}
        }
        let mut header = Vec::new();
        Read::by_ref(&mut file).take(HEADER).read_to_end(&mut header).map_err(failed)?;
        let whole: Vec<u8> = MAGIC.iter().chain(&run).copied().collect();
        let mut ledger = Ledger { path: path.into(), file, known: HashMap::new() };
        if whole.starts_with(&header) && header.len() < whole.len() {
            // New, or cut as it was begun.
            ledger.file.seek(SeekFrom::Start(0)).and_then(|_| ledger.file.write_all(&whole)).map_err(failed)?;
            return Ok(ledger);
        }
        if !header.starts_with(MAGIC) {
            return Err(wrong("is no checkpoint of cloudvdb".into(), "Name another file"));
        }
        if header != whole {
            let reason = "is the checkpoint of another run: of another scene, other settings, or another version";
            return Err(wrong(reason.into(), "Repeat that run, name another file, or remove this one"));
        }
        let end = ledger.scan().map_err(failed)?;
        ledger.file.set_len(end).and_then(|()| ledger.file.seek(SeekFrom::Start(end))).map_err(failed)?;
        Ok(ledger)
    }

    /// Finds the whole records; gives where they end.
    fn scan(&mut self) -> std::io::Result<u64> {
        let length = self.file.metadata()?.len();
        let mut reader = BufReader::with_capacity(1 << 20, &self.file);
        let (mut at, mut head) = (HEADER, [0; HEAD]);
        while at + (HEAD + CHECK) as u64 <= length {
            reader.read_exact(&mut head)?;
            let [meeting, item, bytes] = [0, 8, 16].map(|i| u64::from_le_bytes(std::array::from_fn(|k| head[i + k])));
            let Some(end) = bytes.checked_add(at + (HEAD + CHECK) as u64).filter(|&end| end <= length) else { break };
            let mut data = vec![0; bytes as usize];
            reader.read_exact(&mut data)?;
            let mut found = [0; CHECK];
            reader.read_exact(&mut found)?;
            if found != check(&head, &data) {
                break;
            }
            self.known.entry(meeting).or_default().push((item, at + HEAD as u64, bytes as usize));
            at = end;
        }
        Ok(at)
    }

    /// What is done of a meeting.
    ///
    /// # Errors
    /// [`Error::Write`] where it cannot be read any more.
    pub fn known(&mut self, meeting: u64) -> Result<Vec<(u64, Vec<u8>)>> {
        let known = self.known.remove(&meeting).unwrap_or_default();
        let one = |(item, at, length): (u64, u64, usize)| {
            let mut bytes = vec![0; length];
            self.file.read_exact_at(&mut bytes, at).map_err(|e| failed(&self.path, &e))?;
            Ok((item, bytes))
        };
        known.into_iter().map(one).collect()
    }

    /// Keeps what came of an item.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn note(&mut self, meeting: u64, item: u64, bytes: &[u8]) -> Result<()> {
        let mut head = [0; HEAD];
        for (place, number) in head.as_chunks_mut::<8>().0.iter_mut().zip([meeting, item, bytes.len() as u64]) {
            *place = number.to_le_bytes();
        }
        let record = [&head[..], bytes, &check(&head, bytes)].concat();
        self.file.write_all(&record).map_err(|e| failed(&self.path, &e))
    }

    /// Removes the file: the run is done.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn remove(self) -> Result<()> {
        std::fs::remove_file(&self.path).map_err(|e| failed(&self.path, &e))
    }
}

fn check(head: &[u8], bytes: &[u8]) -> [u8; CHECK] {
    let digest = Sha256::new().chain_update(head).chain_update(bytes).finalize();
    std::array::from_fn(|i| digest[i])
}

fn failed(path: &Path, e: &std::io::Error) -> Error {
    Error::Write {
        target: path.into(),
        reason: format!("the checkpoint cannot be kept ({e})"),
        fix: "Free some space, check the permissions, or name another file".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_noted_is_known_again_and_what_was_cut_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        let mut ledger = Ledger::open(&path, [1; 32]).unwrap();
        ledger.note(3, 7, b"seven").unwrap();
        ledger.note(3, 5, b"").unwrap();
        ledger.note(4, 7, b"other").unwrap();
        // It is in use.
        assert!(Ledger::open(&path, [1; 32]).map(drop).unwrap_err().to_string().contains("right now"));
        drop(ledger);
        let whole = std::fs::read(&path).unwrap();
        for cut in [whole.len(), whole.len() - 1, whole.len() - 30, HEADER as usize + 2, HEADER as usize, 40, 0] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let mut ledger = Ledger::open(&path, [1; 32]).unwrap();
            let known = ledger.known(3).unwrap();
            let two = cut >= whole.len() - 37;
            assert_eq!(known, if two { vec![(7, b"seven".to_vec()), (5, Vec::new())] } else { Vec::new() }, "{cut}");
            assert_eq!(ledger.known(4).unwrap().len(), usize::from(cut == whole.len()), "{cut}");
            // It goes on where it was cut.
            ledger.note(9, 1, b"more").unwrap();
            drop(ledger);
            assert_eq!(Ledger::open(&path, [1; 32]).unwrap().known(9).unwrap(), [(1, b"more".to_vec())], "{cut}");
        }
        // A flipped bit is a record that is not there, nor is any behind it.
        let mut flipped = whole.clone();
        flipped[HEADER as usize + HEAD] ^= 1;
        std::fs::write(&path, flipped).unwrap();
        assert!(Ledger::open(&path, [1; 32]).unwrap().known(3).unwrap().is_empty());
    }

    #[test]
    fn the_checkpoint_of_another_run_and_other_files_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        drop(Ledger::open(&path, [1; 32]).unwrap());
        let before = std::fs::read(&path).unwrap();
        assert!(Ledger::open(&path, [2; 32]).map(drop).unwrap_err().to_string().contains("another run"));
        assert_eq!(std::fs::read(&path).unwrap(), before);
        std::fs::write(&path, b"a picture").unwrap();
        assert!(Ledger::open(&path, [1; 32]).map(drop).unwrap_err().to_string().contains("is no checkpoint"));
        assert_eq!(std::fs::read(&path).unwrap(), b"a picture");
    }
}
