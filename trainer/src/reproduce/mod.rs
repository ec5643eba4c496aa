//! Tables for a given mesh: every row is trained, written and measured here.
//!
//! [`lodavatar`] makes tables 1 and 2 of LoDAvatar, [`lapisgs`] tables 1 and 5 of LapisGS. Figures are means over
//! pictures drawn by the runtime from each row's file, as in [`mod@crate::eval`]. [`face_lod`] makes
//! table 1 of levels of detail for faces, [`formats`] puts the same Gaussians into files of several formats.

pub mod face_lod;
pub mod formats;
pub mod lapisgs;
pub mod lodavatar;

use anyhow::{Result, ensure};
use dermis_format::Avatar;

use crate::bench::clock::Clock;
use crate::eval::{EvalOptions, Row, Split, evaluate};
use crate::model::Model;
use crate::options::Options;
use crate::train::train;

/// On what all rows are measured.
#[derive(Clone, Copy, Debug)]
pub struct Measure {
    /// Poses of each split.
    pub key_frames: u32,
    /// Directions from which each is seen, at most 42.
    pub views: u32,
}

/// What training is timed with: rows are compared by the work they take, not by who else used the machine.
pub const CLOCK: Clock = Clock::ALL_THREADS;

/// A trained file and how long it took, seconds.
struct Made {
    bytes: Vec<u8>,
    seconds: f64,
}

fn made(model: &Model, options: &Options) -> Result<Made> {
    let (trained, ms) = CLOCK.time(|| train(model, options))?;
    Ok(Made { bytes: trained.bytes, seconds: ms / 1e3 })
}

/// Rows of a file at its levels and at `budgets`, in pictures of `size` px.
fn rows(
    model: &Model,
    file: &Made,
    options: &Options,
    measure: Measure,
    size: u32,
    budgets: &[u32],
) -> Result<Vec<Row>> {
    let avatar = Avatar::parse(&file.bytes)?;
    let options = EvalOptions {
        key_frames: measure.key_frames,
        views: measure.views,
        size,
        background: options.background,
        budgets: budgets.to_vec(),
        prefixes: Vec::new(),
        packed: None,
        planned: false,
        distance: None,
    };
    Ok(evaluate(&avatar, model, &options)?.rows)
}

/// The row of a split at a count, or the next greater one.
fn at(rows: &[Row], split: Split, gaussians: u32) -> Option<&Row> {
    let of_split = rows.iter().filter(|row| row.split == split && row.gaussians >= gaussians);
    of_split.min_by_key(|row| row.gaussians)
}

/// Refuses sizes of which an eighth is no picture.
fn check_size(size: u32) -> Result<()> {
    ensure!(size >= 128, "--size: an eighth of {size} px shows nothing; give 128 or more");
    Ok(())
}
