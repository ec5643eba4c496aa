//! Structural similarity and its gradient.
//!
//! Wang et al. 2004, with an 11×11 Gaussian window of σ = 1.5 pixels, K1 = 0.01, K2 = 0.03 and a
//! range of 1, the mean over pixels and channels. Boundary rule: pictures are zero outside the
//! frame and the window keeps its full weight there, as in the 3D Gaussian Splatting code base.
//!
//! Equal pixels far from any difference have a similarity of exactly 1 and no gradient. So where
//! pictures differ only inside a rectangle (an avatar before a plain background), only that
//! rectangle and a margin are worked on, and the result is that of the whole frame.

use rayon::prelude::*;

use super::Rect;
use crate::picture::Picture;
use crate::widest::widest;

/// Radius of the window in pixels: 11 = 2·5 + 1.
const RADIUS: usize = 5;
/// Columns and rows of the window.
const TAPS: usize = 2 * RADIUS + 1;
/// exp(−d² / (2·1.5²)) of d = 0..5, divided by the sum over −5..5.
const WINDOW: [f32; RADIUS + 1] =
    [0.266_011_74, 0.213_005_53, 0.109_360_69, 0.036_000_773, 0.007_598_758, 0.001_028_380_1];
/// (K1 · range)².
const C1: f32 = 0.01 * 0.01;
/// (K2 · range)².
const C2: f32 = 0.03 * 0.03;
/// Rows that one task works on. Any number gives the same bits: rows do not mix within a stage.
const BAND: usize = 8;

/// Buffers that [`SsimWorkspace::ssim_with_gradient`] uses again at each call.
///
/// A row holds the three channels one after the other, each followed by 5 zeros, and
/// starts with as many: one pass over a row filters all three, and the zeros keep them apart.
#[derive(Clone, Debug, Default)]
pub struct SsimWorkspace {
    /// Mean of a, mean of b, a² + b², a·b, filtered along rows.
    moments: [Vec<f32>; 4],
    /// ∂S by the mean of a, by a² + b², by a·b, filtered along rows.
    slopes: [Vec<f32>; 3],
    /// Sum of the similarities of each row.
    sums: Vec<f64>,
    /// A row of zeros: what lies above and below the frame.
    zeros: Vec<f32>,
    gradient: Vec<[f32; 3]>,
}

/// Structural similarity of two pictures of one size: the mean over pixels and channels, 1 where
/// they are equal.
///
/// # Panics
///
/// Where the sizes differ.
pub fn ssim(a: &Picture, b: &Picture) -> f64 {
    SsimWorkspace::default().ssim_with_gradient(a, b, Rect::frame(a.width, a.height)).0
}

/// [`ssim`] of 8-bit pictures: (r, g, b) of each pixel, row-major.
///
/// # Panics
///
/// Where `a` or `b` does not hold 3 · `width` · `height` values.
pub fn ssim_u8(a: &[u8], b: &[u8], width: u32, height: u32) -> f64 {
    let picture = |bytes: &[u8]| {
        let rgb = bytes.chunks_exact(3).map(|p| [p[0], p[1], p[2]].map(|v| f32::from(v) / 255.0));
        Picture { width, height, rgb: rgb.collect() }
    };
    ssim(&picture(a), &picture(b))
}

impl SsimWorkspace {
    /// Mean structural similarity over the whole frame, and its gradient by the values of `a`
    /// inside `region`, row-major (`region.width · region.height` pixels).
    ///
    /// The pictures must be equal outside `region`: what differs there is partly missed. Both
    /// the mean and its gradient are those of the frame, divided by 3 · width · height; multiply
    /// the gradient by the ratio of areas for a mean over the rectangle. A frame or region
    /// without pixels has similarity 1.
    ///
    /// The result has the same bits for any number of threads.
    ///
    /// # Panics
    ///
    /// Where the sizes of the pictures differ or `region` leaves the frame.
    pub fn ssim_with_gradient(
        &mut self,
        a: &Picture,
        b: &Picture,
        region: Rect,
    ) -> (f64, &[[f32; 3]]) {
        let (width, height) = (a.width, a.height);
        assert_eq!((width, height), (b.width, b.height), "two pictures of one size");
        assert_eq!(region, region.dilated(0, width, height), "a region inside the frame");
        self.gradient.clear();
        self.gradient.resize(region.pixels(), [0.0; 3]);
        if region.pixels() == 0 {
            return (1.0, &self.gradient);
        }
        // Similarities within RADIUS of the region feel it, and see RADIUS further. Beyond, the
        // pictures are equal, where a wrong neighbourhood still gives 1 and no gradient.
        let area = region.dilated(2 * RADIUS as u32, width, height);
        let values = 3 * width as usize * height as usize;
        let layout = Layout::new(area, width as usize);
        self.prepare(&layout);
        self.filter_moments(a, b, &layout);
        self.similarities(&layout);
        self.gather(a, b, region, &layout, 1.0 / values as f64);
        let missing: f64 = self.sums.iter().map(|sum| (3 * layout.columns) as f64 - sum).sum();
        (1.0 - missing / values as f64, &self.gradient)
    }

    /// Sizes the buffers. Their contents need no clearing: each stage writes all it reads later.
    fn prepare(&mut self, layout: &Layout) {
        for plane in self.moments.iter_mut().chain(&mut self.slopes) {
            plane.resize(layout.stride * layout.rows, 0.0);
        }
        self.sums.resize(layout.rows, 0.0);
        self.zeros.resize(layout.stride, 0.0);
    }

    /// Stage 1: the four moments, filtered along rows.
    fn filter_moments(&mut self, a: &Picture, b: &Picture, layout: &Layout) {
        let band = layout.stride * BAND;
        let [p0, p1, p2, p3] = &mut self.moments;
        let planes = (p0.par_chunks_mut(band), p1.par_chunks_mut(band))
            .into_par_iter()
            .zip((p2.par_chunks_mut(band), p3.par_chunks_mut(band)).into_par_iter());
        planes.enumerate().for_each(|(index, ((m0, m1), (m2, m3)))| {
            widest(
                #[inline(always)]
                || {
                    let mut inputs: [Vec<f32>; 4] = std::array::from_fn(|_| layout.padded());
                    for row in 0..m0.len() / layout.stride {
                        layout.load(a, index * BAND + row, &mut inputs[0]);
                        layout.load(b, index * BAND + row, &mut inputs[1]);
                        let [a, b, squares, product] = &mut inputs;
                        for (((&a, &b), s), p) in a.iter().zip(&*b).zip(squares).zip(product) {
                            *s = a * a + b * b;
                            *p = a * b;
                        }
                        let range = row * layout.stride..(row + 1) * layout.stride;
                        for (input, plane) in
                            inputs.iter().zip([&mut *m0, &mut *m1, &mut *m2, &mut *m3])
                        {
                            filter(
                                &mut plane[range.clone()],
                                std::array::from_fn(|tap| &input[tap..]),
                            );
                        }
                    }
                },
            );
        });
    }

    /// Stage 2: moments filtered along columns, similarities, and their slopes filtered along rows.
    fn similarities(&mut self, layout: &Layout) {
        let band = layout.stride * BAND;
        let (moments, zeros) = (&self.moments, &self.zeros);
        let [p0, p1, p2] = &mut self.slopes;
        let planes = (p0.par_chunks_mut(band), p1.par_chunks_mut(band), p2.par_chunks_mut(band));
        let sums = self.sums.par_chunks_mut(BAND);
        planes.into_par_iter().zip(sums).enumerate().for_each(|(index, ((s0, s1, s2), sums))| {
            widest(
                #[inline(always)]
                || {
                    let mut rows: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; layout.stride]);
                    let mut slopes: [Vec<f32>; 3] = std::array::from_fn(|_| layout.padded());
                    let mut values = vec![0.0; layout.columns];
                    for (row, sum) in sums.iter_mut().enumerate() {
                        for (moment, plane) in rows.iter_mut().zip(moments) {
                            filter(moment, layout.window(plane, zeros, index * BAND + row));
                        }
                        *sum = 0.0;
                        for channel in 0..3 {
                            let inner = layout.channel(channel);
                            let inputs = rows.each_ref().map(|row| &row[inner.clone()]);
                            let outputs =
                                slopes.each_mut().map(|row| &mut row[RADIUS..][inner.clone()]);
                            similarity_row(inputs, &mut values, outputs);
                            *sum += values.iter().map(|&value| f64::from(value)).sum::<f64>();
                        }
                        let range = row * layout.stride..(row + 1) * layout.stride;
                        for (slope, plane) in slopes.iter().zip([&mut *s0, &mut *s1, &mut *s2]) {
                            filter(
                                &mut plane[range.clone()],
                                std::array::from_fn(|tap| &slope[tap..]),
                            );
                        }
                    }
                },
            );
        });
    }

    /// Stage 3: slopes filtered along columns, chained to the values of `a`.
    fn gather(&mut self, a: &Picture, b: &Picture, region: Rect, layout: &Layout, scale: f64) {
        let (slopes, zeros, scale) = (&self.slopes, &self.zeros, scale as f32);
        let width = region.width as usize;
        let top = (region.y - layout.area.y) as usize;
        let left = (region.x - layout.area.x) as usize;
        self.gradient.par_chunks_mut(width * BAND).enumerate().for_each(|(index, band)| {
            widest(
                #[inline(always)]
                || {
                    let mut rows: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; layout.stride]);
                    for (row, gradient) in band.chunks_exact_mut(width).enumerate() {
                        let row = index * BAND + row;
                        for (slope, plane) in rows.iter_mut().zip(slopes) {
                            filter(slope, layout.window(plane, zeros, top + row));
                        }
                        let start =
                            (region.y as usize + row) * layout.frame_width + region.x as usize;
                        let pixels =
                            a.rgb[start..start + width].iter().zip(&b.rgb[start..start + width]);
                        for channel in 0..3 {
                            let [mean, squares, product] = rows
                                .each_ref()
                                .map(|row| &row[layout.channel(channel)][left..][..width]);
                            for (x, (gradient, (a, b))) in
                                gradient.iter_mut().zip(pixels.clone()).enumerate()
                            {
                                let chained = mean[x]
                                    + 2.0 * a[channel] * squares[x]
                                    + b[channel] * product[x];
                                gradient[channel] = scale * chained;
                            }
                        }
                    }
                },
            );
        });
    }
}

/// Where things lie in the rows of a [`SsimWorkspace`].
struct Layout {
    area: Rect,
    frame_width: usize,
    columns: usize,
    rows: usize,
    /// Values in a filtered row: three channels with their gaps.
    stride: usize,
}

impl Layout {
    fn new(area: Rect, frame_width: usize) -> Self {
        let columns = area.width as usize;
        let stride = 3 * (columns + RADIUS);
        Self { area, frame_width, columns, rows: area.height as usize, stride }
    }

    /// Values of a channel in a filtered row.
    fn channel(&self, channel: usize) -> std::ops::Range<usize> {
        let start = channel * (self.columns + RADIUS);
        start..start + self.columns
    }

    /// A row of zeros that can be filtered: RADIUS more values on each side.
    fn padded(&self) -> Vec<f32> {
        vec![0.0; self.stride + 2 * RADIUS]
    }

    /// Writes a row of the area into a padded row.
    #[inline(always)]
    fn load(&self, picture: &Picture, row: usize, padded: &mut [f32]) {
        let start = (self.area.y as usize + row) * self.frame_width + self.area.x as usize;
        let pixels = &picture.rgb[start..start + self.columns];
        for channel in 0..3 {
            let values = &mut padded[RADIUS..][self.channel(channel)];
            for (value, pixel) in values.iter_mut().zip(pixels) {
                *value = pixel[channel];
            }
        }
    }

    /// The rows under the window around `row`.
    #[inline(always)]
    fn window<'a>(&self, plane: &'a [f32], zeros: &'a [f32], row: usize) -> [&'a [f32]; TAPS] {
        std::array::from_fn(|tap| match (row + tap).checked_sub(RADIUS) {
            Some(row) if row < self.rows => &plane[row * self.stride..(row + 1) * self.stride],
            _ => zeros,
        })
    }
}

/// out[i] = Σ window[tap] · taps[tap][i].
#[inline(always)]
fn filter(out: &mut [f32], taps: [&[f32]; TAPS]) {
    let length = out.len();
    // Slices of one known length let the compiler drop the bounds checks and vectorise.
    let taps = taps.map(|tap| &tap[..length]);
    for (i, out) in out.iter_mut().enumerate() {
        *out = WINDOW[0] * taps[5][i]
            + WINDOW[1] * (taps[4][i] + taps[6][i])
            + WINDOW[2] * (taps[3][i] + taps[7][i])
            + WINDOW[3] * (taps[2][i] + taps[8][i])
            + WINDOW[4] * (taps[1][i] + taps[9][i])
            + WINDOW[5] * (taps[0][i] + taps[10][i]);
    }
}

/// Similarities of a row from its filtered moments (mean of a, mean of b, a² + b², a·b), and
/// their derivatives by the first, third and fourth moment.
///
/// S = A1·A2 / (B1·B2) with A1 = 2·μa·μb + C1, A2 = 2·σab + C2, B1 = μa² + μb² + C1 and
/// B2 = σa² + σb² + C2, where σab = m(ab) − μa·μb and σa² + σb² = m(a² + b²) − μa² − μb².
#[inline(always)]
fn similarity_row(moments: [&[f32]; 4], values: &mut [f32], slopes: [&mut [f32]; 3]) {
    let length = values.len();
    let [mean_a, mean_b, squares, product] = moments.map(|row| &row[..length]);
    let [by_mean, by_squares, by_product] = slopes.map(|row| &mut row[..length]);
    for (i, value) in values.iter_mut().enumerate() {
        let (ma, mb) = (mean_a[i], mean_b[i]);
        let (cross, power) = (ma * mb, ma * ma + mb * mb);
        let a1 = 2.0 * cross + C1;
        let a2 = 2.0 * (product[i] - cross) + C2;
        let b1 = power + C1;
        let b2 = squares[i] - power + C2;
        // A division, so that equal pictures give exactly 1.
        let similarity = (a1 * a2) / (b1 * b2);
        let inverse = 1.0 / (b1 * b2);
        *value = similarity;
        by_mean[i] = 2.0 * inverse * (mb * (a2 - a1) + similarity * ma * (b1 - b2));
        by_squares[i] = -similarity * inverse * b1;
        by_product[i] = 2.0 * a1 * inverse;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::noise;

    fn random_picture(width: u32, height: u32, seed: u32) -> Picture {
        let mut picture = Picture::filled(width, height, [0.0; 3]);
        for (index, value) in picture.rgb.iter_mut().flatten().enumerate() {
            *value = noise::unit(seed + index as u32);
        }
        picture
    }

    /// The definition in f64, with a full two-dimensional window at each pixel.
    fn reference(a: &[[f64; 3]], b: &[[f64; 3]], width: i32, height: i32) -> f64 {
        let weight = |d: i32| (-f64::from(d * d) / 4.5).exp();
        let total: f64 = (-5..=5).map(weight).sum();
        let mut sum = 0.0;
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            for channel in 0..3 {
                let [mut ma, mut mb, mut aa, mut bb, mut ab] = [0.0; 5];
                for (dy, dx) in (-5..=5).flat_map(|dy| (-5..=5).map(move |dx| (dy, dx))) {
                    let (y, x) = (y + dy, x + dx);
                    if (0..height).contains(&y) && (0..width).contains(&x) {
                        let w = weight(dx) * weight(dy) / (total * total);
                        let at = (y * width + x) as usize;
                        let (a, b) = (a[at][channel], b[at][channel]);
                        ma += w * a;
                        mb += w * b;
                        aa += w * a * a;
                        bb += w * b * b;
                        ab += w * a * b;
                    }
                }
                let numerator = (2.0 * ma * mb + 1e-4) * (2.0 * (ab - ma * mb) + 9e-4);
                let (va, vb) = (aa - ma * ma, bb - mb * mb);
                sum += numerator / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
            }
        }
        sum / f64::from(3 * width * height)
    }

    fn widen(picture: &Picture) -> Vec<[f64; 3]> {
        picture.rgb.iter().map(|pixel| pixel.map(f64::from)).collect()
    }

    #[test]
    fn equals_the_definition_and_its_central_differences() {
        let (width, height) = (17, 14);
        let a = random_picture(width, height, 1);
        let b = random_picture(width, height, 10_000);
        let (wide_a, wide_b) = (widen(&a), widen(&b));
        let expected = reference(&wide_a, &wide_b, width as i32, height as i32);
        let mut workspace = SsimWorkspace::default();
        let frame = Rect::frame(width, height);
        let (value, gradient) = workspace.ssim_with_gradient(&a, &b, frame);
        assert!((value - expected).abs() < 1e-6, "{value} {expected}");
        for at in (0..wide_a.len()).step_by(5) {
            for channel in 0..3 {
                let shifted = |step: f64| {
                    let mut moved = wide_a.clone();
                    moved[at][channel] += step;
                    reference(&moved, &wide_b, width as i32, height as i32)
                };
                let slope = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
                let error = (f64::from(gradient[at][channel]) - slope).abs();
                assert!(error < 1e-8 + 1e-4 * slope.abs(), "{slope} {}", gradient[at][channel]);
            }
        }
    }

    #[test]
    fn a_region_gives_the_result_of_the_frame() {
        let (width, height) = (48, 40);
        let a = random_picture(width, height, 1);
        let region = Rect { x: 15, y: 0, width: 9, height: 21 };
        let mut b = a.clone();
        for row in region.y..region.y + region.height {
            for column in region.x..region.x + region.width {
                let at = row * width + column;
                b.rgb[at as usize] = [0, 1, 2].map(|c| noise::unit(77_777 + 3 * at + c));
            }
        }
        let (mut all, mut part) = (SsimWorkspace::default(), SsimWorkspace::default());
        let (whole, by_all) = all.ssim_with_gradient(&a, &b, Rect::frame(width, height));
        let (value, by_part) = part.ssim_with_gradient(&a, &b, region);
        assert!(whole < 0.95);
        assert!((whole - value).abs() < 1e-6, "{whole} {value}");
        for (index, part) in by_part.iter().enumerate() {
            let row = region.y as usize + index / region.width as usize;
            let column = region.x as usize + index % region.width as usize;
            let all = by_all[row * width as usize + column];
            assert!(all.iter().zip(part).all(|(a, b)| (a - b).abs() < 1e-8), "{all:?} {part:?}");
        }
    }

    #[test]
    fn equal_pictures_are_at_the_top() {
        let a = random_picture(30, 20, 5);
        let mut workspace = SsimWorkspace::default();
        let (value, gradient) = workspace.ssim_with_gradient(&a, &a, Rect::frame(30, 20));
        assert_eq!(value, 1.0);
        assert!(gradient.iter().flatten().all(|&slope| slope == 0.0));
        assert_eq!(ssim_u8(&[], &[], 0, 0), 1.0);
        assert_eq!(ssim_u8(&[9, 8, 7], &[9, 8, 7], 1, 1), 1.0);
    }

    #[test]
    fn the_same_bits_for_any_number_of_threads() {
        let a = random_picture(90, 70, 5);
        let b = random_picture(90, 70, 500_000);
        let with_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut workspace = SsimWorkspace::default();
                let region = Rect { x: 7, y: 9, width: 61, height: 50 };
                let (value, gradient) = workspace.ssim_with_gradient(&a, &b, region);
                (value.to_bits(), gradient.to_vec())
            })
        };
        assert_eq!(with_threads(1), with_threads(3));
    }
}
