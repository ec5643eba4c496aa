//! The difference that training lessens.

use rayon::prelude::*;

use crate::metrics::Rect;
use crate::metrics::ssim::SsimWorkspace;
use crate::picture::Picture;
use crate::widest::widest;

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

/// How far a picture is from the truth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Compared {
    /// What is lessened.
    pub loss: f64,
    /// Mean squared difference over the region in which the pictures may differ.
    pub mse: f64,
}

impl Default for Loss {
    /// By trial: half way between what 3D Gaussian Splatting and LoDAvatar have (0.8 L1 + 0.2 D-SSIM) and squares, which
    /// PSNR measures.
    fn default() -> Self {
        Self { l1: 0.4, l2: 3.0, dssim: 0.1 }
    }
}

impl Loss {
    /// Compares, and gives the gradient of the loss by each pixel of `picture`. Both pictures must agree outside
    /// `region`; the gradient is 0 there.
    pub fn with_gradient(
        &self,
        picture: &Picture,
        truth: &Picture,
        region: Rect,
        ssim: &mut SsimWorkspace,
        gradient: &mut Vec<[f32; 3]>,
    ) -> Compared {
        gradient.clear();
        gradient.resize(picture.rgb.len(), [0.0; 3]);
        let scale = 1.0 / (3 * picture.rgb.len()) as f32;
        let width = picture.width as usize;
        let rows = gradient.par_chunks_mut(width).zip(picture.rgb.par_chunks(width));
        let rows = rows.zip(truth.rgb.par_chunks(width)).skip(region.y as usize);
        let columns = region.x as usize..(region.x + region.width) as usize;
        let sums: Vec<[f32; 2]> = rows
            .take(region.height as usize)
            .with_min_len(16)
            .map(|((gradient, picture), truth)| {
                let gradient = &mut gradient[columns.clone()];
                let (picture, truth) = (&picture[columns.clone()], &truth[columns.clone()]);
                widest(
                    #[inline(always)]
                    || self.row(picture, truth, scale, gradient),
                )
            })
            .collect();
        let total = |i: usize| sums.iter().map(|row| f64::from(row[i])).sum::<f64>();
        let mut loss = total(0) * f64::from(scale);
        let mse = total(1) / (3 * region.pixels()).max(1) as f64;
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
        Compared { loss, mse }
    }

    /// Differences of a row: their gradient, what they add to the loss, and their squares.
    #[inline(always)]
    fn row(
        &self,
        picture: &[[f32; 3]],
        truth: &[[f32; 3]],
        scale: f32,
        gradient: &mut [[f32; 3]],
    ) -> [f32; 2] {
        let pixels = picture.as_flattened().iter().zip(truth.as_flattened());
        // Sums side by side, so that they need not wait for each other.
        let (mut sums, mut squares) = ([0.0f32; 16], [0.0f32; 16]);
        for (i, (to, (a, b))) in gradient.as_flattened_mut().iter_mut().zip(pixels).enumerate() {
            let difference = a - b;
            let sign = if difference == 0.0 { 0.0 } else { difference.signum() };
            *to = scale * (self.l1 * sign + self.l2 * 2.0 * difference);
            let square = difference * difference;
            sums[i % 16] += self.l1 * difference.abs() + self.l2 * square;
            squares[i % 16] += square;
        }
        [sums.into_iter().sum(), squares.into_iter().sum()]
    }
}
