//! The caller's memory: pixels of one of five formats, and if wanted their depths.
//!
//! A tile gives each pixel a colour C, premultiplied and not below 0, and T, the share of the light
//! from behind that is left; its alpha is 1 − T. Written is
//!
//! - over a colour B: C + T · B, and 1 for alpha;
//! - over a pixel P of alpha A that is there: C + T · P, and (1 − T) + T · A for alpha. A pixel that
//!   no Gaussian touches keeps its bits.
//!
//! | [`Pixels`] | bytes | a value v becomes | alpha |
//! |---|---|---|---|
//! | `Rgba8` | R, G, B, A | ⌊255 v + ½⌋ | stored; colours are premultiplied by it |
//! | `Bgra8` | B, G, R, A | the same | the same |
//! | `Rgb565` | low and high byte of R · 2¹¹ + G · 2⁵ + B | ⌊31 v + ½⌋, green ⌊63 v + ½⌋ | none: what is there is opaque |
//! | `Rgb565Dithered` | the same | ⌊31 v + d⌋, green ⌊63 v + d⌋ | the same |
//! | `RgbaF32` | R, G, B, A, 4 each | v | stored; colours are premultiplied by it |
//!
//! Integer formats take v into [0, 1] first, NaN to 0. The float format keeps what is beyond; a NaN
//! becomes 0 and an infinity the greatest number of its sign. Over a colour, pixels that nothing
//! touches get that colour by the same rules.
//!
//! d = (2 M + 1) / 128 is the ordered dither of Bayer's 8 × 8 matrix M (0..=63) at the pixel's column
//! and row in the frame, modulo 8. The mean of 8 × 8 pixels of one colour is off by at most 1/128 of a
//! step, and colours that the format has (black and white among them) stay exact.

mod compose;
mod dither;
mod encoding;
mod float;
mod packed;

use core::ops::Range;

use compose::{Compose, Fill, Window};
use encoding::Encoding;
use float::RgbaF32;
use packed::{Bgra8, Dithered, Nearest, Rgb565, Rgba8};

use crate::error::{Buffer, Error};
use crate::kernel::Kernel;
use crate::raster::{TileDepths, TilePixels};

/// What a picture is composited over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// A colour, display-referred sRGB; the result is opaque.
    Color([f32; 3]),
    /// The pixels that are there, premultiplied by their alpha.
    Existing,
}

/// What a picture is drawn into; row 0 on top.
#[derive(Debug)]
pub struct Framebuffer<'p> {
    /// All rows.
    pub pixels: Pixels<'p>,
    /// From one row to the next: elements of the pixels' slice, that is bytes, for
    /// [`Pixels::RgbaF32`] numbers. At least a row's. What stands between rows stays.
    pub stride: usize,
    /// What the picture is composited over.
    pub background: Background,
    /// Where depths go, if they are wanted.
    pub depth: Option<Depth<'p>>,
}

/// Pixels in one of the formats that the [module](self) describes. Bytes may stand at any address.
#[derive(Debug)]
pub enum Pixels<'p> {
    /// Red, green, blue, alpha: a byte each.
    Rgba8(&'p mut [u8]),
    /// Blue, green, red, alpha: a byte each.
    Bgra8(&'p mut [u8]),
    /// Two bytes, the lower first: blue in the lowest 5 bits, then 6 of green and 5 of red.
    Rgb565(&'p mut [u8]),
    /// The same with an ordered dither in place of rounding to nearest.
    Rgb565Dithered(&'p mut [u8]),
    /// Red, green, blue, alpha: a number each.
    RgbaF32(&'p mut [f32]),
}

/// Depths beside pixels, whatever their format. A frame with depths takes
/// [`DEPTH_SCRATCH_LEN`](crate::draw::DEPTH_SCRATCH_LEN) words of scratch more.
#[derive(Debug)]
pub struct Depth<'p> {
    /// One number a pixel: the median depth, that is z in camera axes, metres, of the first splat
    /// behind which T is below ½; +∞ where there is none. Every pixel of the frame is written; the
    /// depth that is there is neither read nor tested: of several avatars in one picture, give each a
    /// plane of its own and keep the nearer depth.
    pub metres: &'p mut [f32],
    /// Numbers from one row to the next; at least the frame's width. What stands between rows stays.
    pub stride: usize,
}

/// Pixels of a tile in a band.
#[derive(Clone, Debug)]
pub(crate) struct Area {
    /// Columns of the frame.
    pub(crate) columns: Range<u32>,
    /// Rows of the frame.
    pub(crate) rows: Range<u32>,
    /// The frame's row that is the buffer's row 0.
    pub(crate) first_row: u32,
}

impl Framebuffer<'_> {
    /// Whether `rows` rows of a frame `width` pixels wide fit.
    pub(crate) fn check(&self, width: u32, rows: usize) -> Result<(), Error> {
        let (buffer, elements, lent) = match &self.pixels {
            Pixels::Rgba8(bytes) | Pixels::Bgra8(bytes) => (Buffer::Bytes, 4, bytes.len()),
            Pixels::Rgb565(bytes) | Pixels::Rgb565Dithered(bytes) => {
                (Buffer::Bytes, 2, bytes.len())
            }
            Pixels::RgbaF32(numbers) => (Buffer::Numbers, 4, numbers.len()),
        };
        let width = width as usize;
        check_rows(buffer, width.saturating_mul(elements), rows, self.stride, lent)?;
        self.depth.as_ref().map_or(Ok(()), |depth| {
            check_rows(Buffer::Depths, width, rows, depth.stride, depth.metres.len())
        })
    }

    /// Writes a tile that was drawn; `depths` are asked for only where they are wanted.
    pub(crate) fn write(
        &mut self,
        kernel: Kernel,
        area: &Area,
        source: &TilePixels,
        depths: Option<&TileDepths>,
    ) {
        self.compose(kernel, area, Some(source));
        if let (Some(depth), Some(depths)) = (&mut self.depth, depths) {
            let mut window = Window::new(depth.metres, depth.stride, 1, area);
            for (y, source) in depths.0.iter().enumerate().take(area.rows.len()) {
                let row = window.row(y).iter_mut();
                row.zip(source).for_each(|(depth, source)| *depth = *source);
            }
        }
    }

    /// Writes a tile that no Gaussian touches.
    pub(crate) fn clear(&mut self, kernel: Kernel, area: &Area) {
        self.compose(kernel, area, None);
        if let Some(depth) = &mut self.depth {
            let mut window = Window::new(depth.metres, depth.stride, 1, area);
            (0..area.rows.len()).for_each(|y| window.row(y).fill(f32::INFINITY));
        }
    }

    fn compose(&mut self, kernel: Kernel, area: &Area, source: Option<&TilePixels>) {
        let Self { pixels, stride, background, .. } = self;
        let tile = Tile { kernel, area, source, stride: *stride, background: *background };
        match pixels {
            Pixels::Rgba8(bytes) => tile.compose::<Rgba8>(bytes),
            Pixels::Bgra8(bytes) => tile.compose::<Bgra8>(bytes),
            Pixels::Rgb565(bytes) => tile.compose::<Rgb565<Nearest>>(bytes),
            Pixels::Rgb565Dithered(bytes) => tile.compose::<Rgb565<Dithered>>(bytes),
            Pixels::RgbaF32(numbers) => tile.compose::<RgbaF32>(numbers),
        }
    }
}

/// A tile on its way into a framebuffer; no source where nothing touches it.
struct Tile<'a> {
    kernel: Kernel,
    area: &'a Area,
    source: Option<&'a TilePixels>,
    stride: usize,
    background: Background,
}

impl Tile<'_> {
    fn compose<E: Encoding>(&self, elements: &mut [E::Element]) {
        let area = self.area;
        let window = Window::new(elements, self.stride, E::ELEMENTS, area);
        match (self.source, self.background) {
            (Some(source), background) => {
                self.kernel.run(Compose::<E> { window, area, source, background });
            }
            (None, Background::Color(color)) => self.kernel.run(Fill::<E> { window, area, color }),
            (None, Background::Existing) => {}
        }
    }
}

/// Whether `rows` rows of `row` elements fit into `lent`, their beginnings `stride` apart.
fn check_rows(
    buffer: Buffer,
    row: usize,
    rows: usize,
    stride: usize,
    lent: usize,
) -> Result<(), Error> {
    if rows == 0 {
        return Ok(());
    }
    if stride < row {
        return Err(Error::Stride { buffer, needed: row, given: stride });
    }
    let needed = stride.saturating_mul(rows - 1).saturating_add(row);
    if lent < needed { Err(Error::Buffer { buffer, needed, lent }) } else { Ok(()) }
}

/// What a colour becomes in 8 bits: nearest of 256 steps, halves up; below 0 and NaN become 0, above
/// 1 becomes 255.
#[inline]
pub fn to_byte(value: f32) -> u8 {
    (packed::in_unit(value) * 255.0 + 0.5) as i32 as u8
}
