//! Merged Gaussians match renders of all, level by level.

use anyhow::Result;
use dermis_format::LowPass;

use super::super::assembly::{Assembly, Levels};
use super::Coarsening;
use super::views::Poses;
use crate::metrics::ssim::SsimWorkspace;
use crate::optimize::adam::Rates;
use crate::optimize::backward::by_splats;
use crate::optimize::cloud::Freedom;
use crate::optimize::descend::region;
use crate::optimize::fulls::{Fulls, Motion, Mover};
use crate::optimize::loss::Loss;
use crate::optimize::schedule::{Prefixes, Random, Schedule};
use crate::picture::Picture;
use crate::progress;
use crate::truth::{Scratch, TrainingView};

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

    /// Trains each level, and puts them before what was there.
    pub(super) fn train(
        &mut self,
        mut assembly: Assembly,
        levels: Vec<Fulls>,
        options: &Coarsening,
    ) -> Result<Assembly> {
        let mut whole = Levels::default();
        let mut coarse = Fulls::default();
        let count = levels.len();
        let bar = progress::bar("training", u64::from(options.steps));
        for (index, mut level) in levels.into_iter().enumerate() {
            // Twice the steps for each finer level.
            let parts = (1u32 << count) - 1;
            let steps = (u64::from(options.steps) << index) / u64::from(parts);
            self.descend(&mut level, steps.max(1) as u32, &bar)?;
            whole.layers.push(level.len() as u32);
            for _ in 0..level.len() {
                whole.later_opacities.push(vec![0.0; count - index]);
            }
            coarse.gaussians.append(&mut level.gaussians);
            coarse.triangles.append(&mut level.triangles);
            coarse.harmonics.append(&mut level.harmonics);
        }
        bar.finish_and_clear();
        let splats = &mut assembly.splats;
        whole.layers.push(splats.gaussians.len() as u32);
        whole.later_opacities.resize(coarse.len() + splats.gaussians.len(), Vec::new());
        splats.gaussians.splice(0..0, coarse.gaussians);
        splats.harmonics.splice(0..0, coarse.harmonics);
        if let Some(mount) = &mut assembly.mount {
            mount.triangles.splice(0..0, coarse.triangles);
        }
        assembly.levels = Some(whole);
        Ok(assembly)
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
        let loss = Loss::default();
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
                bound: (0, Freedom::Free),
            };
            mover.advance(level, &mut motion, &forward, &gradients);
        }
        Ok(())
    }
}
