//! Crops in memory up to a bound, and beyond it in a file.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::Result;

use super::crop::{Crop, Outline, Scratch};
use super::scale::scaled_rect;
use super::spill::Spill;
use crate::metrics::Rect;
use crate::picture::Picture;

/// Keeps crops, from several threads at once. Which of them stay in memory depends on who comes
/// first; what is read back does not.
#[derive(Debug)]
pub struct Store {
    /// Bytes that may stay in memory.
    bound: u64,
    /// Bytes that do.
    held: AtomicU64,
    spill: Arc<Spill>,
}

/// A picture that a [`Store`] keeps.
#[derive(Debug)]
pub struct Stored {
    outline: Outline,
    place: Place,
}

#[derive(Debug)]
enum Place {
    Memory(Box<[u8]>),
    /// Bytes of a file.
    File {
        spill: Arc<Spill>,
        start: u64,
        len: usize,
    },
}

impl Store {
    /// Holds at most `bound` bytes of pixels in memory, and the rest in a file without a name in
    /// `folder`, which is made when it is first needed.
    pub fn new(bound: u64, folder: &Path) -> Self {
        Self::with_spill(bound, Spill::new(folder))
    }

    pub(super) fn with_spill(bound: u64, spill: Spill) -> Self {
        Self { bound, held: AtomicU64::new(0), spill: Arc::new(spill) }
    }

    /// Keeps a crop for as long as what is returned lives.
    pub fn keep(&self, crop: Crop) -> Result<Stored> {
        let Crop { outline, bytes } = crop;
        let len = bytes.len() as u64;
        let with_it = |held: u64| held.checked_add(len).filter(|&sum| sum <= self.bound);
        let fits = self.held.fetch_update(Ordering::Relaxed, Ordering::Relaxed, with_it).is_ok();
        let place = if fits {
            Place::Memory(bytes.into_boxed_slice())
        } else {
            let start = self.spill.append(&bytes)?;
            Place::File { spill: Arc::clone(&self.spill), start, len: bytes.len() }
        };
        Ok(Stored { outline, place })
    }

    /// Bytes of pixels that were kept in memory.
    pub fn held_bytes(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }
}

impl Stored {
    /// Where the covered part stands in the picture that [`Self::draw`] makes for `shift`; without
    /// pixels if nothing is covered.
    pub fn rect(&self, shift: u32) -> Rect {
        scaled_rect(self.outline.rect, shift)
    }

    /// Makes `picture` what [`Crop::picture_at`] returns, in the memory it has.
    ///
    /// # Panics
    /// As [`Crop::picture_at`].
    pub fn draw(
        &self,
        background: [f32; 3],
        shift: u32,
        scratch: &mut Scratch,
        picture: &mut Picture,
    ) -> Result<()> {
        let Scratch { bytes, sums } = scratch;
        let bytes = match &self.place {
            Place::Memory(bytes) => bytes,
            Place::File { spill, start, len } => {
                bytes.resize(*len, 0);
                spill.read(*start, bytes)?;
                &bytes[..]
            }
        };
        self.outline.draw(bytes, background, shift, sums, picture);
        Ok(())
    }
}
