//! Gradient descent over pictures.

use std::borrow::Cow;

use anyhow::Result;
use dermis_format::LowPass;
use dermis_runtime::plan::prefix_log2_scale;
use serde::{Deserialize, Serialize};

use super::adam::Moments;
use super::backward::by_splats;
use super::cloud::{Cloud, Parameters};
use super::forward::{Forward, Stage, draw};
use super::loss::Loss;
use super::mover::Mover;
use super::schedule::{Random, Schedule};
use crate::metrics::Rect;
use crate::metrics::ssim::SsimWorkspace;
use crate::picture::Picture;
use crate::truth::{Scratch, TrainingView, scaled};

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

/// A part of a step, whose time may be of interest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Drawing the picture.
    Forward,
    /// Comparing it with the truth.
    Loss,
    /// Taking the gradient from pixels to splats.
    Backward,
    /// Taking it to parameters, and moving them.
    Move,
}

/// A cloud on its way down.
#[derive(Debug)]
pub struct Descent<'a> {
    problem: &'a Problem<'a>,
    schedule: &'a Schedule,
    cloud: Cloud,
    /// Of each Gaussian at each level.
    moments: Vec<Vec<Moments>>,
    /// Steps of positions stay those of the first spacing: scales that grow must not run away.
    sigmas: Vec<Vec<f32>>,
    random: Random,
    /// Views that this round has not seen yet, the next one last.
    order: Vec<usize>,
    step: u32,
    workspace: Workspace,
}

/// What steps change: with the cloud, the schedule and the problem that a descent began with, all that it needs to go
/// on. What is fixed by those is not kept twice, and cannot contradict them.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct State<'a> {
    step: u32,
    random: Random,
    /// Empty at the end.
    order: Cow<'a, [usize]>,
    levels: Cow<'a, [Vec<Parameters>]>,
    /// Empty at the end.
    moments: Cow<'a, [Vec<Moments>]>,
}

impl State<'_> {
    /// Bytes that it takes, roughly.
    pub fn bytes(&self) -> usize {
        let of_order = 2 * self.order.len();
        of_order
            + self.levels.iter().map(|level| size_of_val(&level[..])).sum::<usize>()
            + self.moments.iter().map(|level| size_of_val(&level[..])).sum::<usize>()
    }
}

/// Memory that steps share.
#[derive(Debug, Default)]
struct Workspace {
    truth: Picture,
    reading: Scratch,
    ssim: SsimWorkspace,
    by_pixels: Vec<[f32; 3]>,
}

impl<'a> Descent<'a> {
    /// Before the first step.
    pub fn new(
        cloud: Cloud,
        problem: &'a Problem<'a>,
        schedule: &'a Schedule,
        random: Random,
    ) -> Self {
        let of_each = |level: &Vec<Parameters>| vec![Moments::default(); level.len()];
        let moments = cloud.levels.iter().map(of_each).collect();
        let sigma = |p: &Parameters| libm::exp2f(0.5 * (p.log2_scale[0] + p.log2_scale[1]));
        let sigmas = cloud.levels.iter().map(|level| level.iter().map(sigma).collect()).collect();
        Self {
            problem,
            schedule,
            cloud,
            moments,
            sigmas,
            random,
            order: Vec::new(),
            step: 0,
            workspace: Workspace::default(),
        }
    }

    /// Steps done.
    pub fn step(&self) -> u32 {
        self.step
    }

    /// Whether the schedule is done, or there is nothing to do.
    pub fn is_done(&self) -> bool {
        self.step >= self.schedule.steps || self.problem.views.is_empty() || self.cloud.is_empty()
    }

    /// From here on each level goes its own way, with the momentum of all.
    fn split_into_levels(&mut self) {
        self.cloud.split_into_levels(|[count, all]| prefix_log2_scale(count, all));
        let of_level = |level: &Vec<Parameters>| self.moments[0][..level.len()].to_vec();
        self.moments = self.cloud.levels.iter().map(of_level).collect();
        let len = self.cloud.len();
        let of_level = |level: &Vec<Parameters>| {
            let wider = (len as f32 / level.len() as f32).sqrt();
            self.sigmas[0][..level.len()].iter().map(|sigma| sigma * wider).collect()
        };
        self.sigmas = self.cloud.levels.iter().map(of_level).collect();
    }

    /// The cloud as it is, and the numbers that come next.
    pub fn finish(self) -> (Cloud, Random) {
        (self.cloud, self.random)
    }

    /// Where it is.
    pub fn state(&self) -> State<'_> {
        // Who is done moves no more.
        let (order, moments) =
            if self.is_done() { Default::default() } else { (&self.order[..], &self.moments[..]) };
        State {
            step: self.step,
            random: self.random.clone(),
            order: order.into(),
            levels: self.cloud.levels[..].into(),
            moments: moments.into(),
        }
    }

    /// Goes on from a state of the same descent. Returns whether it can be one; where not, the descent is of no use
    /// any more.
    #[must_use]
    pub fn restore(&mut self, state: State<'_>) -> bool {
        if self.schedule.split.is_some_and(|split| split < state.step) {
            self.split_into_levels();
        }
        self.step = state.step;
        let views = self.problem.views.len();
        let fits = state.step <= self.schedule.steps
            && state.order.iter().all(|&view| view < views)
            && same_lengths(&state.levels, &self.cloud.levels)
            && (self.is_done() || same_lengths(&state.moments, &self.moments));
        self.random = state.random;
        self.order = state.order.into_owned();
        self.cloud.levels = state.levels.into_owned();
        self.moments = state.moments.into_owned();
        fits
    }

    /// Moves the cloud against the gradient of one picture's loss, which it returns; calls `lap` behind
    /// each part. It fails where a picture cannot be read.
    pub fn advance(&mut self, mut lap: impl FnMut(Part)) -> Result<f64> {
        if self.schedule.split == Some(self.step) {
            self.split_into_levels();
        }
        let Self { problem, schedule, cloud, random, workspace, .. } = self;
        if self.order.is_empty() {
            self.order = (0..problem.views.len()).collect();
            random.shuffle(&mut self.order);
        }
        let view = &problem.views[self.order.pop().unwrap_or(0)];
        let prefix = schedule.prefix(cloud, random);
        let stage = &problem.stages[view.stage];
        let background = schedule.background(problem.background, random);
        let rates = schedule.rates_at(self.step);
        self.step += 1;
        let camera = scaled(&view.camera, schedule.shift);
        let forward = draw(cloud, prefix, stage, &camera, problem.low_pass, background);
        lap(Part::Forward);
        let region = region(&forward, view.truth.rect(schedule.shift));
        if region.pixels() == 0 {
            // A flat mesh seen edge-on: nothing to match, nothing drawn.
            return Ok(0.0);
        }
        let Workspace { truth, reading, ssim, by_pixels } = workspace;
        view.truth.draw(background, schedule.shift, reading, truth)?;
        let loss = problem.loss.with_gradient(&forward.picture, truth, region, ssim, by_pixels);
        lap(Part::Loss);
        let gradients = by_splats(&forward, by_pixels);
        lap(Part::Backward);
        let mover = Mover { camera: &camera, low_pass: problem.low_pass, stage, prefix, rates };
        mover.advance(cloud, &mut self.moments, &self.sigmas, &forward, &gradients);
        lap(Part::Move);
        Ok(loss)
    }
}

fn same_lengths<A, B>(these: &[Vec<A>], those: &[Vec<B>]) -> bool {
    these.iter().map(Vec::len).eq(those.iter().map(Vec::len))
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
