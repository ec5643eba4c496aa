//! Choosing triangles by a picture of the mesh at rest in which the parts that matter are painted.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use dermis_runtime::Camera;
use glam::Vec3;
use image::{Pixel, RgbaImage};

use crate::scene::{Painter, vertices_in_sight};
use crate::{camera_file, import, output};

/// Luma and alpha from which on a pixel is inside.
const INSIDE: u8 = 128;

/// A picture of what is chosen, and the camera that it was seen by. The picture has as many pixels as
/// the camera's.
#[derive(Clone, Debug)]
pub struct Mask {
    /// What errors call it: its file.
    pub name: String,
    /// Inside where luma and alpha are at least 128.
    mask: RgbaImage,
    camera: Camera,
}

impl Mask {
    /// A mask in memory.
    ///
    /// # Errors
    /// If `mask` has not as many pixels each way as `camera`.
    pub fn new(name: String, mask: RgbaImage, camera: Camera) -> Result<Self> {
        let (width, height) = mask.dimensions();
        // A mask of another size was cut or scaled, and nothing says which.
        ensure!(
            (width, height) == (camera.width, camera.height),
            "{name}: is {width}×{height} px, but its camera's picture {}×{}; \
             give the mask the camera's size",
            camera.width,
            camera.height
        );
        Ok(Self { name, mask, camera })
    }

    /// Reads a picture (PNG, JPEG or WebP) and its camera file.
    pub fn load(mask: &Path, camera: &Path) -> Result<Self> {
        let name = mask.display().to_string();
        let image =
            import::image_file::decode(&output::read(mask)?).with_context(|| name.clone())?;
        Self::new(name, image, camera_file::read(camera)?.camera)
    }

    /// Whether each triangle of the painter's model, with its vertices at `rest` (world, metres), lies
    /// in the mask with all three corners, none of them hidden ([`vertices_in_sight`]).
    ///
    /// # Errors
    /// If none does.
    pub fn select(&self, painter: &Painter<'_>, rest: &[Vec3]) -> Result<Vec<bool>> {
        let places = vertices_in_sight(painter, rest, &self.camera);
        let inside: Vec<bool> =
            places.iter().map(|place| place.is_some_and(|at| self.contains(at))).collect();
        let triangles = painter.model().triangles.iter();
        let choice =
            triangles.map(|t| t.corners.iter().all(|&corner| inside[corner as usize])).collect();
        super::not_empty(choice, || {
            format!(
                "{}: no triangle of the mesh at rest lies in the mask, in sight of its camera; \
                 paint what to choose white, and give the camera that saw it",
                self.name
            )
        })
    }

    fn contains(&self, [x, y]: [u32; 2]) -> bool {
        let pixel = self.mask.get_pixel(x, y);
        pixel.to_luma().0[0] >= INSIDE && pixel.0[3] >= INSIDE
    }
}
