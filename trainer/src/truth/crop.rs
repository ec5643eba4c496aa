//! A picture cropped to what differs from the background, in a few bytes a pixel.

use std::ops::Range;

use dermis_runtime::framebuffer::to_byte;

use super::runs::{Run, Runs, encode};
use super::scale::{MAX_SHIFT, scaled_length, scaled_rect};
use crate::metrics::Rect;
use crate::picture::Picture;
use crate::scene::mesh_render::Truth;

/// The part of a picture that a mesh covers, 8 bits a channel.
#[derive(Clone, Debug)]
pub struct Crop {
    pub(super) outline: Outline,
    /// Rows of the rectangle, as `runs` writes them.
    pub(super) bytes: Vec<u8>,
}

/// All of a crop but its pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outline {
    /// Of the whole picture, px.
    width: u32,
    height: u32,
    /// Where the part stands.
    pub(super) rect: Rect,
    /// What colours lie over, sRGB.
    background: [f32; 3],
}

/// What reading needs and can use again; each thread has its own.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    /// Of a picture that lies in the file.
    pub(super) bytes: Vec<u8>,
    /// Sums of r, g, b and 255 − coverage over a row of coarse pixels.
    pub(super) sums: Vec<[u32; 4]>,
}

impl Crop {
    /// Of a truth that was rendered over `background`, sRGB.
    pub fn of(truth: &Truth, background: [f32; 3]) -> Self {
        let (width, height) = (truth.picture.width, truth.picture.height);
        let rect = covered(&truth.coverage, width);
        let outline = Outline { width, height, rect, background };
        let (mut bytes, mut row) = (Vec::new(), Vec::new());
        for y in rect.y..rect.y + rect.height {
            let start = y as usize * width as usize + rect.x as usize;
            let places = start..start + rect.width as usize;
            row.clear();
            row.extend(places.map(|at| {
                let [r, g, b] = truth.picture.rgb[at].map(to_byte);
                [r, g, b, to_byte(truth.coverage[at])]
            }));
            encode(&row, outline.empty(), &mut bytes);
        }
        Self { outline, bytes }
    }

    /// Where the covered part stands.
    pub fn rect(&self) -> Rect {
        self.outline.rect
    }

    /// The whole picture over `background` (sRGB), which may be another one than it was rendered over.
    pub fn picture(&self, background: [f32; 3]) -> Picture {
        self.picture_at(background, 0)
    }

    /// The picture over `background` (sRGB) with its sides divided by 2^`shift`, rounded up: each
    /// pixel is the average of the stored sRGB values of those it covers.
    ///
    /// # Panics
    /// If `shift` is over [`MAX_SHIFT`].
    pub fn picture_at(&self, background: [f32; 3], shift: u32) -> Picture {
        let mut picture = Picture::default();
        self.outline.draw(&self.bytes, background, shift, &mut Vec::new(), &mut picture);
        picture
    }
}

impl Outline {
    /// A stored pixel that shows the background alone.
    fn empty(&self) -> [u8; 4] {
        let [r, g, b] = self.background.map(to_byte);
        [r, g, b, 0]
    }

    /// Makes `picture` the crop of `bytes` over `background`, as [`Crop::picture_at`] says.
    pub(super) fn draw(
        &self,
        bytes: &[u8],
        background: [f32; 3],
        shift: u32,
        sums: &mut Vec<[u32; 4]>,
        picture: &mut Picture,
    ) {
        assert!(shift <= MAX_SHIFT, "pictures are divided by 2^{MAX_SHIFT} at most");
        picture.width = scaled_length(self.width, shift);
        picture.height = scaled_length(self.height, shift);
        // What is left of another picture is overwritten.
        picture.rgb.resize(picture.width as usize * picture.height as usize, background);
        if shift == 0 {
            self.draw_whole(bytes, background, picture);
        } else {
            self.draw_coarse(bytes, background, shift, sums, picture);
        }
    }

    fn draw_whole(&self, bytes: &[u8], background: [f32; 3], picture: &mut Picture) {
        let over = Over::new(self, background);
        let Rect { x, y, width, height } = self.rect;
        let mut runs = Runs(bytes);
        for (row, to) in picture.rgb.chunks_exact_mut(self.width.max(1) as usize).enumerate() {
            if !(y..y + height).contains(&(row as u32)) {
                to.fill(background);
                continue;
            }
            let (left, to) = to.split_at_mut(x as usize);
            let (mut to, right) = to.split_at_mut(width as usize);
            left.fill(background);
            right.fill(background);
            while !to.is_empty()
                && let Some(run) = runs.next()
            {
                let (now, later) = to.split_at_mut(run.len().min(to.len()));
                over.draw(run, now);
                to = later;
            }
        }
    }

    fn draw_coarse(
        &self,
        bytes: &[u8],
        background: [f32; 3],
        shift: u32,
        sums: &mut Vec<[u32; 4]>,
        picture: &mut Picture,
    ) {
        picture.rgb.fill(background);
        let change = self.change(background);
        let Rect { x, y, width, height } = self.rect;
        let coarse = scaled_rect(self.rect, shift);
        let mut runs = Runs(bytes);
        for row in coarse.y..coarse.y + coarse.height {
            let (rows, rows_inside) = covering(row, shift, self.height, y..y + height);
            sums.clear();
            sums.resize(coarse.width as usize, [0; 4]);
            for _ in 0..rows_inside {
                self.add_row(&mut runs, shift, sums);
            }
            let start = row as usize * picture.width as usize + coarse.x as usize;
            for ((column, sum), to) in (coarse.x..).zip(&*sums).zip(&mut picture.rgb[start..]) {
                let (columns, columns_inside) = covering(column, shift, self.width, x..x + width);
                let count = (columns * rows) as f32;
                let outside = (columns * rows - columns_inside * rows_inside) as f32;
                let seen_through = sum[3] as f32 / 255.0;
                *to = std::array::from_fn(|i| {
                    let inside = sum[i] as f32 / 255.0 + seen_through * change[i];
                    (inside + outside * background[i]) / count
                });
            }
        }
    }

    /// Adds a row of the rectangle to the sums of the coarse pixels that it passes.
    fn add_row(&self, runs: &mut Runs<'_>, shift: u32, sums: &mut [[u32; 4]]) {
        // Counted from the left edge of the first coarse pixel.
        let mut at = (self.rect.x & ((1 << shift) - 1)) as usize;
        let end = at + self.rect.width as usize;
        while at < end
            && let Some(run) = runs.next()
        {
            match run {
                Run::Empty(len) => add(sums, shift, at, std::iter::repeat_n(self.empty(), len)),
                Run::Full(pixels) => {
                    add(sums, shift, at, pixels.iter().map(|&[r, g, b]| [r, g, b, 255]));
                }
                Run::Mixed(pixels) => add(sums, shift, at, pixels.iter().copied()),
            }
            at += run.len();
        }
    }

    /// From the background that colours lie over to another.
    fn change(&self, background: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|i| background[i] - self.background[i])
    }
}

/// How stored pixels look over another background.
struct Over {
    /// From the background that colours lie over to the other.
    change: [f32; 3],
    /// What a pixel of the background alone becomes.
    empty: [f32; 3],
}

impl Over {
    fn new(outline: &Outline, background: [f32; 3]) -> Self {
        let mut over = Self { change: outline.change(background), empty: [0.0; 3] };
        over.empty = over.mixed(outline.empty());
        over
    }

    fn draw(&self, run: Run<'_>, to: &mut [[f32; 3]]) {
        match run {
            Run::Empty(_) => to.fill(self.empty),
            Run::Full(from) => {
                let values = to.as_flattened_mut().iter_mut().zip(from.as_flattened());
                values.for_each(|(to, &byte)| *to = unit(byte));
            }
            Run::Mixed(from) => {
                to.iter_mut().zip(from).for_each(|(to, &pixel)| *to = self.mixed(pixel));
            }
        }
    }

    fn mixed(&self, [r, g, b, coverage]: [u8; 4]) -> [f32; 3] {
        let (color, seen_through) = ([r, g, b].map(unit), unit(255 - coverage));
        std::array::from_fn(|i| color[i] + seen_through * self.change[i])
    }
}

/// `byte / 255` to the last bit, without a division: `byte × UPPER` is exact, because UPPER has 16 bits
/// and a byte 8, so the sum is rounded once.
fn unit(byte: u8) -> f32 {
    /// The upper 16 bits of 1/255.
    const UPPER: f32 = f32::from_bits(0x3b80_8000);
    const LOWER: f32 = (1.0 / 255.0 - UPPER as f64) as f32;
    let byte = f32::from(byte);
    byte * UPPER + byte * LOWER
}

/// Adds pixels from column `at` to the sums of r, g, b and 255 − coverage of the coarse pixels that
/// cover them.
fn add(sums: &mut [[u32; 4]], shift: u32, at: usize, pixels: impl Iterator<Item = [u8; 4]>) {
    for (at, [r, g, b, coverage]) in (at..).zip(pixels) {
        if let Some(sum) = sums.get_mut(at >> shift) {
            let values = [r, g, b, 255 - coverage].map(u32::from);
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
    }
}

/// Of the fine columns (or rows) that a coarse one covers: how many are in a picture of `length`, and
/// how many in `part` of it.
fn covering(coarse: u32, shift: u32, length: u32, part: Range<u32>) -> (u32, u32) {
    let (from, to) = (coarse << shift, ((coarse + 1) << shift).min(length));
    (to - from, part.end.min(to).saturating_sub(part.start.max(from)))
}

/// The least rectangle around all pixels of any coverage.
fn covered(coverage: &[f32], width: u32) -> Rect {
    let mut corners: Option<[u32; 4]> = None;
    for (index, _) in coverage.iter().enumerate().filter(|(_, c)| **c > 0.0) {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let [x0, y0, x1, y1] = corners.unwrap_or([x, y, x, y]);
        corners = Some([x0.min(x), y0.min(y), x1.max(x), y1.max(y)]);
    }
    let [x0, y0, x1, y1] =
        corners.map_or([0, 0, 0, 0], |[x0, y0, x1, y1]| [x0, y0, x1 + 1, y1 + 1]);
    Rect { x: x0, y: y0, width: x1 - x0, height: y1 - y0 }
}

#[cfg(test)]
mod tests {
    use super::unit;

    #[test]
    fn products_are_quotients() {
        for byte in 0..=u8::MAX {
            assert_eq!(unit(byte).to_bits(), (f32::from(byte) / 255.0).to_bits(), "{byte}");
        }
    }
}
