//! Gradient descent over pictures.

use anyhow::Result;
use dermis_format::LowPass;
use dermis_runtime::project::View;
use rayon::prelude::*;

use super::adam::{Moments, Rates};
use super::backward::{SplatGradient, by_splats};
use super::cloud::{Cloud, Freedom, Parameters, Seed};
use super::forward::{Forward, Prefix, Stage, draw};
use super::loss::Loss;
use super::projection::by_parameters;
use super::schedule::{Random, Schedule};
use crate::metrics::Rect;
use crate::metrics::ssim::SsimWorkspace;
use crate::picture::Picture;
use crate::truth::{Scratch, TrainingView};

/// Gaussians that one task moves.
const CHUNK: usize = 4096;

/// What is to be matched.
#[derive(Debug)]
pub struct Problem<'a> {
    /// Poses.
    pub stages: &'a [Stage],
    /// Pictures of them.
    pub views: &'a [TrainingView],
    /// Behind the avatar.
    pub background: [f32; 3],
    /// How the low-pass acts.
    pub low_pass: LowPass,
    /// What to lessen.
    pub loss: Loss,
}

/// How far training is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Steps done.
    pub step: u32,
    /// Loss of the last picture.
    pub loss: f64,
}

/// Moves the cloud's parameters through `schedule`, one picture a step, and reports each step. Fails
/// where a picture cannot be read back.
pub fn descend(
    cloud: &mut Cloud,
    problem: &Problem<'_>,
    schedule: &Schedule,
    random: &mut Random,
    mut report: impl FnMut(Progress),
) -> Result<()> {
    if problem.views.is_empty() || cloud.is_empty() {
        return Ok(());
    }
    let mut moments = vec![Moments::default(); cloud.len()];
    // Steps of positions stay those of the first spacing: scales that grow must not run away.
    let sigmas: Vec<f32> =
        cloud.gaussians.iter().map(|g| standard_deviation(&g.parameters)).collect();
    let mut ssim = SsimWorkspace::default();
    let mut by_pixels = Vec::new();
    let (mut scratch, mut truth) = (Scratch::default(), Picture::default());
    let mut order: Vec<usize> = Vec::new();
    for step in 0..schedule.steps {
        if order.is_empty() {
            order = (0..problem.views.len()).collect();
            random.shuffle(&mut order);
        }
        let view = &problem.views[order.pop().unwrap_or(0)];
        let prefix = schedule.prefix(cloud.len() as u32, random);
        let stage = &problem.stages[view.stage];
        let background = schedule.background(problem.background, random);
        let forward = draw(cloud, prefix, stage, &view.camera, problem.low_pass, background);
        view.truth.draw(background, 0, &mut scratch, &mut truth)?;
        let region = region(&forward, view.truth.rect(0));
        if region.pixels() == 0 {
            // A flat mesh seen edge-on: nothing to match, nothing drawn.
            report(Progress { step: step + 1, loss: 0.0 });
            continue;
        }
        let loss =
            problem.loss.with_gradient(&forward.picture, &truth, region, &mut ssim, &mut by_pixels);
        let gradients = by_splats(&forward, &by_pixels);
        let mover = Mover {
            view: View::new(&view.camera),
            low_pass: problem.low_pass,
            stage,
            prefix,
            rates: schedule.rates_at(step),
        };
        mover.step(cloud, &mut moments, &sigmas, &forward, &gradients);
        report(Progress { step: step + 1, loss });
    }
    Ok(())
}

fn standard_deviation(p: &Parameters) -> f32 {
    libm::exp2f(0.5 * (p.log2_scale[0] + p.log2_scale[1]))
}

/// Where the two pictures can differ.
fn region(forward: &Forward, truth: Rect) -> Rect {
    if forward.splats.is_empty() {
        return truth;
    }
    let (width, height) = (forward.picture.width, forward.picture.height);
    let all = forward.splats.iter().fold(corners(truth), |[x0, y0, x1, y1], splat| {
        let [a0, b0, a1, b1] = splat.bounds.map(u32::from);
        [x0.min(a0), y0.min(b0), x1.max(a1), y1.max(b1)]
    });
    let [x0, y0, x1, y1] = [all[0], all[1], all[2].min(width), all[3].min(height)];
    // A view may see nothing at all: a flat sheet from its side.
    if x0 >= x1 || y0 >= y1 {
        return Rect { x: 0, y: 0, width: 0, height: 0 };
    }
    Rect { x: x0, y: y0, width: x1 - x0, height: y1 - y0 }
}

fn corners(rect: Rect) -> [u32; 4] {
    if rect.width == 0 || rect.height == 0 {
        return [u32::MAX, u32::MAX, 0, 0];
    }
    [rect.x, rect.y, rect.x + rect.width, rect.y + rect.height]
}

/// One step of all Gaussians that were drawn.
struct Mover<'a> {
    view: View<f32>,
    low_pass: LowPass,
    stage: &'a Stage,
    prefix: Prefix,
    rates: Rates,
}

impl Mover<'_> {
    fn step(
        &self,
        cloud: &mut Cloud,
        moments: &mut [Moments],
        sigmas: &[f32],
        forward: &Forward,
        gradients: &[SplatGradient],
    ) {
        let chunks = cloud.gaussians.par_chunks_mut(CHUNK).zip(moments.par_chunks_mut(CHUNK));
        chunks.enumerate().for_each(|(chunk, (gaussians, moments))| {
            let first = chunk * CHUNK;
            // Splats stand in the order of their Gaussians.
            let from = forward.sources.partition_point(|&source| (source as usize) < first);
            let to = forward
                .sources
                .partition_point(|&source| (source as usize) < first + gaussians.len());
            for (&source, gradient) in forward.sources[from..to].iter().zip(&gradients[from..to]) {
                let at = source as usize - first;
                self.step_one(
                    &mut gaussians[at],
                    &mut moments[at],
                    sigmas[source as usize],
                    gradient,
                );
            }
        });
    }

    fn step_one(
        &self,
        gaussian: &mut Seed,
        moments: &mut Moments,
        sigma: f32,
        gradient: &SplatGradient,
    ) {
        if gaussian.freedom == Freedom::Fixed {
            return;
        }
        let Some(frame) = &self.stage.frames[gaussian.triangle as usize] else { return };
        let mut gradient = by_parameters(
            &self.view,
            self.low_pass,
            frame,
            &gaussian.parameters,
            self.prefix.log2_scale,
            gradient,
        )
        .to_array();
        if gaussian.freedom == Freedom::Anchored {
            gradient[..3].fill(0.0);
        }
        if gradient.iter().all(|g| g.is_finite()) {
            moments.step(&mut gaussian.parameters, &gradient, &self.rates, sigma);
        }
    }
}
