//! GaussianAvatars: Gaussians in the frames of a mesh's triangles.
//!
//! The PLY is that of 3D Gaussian Splatting, but position, scales and rotation are those in the frame
//! of triangle `binding_0`: origin in its centroid, first axis along v1 − v0, second along the normal,
//! third their cross product, scale the mean of edge and height. The format's Edge frames are just
//! these, so the numbers are kept and the avatar moves as it was trained. Harmonics are those of the
//! world's directions, for its authors as for the format: they do not turn with the triangle.

use std::path::Path;

use anyhow::{Result, ensure};
use dermis_format::FrameKind;

use super::assembly::{Assembly, Carrier, Mount};
use super::splat_ply::BINDING;
use super::splats::LeftOut;

/// Reads a PLY whose Gaussians hang on `carrier`.
pub(super) fn read(path: &Path, carrier: Carrier) -> Result<(Assembly, LeftOut)> {
    let ply = super::open(path)?.with(BINDING)?;
    let mut splats = ply.splats();
    let (mut left_out, mut triangles) = (LeftOut::default(), Vec::new());
    let count = carrier.triangles();
    ply.for_each(|row, splat, more| {
        let binding = more[0];
        ensure!(
            binding >= 0.0 && binding < count as f64 && binding.fract() == 0.0,
            "vertex row {row}: its {BINDING} is {binding}, but {} has the triangles 0 to {}; give the \
             mesh that it was trained on",
            carrier.name,
            count - 1
        );
        if splats.push(splat, &mut left_out) {
            triangles.push(binding as u32);
        }
        Ok(())
    })?;
    splats.ensure_any(&left_out)?;
    splats.lower_degree();
    let mount = Mount { carrier, frame: FrameKind::Edge, triangles };
    Ok((Assembly { splats, mount: Some(mount), levels: None }, left_out))
}
