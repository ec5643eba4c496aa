//! Cameras on disk and on the command line.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use dermis_runtime::Camera;
use dermis_runtime::prepare::MAX_SIZE;
use glam::Mat3;
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
#[serde(deny_unknown_fields)]
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
    let [a, b, c, last] = match file.world_to_camera {
        Matrix::Flat(m) => [0, 4, 8, 12].map(|i| [m[i], m[i + 1], m[i + 2], m[i + 3]]),
        Matrix::Rows(rows) => rows,
    };
    let world_to_camera = [a, b, c];
    let CameraFile { width, height, fx, fy, cx, cy, .. } = file;
    let sized = (1..=MAX_SIZE).contains(&width) && (1..=MAX_SIZE).contains(&height);
    ensure!(
        sized,
        "{name}: {width}×{height} pixels cannot be drawn; choose 1 to {MAX_SIZE} each way"
    );
    let background = file.background.unwrap_or([1.0; 3]);
    let numbers = [[fx, fy, cx, cy].as_slice(), &background, &a, &b, &c, &last].concat();
    ensure!(
        numbers.iter().all(|number| number.is_finite()),
        "{name}: has a number that is not finite or too great; write the camera again"
    );
    ensure!(
        background.iter().all(|channel| (0.0..=1.0).contains(channel)),
        "{name}: its background is not from 0 to 1; give red, green and blue so"
    );
    ensure!(fx > 0.0 && fy > 0.0, "{name}: its focal lengths are not above 0; give them in pixels");
    ensure!(
        is_rigid(&world_to_camera) && last == [0.0, 0.0, 0.0, 1.0],
        "{name}: its world_to_camera is no rotation and translation; give its rows, unscaled"
    );
    let camera = Camera { width, height, fx, fy, cx, cy, world_to_camera };
    Ok(Shot { camera, background })
}

/// Whether the left part of a matrix is a rotation: R Rᵀ = I, and not mirrored.
fn is_rigid(rows: &[[f32; 4]; 3]) -> bool {
    // Of the rows as columns: the transpose's product and determinant are alike for the test.
    let turned = Mat3::from_cols_array_2d(&rows.map(|[x, y, z, _]| [x, y, z]));
    let off = turned.transpose() * turned - Mat3::IDENTITY;
    off.to_cols_array().iter().all(|x| x.abs() <= 1e-3) && turned.determinant() > 0.0
}
