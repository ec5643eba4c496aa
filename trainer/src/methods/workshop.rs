//! What all methods share: the posed mesh, the pictures of it, placement and descent.

use core::ops::Range;

use anyhow::{Context, Result, ensure};
use dermis_format::source::{Importance, MeasuredCurves, Source};
use dermis_format::{Avatar, Sample};
use dermis_runtime::{Kernel, Pose, Posed};
use rayon::prelude::*;

use super::culling::{self, Culling};
use super::curves;
use super::parts::Parts;
use super::samples;
use crate::checkpoint::Journal;
use crate::embed::carriers::Carriers;
use crate::embed::density;
use crate::embed::importance;
use crate::embed::initial::seed;
use crate::embed::placement::spread;
use crate::embed::surface::{Surface, SurfacePoint};
use crate::optimize::cloud::{Cloud, Freedom, Seed};
use crate::optimize::descend::{Advance, Descent, Problem};
use crate::optimize::forward::Stage;
use crate::optimize::loss::Compared;
use crate::optimize::mover::Motion;
use crate::optimize::precision::Precision;
use crate::optimize::residual;
use crate::optimize::schedule::{Prefixes, Random, Schedule};
use crate::options::Options;
use crate::package;
use crate::progress;
use crate::scene::{self, KeyFrame, Painter, SideCount};
use crate::train::runtime_pose;
use crate::truth::TrainingView;

/// Density of Gaussians on triangles that no training view sees.
const UNSEEN_WEIGHT: f32 = 0.1;

/// What is to be trained, and by what.
#[derive(Clone, Copy)]
pub struct Setting<'a> {
    /// The mesh as it looks.
    pub painter: &'a Painter<'a>,
    /// Poses of it.
    pub key_frames: &'a [KeyFrame],
    /// Pictures of them.
    pub views: &'a [TrainingView],
    /// How much of each triangle they have seen.
    pub seen: &'a [SideCount],
    /// Parts of the same mesh.
    pub parts: &'a Parts,
    /// How.
    pub options: &'a Options,
}

/// What all methods share.
pub struct Workshop<'a> {
    pub(super) painter: &'a Painter<'a>,
    pub(super) options: &'a Options,
    /// Vertices of each triangle of the surface.
    pub(super) corners: Vec<[u32; 3]>,
    pub(super) surface: Surface,
    /// With the triangles of all coarser meshes.
    with_coarser: Surface,
    /// Triangles of each coarser mesh, from fine to coarse, and of each region.
    coarser: Vec<Vec<Vec<u32>>>,
    /// Wanted density of Gaussians on each triangle, relative to the others.
    pub(super) weights: Vec<f32>,
    pub(super) parts: &'a Parts,
    /// Squared error on each triangle; empty before a survey.
    residuals: Vec<f64>,
    stages: Vec<Stage>,
    views: &'a [TrainingView],
    pub(super) random: Random,
    steps: u32,
    /// What the last descent ended with.
    precision: Option<Precision>,
    journal: Option<&'a mut Journal>,
}

impl<'a> Workshop<'a> {
    /// For the mesh of `source`, with its coarser ones.
    pub fn new(source: &Source, setting: &Setting<'a>) -> Result<Self> {
        let Setting { painter, key_frames, views, seen, parts, options } = *setting;
        // Frames come from the runtime and the encoded mesh: what is trained on is what is drawn on.
        let bytes = package::encode(source)?;
        let avatar = Avatar::parse(&bytes).context("the mesh alone cannot be read back")?;
        let stages = key_frames.par_iter().map(|frame| Stage::of(&avatar, &runtime_pose(frame)));
        let stages = stages.collect::<Result<Vec<_>>>()?;
        let mut scratch = vec![0; Posed::scratch_len(&avatar)];
        let rest = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut scratch)?;
        let mut corners = source.mesh.triangles.clone();
        let with_coarser = Surface::new(source.mathematics.frame, rest.vertices(), &corners);
        let of_regions = |mesh: Range<u32>| -> Vec<Vec<u32>> {
            let own = |region: usize| {
                let is_own = |&t: &u32| usize::from(avatar.triangle_region(t as usize)) == region;
                mesh.clone().filter(is_own).collect()
            };
            (0..parts.regions.len()).map(own).collect()
        };
        let coarser = avatar.mesh_levels().ranges().skip(1).map(of_regions).collect();
        corners.truncate(avatar.mesh_levels().surface() as usize);
        let surface = Surface::new(source.mathematics.frame, rest.vertices(), &corners);
        let is_seen = |count: &SideCount| count.front + count.back > 0;
        let mut weights: Vec<f32> =
            seen.iter().map(|count| if is_seen(count) { 1.0 } else { UNSEEN_WEIGHT }).collect();
        if let Some(selected) = &parts.detail {
            options.detail.thicken(&mut weights, selected);
        }
        let random = Random::new(options.seed);
        Ok(Self {
            painter,
            options,
            corners,
            surface,
            with_coarser,
            coarser,
            weights,
            parts,
            residuals: Vec::new(),
            stages,
            views,
            random,
            steps: 0,
            precision: None,
            journal: None,
        })
    }

    /// Goes on from what a journal holds, and writes down what descents come to.
    pub fn keep(&mut self, journal: &'a mut Journal) {
        self.journal = Some(journal);
    }

    /// Steps taken so far.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// What culling costs the clouds of all regions.
    pub fn culling(&self, clouds: &[Cloud]) -> Result<Culling> {
        culling::measure(clouds, &self.problem())
    }

    /// How exact the file's numbers are: as the last steps of the last descent drew them, if they are of as many layers.
    pub fn precision(&self, clouds: &[Cloud]) -> Result<Precision> {
        let layers = clouds.iter().map(|cloud| cloud.layers.len()).max();
        match &self.precision {
            Some(precision) if layers == Some(precision.widths.len()) => Ok(precision.clone()),
            _ => {
                let motions: Vec<Motion> = clouds.iter().map(Motion::new).collect();
                let moments: Vec<_> = motions.iter().map(|motion| &motion.moments[..]).collect();
                let max_loss_db = self.options.max_loss_db;
                Precision::choose(clouds, &moments, &self.problem(), max_loss_db)
            }
        }
    }

    /// How near the picture of each level is to the mesh, for clouds as the file holds them ([`Precision::stored`]).
    pub fn curves(&self, stored: &[Cloud]) -> Result<MeasuredCurves> {
        let kind = self.options.method.mathematics().frame;
        curves::measure(stored, &self.problem(), kind, &self.parts.regions)
    }

    /// Which triangles stand for the others, for the same clouds.
    pub fn samples(&self, stored: &[Cloud]) -> Vec<Sample> {
        let kind = self.options.method.mathematics().frame;
        samples::choose(stored, &self.problem(), kind, &self.parts.regions)
    }

    /// How much each region matters, which moves in `clips` and of which views have `seen` so much.
    pub fn importances(&self, clips: &[usize], seen: &[SideCount]) -> Vec<Importance> {
        let regions = &self.parts.regions;
        let model = self.painter.model();
        let mobilities = importance::mobilities(model, &self.surface, clips, regions);
        importance::of_regions(regions, &mobilities, seen, &self.residuals)
    }

    /// Gaussians on the surface, coarse to fine, denser where the error is; otherwise as
    /// [`Self::spread_out`].
    pub(super) fn place(
        &mut self,
        layers: &[u32],
        spread_over: impl Fn(usize) -> u32 + Sync,
    ) -> Result<Vec<Seed>> {
        if self.options.survey_steps > 0 {
            self.weigh_by_residual()?;
        }
        // Not before the survey: under w times the density it would find 1 / w of the error, and take √w back.
        self.parts.regions.thicken(&mut self.weights);
        self.spread_out(layers, spread_over)
    }

    /// How many layers stand on coarser meshes.
    pub(super) fn coarser_layers(&self) -> usize {
        self.coarser.len()
    }

    /// Puts the Gaussians of the first of a region's layers on its parts of coarser meshes.
    pub(super) fn carry(&self, region: usize, layers: &[u32], seeds: &mut [Seed]) {
        let coarsest_first = self.coarser.iter().rev();
        let mut rest = seeds;
        for (&len, of_regions) in layers.iter().filter(|&&len| len > 0).zip(coarsest_first) {
            let (layer, later) = rest.split_at_mut((len as usize).min(rest.len()));
            let own = of_regions[region].iter().copied();
            Carriers::new(&self.with_coarser, &self.stages, own).carry(layer);
            rest = later;
        }
    }

    /// Gaussians spread over the surface, coarse to fine, by the density of each triangle, `layers` of them (fewer
    /// in the last ones where there is no room). Those of layer i are as wide as `spread_over(i)` of them ask for.
    fn spread_out(
        &mut self,
        layers: &[u32],
        spread_over: impl Fn(usize) -> u32 + Sync,
    ) -> Result<Vec<Seed>> {
        let (surface, painter, weights) = (&self.surface, self.painter, &self.weights);
        let wanted = layers.iter().sum::<u32>() as usize;
        let accept = |point: &_| is_painted(painter, point);
        let points = spread(surface, weights, wanted, &mut self.random, accept);
        ensure!(
            !points.is_empty(),
            "the mesh has no visible surface; check its alpha and its scale"
        );
        let weighted = |(triangle, weight): (u32, &f32)| weight * surface.area(triangle);
        let covered: f32 = (0..).zip(weights).map(weighted).sum();
        // Where darts found no room there are fewer than wanted, and each stands for more.
        let found = points.len() as f32 / wanted as f32;
        let mut last = 0;
        let ends: Vec<u32> = layers
            .iter()
            .map(|layer| {
                last += layer;
                last
            })
            .collect();
        let seeds = points.par_iter().enumerate().map(|(rank, point)| {
            let layer = ends.partition_point(|&end| end <= rank as u32);
            // Where points stand further apart each stands for more of the surface.
            let density = weights[point.triangle as usize];
            let area = covered / (found * spread_over(layer) as f32) / density;
            seed(surface, painter, point, area, Freedom::Free)
        });
        Ok(seeds.collect())
    }

    /// The density of each triangle by what an evenly spread cloud of all Gaussians, trained for a while,
    /// leaves of the error on it.
    fn weigh_by_residual(&mut self) -> Result<()> {
        let options = self.options;
        let seeds = self.spread_out(&[options.gaussians], |_| options.gaussians)?;
        let cloud = Cloud::arrange(vec![seeds.len() as u32], &seeds);
        let mut schedule = options.schedule(Prefixes::All);
        schedule.steps = options.survey_steps;
        // No file holds it.
        schedule.finish = 0.0;
        let cloud = self.descend_one(cloud, &schedule)?;
        let problem = self.problem();
        let residuals = residual::by_triangles(&[cloud], &problem, self.surface.len())?;
        density::follow(&residuals, &self.surface, &mut self.weights);
        self.residuals = residuals;
        Ok(())
    }

    pub(super) fn problem(&self) -> Problem<'_> {
        Problem {
            stages: &self.stages,
            views: self.views,
            background: self.options.background,
            low_pass: self.options.method.mathematics().low_pass,
            loss: self.options.loss,
            blend_price: self.options.blend_price,
        }
    }

    /// Trains the cloud of a mesh in one piece.
    pub(super) fn descend_one(&mut self, cloud: Cloud, schedule: &Schedule) -> Result<Cloud> {
        Ok(self.descend(vec![cloud], schedule)?.swap_remove(0))
    }

    /// Trains the clouds of all regions.
    pub(super) fn descend(
        &mut self,
        clouds: Vec<Cloud>,
        schedule: &Schedule,
    ) -> Result<Vec<Cloud>> {
        let mut journal = self.journal.take();
        let problem = self.problem();
        let bar = progress::bar("training", u64::from(schedule.steps));
        let mut smooth: Option<Compared> = None;
        let gaussians: usize = clouds.iter().map(Cloud::len).sum();
        let mut descent = Descent::new(clouds, &problem, schedule, self.random.clone());
        if let Some(journal) = &mut journal {
            journal.resume(&mut descent)?;
            let run = self.steps + descent.step();
            if run > 0 && !journal.has_begun() && !descent.is_done() {
                progress::resume(&bar, u64::from(descent.step()), u64::from(run));
            }
        }
        while !descent.is_done() {
            let Advance { steps, compared: now, .. } = descent.advance()?;
            let before = smooth.unwrap_or(now);
            let mean = |before: f64, now: f64| 0.95 * before + 0.05 * now;
            let compared =
                Compared { loss: mean(before.loss, now.loss), mse: mean(before.mse, now.mse) };
            smooth = Some(compared);
            let psnr = -10.0 * compared.mse.max(1e-10).log10();
            let Compared { loss, .. } = compared;
            bar.set_prefix(format!("loss {loss:.5}, {psnr:.1} dB, {gaussians} Gaussians"));
            bar.set_position(u64::from(descent.step()));
            if let Some(journal) = &mut journal {
                journal.after_steps(steps, &descent)?;
            }
        }
        bar.finish_and_clear();
        if let Some(journal) = &mut journal {
            journal.finish(&descent)?;
        }
        let (clouds, random, precision) = descent.finish();
        self.precision = precision;
        self.steps += schedule.steps;
        self.random = random;
        self.journal = journal;
        Ok(clouds)
    }
}

/// Whether a texture's alpha leaves anything of the surface at a point.
fn is_painted(painter: &Painter<'_>, point: &SurfacePoint) -> bool {
    painter.coverage(point.triangle as usize, point.barycentrics, &scene::Footprint::POINT) >= 0.02
}
