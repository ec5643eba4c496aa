//! Files: read if they are such, written whole or not at all.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

/// A file to be written: in the end, under another name beside it, and then renamed. Made before long work starts, so that a
/// folder that cannot be written to is no surprise after it; a program that is stopped before the end leaves nothing.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    temporary: PathBuf,
}

impl Output {
    /// Checks that `path` can be written, and is none of the files that are `read` for it.
    pub fn create(path: &Path, read: &[&Path]) -> Result<Self> {
        let name = path
            .file_name()
            .with_context(|| format!("{}: names no file; give one", path.display()))?;
        // Taking its name would fail at the very end (a folder) or replace a device.
        let free = fs::metadata(path).map_or(true, |there| there.is_file());
        ensure!(free, "{}: is a folder or a device; give the name of a file", path.display());
        let same = |read: &&Path| {
            let [path, read] = [path, read].map(fs::canonicalize);
            path.is_ok_and(|path| read.is_ok_and(|read| path == read))
        };
        ensure!(!read.iter().any(same), "{}: is read, too; write another file", path.display());
        let temporary =
            path.with_file_name(format!(".{}.{}.tmp", name.to_string_lossy(), std::process::id()));
        let tried = File::create(&temporary).and_then(|_| fs::remove_file(&temporary));
        tried.with_context(|| {
            format!("{}: cannot be written; choose another folder", path.display())
        })?;
        Ok(Self { path: path.to_owned(), temporary })
    }

    /// Writes everything and gives the file its name.
    pub fn finish(self, bytes: &[u8]) -> Result<()> {
        self.finish_after(bytes, |_| Ok(()))
    }

    /// The same, and what stands there is whole after a loss of power, too.
    pub fn finish_on_disk(self, bytes: &[u8]) -> Result<()> {
        self.finish_after(bytes, File::sync_all)
    }

    fn finish_after(
        self,
        bytes: &[u8],
        written: impl FnOnce(&File) -> io::Result<()>,
    ) -> Result<()> {
        let write = || {
            let mut file = File::create(&self.temporary)?;
            file.write_all(bytes)?;
            written(&file)?;
            fs::rename(&self.temporary, &self.path)
        };
        let named = write();
        if named.is_err() {
            let _ = fs::remove_file(&self.temporary);
        }
        named.with_context(|| {
            format!("{}: cannot be written; is there room on the disk?", self.path.display())
        })
    }
}

/// Writes a file at once.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    Output::create(path, &[])?.finish(bytes)
}

/// Reads a whole file; an error begins with its name.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    read_unnamed(path).with_context(|| path.display().to_string())
}

/// The same for those who name the file themselves.
pub fn read_unnamed(path: &Path) -> Result<Vec<u8>> {
    regular_file(path)?;
    fs::read(path).context("cannot be read; may you read it?")
}

/// What the file system says of a file, before it is opened: a pipe would make the program wait, and a
/// device may have no end.
pub fn regular_file(path: &Path) -> Result<fs::Metadata> {
    let about = fs::metadata(path).context("cannot be read; is the path right?")?;
    ensure!(about.is_file(), "is a folder or a device; give the name of a file");
    Ok(about)
}

/// PNG of an RGB8 or RGBA8 picture, by the number of bytes.
pub fn png(pixels: &[u8], width: u32, height: u32) -> Result<Vec<u8>> {
    let color = match pixels.len() / (width as usize * height as usize).max(1) {
        3 => image::ExtendedColorType::Rgb8,
        _ => image::ExtendedColorType::Rgba8,
    };
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, pixels, width, height, color)
        .context("the picture cannot be encoded")?;
    Ok(bytes)
}
