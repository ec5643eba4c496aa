//! How a case is drawn.

pub use dermis_runtime::Kernel;
use dermis_runtime::{Framebuffer, Pixels};

use crate::cases::Case;

/// How a case is drawn. All but the format must not show.
#[derive(Clone, Copy, Debug)]
pub struct How {
    /// Of the framebuffer: a column of the table.
    pub format: Format,
    /// In how many bands of tile rows; at least 1. They may be drawn by as many threads.
    pub bands: u32,
    /// With which instructions.
    pub kernel: Kernel,
}

/// What a pixel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Red, green, blue, alpha, a byte each.
    Rgba8,
}

impl Format {
    /// All of them, in the order of the table's columns.
    pub const ALL: &[Self] = &[Self::Rgba8];

    /// Its column of the table.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rgba8 => "rgba8",
        }
    }

    /// Bytes of a pixel.
    pub const fn pixel_len(self) -> usize {
        match self {
            Self::Rgba8 => 4,
        }
    }

    /// Bytes from row to row of a case.
    pub const fn stride(self, case: &Case) -> usize {
        (case.size[0] + case.padding) as usize * self.pixel_len()
    }

    /// Bytes of a case's frame, padding included.
    pub const fn frame_len(self, case: &Case) -> usize {
        self.stride(case) * case.size[1] as usize
    }

    /// What is there before anything is drawn: premultiplied pixels of every alpha, 0 and 1 among them.
    /// Padding keeps them, whatever is drawn.
    pub fn fill(self, pixels: &mut [u8]) {
        match self {
            Self::Rgba8 => {
                for (pixel, index) in pixels.as_chunks_mut::<4>().0.iter_mut().zip(0u32..) {
                    *pixel = pattern(index);
                }
            }
        }
    }

    /// The framebuffer of a case, or of a band of it.
    pub fn framebuffer<'p>(self, case: &Case, pixels: &'p mut [u8]) -> Framebuffer<'p> {
        match self {
            Self::Rgba8 => {
                let stride = self.stride(case);
                let (pixels, background) = (Pixels::Rgba8(pixels), case.background);
                Framebuffer { pixels, stride, background, depth: None }
            }
        }
    }
}

/// Pixel `index` of what is there before: no channel exceeds alpha.
fn pattern(index: u32) -> [u8; 4] {
    let [a, r, g, b] = index.wrapping_mul(2_654_435_761).to_be_bytes();
    let premultiplied = |channel: u8| (u16::from(channel) * u16::from(a) / 255) as u8;
    [premultiplied(r), premultiplied(g), premultiplied(b), a]
}
