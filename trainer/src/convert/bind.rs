//! Hangs Gaussians on a mesh, so that they stay where they are while it rests.
//!
//! They stand in affine frames. A point in the plane of its triangle keeps its place between the
//! corners in every pose, so that what meets at an edge at rest meets there always, and what is drawn
//! closes where the triangle stretches; `notes/convert.md` has the figures.

use anyhow::{Context, Result, ensure};
use dermis_format::FrameKind;
use dermis_runtime::frame::Frame;
use dermis_runtime::math::dot;
use rayon::prelude::*;

use super::assembly::{Assembly, Carrier, Mount};
use super::local::local;
use super::nearest::Nearest;
use super::splats::Splats;

/// The frames in which they stand.
pub(super) const FRAME: FrameKind = FrameKind::Affine;

/// A triangle flatter than this (the lesser axis of an affine frame's ellipse to the greater) carries
/// nothing: what opens in another pose would draw a Gaussian out without end.
const FLATTEST: f64 = 1.0 / 32.0;

/// In units of a frame, far within the format's limit.
const FARTHEST: f32 = 1e9;

/// Binds each Gaussian to the nearest triangle of the mesh at rest.
pub(super) fn to_nearest(mut free: Assembly, carrier: Carrier) -> Result<Assembly> {
    let triangles = hang(&mut free.splats, &carrier, &[])?;
    Ok(Assembly { mount: Some(Mount { carrier, frame: FRAME, triangles }), ..free })
}

/// Takes Gaussians from world axes, metres, into frames of the resting mesh: of the triangle that is
/// `chosen` for each, else, or where that one is too flat, of the nearest. Gives their triangles.
pub(super) fn hang(splats: &mut Splats, mesh: &Carrier, chosen: &[u32]) -> Result<Vec<u32>> {
    let frames: Vec<Option<Frame<f64>>> = (0..mesh.triangles() as u32)
        .map(|triangle| mesh.frame(FRAME, triangle).filter(is_fit))
        .collect();
    let fit = (0..).zip(&frames).filter(|(_, frame)| frame.is_some());
    let nearest = Nearest::of(fit.map(|(triangle, _)| (triangle, mesh.corners(triangle))));
    let bind = |(index, gaussian): (usize, &mut _)| {
        let frame = |triangle: u32| frames[triangle as usize].map(|frame| (triangle, frame));
        let chosen = chosen.get(index).and_then(|&triangle| frame(triangle));
        let (triangle, frame) = chosen.or_else(|| {
            let dermis_format::Full { position, .. } = *gaussian;
            nearest.triangle(position.map(f64::from)).and_then(frame)
        })?;
        *gaussian = local(gaussian, &frame);
        Some(triangle)
    };
    let triangles: Option<Vec<u32>> =
        splats.gaussians.par_iter_mut().enumerate().map(bind).collect();
    let triangles = triangles.context(
        "the mesh has no triangle to hang Gaussians on, as all are flat; give another with --mesh",
    )?;
    let is_near = |x: &f32| x.abs() <= FARTHEST;
    ensure!(
        splats.gaussians.iter().all(|g| g.position.iter().all(is_near)),
        "a Gaussian is too far from the mesh; is it in the same place and of the same size?"
    );
    Ok(triangles)
}

/// Whether a triangle with this frame carries Gaussians.
fn is_fit(frame: &Frame<f64>) -> bool {
    // The frame's area is the square of its third axis.
    let (area, longest) = (dot(frame.z, frame.z), frame.reach(FrameKind::Affine));
    area > FLATTEST * longest * longest
}
