//! Posed Gaussians of an avatar in files of other programs.
//!
//! 1. [`posed`] takes the Gaussians of a plan into the world: of an avatar without a mesh as they stand, with
//!    their harmonics; of another by [`Posed::export`], both sides of its mesh.
//! 2. [`ply()`], [`spz()`] and [`splat()`] write them; [`convert`](crate::convert) reads them again.
//!
//! Axes and units stay the avatar's: metres and, where it was trained here, x to the right of who looks at its
//! front, y up, z towards him, which is what SPZ prescribes. PLY prescribes nothing, but many viewers take what
//! captures have (y down, z forward) for granted: [`Splats::half_turn`] leads from one to the other.

mod ply;
mod splat;
mod spz;

use anyhow::{Result, ensure};
use dermis_format::FrameKind;
use dermis_runtime::select::{Local, for_each_block, for_each_of_block};
use dermis_runtime::{Avatar, Kernel, Plan, Pose, Posed, PosedGaussian, Sides};
use glam::{DMat3, DQuat, DVec3};

use crate::convert::splats::Splat;
use crate::convert::{LeftOut, Splats};
use crate::orbit::Orbit;

pub use ply::ply;
pub use splat::splat;
pub use spz::spz;

/// A file, and what its codes could not hold.
#[derive(Clone, Debug)]
pub struct Packed {
    /// The file.
    pub bytes: Vec<u8>,
    /// Gaussians with a number beyond its codes, which took the nearest.
    pub clamped: usize,
}

/// Gaussians of a plan in the world, metres, as wide and as opaque as the plan has them.
///
/// Harmonics of Gaussians that hang on a mesh come as the colour that they show to who stands before its front,
/// and as [`Splats::cut_from`].
///
/// # Errors
///
/// Where the pose or the plan is not of this avatar, or none of its Gaussians can be drawn.
pub fn posed(avatar: &Avatar<'_>, pose: &Pose<'_>, plan: &Plan) -> Result<(Splats, LeftOut)> {
    let header = avatar.header();
    let compensated = header.low_pass != dermis_format::LowPass::Classic;
    let splats = Splats { compensated, ..Splats::default() };
    let exported = match header.frame {
        FrameKind::World => standing(avatar, plan, splats),
        _ => hanging(avatar, pose, plan, splats)?,
    };
    ensure!(
        !exported.0.gaussians.is_empty(),
        "none of its Gaussians can be drawn; give a greater budget"
    );
    Ok(exported)
}

/// Of an avatar without a mesh.
fn standing(avatar: &Avatar<'_>, plan: &Plan, mut splats: Splats) -> (Splats, LeftOut) {
    let mut left_out = LeftOut::default();
    splats.degree = avatar.header().harmonics_degree;
    for_each_block(avatar, plan, |block, region, drawn| {
        for_each_of_block(
            block,
            region,
            drawn,
            |_| true,
            |place| {
                // Without a mesh all records are full.
                let Some((Local::Full(full), harmonics)) =
                    place.decode().map(|selected| (selected.gaussian, selected.harmonics))
                else {
                    return;
                };
                let harmonics: Vec<f32> = harmonics.values(0.0f32).flatten().collect();
                let splat = Splat {
                    position: full.position.map(f64::from),
                    rotation: full.rotation.map(f64::from),
                    log2_scale: full.log2_scale.map(f64::from),
                    color: full.color.map(f64::from),
                    opacity: f64::from(full.opacity),
                    harmonics: &harmonics,
                };
                splats.push(&splat, &mut left_out);
            },
        );
    });
    (splats, left_out)
}

/// Of an avatar with a mesh.
fn hanging(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    mut splats: Splats,
) -> Result<(Splats, LeftOut)> {
    let degree = avatar.header().harmonics_degree;
    splats.cut_from = (degree > 0).then_some(degree);
    let front = Orbit { yaw: 0.0, pitch: 0.0, distance: None };
    let eye = front.camera(avatar, pose, 1, 1)?.position();
    let mut scratch = vec![0; Posed::scratch_len(avatar)];
    let posed = Posed::new(avatar, pose, Kernel::detect(), &mut scratch)?;
    let mut gaussians = vec![PosedGaussian::default(); plan.gaussians() as usize];
    let count = posed.export(plan, eye, Sides::All, &mut gaussians)?;
    let mut left_out = LeftOut::default();
    for gaussian in &gaussians[..count] {
        splats.push(&free(gaussian), &mut left_out);
    }
    Ok((splats, left_out))
}

/// A Gaussian by rotation and scales. The axes of the rotation are those of the Gaussian from the longest to the
/// shortest one.
fn free(gaussian: &PosedGaussian) -> Splat<'static> {
    let axes = [gaussian.axis_0, gaussian.axis_1, gaussian.axis_2];
    let PosedGaussian { center, opacity, red, green, blue, .. } = gaussian;
    Splat {
        position: center.map(f64::from),
        color: [*red, *green, *blue].map(f64::from),
        opacity: f64::from(*opacity),
        ..of_axes(axes.map(|axis| DVec3::from(axis.map(f64::from))))
    }
}

/// Rotation and scales of orthogonal axes, whose lengths are the standard deviations; nothing else.
pub(crate) fn of_axes(mut axes: [DVec3; 3]) -> Splat<'static> {
    axes.sort_by(|a, b| b.length().total_cmp(&a.length()));
    let sigma = axes.map(DVec3::length);
    // Flat and thin Gaussians have directions that are not their axes'.
    let first = axes[0].try_normalize().unwrap_or(DVec3::X);
    let second = axes[1].reject_from_normalized(first).try_normalize();
    let second = second.unwrap_or_else(|| first.any_orthonormal_vector());
    let turn = DQuat::from_mat3(&DMat3::from_cols(first, second, first.cross(second)));
    Splat {
        position: [0.0; 3],
        rotation: [turn.w, turn.x, turn.y, turn.z],
        log2_scale: sigma.map(libm::log2),
        color: [0.0; 3],
        opacity: 0.0,
        harmonics: &[],
    }
}
