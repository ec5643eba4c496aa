//! Training: a mesh in, the bytes of an avatar out.

use anyhow::{Result, ensure};
use dermis_format::source::MeasuredMovements;
use dermis_runtime::Pose;
use serde::{Deserialize, Serialize};

use crate::checkpoint::{Checkpoint, Journal};
use crate::embed::sides::two_sided;
use crate::methods::{self, Culling, MeshTrial, Method, Parts, Setting, Workshop};
use crate::model::Model;
use crate::movements;
use crate::optimize::cloud::Cloud;
use crate::optimize::precision::Precision;
use crate::options::Options;
use crate::package;
use crate::scene::{self, KeyFrame, Painter};
use crate::truth;

/// A trained avatar.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trained {
    /// The file.
    pub bytes: Vec<u8>,
    /// What was packed into it, before quantization: the Gaussians of each region.
    pub clouds: Vec<Cloud>,
    /// How exactly.
    pub precision: Precision,
    /// Steps taken.
    pub steps: u32,
    /// What culling costs it.
    pub culling: Culling,
    /// Which coarser meshes its first layers stand on.
    pub mesh_trials: Vec<MeshTrial>,
}

/// Trains an avatar: truth, placement, descent, packing.
pub fn train(model: &Model, options: &Options) -> Result<Trained> {
    train_with(model, options, None)
}

/// The same, by a run that may be killed at any moment: run again with the same checkpoint it goes on, to the same
/// bytes; once it is done it only reads them.
///
/// # Errors
/// Where a file in the checkpoint's folder is damaged or belongs to another mesh or other options, too.
pub fn train_resumably(
    model: &Model,
    options: &Options,
    checkpoint: &Checkpoint,
) -> Result<Trained> {
    let mut journal = Journal::open(checkpoint, model, options)?;
    if let Some(trained) = journal.result()? {
        return Ok(trained);
    }
    let trained = train_with(model, options, Some(&mut journal))?;
    journal.conclude(&trained)?;
    Ok(trained)
}

fn train_with(model: &Model, options: &Options, journal: Option<&mut Journal>) -> Result<Trained> {
    ensure!(
        options.regions.is_empty() || options.method == Method::Dermis,
        "only the method dermis gives regions an order of their own; choose it, or ask for no region"
    );
    let painter = Painter::new(model);
    let parts = Parts::choose(model, options)?;
    let key_frames = key_frames(model, options)?;
    let mut source = package::with_regions(package::rigged_mesh(model), &parts.regions);
    source.mathematics = options.method.mathematics();
    source.key_frames = package::key_frames(&key_frames);
    // Without joints and morph targets there are none.
    let mut none = MeasuredMovements::default();
    let movements = source.movements.as_mut().unwrap_or(&mut none);
    movements::edit(movements, model, &options.movements)?;
    let (views, seen) = truth::observe(&painter, &key_frames, options)?;
    ensure!(
        views.iter().any(|view| view.truth.rect(0).pixels() > 0),
        "no camera sees the mesh; is it under 2 cm, or transparent? scale it to metres"
    );
    source.mesh.two_sided = two_sided(model, &seen);
    let (painter, key_frames) = (&painter, &key_frames[..]);
    let setting =
        Setting { painter, key_frames, views: &views, seen: &seen, parts: &parts, options };
    let (coarser, mesh_trials) = methods::choose_meshes(model, &source, &setting)?;
    let source = package::with_coarser(source, &coarser);
    let mut workshop = Workshop::new(&source, &setting)?;
    if let Some(journal) = journal {
        workshop.keep(journal);
    }
    let clouds = options.method.train(&mut workshop)?;
    let precision = workshop.precision(&clouds)?;
    let mut source = package::with_gaussians(source, &precision.within_limits(&clouds));
    let stored = precision.stored(&clouds)?;
    source.curves = Some(workshop.curves(&stored)?);
    source.samples = workshop.samples(&stored);
    source.widths.clone_from(&precision.widths);
    if !options.regions.is_empty() {
        let importances = workshop.importances(&training_clips(model, options)?, &seen);
        for (region, importance) in source.regions.iter_mut().zip(importances) {
            region.importance = Some(importance);
        }
    }
    let (steps, culling) = (workshop.steps(), workshop.culling(&clouds)?);
    let bytes = package::encode(&source)?;
    Ok(Trained { bytes, clouds, precision, steps, culling, mesh_trials })
}

/// The poses to train on.
pub fn key_frames(model: &Model, options: &Options) -> Result<Vec<KeyFrame>> {
    let clips = training_clips(model, options)?;
    Ok(scene::training_key_frames(model, &clips, options.key_frames as usize))
}

fn training_clips(model: &Model, options: &Options) -> Result<Vec<usize>> {
    let named = scene::clips_named(model, &options.clips)?;
    let chosen = (!named.is_empty()).then_some(&named[..]);
    Ok(scene::training_clips(model, chosen))
}

/// A key frame as the runtime names it.
pub fn runtime_pose(frame: &KeyFrame) -> Pose<'static> {
    frame.clip.map_or(Pose::Rest, |clip| Pose::Clip { clip, seconds: frame.seconds })
}
