//! Gradient descent over pictures.

use std::borrow::Cow;
use std::time::Instant;

use anyhow::Result;
use dermis_format::LowPass;
use dermis_runtime::Camera;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::adam::Moments;
use super::backward::{SplatGradient, by_splats};
use super::cloud::{Cloud, Parameters, Prefix};
use super::forward::{Forward, Stage, draw};
use super::loss::{Compared, Loss};
use super::mover::{Motion, Mover};
use super::precision::Precision;
use super::price;
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
    /// What a blend in each pixel of the frame adds to it.
    pub blend_price: f32,
}

impl<'a> Problem<'a> {
    /// At most so many of its views, evenly chosen.
    pub fn some_views(&self, most: usize) -> impl Iterator<Item = &'a TrainingView> + use<'a> {
        self.views.iter().step_by(self.views.len().div_ceil(most).max(1))
    }
}

/// Pictures that are drawn at once, each with its way back. Their steps follow one another, so that of a pair the
/// second one's gradient is one step old; but while pictures have serial parts, threads have work.
const AT_ONCE: usize = 2;

/// The clouds of all regions on their way down.
#[derive(Debug)]
pub struct Descent<'a> {
    problem: &'a Problem<'a>,
    schedule: &'a Schedule,
    clouds: Vec<Cloud>,
    motions: Vec<Motion>,
    random: Random,
    /// Views that this round has not seen yet, the next one last: of each kind of steps ([`kind`]), so that a level sees all
    /// views equally often, however seldom it is drawn.
    orders: Vec<Vec<usize>>,
    step: u32,
    /// Of the file's numbers; chosen when the last steps begin.
    precision: Option<Precision>,
    workspaces: [Workspace; AT_ONCE],
}

/// What a few steps were like.
#[derive(Clone, Copy, Debug, Default)]
pub struct Advance {
    /// Steps.
    pub steps: u32,
    /// Means over their pictures.
    pub compared: Compared,
    /// Time of each part, a sum over the steps.
    pub times: Times,
}

/// Time of the parts of steps, ms. Of steps that run at once each counts in full.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Times {
    /// Rounding in the last steps, projection, lists, blending.
    pub forward: f64,
    /// Reading the truth, and both terms of the loss with their gradient.
    pub loss: f64,
    /// From pixels to splats.
    pub backward: f64,
    /// From splats to parameters, and Adam.
    pub update: f64,
}

/// What steps change: with the clouds, the schedule and the problem that a descent began with, all that it needs to go
/// on. What is fixed by those is not kept twice, and cannot contradict them.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct State<'a> {
    step: u32,
    random: Random,
    /// Empty at the end.
    orders: Cow<'a, [Vec<usize>]>,
    precision: Option<Cow<'a, Precision>>,
    /// Of each region.
    levels: Vec<Cow<'a, [Vec<Parameters>]>>,
    /// Of each region; empty at the end.
    moments: Vec<Cow<'a, [Vec<Moments>]>>,
}

impl State<'_> {
    /// Bytes that it takes, roughly.
    pub fn bytes(&self) -> usize {
        let of_orders = 2 * self.orders.iter().map(Vec::len).sum::<usize>();
        of_orders + bytes(&self.levels) + bytes(&self.moments)
    }
}

impl<'a> Descent<'a> {
    /// Before the first step.
    pub fn new(
        clouds: Vec<Cloud>,
        problem: &'a Problem<'a>,
        schedule: &'a Schedule,
        random: Random,
    ) -> Self {
        Self {
            problem,
            schedule,
            motions: clouds.iter().map(Motion::new).collect(),
            orders: vec![Vec::new(); kinds(&clouds)],
            clouds,
            random,
            step: 0,
            precision: None,
            workspaces: Default::default(),
        }
    }

    /// Steps done.
    pub fn step(&self) -> u32 {
        self.step
    }

    /// Whether the schedule is done, or there is nothing to do.
    pub fn is_done(&self) -> bool {
        self.step >= self.schedule.steps
            || self.problem.views.is_empty()
            || self.clouds.iter().all(Cloud::is_empty)
    }

    /// The clouds as they are, the numbers that come next, and how exact the last steps drew them, if there were such.
    pub fn finish(self) -> (Vec<Cloud>, Random, Option<Precision>) {
        (self.clouds, self.random, self.precision)
    }

    /// Where it is.
    pub fn state(&self) -> State<'_> {
        // Who is done moves no more.
        let (orders, motions) =
            if self.is_done() { Default::default() } else { (&self.orders[..], &self.motions[..]) };
        State {
            step: self.step,
            random: self.random.clone(),
            orders: orders.into(),
            precision: self.precision.as_ref().map(Cow::Borrowed),
            levels: self.clouds.iter().map(|cloud| cloud.levels[..].into()).collect(),
            moments: motions.iter().map(|motion| motion.moments[..].into()).collect(),
        }
    }

    /// Goes on from a state of the same descent. Returns whether it can be one; where not, the descent is of no use
    /// any more.
    #[must_use]
    pub fn restore(&mut self, state: State<'_>) -> bool {
        self.step = state.step;
        let views = self.problem.views.len();
        let fits = state.step <= self.schedule.steps
            && state.orders.iter().flatten().all(|&view| view < views)
            && (self.is_done() || state.orders.len() == self.orders.len())
            && same_lengths(&state.levels, self.clouds.iter().map(|cloud| &cloud.levels))
            && (self.is_done()
                || same_lengths(&state.moments, self.motions.iter().map(|motion| &motion.moments)));
        self.random = state.random;
        self.orders = state.orders.into_owned();
        self.precision = state.precision.map(Cow::into_owned);
        for (cloud, levels) in self.clouds.iter_mut().zip(state.levels) {
            cloud.levels = levels.into_owned();
        }
        for (motion, moments) in self.motions.iter_mut().zip(state.moments) {
            motion.moments = moments.into_owned();
        }
        fits
    }

    /// Takes the next steps, one picture each: draws a few pictures, then moves the clouds against the gradient of
    /// each one's loss. It fails where a picture cannot be read, and in the last steps where a number is not finite.
    pub fn advance(&mut self) -> Result<Advance> {
        let steps = (self.schedule.steps - self.step).min(AT_ONCE as u32);
        let finishes = self.schedule.finishes_at(self.step);
        let shots: Vec<Shot<'_>> = (0..steps).map(|_| self.next_shot()).collect();
        let start = Instant::now();
        let stored = if finishes { Some(self.stored(&shots)?) } else { None };
        let (clouds, problem) = (stored.as_ref().unwrap_or(&self.clouds), self.problem);
        let mut advance = Advance { steps, ..Advance::default() };
        advance.times.forward += milliseconds(start);
        let passes = shots.par_iter().zip(&mut self.workspaces).with_max_len(1);
        let passes: Vec<Pass> = passes
            .map(|(shot, workspace)| shot.pass(clouds, problem, workspace))
            .collect::<Result<_>>()?;
        for (shot, pass) in shots.iter().zip(&passes) {
            let start = Instant::now();
            let Pass { forward, gradients, .. } = pass;
            let regions = self.clouds.iter_mut().zip(&mut self.motions);
            let drawn = shot.prefixes.iter().zip(&forward.regions);
            for (region, ((cloud, motion), (&prefix, drawn))) in regions.zip(drawn).enumerate() {
                let rates = self.schedule.rates_of_levels(shot.step, cloud);
                let mover = Mover {
                    camera: &shot.camera,
                    low_pass: problem.low_pass,
                    stage: &problem.stages[shot.view.stage],
                    prefix,
                    stored: stored.as_ref().map(|stored| &stored[region]),
                    drawn: drawn.clone(),
                    rates: &rates,
                };
                mover.advance(cloud, motion, forward, gradients);
            }
            advance.times.update += milliseconds(start);
            advance.times.forward += pass.times.forward;
            advance.times.loss += pass.times.loss;
            advance.times.backward += pass.times.backward;
            advance.compared.loss += pass.compared.loss / f64::from(steps);
            advance.compared.mse += pass.compared.mse / f64::from(steps);
        }
        Ok(advance)
    }

    /// The clouds as a file would hold them, as far as `shots` see them.
    fn stored(&mut self, shots: &[Shot<'_>]) -> Result<Vec<Cloud>> {
        let precision = match &self.precision {
            Some(precision) => precision,
            None => {
                let moments: Vec<_> =
                    self.motions.iter().map(|motion| &motion.moments[..]).collect();
                let (clouds, problem) = (&self.clouds, self.problem);
                let max_loss_db = self.schedule.max_loss_db;
                self.precision.insert(Precision::choose(clouds, &moments, problem, max_loss_db)?)
            }
        };
        let drawn: Vec<&[Prefix]> = shots.iter().map(|shot| &shot.prefixes[..]).collect();
        precision.stored_as_drawn(&self.clouds, &drawn)
    }

    /// What the next step draws.
    fn next_shot(&mut self) -> Shot<'a> {
        let Self { problem, schedule, clouds, random, .. } = self;
        let prefixes = schedule.prefixes(clouds, random);
        let order = &mut self.orders[kind(&prefixes, clouds)];
        if order.is_empty() {
            *order = (0..problem.views.len()).collect();
            random.shuffle(order);
        }
        let view = &problem.views[order.pop().unwrap_or(0)];
        let background = schedule.background(problem.background, random);
        let shift = schedule.shift_at(self.step, clouds, &prefixes, random);
        let step = self.step;
        self.step += 1;
        Shot { step, view, camera: scaled(&view.camera, shift), prefixes, background, shift }
    }
}

/// Kinds of steps on such clouds.
fn kinds(clouds: &[Cloud]) -> usize {
    2 * clouds.iter().map(|cloud| cloud.levels.len()).max().unwrap_or(0).max(1)
}

/// Which level a step reaches, and whether it draws whole levels only.
fn kind(prefixes: &[Prefix], clouds: &[Cloud]) -> usize {
    let level = prefixes.iter().map(|prefix| prefix.level).max().unwrap_or(0);
    let whole = prefixes.iter().zip(clouds).all(|(prefix, cloud)| prefix.is_level_of(cloud));
    2 * level + usize::from(whole)
}

/// What a step draws.
struct Shot<'a> {
    step: u32,
    view: &'a TrainingView,
    camera: Camera,
    prefixes: Vec<Prefix>,
    background: [f32; 3],
    shift: u32,
}

/// Memory that steps share.
#[derive(Debug, Default)]
struct Workspace {
    truth: Picture,
    reading: Scratch,
    ssim: SsimWorkspace,
    by_pixels: Vec<[f32; 3]>,
}

/// A picture, and the gradient by its splats.
#[derive(Default)]
struct Pass {
    forward: Forward,
    gradients: Vec<SplatGradient>,
    compared: Compared,
    times: Times,
}

impl Shot<'_> {
    fn pass(
        &self,
        clouds: &[Cloud],
        problem: &Problem<'_>,
        workspace: &mut Workspace,
    ) -> Result<Pass> {
        let start = Instant::now();
        let (view, background) = (self.view, self.background);
        let (stage, low_pass) = (&problem.stages[view.stage], problem.low_pass);
        let forward = draw(clouds, &self.prefixes, stage, &self.camera, low_pass, background);
        let drawn = milliseconds(start);
        let region = region(&forward, view.truth.rect(self.shift));
        if region.pixels() == 0 {
            // A flat mesh seen edge-on: nothing to match, nothing drawn.
            return Ok(Pass::default());
        }
        let Workspace { truth, reading, ssim, by_pixels } = workspace;
        view.truth.draw(background, self.shift, reading, truth)?;
        let compared = problem.loss.with_gradient(&forward.picture, truth, region, ssim, by_pixels);
        let matched = milliseconds(start);
        let mut gradients = by_splats(&forward, by_pixels);
        if problem.blend_price > 0.0 {
            let price = problem.blend_price / forward.picture.rgb.len() as f32;
            price::add_gradient(price, &forward.splats, &mut gradients);
        }
        let backward = milliseconds(start) - matched;
        let times = Times { forward: drawn, loss: matched - drawn, backward, update: 0.0 };
        Ok(Pass { forward, gradients, compared, times })
    }
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

/// Bytes of all levels of all regions.
fn bytes<T: Clone>(regions: &[Cow<'_, [Vec<T>]>]) -> usize {
    regions.iter().flat_map(|levels| levels.iter()).map(|level| size_of_val(&level[..])).sum()
}

/// Whether there are as many regions, of as many levels, of as many Gaussians.
fn same_lengths<'a, T: Clone + 'a>(
    these: &[Cow<'_, [Vec<T>]>],
    those: impl Iterator<Item = &'a Vec<Vec<T>>>,
) -> bool {
    let lengths = |levels: &[Vec<T>]| levels.iter().map(Vec::len).collect::<Vec<_>>();
    these.iter().map(|levels| lengths(levels)).eq(those.map(|levels| lengths(levels)))
}

/// Where the two pictures can differ.
pub(crate) fn region(forward: &Forward, truth: Rect) -> Rect {
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
