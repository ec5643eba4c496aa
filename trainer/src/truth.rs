//! The pictures that training matches, cropped to what differs from the background.

use dermis_runtime::Camera;

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
    rgb: Vec<[u8; 3]>,
}

impl Crop {
    /// Of a rendered truth.
    pub fn of(truth: &Truth) -> Self {
        let (width, height) = (truth.picture.width, truth.picture.height);
        let rect = covered(&truth.coverage, width);
        let rows = (rect.y..rect.y + rect.height).map(|y| (y * width + rect.x) as usize);
        let pixels = rows.flat_map(|start| &truth.picture.rgb[start..start + rect.width as usize]);
        let rgb = pixels.map(|pixel| pixel.map(dermis_runtime::framebuffer::to_byte)).collect();
        Self { width, height, rect, rgb }
    }

    /// The whole picture over `background`.
    pub fn picture(&self, background: [f32; 3]) -> Picture {
        let mut picture = Picture::filled(self.width, self.height, background);
        let rows = self.rgb.chunks_exact(self.rect.width.max(1) as usize);
        for (y, row) in (self.rect.y..self.rect.y + self.rect.height).zip(rows) {
            let start = (y * self.width + self.rect.x) as usize;
            for (to, from) in picture.rgb[start..].iter_mut().zip(row) {
                *to = from.map(|byte| f32::from(byte) / 255.0);
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
