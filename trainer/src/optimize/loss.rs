//! The difference that training lessens.

use crate::metrics::Rect;
use crate::metrics::ssim::SsimWorkspace;
use crate::picture::Picture;

/// Weights of the terms: `l1 · mean |Δ| + l2 · mean Δ² + dssim · (1 − SSIM)`, means over the frame and
/// its channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loss {
    /// Of the mean absolute difference.
    pub l1: f32,
    /// Of the mean squared difference.
    pub l2: f32,
    /// Of the structural dissimilarity.
    pub dssim: f32,
}

impl Loss {
    /// 3D Gaussian Splatting's and LoDAvatar's: 0.8 L1 + 0.2 D-SSIM.
    pub const PAPER: Self = Self { l1: 0.8, l2: 0.0, dssim: 0.2 };

    /// The loss, and its gradient by each pixel of `picture`. Both pictures must agree outside
    /// `region`; the gradient is 0 there.
    pub fn with_gradient(
        &self,
        picture: &Picture,
        truth: &Picture,
        region: Rect,
        ssim: &mut SsimWorkspace,
        gradient: &mut Vec<[f32; 3]>,
    ) -> f64 {
        gradient.clear();
        gradient.resize(picture.rgb.len(), [0.0; 3]);
        let scale = 1.0 / (3 * picture.rgb.len()) as f32;
        let mut sum = 0.0;
        let width = picture.width as usize;
        for y in region.y..region.y + region.height {
            let start = y as usize * width + region.x as usize;
            let row = start..start + region.width as usize;
            let pixels = picture.rgb[row.clone()].iter().zip(&truth.rgb[row.clone()]);
            for (to, (a, b)) in gradient[row].iter_mut().zip(pixels) {
                for i in 0..3 {
                    let difference = a[i] - b[i];
                    let sign = if difference == 0.0 { 0.0 } else { difference.signum() };
                    to[i] = scale * (self.l1 * sign + self.l2 * 2.0 * difference);
                    sum +=
                        f64::from(self.l1 * difference.abs() + self.l2 * difference * difference);
                }
            }
        }
        let mut loss = sum * f64::from(scale);
        if self.dssim > 0.0 {
            let (value, by_pixels) = ssim.ssim_with_gradient(picture, truth, region);
            loss += f64::from(self.dssim) * (1.0 - value);
            let rows = by_pixels.chunks_exact(region.width.max(1) as usize);
            for (y, row) in (region.y..region.y + region.height).zip(rows) {
                let start = y as usize * width + region.x as usize;
                for (to, from) in gradient[start..].iter_mut().zip(row) {
                    for i in 0..3 {
                        to[i] -= self.dssim * from[i];
                    }
                }
            }
        }
        loss
    }
}
