//! Frames for counters of instructions, which want to know where a frame begins and ends: the stages
//! are functions of their own, by whose names a counter can be switched on and off.
//!
//! `.ci/instructions` holds the counts against a record.

use anyhow::Result;
use dermis_runtime::{Error, Kernel, Plan, Posed, Prepared, Statistics};

use super::stages::Scene;
use super::team::{Canvas, Team};
use crate::camera_file::Shot;

/// Draws one frame on one thread: memory is made before the counted part, so that only the
/// runtime's work is inside.
///
/// # Errors
///
/// Where the runtime refuses.
pub fn draw_once(scene: &Scene<'_>, kernel: Kernel) -> Result<Statistics> {
    let camera = scene.shot.camera;
    let (width, height, budget) = (camera.width, camera.height, scene.plan().gaussians());
    let mut posing = vec![0; Posed::scratch_len(scene.avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(scene.avatar, budget, width, height)];
    let mut bands = [vec![0; Prepared::band_scratch_len(budget, width, height)]];
    let mut rgba = vec![0; width as usize * height as usize * 4];
    frame(scene, kernel, &mut posing, &mut preparing, &mut bands, &mut rgba)
}

/// The frame.
#[inline(never)]
fn frame(
    scene: &Scene<'_>,
    kernel: Kernel,
    posing: &mut [u32],
    preparing: &mut [u32],
    bands: &mut [Vec<u32>],
    rgba: &mut [u8],
) -> Result<Statistics> {
    let posed = stage_pose(scene, kernel, posing)?;
    let plan = stage_select(scene);
    let prepared = stage_project(scene, &posed, &plan, preparing)?;
    stage_draw(scene, &prepared, bands, rgba)
}

#[inline(never)]
fn stage_pose<'s, 'a>(
    scene: &Scene<'a>,
    kernel: Kernel,
    scratch: &'s mut [u32],
) -> Result<Posed<'s, 'a>, Error>
where
    'a: 's,
{
    Posed::new(scene.avatar, scene.pose, kernel, scratch)
}

#[inline(never)]
fn stage_select(scene: &Scene<'_>) -> Plan {
    scene.plan()
}

#[inline(never)]
fn stage_project<'s>(
    scene: &Scene<'_>,
    posed: &Posed<'_, '_>,
    plan: &Plan,
    scratch: &'s mut [u32],
) -> Result<Prepared<'s>, Error> {
    Prepared::new(posed, plan, &scene.shot.camera, scratch)
}

/// Lists and pixels.
#[inline(never)]
fn stage_draw(
    scene: &Scene<'_>,
    prepared: &Prepared<'_>,
    bands: &mut [Vec<u32>],
    rgba: &mut [u8],
) -> Result<Statistics> {
    let Shot { camera, background } = scene.shot;
    let mut canvas = Canvas { rgba, width: camera.width, background };
    Ok(Statistics {
        gaussians_selected: prepared.gaussians_selected(),
        gaussians_visible: prepared.splats().len() as u32,
        counts: Team::ONE.draw(prepared, bands, &mut canvas)?,
    })
}
