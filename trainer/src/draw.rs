//! Draws a file as its users will: by the runtime, from its bytes.

use anyhow::Result;
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Plan, Pose, Statistics, render, scratch_len,
};

/// A frame that the runtime drew.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// RGBA8, row 0 on top, no gaps between rows.
    pub rgba: Vec<u8>,
    /// What it took.
    pub statistics: Statistics,
    /// Bytes of scratch that were lent.
    pub scratch_bytes: usize,
}

/// Draws one frame over `background`.
pub fn draw(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    camera: &Camera,
    background: [f32; 3],
) -> Result<Drawn> {
    let mut scratch = vec![0; scratch_len(avatar, plan.gaussians(), camera.width, camera.height)];
    let mut rgba = vec![0; camera.width as usize * camera.height as usize * 4];
    let mut framebuffer = Framebuffer {
        pixels: &mut rgba,
        stride: camera.width as usize * 4,
        background: Background::Color(background),
    };
    let statistics = render(avatar, pose, plan, camera, &mut scratch, &mut framebuffer)?;
    Ok(Drawn { rgba, statistics, scratch_bytes: scratch.len() * 4 })
}

/// RGB of an RGBA8 picture.
pub fn rgb_of(rgba: &[u8]) -> Vec<u8> {
    rgba.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect()
}
