//! From the gradient by splats to a step of the parameters they came from.

use std::iter::repeat_with;
use std::ops::Range;

use dermis_format::{Disc, LowPass};
use dermis_runtime::Camera;
use dermis_runtime::mix::{is_odd, quarters};
use dermis_runtime::project::View;
use rayon::prelude::*;

use super::adam::{Moments, Rates};
use super::backward::SplatGradient;
use super::cloud::{Cloud, Freedom, Parameters, Prefix};
use super::discs::{BATCH, ByDiscs};
use super::forward::{Forward, Stage};
use crate::widest::widest;

/// Gaussians that one task moves.
const CHUNK: usize = 2048;

/// A step of what a shape shares with the level before, by a picture of the shape, to one by a picture of that level: at 1 that
/// level loses half a dB, at 0.3 the whole set loses a third of one (notes/training.md).
const PULL: f32 = 0.6;

/// One step of all Gaussians of a region that were drawn.
#[derive(Clone, Debug)]
pub struct Mover<'a> {
    /// Who looked.
    pub camera: &'a Camera,
    /// How the low-pass acted.
    pub low_pass: LowPass,
    /// The pose.
    pub stage: &'a Stage,
    /// What was drawn of the region.
    pub prefix: Prefix,
    /// The cloud as it was drawn, where that is not as it is: as a file would hold it.
    pub stored: Option<&'a Cloud>,
    /// Splats of it.
    pub drawn: Range<usize>,
    /// How far to go, level by level.
    pub rates: &'a [Rates],
}

/// How the Gaussians of a region move.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Of each Gaussian at each level.
    pub moments: Vec<Vec<Moments>>,
    /// Steps of positions stay those of the first spacing: scales that grow must not run away.
    sigmas: Vec<Vec<f32>>,
}

impl Motion {
    /// At rest.
    pub fn new(cloud: &Cloud) -> Self {
        let of_each = |level: &Vec<Parameters>| vec![Moments::default(); level.len()];
        let sigma = |p: &Parameters| libm::exp2f(0.5 * (p.log2_scale[0] + p.log2_scale[1]));
        Self {
            moments: cloud.levels.iter().map(of_each).collect(),
            sigmas: cloud.levels.iter().map(|level| level.iter().map(sigma).collect()).collect(),
        }
    }
}

/// Neighbours in the cloud, at one level.
struct Neighbours<'a> {
    rates: &'a Rates,
    parameters: &'a mut [Parameters],
    moments: &'a mut [Moments],
    sigmas: &'a [f32],
}

/// The same neighbours at the level of a picture, and at those beside it that move with it.
struct Around<'a> {
    here: Neighbours<'a>,
    below: Option<Neighbours<'a>>,
    /// A shape of `here`.
    above: Option<Neighbours<'a>>,
    /// Whether `here` is a shape of `below`.
    is_shape: bool,
}

impl Mover<'_> {
    /// Moves the Gaussians of `forward` that are of the region, given the gradients by all of its splats.
    pub fn advance(
        &self,
        cloud: &mut Cloud,
        motion: &mut Motion,
        forward: &Forward,
        gradients: &[SplatGradient],
    ) {
        let is_shape = cloud.base_of(self.prefix.level).is_some();
        let is_base = cloud.base_of(self.prefix.level + 1).is_some();
        let Cloud { levels, freedoms, triangles, .. } = cloud;
        let Motion { moments, sigmas } = motion;
        let by_discs = ByDiscs {
            view: View::new(self.camera),
            low_pass: self.low_pass,
            stage: self.stage,
            triangles,
            forward,
            gradients,
        };
        let levels = levels.iter_mut().zip(moments).zip(sigmas).zip(self.rates);
        let mut levels = levels.map(|(((parameters, moments), sigmas), rates)| {
            let chunks = parameters.chunks_mut(CHUNK).zip(moments.chunks_mut(CHUNK));
            chunks.zip(sigmas.chunks(CHUNK)).map(|((parameters, moments), sigmas)| Neighbours {
                rates,
                parameters,
                moments,
                sigmas,
            })
        });
        let below = self.prefix.level.checked_sub(1).and_then(|below| levels.nth(below));
        let Some(level) = levels.next() else { return };
        // The level below holds the first ones only.
        let below =
            below.filter(|_| is_shape || self.prefix.lower_share > 0.0).into_iter().flatten();
        let above = levels.next().filter(|_| is_base).into_iter().flatten();
        let below = below.map(Some).chain(repeat_with(|| None));
        let above = above.map(Some).chain(repeat_with(|| None));
        let tasks = level.zip(below.zip(above)).map(|(here, (below, above))| Around {
            here,
            below,
            above,
            is_shape,
        });
        let tasks: Vec<_> = tasks.collect();
        let sources = &forward.sources[self.drawn.clone()];
        tasks.into_par_iter().enumerate().for_each(|(chunk, mut around)| {
            let first = chunk * CHUNK;
            let place = |index| {
                self.drawn.start + sources.partition_point(|&source| (source as usize) < index)
            };
            let drawn = place(first)..place(first + around.here.parameters.len());
            for start in drawn.clone().step_by(BATCH) {
                let drawn = start..drawn.end.min(start + BATCH);
                let discs = by_discs.of(drawn.clone());
                let moves = drawn.zip(&discs);
                widest(
                    #[inline(always)]
                    || self.step_all(moves, forward, first, freedoms, &mut around),
                );
            }
        });
    }

    /// Moves neighbours, of which the first is Gaussian `first`, at the level of the picture and, where they are
    /// there, at the one below; what a shape shares is the same at both of its levels before and after.
    #[inline(always)]
    fn step_all<'d>(
        &self,
        moves: impl Iterator<Item = (usize, &'d Disc)>,
        forward: &Forward,
        first: usize,
        freedoms: &[Freedom],
        around: &mut Around<'_>,
    ) {
        let share = self.prefix.lower_share;
        let Around { here, below, above, is_shape } = around;
        for (drawn, by) in moves {
            let index = forward.sources[drawn] as usize;
            let (at, freedom) = (index - first, freedoms[index]);
            let drawn_here = self.drawn_angle(self.prefix.level, index, here.parameters[at].angle);
            let by_here = &exchanged(by, [drawn_here, here.parameters[at].angle]);
            if let Some(below) = below.as_mut().filter(|below| at < below.parameters.len()) {
                let before = here.parameters[at];
                let own = below.parameters[at].angle;
                let drawn_below = self.drawn_angle(self.prefix.level - 1, index, own);
                self.step(here, at, by_here, 1.0 - share, freedom);
                if *is_shape {
                    below.parameters[at].pull([&before, &here.parameters[at]], PULL);
                }
                if share > 0.0 {
                    let by_drawn = exchanged(by, [drawn_here, drawn_below]);
                    let by_below = exchanged(&by_drawn, [drawn_below, own]);
                    self.step(below, at, &by_below, share, freedom);
                }
                if *is_shape {
                    here.parameters[at] = below.parameters[at].shaped(&here.parameters[at]);
                }
            } else {
                self.step(here, at, by_here, 1.0, freedom);
            }
            if let Some(above) = above {
                above.parameters[at] = here.parameters[at].shaped(&above.parameters[at]);
            }
        }
    }

    /// The angle by which Gaussian `index` was drawn at a level, where it has `own`.
    #[inline(always)]
    fn drawn_angle(&self, level: usize, index: usize, own: f32) -> f32 {
        self.stored.map_or(own, |stored| stored.levels[level][index].angle)
    }

    /// Moves one Gaussian at one level, of which the disc that was drawn took `share`.
    #[inline(always)]
    fn step(&self, all: &mut Neighbours<'_>, at: usize, by: &Disc, share: f32, freedom: Freedom) {
        let parameters = &mut all.parameters[at];
        let gradient = parameters.gradient(by);
        let gradient = match freedom {
            Freedom::Free => gradient,
            Freedom::Anchored => Parameters { position: [0.0; 3], ..gradient },
            Freedom::Opacity => Parameters { logit: gradient.logit, ..Parameters::default() },
            Freedom::Fixed => return,
        };
        let gradient = gradient.to_array().map(|g| share * g);
        if gradient.iter().all(|g| g.is_finite()) {
            all.moments[at].step(parameters, &gradient, all.rates, all.sigmas[at]);
            if freedom == Freedom::Free {
                parameters.flatten(all.rates.flatten_step * all.sigmas[at]);
            }
        }
    }
}

/// The gradient by a disc of one angle as that by the same disc of another, some quarter turns on.
#[inline(always)]
fn exchanged(by: &Disc, [from, to]: [f32; 2]) -> Disc {
    if is_odd(quarters(from, to)) { by.exchanged() } else { *by }
}
