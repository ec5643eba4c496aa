//! How a case is drawn.

pub use dermis_runtime::Kernel;
use dermis_runtime::draw::DEPTH_SCRATCH_LEN;

use crate::cases::Case;

/// How a case is drawn. All but the format must not show.
#[derive(Clone, Copy, Debug)]
pub struct How {
    /// Of the framebuffer: a column of the table.
    pub format: Format,
    /// At most so many bands of tile rows, and shares of the projection; at least 1. They may be drawn by
    /// as many threads.
    pub bands: u32,
    /// With which instructions.
    pub kernel: Kernel,
}

/// What a pixel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Red, green, blue, alpha, a byte each.
    Rgba8,
    /// Blue, green, red, alpha, a byte each.
    Bgra8,
    /// 5, 6 and 5 bits, rounded to nearest.
    Rgb565,
    /// The same with an ordered dither.
    Rgb565Dithered,
    /// Red, green, blue, alpha, a number each.
    RgbaF32,
    /// As `Rgba8`, and a plane of depths behind it.
    Depth,
}

impl Format {
    /// All of them, in the order of the table's columns.
    pub const ALL: &[Self] =
        &[Self::Rgba8, Self::Bgra8, Self::Rgb565, Self::Rgb565Dithered, Self::RgbaF32, Self::Depth];

    /// Its column of the table.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rgba8 => "rgba8",
            Self::Bgra8 => "bgra8",
            Self::Rgb565 => "rgb565",
            Self::Rgb565Dithered => "dithered",
            Self::RgbaF32 => "rgbaf32",
            Self::Depth => "depth",
        }
    }

    /// Bytes of a pixel.
    pub const fn pixel_len(self) -> usize {
        match self {
            Self::Rgba8 | Self::Bgra8 | Self::Depth => 4,
            Self::Rgb565 | Self::Rgb565Dithered => 2,
            Self::RgbaF32 => 16,
        }
    }

    /// Bytes from row to row of a case.
    pub const fn stride(self, case: &Case) -> usize {
        (case.size[0] + case.padding) as usize * self.pixel_len()
    }

    /// Depths from row to row of a case: 0 where there are none.
    pub const fn depth_stride(self, case: &Case) -> usize {
        match self {
            Self::Depth => (case.size[0] + case.padding) as usize,
            _ => 0,
        }
    }

    /// Words of a case's frame, padding included: pixels, then depths.
    pub const fn frame_len(self, case: &Case) -> usize {
        let rows = case.size[1] as usize;
        (self.stride(case) * rows).div_ceil(4) + self.depth_stride(case) * rows
    }

    /// Words of scratch that it takes beside what every format takes.
    pub const fn scratch_len(self) -> usize {
        match self {
            Self::Depth => DEPTH_SCRATCH_LEN,
            _ => 0,
        }
    }
}
