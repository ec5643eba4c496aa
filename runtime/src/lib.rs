//! Draws `.dermis` avatars in memory that the caller lends: no heap, no panic, no unsafe code, and
//! the same bytes on every target.
//!
//! Data flows one way: bytes → avatar → pose → plan → prepare → bands → pixels (with one budget for several avatars the plan
//! comes before the pose, of which it needs a part).
//!
//! 1. [`Avatar::parse`] checks the bytes once and reads them in place; [`Unpacker`] makes them of packed ones.
//! 2. [`Posed`] skins the mesh in a [`Pose`] ([`pose`], [`posed`]) and gives each triangle a
//!    coordinate system ([`frame`]).
//! 3. [`Plan`] chooses the Gaussians of the frame under a budget ([`plan`], [`select`]), between two levels
//!    where they have parameters of their own at each ([`mix`]). For several avatars [`budget`] shares one budget out,
//!    by what each region covers ([`footprint`]); then [`Posed::for_plan`] poses what the plans need, and [`rate`] says how
//!    often.
//! 4. [`Prepared`] puts them in the world ([`gaussian`], [`harmonics`]) and on the screen
//!    ([`project`], [`prepare`]): one by one by the specification ([`screen`]), in fact many at
//!    once ([`batch`], from the file's codes: [`coded`]), in shares that the caller's threads may take
//!    ([`Part`]).
//! 5. Bands of tiles ([`tiles`]) are listed and sorted front to back ([`lists`]) and blended
//!    ([`raster`], [`draw`])
//! 6. into the caller's [`Framebuffer`] ([`framebuffer`]).
//!
//! Formulas are written once over [`math::Real`], which f32, f64 and the vectors of [`lanes`] are; a
//! [`Kernel`] says which of them draw. The bytes do not depend on it.
//!
//! Beside that memory a frame takes stack: while it projects up to 8 KB for shares, 7 KB for a batch
//! of 64 Gaussians and 4 KB to walk a file with parameters per level, while it sorts 8 KB for counts;
//! [`Posed::footprints`] takes 13 KB. An [`Unpacker`] is a value of 72 KB: where the stack is
//! less, take files that are not packed.
//!
//! Feature `std`, on by default, has [`Kernel::detect`] look what vectors the CPU has; without it [`Kernel::baseline`] says what
//! the target surely has. Several avatars in one picture are drawn one over the other with
//! [`Background::Existing`], the farthest first: they are not sorted against one another.
//!
//! A GPU of your own takes the Gaussians instead after 3: [`Posed::export`] ([`export`]).
//!
//! [`render`] does all of it for one avatar and one camera; [`scratch_len`] says how many words it
//! needs. World axes are glTF's (metres, right-handed, +Y up), camera axes OpenCV's.
#![no_std]

pub mod batch;
pub mod budget;
pub mod camera;
pub mod coded;
pub mod draw;
pub mod error;
pub mod export;
mod extent;
pub mod footprint;
pub mod frame;
pub mod framebuffer;
mod frames;
mod frustum;
pub mod gaussian;
pub mod harmonics;
pub mod kernel;
pub mod lanes;
pub mod lists;
pub mod math;
pub mod mix;
mod needed;
mod parts;
pub mod plan;
pub mod pose;
pub mod posed;
pub mod prepare;
pub mod project;
pub mod raster;
pub mod rate;
mod scratch;
pub mod screen;
pub mod select;
mod skin;
mod sort;
pub mod tiles;

pub use camera::Camera;
pub use dermis_format::Avatar;
pub use dermis_format::packed::Unpacker;
pub use error::Error;
pub use export::{PosedGaussian, Sides};
pub use framebuffer::{Background, Depth, Framebuffer, Pixels};
pub use kernel::{Kernel, Level};
pub use plan::Plan;
pub use pose::Pose;
pub use posed::Posed;
pub use prepare::{Part, Prepared};

/// What a frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Gaussians of the plan: never more than the budget.
    pub gaussians_selected: u32,
    /// Those whose bounds hold a pixel of the frame.
    pub gaussians_visible: u32,
    /// What the pixels took.
    pub counts: raster::Counts,
}

/// Words of scratch with which [`render`] never fails for want of memory; with depths
/// [`draw::DEPTH_SCRATCH_LEN`] more.
pub fn scratch_len(avatar: &Avatar<'_>, budget: u32, width: u32, height: u32) -> usize {
    scratch_len_for_threads(avatar, budget, width, height, 1)
}

/// Words of scratch of a frame whose bands `threads` threads draw at once: for [`Posed`], for
/// [`Prepared`], and a band's ([`Prepared::band_scratch_len`]) for each of them; with depths
/// [`draw::DEPTH_SCRATCH_LEN`] more for each.
pub fn scratch_len_for_threads(
    avatar: &Avatar<'_>,
    budget: u32,
    width: u32,
    height: u32,
    threads: usize,
) -> usize {
    let budget = budget.min(avatar.header().gaussians);
    Posed::scratch_len(avatar)
        .saturating_add(Prepared::scratch_len(avatar, budget, width, height))
        .saturating_add(Prepared::band_scratch_len(budget, width, height).saturating_mul(threads))
}

/// Poses, projects and draws one avatar.
pub fn render(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    camera: &Camera,
    kernel: Kernel,
    scratch: &mut [u32],
    framebuffer: &mut Framebuffer<'_>,
) -> Result<Statistics, Error> {
    prepare::check(avatar, plan, camera)?;
    let budget = plan.gaussians();
    let (width, height) = (camera.width, camera.height);
    let lent = scratch.len();
    let depths = framebuffer.depth.as_ref().map_or(0, |_| draw::DEPTH_SCRATCH_LEN);
    let needed = scratch_len(avatar, budget, width, height).saturating_add(depths);
    let missing = Error::Scratch { needed, lent };
    if lent < needed {
        return Err(missing);
    }
    let (posing, rest) = scratch.split_at_mut_checked(Posed::scratch_len(avatar)).ok_or(missing)?;
    let preparing = Prepared::scratch_len(avatar, budget, width, height);
    let (preparing, drawing) = rest.split_at_mut_checked(preparing).ok_or(missing)?;
    let posed = Posed::moving_from(avatar, pose, plan.still_below(), kernel, posing)?;
    let prepared = Prepared::new(&posed, plan, camera, preparing)?;
    let drawn = prepared.draw(drawing, framebuffer)?;
    Ok(Statistics {
        gaussians_selected: prepared.gaussians_selected(),
        gaussians_visible: prepared.splats().len() as u32,
        counts: drawn,
    })
}
