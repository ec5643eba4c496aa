//! LapisGS, tables 1 (quality and size at four scales) and 5 (against Freeze).
//!
//! Level i of four is shown at 1/8, 1/4, 1/2 and 1 of the size, and has a quarter of the Gaussians of the next one.
//! FLIP stands in for LPIPS, which needs a network. Sizes are bytes of Gaussians at a level's occupancy (without
//! mesh and rig, which all methods share) over the greatest of all.

use anyhow::{Context, Result};
use dermis_format::Avatar;
use dermis_runtime::Plan;
use serde::Serialize;

use super::{Made, Measure, at, check_size, made, rows};
use crate::eval::{Row, Split, bytes_of};
use crate::methods::Method;
use crate::model::Model;
use crate::options::Options;

/// Scales, from the coarsest.
pub const SCALES: usize = 4;

/// Ours, in as many steps as each other row.
pub const OURS: &str = "ours";

/// Ours, in the time of *single*.
pub const OURS_AS_LONG: &str = "ours, as long";

/// A method at the four scales.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// Its name.
    pub method: &'static str,
    /// Seconds of training by [`super::CLOCK`], all files of the method.
    pub seconds: f64,
    /// From the coarsest scale.
    pub scales: Vec<Scale>,
}

/// A method at one scale.
#[derive(Clone, Debug, Serialize)]
pub struct Scale {
    /// Width and height of the pictures, px.
    pub size: u32,
    /// Bytes of the Gaussians that are drawn.
    pub gaussian_bytes: usize,
    /// The same over the greatest of all methods.
    pub normalised_size: f64,
    /// Novel views.
    pub row: Row,
}

/// Steps of ours that take as long as one step of *single*: most of ours draw fewer Gaussians or smaller pictures. Of
/// four meshes 1.75 or a few more do; the table gives each row's seconds.
const STEPS_AS_LONG: f64 = 1.75;

/// Trains and measures all methods. Each has all steps of `options`; of multiscale each of the four files; and ours
/// once more in the time that *single* takes.
pub fn table(
    model: &Model,
    options: &Options,
    measure: Measure,
    mut done: impl FnMut(&Entry),
) -> Result<Vec<Entry>> {
    check_size(options.size)?;
    let options = Options { levels: SCALES as u32, ..options.clone() };
    let layers = options.layers(options.gaussians);
    let count = |scale: usize| layers[..=scale].iter().sum::<u32>();
    let size = |scale: usize| options.size.div_ceil(1 << (SCALES - 1 - scale));
    let steps = options.steps;
    let as_long = (f64::from(steps) * STEPS_AS_LONG) as u32;
    let methods = [
        ("Downsample", Method::Downsample, steps),
        ("Single", Method::Single, steps),
        ("Multiscale", Method::Multiscale, steps),
        ("Freeze", Method::Freeze, steps),
        ("LapisGS", Method::Lapisgs, steps),
        (OURS, Method::Dermis, steps),
        (OURS_AS_LONG, Method::Dermis, as_long),
    ];
    let mut entries = Vec::new();
    for (name, method, steps) in methods {
        let options = Options { method, steps, ..options.clone() };
        let mut entry = Entry { method: name, seconds: 0.0, scales: Vec::new() };
        let files: Vec<Made> = if method == Method::Multiscale {
            let alone = |scale| {
                let (gaussians, size) = (count(scale), size(scale));
                made(model, &Options { gaussians, size, ..options.clone() })
            };
            (0..SCALES).map(alone).collect::<Result<_>>()?
        } else {
            vec![made(model, &options)?]
        };
        entry.seconds = files.iter().map(|file| file.seconds).sum();
        for scale in 0..SCALES {
            let file = &files[scale.min(files.len() - 1)];
            // Single has one level, which is shown at every scale.
            let wanted = if method == Method::Single { count(SCALES - 1) } else { count(scale) };
            let rows = rows(model, file, &options, measure, size(scale), &[])?;
            let row = at(&rows, Split::NovelView, wanted.min(greatest(&rows)));
            let row = row.context("no novel view was measured")?.clone();
            let gaussian_bytes = gaussian_bytes(&file.bytes, row.gaussians)?;
            entry.scales.push(Scale {
                size: size(scale),
                gaussian_bytes,
                normalised_size: 0.0,
                row,
            });
        }
        done(&entry);
        entries.push(entry);
    }
    let scales = || entries.iter().flat_map(|entry| &entry.scales);
    let most = scales().map(|scale| scale.gaussian_bytes).max().unwrap_or(1).max(1) as f64;
    for scale in entries.iter_mut().flat_map(|entry| &mut entry.scales) {
        scale.normalised_size = scale.gaussian_bytes as f64 / most;
    }
    Ok(entries)
}

fn greatest(rows: &[Row]) -> u32 {
    rows.iter().map(|row| row.gaussians).max().unwrap_or(0)
}

/// Bytes of the file that a count needs beyond those of none.
fn gaussian_bytes(file: &[u8], count: u32) -> Result<usize> {
    let avatar = Avatar::parse(file)?;
    let bytes = |count| bytes_of(&avatar, &Plan::with_budget(&avatar, count));
    Ok(bytes(count) - bytes(0))
}
