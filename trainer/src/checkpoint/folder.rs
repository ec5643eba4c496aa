//! The folder of a training: which files lie there, and that they are whole.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Error, Result, anyhow, bail};

use super::file::{self, Content, Fault};
use super::fingerprint::Fingerprint;
use crate::output::{self, Output};

/// Tries to lock, [`PATIENCE`] apart: a process that was killed may take seconds to hand back its memory, and is gone
/// only then.
const TRIES: u32 = 50;
const PATIENCE: Duration = Duration::from_millis(100);

/// A folder that this process alone writes to.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
    fingerprint: Fingerprint,
    /// Held until the end.
    _lock: File,
}

/// A file in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Name {
    /// The descent that runs.
    Running,
    /// One that is done.
    Finished(u32),
    /// The end.
    Result,
}

impl Name {
    fn text(self) -> String {
        match self {
            Self::Running => "running".into(),
            Self::Finished(index) => format!("finished.{index}"),
            Self::Result => "result".into(),
        }
    }

    fn parse(text: &str) -> Option<Self> {
        let name = match text {
            "running" => Self::Running,
            "result" => Self::Result,
            _ => Self::Finished(text.strip_prefix("finished.")?.parse().ok()?),
        };
        // `+1` and `01` are numbers, too.
        (name.text() == text).then_some(name)
    }

    /// Of an [`Output`] that never came to its end.
    fn is_leftover(text: &str) -> bool {
        let parts = || {
            let (name, process) = text.strip_prefix('.')?.strip_suffix(".tmp")?.rsplit_once('.')?;
            process.parse::<u32>().ok()?;
            Self::parse(name)
        };
        parts().is_some()
    }
}

impl Folder {
    /// Makes it where it is absent, removes what a kill left half written, and refuses what is damaged or of another
    /// training before any work is done.
    pub(super) fn open(path: &Path, fingerprint: Fingerprint) -> Result<Self> {
        let unusable = || {
            format!(
                "{}: cannot be used for checkpoints; give a folder that can be written to",
                path.display()
            )
        };
        fs::create_dir_all(path).with_context(unusable)?;
        let mut options = File::options();
        // Not emptied: a file of this name may be somebody's.
        options.write(true).create(true).truncate(false);
        let lock = options.open(path.join("lock")).with_context(unusable)?;
        lock_within(&lock, TRIES).with_context(|| path.display().to_string())?;
        let folder = Self { path: path.to_owned(), fingerprint, _lock: lock };
        for (text, name) in folder.names()? {
            if Name::is_leftover(&text) {
                // One that stays is in nobody's way.
                let _ = fs::remove_file(path.join(text));
            } else if let Some(name) = name {
                let bytes = folder.bytes(name)?;
                file::check(&bytes, fingerprint).map_err(|fault| folder.refusal(name, &fault))?;
            }
        }
        Ok(folder)
    }

    /// All names, and which of them are ours.
    fn names(&self) -> Result<Vec<(String, Option<Name>)>> {
        let unreadable = || format!("{}: cannot be listed; may you read it?", self.path.display());
        let mut names = Vec::new();
        for entry in fs::read_dir(&self.path).with_context(unreadable)? {
            let text = entry.with_context(unreadable)?.file_name().to_string_lossy().into_owned();
            let name = Name::parse(&text);
            names.push((text, name));
        }
        Ok(names)
    }

    /// Whether there is such a file.
    pub(super) fn has(&self, name: Name) -> bool {
        self.path(name).exists()
    }

    /// What it holds.
    pub(super) fn read(&self, name: Name) -> Result<Content<'static>> {
        file::decode(&self.bytes(name)?, self.fingerprint)
            .map_err(|fault| self.refusal(name, &fault))
    }

    /// Replaces it, so that at any moment there is the old one or the new one.
    pub(super) fn write(&self, name: Name, content: &Content<'_>, about: usize) -> Result<()> {
        let bytes = file::encode(self.fingerprint, content, about)?;
        Output::create(&self.path(name), &[])?.finish_on_disk(&bytes)
    }

    /// Removes it if it is there; where that fails it is in nobody's way.
    pub(super) fn remove(&self, name: Name) {
        let _ = fs::remove_file(self.path(name));
    }

    /// Removes what the result stands for.
    pub(super) fn keep_result_only(&self) -> Result<()> {
        for (_, name) in self.names()? {
            if let Some(name @ (Name::Running | Name::Finished(_))) = name {
                self.remove(name);
            }
        }
        Ok(())
    }

    /// The error of a file that cannot be used.
    pub(super) fn refusal(&self, name: Name, fault: &Fault) -> Error {
        let (folder, file) = (self.path.display(), self.path(name));
        match fault {
            Fault::Damaged => anyhow!(
                "{}: is damaged, or no checkpoint; delete it and run again, which repeats what it held",
                file.display()
            ),
            Fault::Foreign(part) => anyhow!(
                "{}: belongs to another training, with {part}; run that one again, \
                 or give another folder than {folder}, or delete it",
                file.display()
            ),
        }
    }

    fn path(&self, name: Name) -> PathBuf {
        self.path.join(name.text())
    }

    fn bytes(&self, name: Name) -> Result<Vec<u8>> {
        output::read(&self.path(name))
    }
}

/// Takes a lock, in so many tries.
fn lock_within(lock: &File, tries: u32) -> Result<()> {
    for _ in 0..tries {
        match lock.try_lock() {
            Ok(()) => return Ok(()),
            // Some file systems have no locks; one training at a time is then up to the user.
            Err(TryLockError::Error(_)) => return Ok(()),
            Err(TryLockError::WouldBlock) => std::thread::sleep(PATIENCE),
        }
    }
    bail!("another training uses this folder; wait for its end, or give another folder")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_from_what_others_left() {
        for name in [Name::Running, Name::Finished(0), Name::Finished(12), Name::Result] {
            assert_eq!(Name::parse(&name.text()), Some(name));
            assert!(Name::is_leftover(&format!(".{}.4711.tmp", name.text())));
            assert!(!Name::is_leftover(&name.text()));
        }
        for text in ["", "lock", "finished.", "finished.+1", "finished.01", "finished", "running.1"]
        {
            assert_eq!(Name::parse(text), None, "{text}");
            assert!(!Name::is_leftover(text), "{text}");
        }
        for text in [".running.tmp", ".running.x.tmp", ".notes.12.tmp", "running.12.tmp", ".tmp"] {
            assert!(!Name::is_leftover(text), "{text}");
        }
    }

    #[test]
    fn two_trainings_do_not_share_a_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let open = || File::create(folder.path().join("lock")).expect("it can be written");
        let first = open();
        lock_within(&first, 1).expect("nobody holds it");
        let refused = lock_within(&open(), 2).expect_err("somebody holds it").to_string();
        assert!(refused.contains("; "), "{refused}");
        drop(first);
        lock_within(&open(), 1).expect("nobody holds it any more");
    }
}
