//! Draws a file as its users will: by the runtime, from its bytes.

use std::time::Instant;

use anyhow::Result;
use dermis_runtime::budget::{self, Budget, Instance, Spent};
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Kernel, Pixels, Plan, Pose, Posed, Prepared,
    Statistics, render, scratch_len,
};
use serde::Serialize;

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

/// Time of each stage of a frame, on one thread.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Milliseconds {
    /// Joints, vertices, triangle frames.
    pub pose: f64,
    /// The plan.
    pub select: f64,
    /// Splats, and how many each tile has.
    pub project: f64,
    /// Lists of the tiles, front to back.
    pub sort: f64,
    /// Blending and writing pixels.
    pub raster: f64,
    /// All of it.
    pub total: f64,
}

/// The plan of a posed avatar alone, and what it comes to.
pub fn planned(posed: &Posed<'_, '_>, camera: &Camera, budget: &Budget) -> Result<(Plan, Spent)> {
    let instances =
        [Instance { avatar: posed.avatar(), footprints: posed.footprints(camera), weight: 1.0 }];
    let (mut scratch, mut plans) = (vec![0; budget::scratch_len(&instances)], [Plan::default()]);
    let spent = budget::plan(&instances, budget, None, &mut scratch, &mut plans)?;
    let [plan] = plans;
    Ok((plan, spent))
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
    let mut framebuffer = framebuffer(&mut rgba, camera.width, background);
    let kernel = Kernel::detect();
    let statistics = render(avatar, pose, plan, camera, kernel, &mut scratch, &mut framebuffer)?;
    Ok(Drawn { rgba, statistics, scratch_bytes: scratch.len() * 4 })
}

/// Draws one frame and gives it before it is rounded to bytes: (r, g, b) of each pixel over
/// `background`, row-major.
pub fn draw_unrounded(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    kernel: Kernel,
    camera: &Camera,
    background: [f32; 3],
) -> Result<Vec<[f32; 3]>> {
    let mut scratch = vec![0; scratch_len(avatar, plan.gaussians(), camera.width, camera.height)];
    let mut rgba = vec![0.0; camera.width as usize * camera.height as usize * 4];
    let mut framebuffer = Framebuffer {
        pixels: Pixels::RgbaF32(&mut rgba),
        stride: camera.width as usize * 4,
        background: Background::Color(background),
        depth: None,
    };
    render(avatar, pose, plan, camera, kernel, &mut scratch, &mut framebuffer)?;
    Ok(rgba.as_chunks::<4>().0.iter().map(|&[r, g, b, _]| [r, g, b]).collect())
}

/// Draws one frame stage by stage with a clock beside it. Lists are made once more than needed:
/// alone, to know their share.
pub fn draw_timed(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: impl FnOnce() -> Plan,
    kernel: Kernel,
    camera: &Camera,
    background: [f32; 3],
) -> Result<(Drawn, Plan, Milliseconds)> {
    let (width, height) = (camera.width, camera.height);
    let mut posing = vec![0; Posed::scratch_len(avatar)];
    let mut clock = Clock::start();
    let posed = Posed::new(avatar, pose, kernel, &mut posing)?;
    let pose_time = clock.lap();
    let plan = plan();
    let select = clock.lap();
    let budget = plan.gaussians();
    let mut preparing = vec![0; Prepared::scratch_len(avatar, budget, width, height)];
    let mut drawing = vec![0; Prepared::band_scratch_len(budget, width, height)];
    let mut rgba = vec![0; width as usize * height as usize * 4];
    clock.lap();
    let prepared = Prepared::new(&posed, &plan, camera, &mut preparing)?;
    let project = clock.lap();
    prepared.for_each_list(0..prepared.tile_rows(), &mut drawing, |_, _| ())?;
    let sort = clock.lap();
    let drawn = prepared.draw(&mut drawing, &mut framebuffer(&mut rgba, width, background))?;
    let raster = (clock.lap() - sort).max(0.0);
    let total = pose_time + select + project + sort + raster;
    let statistics = Statistics {
        gaussians_selected: prepared.gaussians_selected(),
        gaussians_visible: prepared.splats().len() as u32,
        counts: drawn,
    };
    let scratch_bytes = 4 * scratch_len(avatar, budget, width, height);
    let ms = Milliseconds { pose: pose_time, select, project, sort, raster, total };
    Ok((Drawn { rgba, statistics, scratch_bytes }, plan, ms))
}

fn framebuffer(rgba: &mut [u8], width: u32, background: [f32; 3]) -> Framebuffer<'_> {
    Framebuffer {
        pixels: Pixels::Rgba8(rgba),
        stride: width as usize * 4,
        background: Background::Color(background),
        depth: None,
    }
}

/// Milliseconds from lap to lap.
struct Clock(Instant);

impl Clock {
    fn start() -> Self {
        Self(Instant::now())
    }

    fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let lap = now - self.0;
        self.0 = now;
        lap.as_secs_f64() * 1e3
    }
}

/// RGB of an RGBA8 picture.
pub fn rgb_of(rgba: &[u8]) -> Vec<u8> {
    rgba.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect()
}
