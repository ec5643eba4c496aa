//! The memory of a frame, in every format.

use crc32fast::Hasher;
use dermis_runtime::{Depth, Framebuffer, Pixels};

use crate::cases::Case;
use crate::how::Format;

/// Rows of a case's frame in one format.
#[derive(Debug)]
pub struct Frame<'m> {
    case: &'m Case,
    format: Format,
    pixels: &'m mut [u8],
    /// Empty but for [`Format::Depth`].
    depths: &'m mut [f32],
}

impl<'m> Frame<'m> {
    /// All rows, in the front of `words`, filled with what is there before: premultiplied pixels of
    /// every alpha, 0 and 1 among them. Padding keeps them, whatever is drawn. `None` if there are
    /// fewer words than [`Format::frame_len`].
    pub fn new(case: &'m Case, format: Format, words: &'m mut [u32]) -> Option<Self> {
        let rows = case.size[1] as usize;
        let bytes = format.stride(case) * rows;
        let words = words.get_mut(..format.frame_len(case))?;
        let (pixels, depths) = words.split_at_mut_checked(bytes.div_ceil(4))?;
        let pixels = bytemuck::try_cast_slice_mut(pixels).ok()?.get_mut(..bytes)?;
        let depths: &mut [f32] = bytemuck::try_cast_slice_mut(depths).ok()?;
        fill(format, pixels);
        depths.fill(-1.0);
        Some(Self { case, format, pixels, depths })
    }

    /// The same rows, to be cut.
    pub fn all(&mut self) -> Frame<'_> {
        Frame { case: self.case, format: self.format, pixels: self.pixels, depths: self.depths }
    }

    /// Cuts `rows` rows off the top.
    pub fn take_rows(&mut self, rows: usize) -> Self {
        let pixels = take(&mut self.pixels, rows * self.format.stride(self.case));
        let depths = take(&mut self.depths, rows * self.format.depth_stride(self.case));
        Self { case: self.case, format: self.format, pixels, depths }
    }

    /// As the runtime takes it.
    pub fn framebuffer(self) -> Framebuffer<'m> {
        let Self { case, format, pixels, depths } = self;
        let stride = format.stride(case);
        let (pixels, stride) = match format {
            Format::Rgba8 | Format::Depth => (Pixels::Rgba8(pixels), stride),
            Format::Bgra8 => (Pixels::Bgra8(pixels), stride),
            Format::Rgb565 => (Pixels::Rgb565(pixels), stride),
            Format::Rgb565Dithered => (Pixels::Rgb565Dithered(pixels), stride),
            // Rows are whole words, and the first begins at one.
            Format::RgbaF32 => {
                let numbers = bytemuck::try_cast_slice_mut(pixels).unwrap_or_default();
                (Pixels::RgbaF32(numbers), stride / 4)
            }
        };
        let depth = (format == Format::Depth)
            .then_some(Depth { metres: depths, stride: format.depth_stride(case) });
        Framebuffer { pixels, stride, background: case.background, depth }
    }

    /// Of all bytes, padding included.
    pub fn crc32(&self) -> u32 {
        let mut hasher = Hasher::new();
        hasher.update(self.pixels);
        hasher.update(bytemuck::try_cast_slice(self.depths).unwrap_or_default());
        hasher.finalize()
    }
}

fn take<'m, T>(from: &mut &'m mut [T], len: usize) -> &'m mut [T] {
    from.split_off_mut(..len).unwrap_or_default()
}

fn fill(format: Format, pixels: &mut [u8]) {
    match format {
        Format::Rgba8 | Format::Bgra8 | Format::Depth => {
            for (pixel, index) in pixels.as_chunks_mut::<4>().0.iter_mut().zip(0u32..) {
                *pixel = pattern(index);
            }
        }
        Format::Rgb565 | Format::Rgb565Dithered => {
            for (pixel, index) in pixels.as_chunks_mut::<2>().0.iter_mut().zip(0u32..) {
                let [r, g, ..] = pattern(index);
                *pixel = [r, g];
            }
        }
        Format::RgbaF32 => {
            for (pixel, index) in pixels.as_chunks_mut::<16>().0.iter_mut().zip(0u32..) {
                let channels = pixel.as_chunks_mut::<4>().0;
                for (channel, byte) in channels.iter_mut().zip(pattern(index)) {
                    *channel = (f32::from(byte) / 255.0).to_le_bytes();
                }
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
