//! The pictures that training matches, cropped to what differs from the background.

use dermis_runtime::Camera;
use dermis_runtime::framebuffer::to_byte;

use crate::metrics::Rect;
use crate::picture::Picture;
use crate::scene::mesh_render::Truth;

/// A picture to be matched.
#[derive(Clone, Debug)]
pub struct TrainingView {
    /// Index of its pose.
    pub stage: usize,
    /// Who looks.
    pub camera: Camera,
    /// What is seen.
    pub truth: Crop,
}

/// The part of a picture that a mesh covers, 8 bits a channel.
#[derive(Clone, Debug)]
pub struct Crop {
    width: u32,
    height: u32,
    /// Where the part stands.
    pub rect: Rect,
    /// Colour over `background`, and coverage in 1/255.
    pixels: Vec<[u8; 4]>,
    background: [f32; 3],
}

impl Crop {
    /// Of a truth that was rendered over `background`.
    pub fn of(truth: &Truth, background: [f32; 3]) -> Self {
        let (width, height) = (truth.picture.width, truth.picture.height);
        let rect = covered(&truth.coverage, width);
        let rows = (rect.y..rect.y + rect.height).map(|y| (y * width + rect.x) as usize);
        let places = rows.flat_map(|start| start..start + rect.width as usize);
        let pixel = |at: usize| {
            let [r, g, b] = truth.picture.rgb[at].map(to_byte);
            [r, g, b, to_byte(truth.coverage[at])]
        };
        Self { width, height, rect, pixels: places.map(pixel).collect(), background }
    }

    /// The whole picture over `background`, which may be another one than it was rendered over.
    pub fn picture(&self, background: [f32; 3]) -> Picture {
        let change: [f32; 3] = std::array::from_fn(|i| background[i] - self.background[i]);
        let mut picture = Picture::filled(self.width, self.height, background);
        let rows = self.pixels.chunks_exact(self.rect.width.max(1) as usize);
        for (y, row) in (self.rect.y..self.rect.y + self.rect.height).zip(rows) {
            let start = (y * self.width + self.rect.x) as usize;
            for (to, &[r, g, b, coverage]) in picture.rgb[start..].iter_mut().zip(row) {
                let seen_through = f32::from(255 - coverage) / 255.0;
                let color = [r, g, b].map(|byte| f32::from(byte) / 255.0);
                *to = std::array::from_fn(|i| color[i] + seen_through * change[i]);
            }
        }
        picture
    }
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
