//! How far a picture is from the ground truth: PSNR, SSIM and FLIP.
//!
//! PSNR and FLIP compare 8-bit pictures, because that is what a framebuffer shows. SSIM compares
//! float pictures and has a gradient, because training descends on it; [`ssim::ssim_u8`] is the
//! same measure of 8-bit pictures.

pub mod flip;
pub mod psnr;
pub mod ssim;

/// A rectangle of pixels; (0, 0) is the upper left pixel of the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// Leftmost column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Rect {
    /// The whole of a frame.
    pub const fn frame(width: u32, height: u32) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// Grown by `margin` pixels on each side, then cut at the edges of a frame.
    pub fn dilated(self, margin: u32, width: u32, height: u32) -> Self {
        let x = self.x.saturating_sub(margin).min(width);
        let y = self.y.saturating_sub(margin).min(height);
        let right = self.x.saturating_add(self.width).saturating_add(margin).min(width);
        let bottom = self.y.saturating_add(self.height).saturating_add(margin).min(height);
        Self { x, y, width: right.saturating_sub(x), height: bottom.saturating_sub(y) }
    }

    /// Number of pixels.
    pub const fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// Deterministic noise pictures for the tests of the metrics.
#[cfg(test)]
mod noise {
    /// A hash of `seed` in [0, 1).
    pub(crate) fn unit(seed: u32) -> f32 {
        let mut bits = seed.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
        bits = (bits ^ (bits >> 16)).wrapping_mul(0x7feb_352d);
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x846c_a68b);
        ((bits ^ (bits >> 16)) >> 8) as f32 / (1 << 24) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::Rect;

    #[test]
    fn dilation_stays_in_the_frame() {
        let rect = Rect { x: 3, y: 8, width: 4, height: 2 };
        assert_eq!(rect.dilated(5, 20, 10), Rect { x: 0, y: 3, width: 12, height: 7 });
        assert_eq!(rect.dilated(0, 5, 4).pixels(), 0);
    }
}
