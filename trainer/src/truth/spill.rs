//! One temporary file without a name, made when it is first needed, gone with its last reader.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

use anyhow::{Context, Result};

/// Bytes beyond the bound, written once and read from any thread.
#[derive(Debug)]
pub(super) struct Spill {
    folder: PathBuf,
    file: OnceLock<File>,
    /// Bytes written. Held while the file's cursor is in use, too, where there are no positioned reads.
    end: Mutex<u64>,
}

impl Spill {
    /// Will stand in `folder`.
    pub(super) fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), file: OnceLock::new(), end: Mutex::new(0) }
    }

    /// Writes to `file`.
    #[cfg(test)]
    pub(super) fn of_file(file: File) -> Self {
        Self { file: OnceLock::from(file), ..Self::new(Path::new("here")) }
    }

    /// Appends bytes and returns where they begin.
    pub(super) fn append(&self, bytes: &[u8]) -> Result<u64> {
        let mut end = self.end.lock().unwrap_or_else(PoisonError::into_inner);
        let file = match self.file.get() {
            Some(file) => file,
            None => {
                let made = tempfile::tempfile_in(&self.folder).with_context(|| {
                    let folder = self.folder.display();
                    format!(
                        "{folder}: no temporary file for ground truth can be made there; \
                         set TMPDIR to another folder, or raise --memory"
                    )
                })?;
                self.file.get_or_init(|| made)
            }
        };
        let start = *end;
        write_at(file, bytes, start).with_context(|| {
            let folder = self.folder.display();
            format!(
                "{folder}: the temporary file for ground truth cannot be written after {start} bytes; \
                 free room there, set TMPDIR to another folder, or raise --memory"
            )
        })?;
        *end += bytes.len() as u64;
        Ok(start)
    }

    /// Fills `bytes` with what was written from `start` on.
    pub(super) fn read(&self, start: u64, bytes: &mut [u8]) -> Result<()> {
        let read = match self.file.get() {
            Some(file) => self.read_at(file, bytes, start),
            None => Err(io::ErrorKind::NotFound.into()),
        };
        read.with_context(|| {
            let folder = self.folder.display();
            format!(
                "{folder}: the temporary file for ground truth cannot be read at byte {start}; \
                 check the disk, or raise --memory"
            )
        })
    }

    #[cfg(unix)]
    fn read_at(&self, file: &File, bytes: &mut [u8], start: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(file, bytes, start)
    }

    #[cfg(not(unix))]
    fn read_at(&self, mut file: &File, bytes: &mut [u8], start: u64) -> io::Result<()> {
        use io::{Read, Seek, SeekFrom};
        let _cursor = self.end.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(bytes)
    }
}

/// Whoever calls holds [`Spill::end`].
fn write_at(mut file: &File, bytes: &[u8], start: u64) -> io::Result<()> {
    use io::{Seek, SeekFrom, Write};
    file.seek(SeekFrom::Start(start))?;
    file.write_all(bytes)
}
