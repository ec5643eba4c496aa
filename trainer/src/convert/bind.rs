//! Hangs Gaussians on a mesh, so that they stay where they are while it rests.
//!
//! Those that stood free get affine frames. A point in the plane of its triangle keeps its place between the
//! corners in every pose, so that what meets at an edge at rest meets there always, and no crack opens where a
//! triangle stretches; `notes/convert.md` has the figures.

use anyhow::{Context, Result, ensure};
use dermis_format::{FrameKind, Full};
use glam::DVec3;
use rayon::prelude::*;

use super::assembly::{Assembly, Carrier, Mount};
use super::local::local;
use super::splats::Splats;
use crate::nearest::Nearest;

/// A triangle whose height over the longest side is less than this share of it carries nothing: what
/// opens in another pose would draw a Gaussian out without end.
const FLATTEST: f64 = 1.0 / 32.0;

/// Farthest place in units of a frame, and log₂ of the greatest scale: within the format's limits.
const FARTHEST: f32 = 1e9;
const GREATEST_LOG2_SCALE: f32 = 39.0;

/// Binds each Gaussian to the nearest triangle of the mesh at rest.
pub(super) fn to_nearest(mut free: Assembly, carrier: Carrier) -> Result<Assembly> {
    let frame = FrameKind::Affine;
    let triangles = hang(&mut free.splats, &carrier, frame, &[])?;
    Ok(Assembly { mount: Some(Mount { carrier, frame, triangles }), ..free })
}

/// Takes Gaussians from world axes, metres, into frames of the resting mesh: of the triangle that is
/// `chosen` for each, else, or where that one is too flat, of the nearest. Gives their triangles.
pub(super) fn hang(
    splats: &mut Splats,
    mesh: &Carrier,
    kind: FrameKind,
    chosen: &[u32],
) -> Result<Vec<u32>> {
    let frame = |triangle: u32| {
        let fit = !is_flat(mesh.corners(triangle));
        fit.then(|| mesh.frame(kind, triangle)).flatten().map(|frame| (triangle, frame))
    };
    let fit = (0..mesh.triangles() as u32).filter_map(frame).map(|(triangle, _)| triangle);
    let nearest = Nearest::of(fit.map(|triangle| (triangle, mesh.corners(triangle))));
    let bind = |(index, gaussian): (usize, &mut Full)| {
        let near = |gaussian: &Full| nearest.triangle(gaussian.position.map(f64::from));
        let chosen = chosen.get(index).copied().and_then(frame);
        let (triangle, frame) = chosen.or_else(|| near(gaussian).and_then(frame))?;
        *gaussian = local(gaussian, &frame);
        Some(triangle)
    };
    let triangles: Option<Vec<u32>> =
        splats.gaussians.par_iter_mut().enumerate().map(bind).collect();
    let triangles = triangles.with_context(|| {
        format!("{}: all its triangles are too flat to carry Gaussians; give another", mesh.name)
    })?;
    let fits = |g: &Full| {
        g.position.iter().all(|x| x.abs() <= FARTHEST)
            && g.log2_scale.iter().all(|&s| s <= GREATEST_LOG2_SCALE)
    };
    ensure!(
        splats.gaussians.iter().all(fits),
        "{}: is too small for a Gaussian or too far from it; give one of the same place and size",
        mesh.name
    );
    Ok(triangles)
}

/// Whether a triangle is too flat to carry Gaussians; one that is not finite is.
fn is_flat([a, b, c]: [[f64; 3]; 3]) -> bool {
    let [a, b, c] = [a, b, c].map(DVec3::from);
    let longest =
        (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    !((b - a).cross(c - a).length() > FLATTEST * longest)
}
