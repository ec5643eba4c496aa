//! Cameras on disk and on the command line.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use dermis_runtime::Camera;
use dermis_runtime::prepare::MAX_SIZE;
use serde::Deserialize;

use crate::output;

/// A camera and what is behind the avatar.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// Who looks.
    pub camera: Camera,
    /// sRGB.
    pub background: [f32; 3],
}

#[derive(Deserialize)]
struct CameraFile {
    width: u32,
    height: u32,
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    world_to_camera: Matrix,
    background: Option<[f32; 3]>,
}

/// Row-major 4×4, as 16 numbers or as 4 rows.
#[derive(Deserialize)]
#[serde(untagged)]
enum Matrix {
    Flat([f32; 16]),
    Rows([[f32; 4]; 4]),
}

/// Reads a camera file (design: JSON with width, height, fx, fy, cx, cy, world_to_camera, background).
pub fn read(path: &Path) -> Result<Shot> {
    let name = path.display();
    let file: CameraFile = serde_json::from_slice(&output::read(path)?)
        .with_context(|| format!("{name}: is not a camera file; see README for its fields"))?;
    let rows = match file.world_to_camera {
        Matrix::Flat(m) => [0, 1, 2].map(|i| [m[4 * i], m[4 * i + 1], m[4 * i + 2], m[4 * i + 3]]),
        Matrix::Rows([a, b, c, _]) => [a, b, c],
    };
    let CameraFile { width, height, fx, fy, cx, cy, .. } = file;
    let sized = (1..=MAX_SIZE).contains(&width) && (1..=MAX_SIZE).contains(&height);
    ensure!(
        sized,
        "{name}: {width}×{height} pixels cannot be drawn; choose 1 to {MAX_SIZE} each way"
    );
    ensure!(fx > 0.0 && fy > 0.0, "{name}: its focal lengths are not above 0; give them in pixels");
    let camera = Camera { width, height, fx, fy, cx, cy, world_to_camera: rows };
    Ok(Shot { camera, background: file.background.unwrap_or([1.0; 3]) })
}
