//! Levels for Gaussians that another program trained as one: each a picture of all with a quarter of the next one's
//! count.
//!
//! 1. [`merge`] makes few Gaussians of many; what is merged at one level is merged further at the one before.
//! 2. [`views`] renders all Gaussians from around, in several poses where a mesh carries them.
//! 3. [`train`] lets the merged ones of a level match these pictures, one level after the other.
//! 4. The file holds all levels, from coarse to fine, and then the Gaussians that came, as they came. An opacity
//!    for each level says who is seen: who was merged takes the place of his whole.
//! 5. [`measure`] draws the file from elsewhere, and says how far it is from renders of all.

mod measure;
mod merge;
mod train;
mod views;

use anyhow::{Result, ensure};
use dermis_format::{Full, LowPass};
use dermis_runtime::Avatar;
use glam::{DMat3, DQuat, DVec3};

use super::assembly::Assembly;
use super::local::{local, principal_axes};
use super::nested;
use super::pack;
use super::splats::Splats;
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

/// The opacity to which a Gaussian that is merged of others begins at most: it must be able to descend.
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
        "{} Gaussians are too few to be halved twice; leave --nested out",
        all.len()
    );
    let poses = Poses::of(&assembly, &all)?;
    let shots = poses.shots(&training_directions(), options.size);
    let views = poses.observe(&all, low_pass, &shots, options.memory_bytes)?;
    // Each level but the last has as many as its layer: what was there before is not seen any more.
    let earlier = &layers[..layers.len() - 1];
    let levels = merged_levels(&assembly, &all, &poses, earlier, options);
    let mut trainer = Trainer::new(&poses, &views, low_pass, Random::new(options.seed));
    let assembly = trainer.train(assembly, levels, options)?;
    let bytes = pack(assembly)?;
    let novel = poses.shots(&novel_directions(), options.size);
    let measured = measure::measure(&Avatar::parse(&bytes)?, &all, &poses, low_pass, &novel)?;
    Ok((bytes, measured))
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

/// The Gaussians of each level before they are trained, as many as asked for.
fn merged_levels(
    assembly: &Assembly,
    all: &Fulls,
    poses: &Poses,
    counts: &[u32],
    options: &Coarsening,
) -> Vec<Fulls> {
    let blobs = all.gaussians.iter().zip(&all.triangles).map(|(full, &triangle)| {
        let points = poses.stages.iter().map(|stage| {
            let frame = stage.frames[triangle as usize].as_ref();
            frame
                .map_or(DVec3::ZERO, |frame| DVec3::from(frame.point(full.position).map(f64::from)))
        });
        let points: Vec<DVec3> = points.collect();
        let axes =
            poses.stages[0].frames[triangle as usize].as_ref().map_or(DMat3::IDENTITY, |frame| {
                let [x, y, z] =
                    [frame.x, frame.y, frame.z].map(|axis| DVec3::from(axis.map(f64::from)));
                DMat3::from_cols(x, y, z)
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
    let mut levels: Vec<Fulls> = counts
        .iter()
        .rev()
        .map(|&count| {
            let blobs = merged.reduce_to(count as usize);
            level(assembly, all, &merged, &blobs)
        })
        .collect();
    levels.reverse();
    levels
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
    let (turn, squares) = principal_axes(blob.covariance);
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
