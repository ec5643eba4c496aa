//! Merged Gaussians match renders of all, level by level.

use anyhow::Result;
use dermis_format::LowPass;

use super::views::Poses;
use crate::metrics::ssim::SsimWorkspace;
use crate::optimize::adam::Rates;
use crate::optimize::backward::by_splats;
use crate::optimize::descend::region;
use crate::optimize::fulls::{Fulls, Motion, Mover};
use crate::optimize::loss::Loss;
use crate::optimize::residual::by_drawn;
use crate::optimize::schedule::{Prefixes, Random, Schedule};
use crate::picture::Picture;
use crate::progress;
use crate::truth::{Scratch, TrainingView};

/// What levels are trained on.
pub(super) struct Trainer<'a> {
    poses: &'a Poses,
    views: &'a [TrainingView],
    low_pass: LowPass,
    random: Random,
}

impl<'a> Trainer<'a> {
    pub(super) fn new(
        poses: &'a Poses,
        views: &'a [TrainingView],
        low_pass: LowPass,
        random: Random,
    ) -> Self {
        Self { poses, views, low_pass, random }
    }

    /// Trains each level, from coarse to fine.
    pub(super) fn train(&mut self, levels: &mut [Fulls], steps: u32) -> Result<()> {
        let bar = progress::bar("training", u64::from(steps));
        // Twice the steps for each finer level.
        let parts = (1u64 << levels.len()) - 1;
        for (index, level) in levels.iter_mut().enumerate() {
            let steps = (u64::from(steps) << index) / parts;
            self.descend(level, steps.max(1) as u32, &bar)?;
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// What is left of the squared error, shared out to the Gaussians of a level.
    pub(super) fn residuals(&self, level: &Fulls) -> Result<Vec<f64>> {
        let mut sums = vec![0.0; level.len()];
        let (mut truth, mut reading) = (Picture::default(), Scratch::default());
        let mut squares = Vec::new();
        let background = [1.0; 3];
        for view in self.views {
            let stage = &self.poses.stages[view.stage];
            let forward = level.draw(stage, &view.camera, self.low_pass, background);
            view.truth.draw(background, 0, &mut reading, &mut truth)?;
            let shares = by_drawn(&forward, &truth, &mut squares);
            for (&source, share) in forward.sources.iter().zip(shares) {
                sums[source as usize] += f64::from(share);
            }
        }
        Ok(sums)
    }

    fn descend(
        &mut self,
        level: &mut Fulls,
        steps: u32,
        bar: &indicatif::ProgressBar,
    ) -> Result<()> {
        let schedule = Schedule {
            steps,
            rates: Rates::default(),
            last_rate: 0.1,
            prefixes: Prefixes::All,
            shift: 0,
            warm_up: 0.0,
            finish: 0.0,
            max_loss_db: 0.0,
            random_background: 0.3,
        };
        let mut motion = Motion::new(level);
        let (mut truth, mut reading) = (Picture::default(), Scratch::default());
        let (mut ssim, mut by_pixels) = (SsimWorkspace::default(), Vec::new());
        let mut order: Vec<usize> = Vec::new();
        // Structural dissimilarity takes a quarter of a step's time, and gains nothing here.
        let loss = Loss { dssim: 0.0, ..Loss::default() };
        for step in 0..steps {
            if order.is_empty() {
                order = (0..self.views.len()).collect();
                self.random.shuffle(&mut order);
            }
            let view = &self.views[order.pop().unwrap_or(0)];
            let background = schedule.background([1.0; 3], &mut self.random);
            let stage = &self.poses.stages[view.stage];
            let forward = level.draw(stage, &view.camera, self.low_pass, background);
            bar.inc(1);
            let region = region(&forward, view.truth.rect(0));
            if region.pixels() == 0 {
                continue;
            }
            view.truth.draw(background, 0, &mut reading, &mut truth)?;
            let compared =
                loss.with_gradient(&forward.picture, &truth, region, &mut ssim, &mut by_pixels);
            let psnr = -10.0 * compared.mse.max(1e-10).log10();
            bar.set_prefix(format!("{psnr:.1} dB, {} Gaussians", level.len()));
            let gradients = by_splats(&forward, &by_pixels);
            let mover = Mover {
                camera: &view.camera,
                low_pass: self.low_pass,
                stage,
                rates: schedule.rates_at(step),
            };
            mover.advance(level, &mut motion, &forward, &gradients);
        }
        Ok(())
    }
}
