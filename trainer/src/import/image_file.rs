//! Decoding of textures and masks.

use anyhow::{Context, Result};
use image::{ImageReader, RgbaImage};
use std::io::Cursor;

/// Decodes PNG, JPEG or WebP, told apart by content because declared types are often wrong.
/// The decoder's own limits stop images that claim more memory than sensible.
pub(crate) fn decode(bytes: &[u8]) -> Result<RgbaImage> {
    ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(anyhow::Error::from)
        .and_then(|reader| Ok(reader.decode()?))
        .map(|image| image.to_rgba8())
        .context("is not an intact PNG, JPEG or WebP image; export it again")
}
