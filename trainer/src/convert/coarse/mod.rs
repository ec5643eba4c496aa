//! Levels for Gaussians that another program trained as one: each a picture of all with a quarter of the next one's
//! count.
//!
//! 1. `merge` makes few Gaussians of many; what is merged at one level is merged further at the one before.
//! 2. `views` renders all Gaussians from around, in several poses where a mesh carries them.
//! 3. `train` lets the merged ones of a level match these pictures, one level after the other.
//! 4. The file holds all levels, from coarse to fine, and then the Gaussians that came, as they came, first where the
//!    levels are worst. An opacity for each level says who is seen: what is merged gives way to what it was merged of.
//! 5. `measure` draws the file from elsewhere, and says how far it is from renders of all.

mod measure;
mod merge;
mod train;
mod views;

use anyhow::{Context, Result, ensure};
use dermis_format::{Full, LowPass};
use dermis_runtime::Avatar;
use glam::{DMat3, DQuat, DVec3};

use super::assembly::{Assembly, Levels};
use super::local::{local, principal_axes};
use super::nested;
use super::pack;
use super::splats::Splats;
use crate::optimize::forward::Stage;
use crate::optimize::fulls::Fulls;
use crate::optimize::schedule::Random;
use crate::scene::{novel_directions, training_directions};
pub use measure::Measured;
use merge::{Blob, Merged, area};
use train::Trainer;
use views::Poses;

/// How levels are made.
#[derive(Clone, Copy, Debug)]
pub struct Coarsening {
    /// Steps of one picture each.
    pub steps: u32,
    /// Width and height of the pictures, px.
    pub size: u32,
    /// Of everything random.
    pub seed: u64,
    /// Bound of the pictures that are held in memory, bytes; others lie in a temporary file.
    pub memory_bytes: u64,
}

impl Default for Coarsening {
    fn default() -> Self {
        Self { steps: 3000, size: 400, seed: 1, memory_bytes: 2048 << 20 }
    }
}

/// Levels in which those that came take their places, so that counts between are pictures that are better the more
/// Gaussians they have. Each costs a byte for each Gaussian that is there before it.
const TURNS: usize = 4;

/// Parts of a level's curve that take their turns as one.
const RUNS: usize = 32;

/// The opacity with which a Gaussian that is merged of others begins at most: it must be able to descend.
const MOST_OPAQUE: f64 = 0.98;

/// Bytes of an avatar with coarser levels, and how good each is.
///
/// # Errors
///
/// Where there are levels already, or too few Gaussians for any; as [`pack`].
pub fn pack_nested(assembly: Assembly, options: &Coarsening) -> Result<(Vec<u8>, Vec<Measured>)> {
    ensure!(
        assembly.levels.is_none(),
        "it has levels of its own, which its authors trained; leave --nested out"
    );
    let all = fulls(&assembly);
    let low_pass =
        if assembly.splats.compensated { LowPass::Compensated } else { LowPass::Classic };
    let layers = nested::layers(u32::try_from(all.len())?);
    ensure!(
        layers.len() > 1,
        "its {} Gaussians are too few for coarser levels, which begin at 1024; leave --nested out",
        all.len()
    );
    let poses = Poses::of(&assembly, &all)?;
    let shots = poses.shots(&training_directions(), options.size);
    let views = poses.observe(&all, low_pass, &shots, options.memory_bytes)?;
    // Each level but the last has as many as its layer: what was there before is not seen any more.
    let coarser = &layers[..layers.len() - 1];
    let (mut levels, wholes) = merged_levels(&assembly, &all, &poses, coarser, options);
    let mut trainer = Trainer::new(&poses, &views, low_pass, Random::new(options.seed));
    trainer.train(&mut levels, options.steps)?;
    let finest = levels.last().context("there is a level")?;
    let turns = turns(finest, &poses.stages[0], &trainer.residuals(finest)?, &wholes);
    let assembly = one_after_the_other(assembly, levels, &wholes, &turns);
    let bytes = pack(assembly)?;
    let novel = poses.shots(&novel_directions(), options.size);
    let measured = measure::measure(&Avatar::parse(&bytes)?, &all, &poses, low_pass, &novel)?;
    Ok((bytes, measured))
}

/// When each Gaussian of the finest level that was trained gives way to those that it was merged of, in 0..[`TURNS`].
/// Neighbours do so together, first where most of the error goes for each Gaussian that comes: what was trained as one
/// does not fit what was not, and the seams between them show. Each turn has about as many.
fn turns(finest: &Fulls, stage: &Stage, residuals: &[f64], wholes: &[u32]) -> Vec<usize> {
    let mut parts = vec![0u32; residuals.len()];
    wholes.iter().for_each(|&whole| parts[whole as usize] += 1);
    let center = |(full, &triangle): (&Full, &u32)| {
        stage.frames[triangle as usize].map_or([0.0; 3], |frame| frame.point(full.position))
    };
    let centers: Vec<[f32; 3]> =
        finest.gaussians.iter().zip(&finest.triangles).map(center).collect();
    let curve = nested::along_curve(&centers);
    let count =
        |run: &[u32]| run.iter().map(|&whole| parts[whole as usize] as usize).sum::<usize>();
    let gain = |run: &[u32]| {
        let error: f64 = run.iter().map(|&whole| residuals[whole as usize]).sum();
        error / count(run).max(1) as f64
    };
    let mut runs: Vec<&[u32]> = curve.chunks(curve.len().div_ceil(RUNS)).collect();
    runs.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let mut turns = vec![0; residuals.len()];
    let mut before = 0;
    for run in runs {
        // By its middle.
        let turn = (before + count(run) / 2) * TURNS / wholes.len();
        run.iter().for_each(|&whole| turns[whole as usize] = turn.min(TURNS - 1));
        before += count(run);
    }
    turns
}

/// Trained levels, then those that came, in the order of their turns.
fn one_after_the_other(
    mut assembly: Assembly,
    levels: Vec<Fulls>,
    wholes: &[u32],
    turns: &[usize],
) -> Assembly {
    let Assembly { splats, mount, .. } = &mut assembly;
    let turn = |index: usize| turns[wholes[index] as usize];
    let mut order: Vec<usize> = (0..wholes.len()).collect();
    order.sort_by_key(|&index| turn(index));
    let mut joined = Levels::default();
    let mut all = Fulls::default();
    let last = levels.len() - 1;
    for (index, mut level) in levels.into_iter().enumerate() {
        joined.layers.push(level.len() as u32);
        for (at, full) in level.gaussians.iter().enumerate() {
            let seen = if index == last { turns[at] } else { 0 };
            let mut later = vec![full.opacity; seen];
            later.resize(last - index + TURNS, 0.0);
            joined.later_opacities.push(later);
        }
        all.gaussians.append(&mut level.gaussians);
        all.triangles.append(&mut level.triangles);
        all.harmonics.append(&mut level.harmonics);
    }
    let counts = (0..TURNS).map(|t| order.iter().filter(|&&index| turn(index) == t).count() as u32);
    joined.layers.extend(counts);
    for &index in &order {
        let full = splats.gaussians[index];
        joined.later_opacities.push(vec![full.opacity; TURNS - 1 - turn(index)]);
        all.gaussians.push(full);
        all.harmonics.extend(splats.harmonics.get_mut(index).map(std::mem::take));
    }
    splats.gaussians = all.gaussians;
    splats.harmonics = all.harmonics;
    if let Some(mount) = mount {
        all.triangles.extend(order.iter().map(|&index| mount.triangles[index]));
        mount.triangles = all.triangles;
    }
    assembly.levels = Some(joined);
    assembly
}

/// Gaussians of an assembly on the triangles of its stages.
fn fulls(assembly: &Assembly) -> Fulls {
    let Splats { gaussians, harmonics, .. } = &assembly.splats;
    Fulls {
        gaussians: gaussians.clone(),
        triangles: assembly
            .mount
            .as_ref()
            .map_or_else(|| vec![0; gaussians.len()], |mount| mount.triangles.clone()),
        harmonics: harmonics.clone(),
    }
}

/// The Gaussians of each level before they are trained, as many as asked for, and of each Gaussian that came the one
/// of the last of these levels that it is part of.
fn merged_levels(
    assembly: &Assembly,
    all: &Fulls,
    poses: &Poses,
    counts: &[u32],
    options: &Coarsening,
) -> (Vec<Fulls>, Vec<u32>) {
    let blobs = all.gaussians.iter().zip(&all.triangles).map(|(full, &triangle)| {
        let points = poses.stages.iter().map(|stage| {
            let frame = stage.frames[triangle as usize].as_ref();
            frame
                .map_or(DVec3::ZERO, |frame| DVec3::from(frame.point(full.position).map(f64::from)))
        });
        let points: Vec<DVec3> = points.collect();
        let frame = poses.stages[0].frames[triangle as usize].as_ref();
        // Without a frame it is not seen: a point.
        let axes = frame.map_or(DMat3::from_diagonal(DVec3::splat(1e-6)), |frame| {
            let [x, y, z] = [frame.x, frame.y, frame.z].map(|axis| axis.map(f64::from));
            DMat3::from_cols(x.into(), y.into(), z.into())
        });
        let covariance = covariance(full, axes);
        Blob {
            mass: f64::from(full.opacity) * area(&covariance).max(1e-30),
            mean: points[0],
            covariance,
            color: DVec3::from(full.color.map(f64::from)),
            posed: points[1..].to_vec(),
        }
    });
    let mut merged = Merged::new(blobs.collect(), f64::from(poses.pixel(options.size)) * 0.5);
    let mut wholes = vec![0; all.len()];
    let mut levels = Vec::new();
    for &count in counts.iter().rev() {
        let blobs = merged.reduce_to(count as usize);
        if levels.is_empty() {
            for (whole, &blob) in (0..).zip(&blobs) {
                merged.parts(blob).iter().for_each(|&part| wholes[part as usize] = whole);
            }
        }
        levels.push(level(assembly, all, &merged, &blobs));
    }
    levels.reverse();
    (levels, wholes)
}

/// Merged Gaussians in the frames of the heaviest of their parts.
fn level(assembly: &Assembly, all: &Fulls, merged: &Merged, blobs: &[u32]) -> Fulls {
    let mut level = Fulls::default();
    for &index in blobs {
        let blob = &merged.blobs[index as usize];
        let parts = merged.parts(index);
        let mass = |&part: &u32| merged.blobs[part as usize].mass;
        let heaviest = parts.iter().max_by(|a, b| mass(a).total_cmp(&mass(b)));
        let heaviest = heaviest.map_or(0, |&part| part as usize);
        let triangle = all.triangles[heaviest];
        let world = full(blob);
        level.gaussians.push(match &assembly.mount {
            None => world,
            Some(mount) => mount
                .carrier
                .frame(mount.frame, triangle)
                .map_or(world, |frame| local(&world, &frame)),
        });
        level.triangles.push(triangle);
        if let Some(first) = all.harmonics.first() {
            let mut mean = vec![0.0; first.len()];
            for part in &parts {
                let share = mass(part) / blob.mass;
                let of_part = &all.harmonics[*part as usize];
                mean.iter_mut().zip(of_part).for_each(|(m, &c)| *m += share * f64::from(c));
            }
            level.harmonics.push(mean.into_iter().map(|c| c as f32).collect());
        }
    }
    level
}

/// Σ in the world of a Gaussian on a frame with these axes.
fn covariance(full: &Full, axes: DMat3) -> DMat3 {
    let [w, x, y, z] = full.rotation.map(f64::from);
    let turn = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    let sigma = full.log2_scale.map(|s| libm::exp2(f64::from(s)));
    let root = axes * turn * DMat3::from_diagonal(sigma.into());
    root * root.transpose()
}

/// A merged Gaussian in world axes.
fn full(blob: &Blob) -> Full {
    let c = blob.covariance;
    let least = 1e-9 * (c.x_axis.x + c.y_axis.y + c.z_axis.z);
    let (turn, squares) = principal_axes(c + DMat3::from_diagonal(DVec3::splat(least)));
    let longest = squares.into_iter().fold(0.0, f64::max).sqrt();
    let DQuat { x, y, z, w } = DQuat::from_mat3(&turn).normalize();
    Full {
        position: blob.mean.as_vec3().to_array(),
        rotation: [w, x, y, z].map(|x| x as f32),
        log2_scale: squares.map(|s| libm::log2(s.sqrt().max(longest / 1024.0).max(1e-6)) as f32),
        color: blob.color.as_vec3().to_array(),
        opacity: (blob.mass / area(&blob.covariance)).clamp(0.02, MOST_OPAQUE) as f32,
    }
}
