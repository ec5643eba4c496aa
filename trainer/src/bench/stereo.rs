//! Both eyes of a headset: what the second one costs beside the first.

use anyhow::Result;
use dermis_runtime::{Camera, Kernel, Part, Posed, Prepared};
use serde::Serialize;

use super::clock::{Clock, median};
use super::stages::Scene;
use super::team::{Canvas, Team};
use crate::progress;

/// Between the pupils of most people, metres.
const APART: f32 = 0.063;

/// Times of one thread, medians, ms.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Instructions.
    pub kernel: &'static str,
    /// px.
    pub width: u32,
    /// px.
    pub height: u32,
    /// Of the plan.
    pub gaussians: u32,
    /// Posing, for both.
    pub pose: f64,
    /// Selection and projection for the left eye alone.
    pub project_one: f64,
    /// For both eyes at once.
    pub project_both: f64,
    /// Lists and pixels of the left eye.
    pub draw_left: f64,
    /// Lists and pixels of the right eye.
    pub draw_right: f64,
}

impl Row {
    /// What the second eye repeats of all that comes before the lists of tiles.
    pub fn repeated(&self) -> f64 {
        (self.project_both - self.project_one) / (self.pose + self.project_one)
    }

    /// A whole second eye to a whole first one.
    pub fn second_to_first(&self) -> f64 {
        let second = self.project_both - self.project_one + self.draw_right;
        second / (self.pose + self.project_one + self.draw_left)
    }
}

/// Draws `runs` frames of both eyes, after one that does not count; the scene's camera is the left one.
///
/// # Errors
///
/// Where the runtime refuses the frame.
pub fn measure(scene: &Scene<'_>, kernel: Kernel, runs: u32) -> Result<Row> {
    let left = scene.shot.camera;
    let mut right = left;
    right.world_to_camera[0][3] -= APART;
    let Camera { width, height, .. } = left;
    let plan = scene.plan();
    let pixels = width as usize * height as usize * 4;
    let clock = Clock::ONE_THREAD;
    let mut posing = vec![0; Posed::scratch_len(scene.avatar)];
    let preparing = Prepared::scratch_len(scene.avatar, plan.gaussians(), width, height);
    let mut preparing = [(); 2].map(|()| vec![0; preparing]);
    let mut band = [vec![0; Prepared::band_scratch_len(plan.gaussians(), width, height)]];
    let mut rgba = vec![0; pixels];
    let mut times: [Vec<f64>; 5] = Default::default();
    let bar = progress::bar("both eyes", u64::from(runs));
    for run in 0..=runs {
        let mut draw = |prepared: &Prepared<'_>| {
            let mut canvas = Canvas { rgba: &mut rgba, width, background: scene.shot.background };
            clock.time(|| Team::ONE.draw(prepared, &mut band, &mut canvas)).map(|(_, ms)| ms)
        };
        let (posed, pose) =
            clock.time(|| Posed::new(scene.avatar, scene.pose, kernel, &mut posing))?;
        let (one, project_one) =
            clock.time(|| Prepared::new(&posed, &plan, &left, &mut preparing[0]))?;
        let draw_left = draw(&one)?;
        let lent = preparing.each_mut().map(Vec::as_mut_slice);
        let ([_, both], project_both) = clock.time(|| {
            let project = |parts: &mut [Part<'_, '_, 2>]| parts.iter_mut().for_each(Part::project);
            Prepared::of_eyes(&posed, &plan, [&left, &right], lent, 1, project)
        })?;
        let draw_right = draw(&both)?;
        if run > 0 {
            let ms = [pose, project_one, project_both, draw_left, draw_right];
            times.iter_mut().zip(ms).for_each(|(times, ms)| times.push(ms));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    let [pose, project_one, project_both, draw_left, draw_right] = times.map(median);
    let (kernel, gaussians) = (kernel.name(), plan.gaussians());
    Ok(Row {
        kernel,
        width,
        height,
        gaussians,
        pose,
        project_one,
        project_both,
        draw_left,
        draw_right,
    })
}
