//! Training: a mesh in, the bytes of an avatar out.

use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use dermis_format::source::{Mathematics, Source};
use dermis_format::{Avatar, ScaleLaw};
use dermis_runtime::{Kernel, Pose, Posed};
use rayon::prelude::*;

use crate::embed::hierarchy::Hierarchy;
use crate::embed::initial::seed;
use crate::embed::placement::spread;
use crate::embed::sides::two_sided;
use crate::embed::surface::Surface;
use crate::model::Model;
use crate::optimize::cloud::{Cloud, Freedom};
use crate::optimize::descend::{Descent, Problem};
use crate::optimize::forward::Stage;
use crate::optimize::schedule::{Random, Schedule};
use crate::options::{Method, Options};
use crate::package;
use crate::progress;
use crate::scene::{self, KeyFrame, Painter, RigScale, SideCount};
use crate::truth::{Crop, Store, TrainingView};

/// Sub-samples along each side of a pixel of the truth.
const SAMPLES: u32 = 4;
/// Density of Gaussians on triangles that no training view sees.
const UNSEEN_WEIGHT: f32 = 0.1;

/// A trained avatar.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The file.
    pub bytes: Vec<u8>,
    /// What was packed into it, before quantization.
    pub cloud: Cloud,
    /// Steps taken.
    pub steps: u32,
}

/// Trains an avatar: truth, placement, descent, packing.
pub fn train(model: &Model, options: &Options) -> Result<Trained> {
    let painter = Painter::new(model);
    let detail = options.detail.select(model)?;
    let key_frames = key_frames(model, options)?;
    let mut source = package::rigged_mesh(model);
    source.key_frames = package::key_frames(&key_frames);
    let (views, seen) = observe(&painter, &key_frames, options)?;
    ensure!(
        views.iter().any(|view| view.truth.rect(0).pixels() > 0),
        "no camera sees the mesh; is it under 2 cm, or transparent? scale it to metres"
    );
    source.mesh.two_sided = two_sided(model, &seen);
    let mut workshop =
        Workshop::new(&source, &painter, &key_frames, views, &seen, detail, options)?;
    let cloud = match options.method {
        Method::Dermis => workshop.nested()?,
        Method::Lodavatar => workshop.hierarchical()?,
    };
    let steps = workshop.steps;
    let scale_law = match options.method {
        Method::Dermis => ScaleLaw::SquareRoot,
        Method::Lodavatar => ScaleLaw::Constant,
    };
    let mathematics = Mathematics { scale_law, ..Mathematics::default() };
    let source = package::with_gaussians(source, &cloud, mathematics);
    Ok(Trained { bytes: package::encode(&source)?, cloud, steps })
}

/// The poses to train on.
pub fn key_frames(model: &Model, options: &Options) -> Result<Vec<KeyFrame>> {
    let named = scene::clips_named(model, &options.clips)?;
    let chosen = (!named.is_empty()).then_some(&named[..]);
    let clips = scene::training_clips(model, chosen);
    Ok(scene::training_key_frames(model, &clips, options.key_frames as usize))
}

/// Renders the truth of all views, and counts what sides of the triangles they see.
fn observe(
    painter: &Painter<'_>,
    key_frames: &[KeyFrame],
    options: &Options,
) -> Result<(Vec<TrainingView>, Vec<SideCount>)> {
    let store = Store::new(options.memory_bytes, &std::env::temp_dir());
    let model = painter.model();
    let rig = RigScale::of(model);
    let directions = &scene::training_directions()[..options.views.clamp(1, 42) as usize];
    let mut views = Vec::new();
    let mut seen = vec![SideCount::default(); model.triangles.len()];
    let bar = progress::bar("ground truth", (key_frames.len() * directions.len()) as u64);
    for (stage, key_frame) in key_frames.iter().enumerate() {
        let posed = scene::posed_vertices(model, &key_frame.pose(model));
        let cameras = rig.cameras(directions, &posed, options.size, options.size);
        let shots: Vec<_> =
            cameras.iter().map(|&camera| scene::View { posed: &posed, camera }).collect();
        let made = scene::render_views(painter, &shots, options.background, SAMPLES, |_, truth| {
            bar.inc(1);
            let kept = store.keep(Crop::of(&truth, options.background));
            kept.map(|kept| (kept, truth.seen))
        });
        for (camera, made) in cameras.into_iter().zip(made) {
            let (truth, counts) = made?;
            seen.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
            views.push(TrainingView { stage, camera, truth });
        }
    }
    bar.finish_and_clear();
    Ok((views, seen))
}

/// Everything that both methods of training use.
struct Workshop<'a> {
    painter: &'a Painter<'a>,
    options: &'a Options,
    corners: Vec<[u32; 3]>,
    surface: Surface,
    weights: Vec<f32>,
    /// Triangles chosen for detail.
    detail: Option<Vec<bool>>,
    stages: Vec<Stage>,
    views: Vec<TrainingView>,
    random: Random,
    steps: u32,
}

impl<'a> Workshop<'a> {
    fn new(
        source: &Source,
        painter: &'a Painter<'a>,
        key_frames: &[KeyFrame],
        views: Vec<TrainingView>,
        seen: &[SideCount],
        detail: Option<Vec<bool>>,
        options: &'a Options,
    ) -> Result<Self> {
        // Frames come from the runtime and the encoded mesh: what is trained on is what is drawn on.
        let bytes = package::encode(source)?;
        let avatar = Avatar::parse(&bytes).context("the mesh alone cannot be read back")?;
        let two_sided: Arc<[bool]> = source.mesh.two_sided.clone().into();
        let stages = key_frames
            .par_iter()
            .map(|frame| stage(&avatar, &runtime_pose(frame), two_sided.clone()));
        let stages = stages.collect::<Result<Vec<_>>>()?;
        let mut scratch = vec![0; Posed::scratch_len(&avatar)];
        let rest = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut scratch)?;
        let corners = source.mesh.triangles.clone();
        let surface = Surface::new(rest.vertices(), &corners);
        let is_seen = |count: &SideCount| count.front + count.back > 0;
        let mut weights: Vec<f32> =
            seen.iter().map(|count| if is_seen(count) { 1.0 } else { UNSEEN_WEIGHT }).collect();
        if let Some(selected) = &detail {
            options.detail.thicken(&mut weights, selected);
        }
        let random = Random::new(options.seed);
        Ok(Self {
            painter,
            options,
            corners,
            surface,
            weights,
            detail,
            stages,
            views,
            random,
            steps: 0,
        })
    }

    /// Even placement in one nested order.
    fn nested(&mut self) -> Result<Cloud> {
        let (surface, painter) = (&self.surface, self.painter);
        let count = self.options.gaussians as usize;
        let accept = |point: &_| is_painted(painter, point);
        let points = spread(surface, &self.weights, count, &mut self.random, accept);
        ensure!(
            !points.is_empty(),
            "the mesh has no visible surface; check its alpha and its scale"
        );
        let covered: f32 =
            self.weights.iter().enumerate().map(|(t, w)| w * surface.area(t as u32)).sum();
        let area = covered / points.len() as f32;
        let seeds: Vec<_> = points
            .par_iter()
            .map(|point| {
                // Where points stand further apart each stands for more of the surface.
                let area = area / self.weights[point.triangle as usize];
                seed(surface, painter, point, area, Freedom::Free)
            })
            .collect();
        let cloud = Cloud::arrange(self.options.layers(seeds.len() as u32), &seeds);
        self.descend(cloud, &self.options.schedule())
    }

    /// LoDAvatar's levels, each on top of the trained ones before; the last on chosen triangles alone.
    fn hierarchical(&mut self) -> Result<Cloud> {
        let vertices = self.painter.model().vertices.len();
        let (mut hierarchy, seeds) =
            Hierarchy::base(&self.surface, self.painter, &self.corners, vertices);
        let mut cloud = Cloud::arrange(hierarchy.layers(), &seeds);
        let mut schedule = self.options.schedule();
        let uniform = self.options.levels.max(1);
        let levels = uniform + self.options.detail_levels();
        schedule.steps /= levels;
        cloud = self.descend(cloud, &schedule)?;
        for level in 1..levels {
            let detail = self.detail.as_deref().filter(|_| level >= uniform);
            let seeds = hierarchy.refine(&self.surface, self.painter, &cloud, detail);
            cloud = self.descend(Cloud::arrange(hierarchy.layers(), &seeds), &schedule)?;
        }
        Ok(cloud)
    }

    fn descend(&mut self, cloud: Cloud, schedule: &Schedule) -> Result<Cloud> {
        let problem = Problem {
            stages: &self.stages,
            views: &self.views,
            background: self.options.background,
            low_pass: Mathematics::default().low_pass,
            loss: self.options.loss,
        };
        let bar = progress::bar("training", u64::from(schedule.steps));
        let mut smooth = None;
        let mut descent = Descent::new(cloud, &problem, schedule, self.random.clone());
        while !descent.is_done() {
            let loss = descent.advance(|_| {})?;
            let loss = smooth.map_or(loss, |s: f64| 0.95 * s + 0.05 * loss);
            smooth = Some(loss);
            bar.set_prefix(format!("loss {loss:.5}"));
            bar.set_position(u64::from(descent.step()));
        }
        bar.finish_and_clear();
        self.steps += schedule.steps;
        let (cloud, random) = descent.finish();
        self.random = random;
        Ok(cloud)
    }
}

/// Whether a texture's alpha leaves anything of the surface at a point.
fn is_painted(painter: &Painter<'_>, point: &crate::embed::surface::SurfacePoint) -> bool {
    painter.coverage(point.triangle as usize, point.barycentrics, &scene::Footprint::POINT) >= 0.02
}

/// A key frame as the runtime names it.
pub fn runtime_pose(frame: &KeyFrame) -> Pose<'static> {
    frame.clip.map_or(Pose::Rest, |clip| Pose::Clip { clip, seconds: frame.seconds })
}

fn stage(avatar: &Avatar<'_>, pose: &Pose<'_>, two_sided: Arc<[bool]>) -> Result<Stage> {
    let mut scratch = vec![0; Posed::scratch_len(avatar)];
    let posed = Posed::new(avatar, pose, Kernel::detect(), &mut scratch)?;
    let frames = (0..avatar.header().triangles).map(|triangle| posed.frame(triangle)).collect();
    Ok(Stage { frames, two_sided })
}
