//! The caller's pixels.

use core::ops::Range;

use crate::error::Error;
use crate::raster::{self, CLEAR, TilePixels};
use crate::tiles::TileGrid;

/// What a picture is composited over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// A colour, display-referred sRGB; the result is opaque.
    Color([f32; 3]),
    /// The pixels that are there, premultiplied by their alpha.
    Existing,
}

/// RGBA8 pixels, 4 bytes each, row 0 on top.
#[derive(Debug)]
pub struct Framebuffer<'p> {
    /// All rows.
    pub pixels: &'p mut [u8],
    /// Bytes from one row to the next; at least 4 × width.
    pub stride: usize,
    /// What the picture is composited over.
    pub background: Background,
}

impl Framebuffer<'_> {
    /// Whether rows `rows` of a frame `width` pixels wide fit.
    pub(crate) fn check(&self, width: u32, rows: usize) -> Result<(), Error> {
        if rows == 0 {
            return Ok(());
        }
        let row = (width as usize).saturating_mul(4);
        let needed = self.stride.saturating_mul(rows - 1).saturating_add(row);
        if self.stride < row {
            return Err(Error::Stride { needed: row, given: self.stride });
        }
        if self.pixels.len() < needed {
            return Err(Error::Framebuffer { needed, lent: self.pixels.len() });
        }
        Ok(())
    }

    /// Writes a tile; row `first_row` of the frame is row 0 of this buffer.
    pub(crate) fn write(
        &mut self,
        grid: &TileGrid,
        tile: u32,
        first_row: u32,
        source: &TilePixels,
    ) {
        let [columns, rows] = grid.pixels(tile);
        let background = self.background;
        for (y, source) in rows.clone().zip(&source.0) {
            let Some(row) = self.row((y - first_row) as usize, &columns) else { continue };
            let pixels = row.as_chunks_mut::<4>().0;
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let source = raster::pixel(source, column);
                match background {
                    Background::Color(color) => *pixel = over_color(source, color),
                    Background::Existing => *pixel = over_pixel(source, *pixel),
                }
            }
        }
    }

    fn row(&mut self, y: usize, columns: &Range<u32>) -> Option<&mut [u8]> {
        let start = y * self.stride + columns.start as usize * 4;
        self.pixels.get_mut(start..start + columns.len() * 4)
    }
}

/// C + T · background, opaque.
fn over_color([r, g, b, t]: [f32; 4], background: [f32; 3]) -> [u8; 4] {
    [
        to_byte(r + t * background[0]),
        to_byte(g + t * background[1]),
        to_byte(b + t * background[2]),
        255,
    ]
}

/// C + T · what is there, alpha 1 − T + T · its alpha. An untouched pixel keeps its bytes.
fn over_pixel(source: [f32; 4], existing: [u8; 4]) -> [u8; 4] {
    if source == CLEAR {
        return existing;
    }
    let [r, g, b, t] = source;
    let there = existing.map(|byte| f32::from(byte) * (1.0 / 255.0));
    [
        to_byte(r + t * there[0]),
        to_byte(g + t * there[1]),
        to_byte(b + t * there[2]),
        to_byte(1.0 - t + t * there[3]),
    ]
}

/// Nearest of 256 steps, halves up; below 0 and NaN become 0, above 1 becomes 255.
#[inline]
pub fn to_byte(value: f32) -> u8 {
    let clamped = if value > 0.0 { value } else { 0.0 };
    let clamped = if clamped < 1.0 { clamped } else { 1.0 };
    (clamped * 255.0 + 0.5) as i32 as u8
}
