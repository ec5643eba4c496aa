//! What a file would hold of a cloud.
//!
//! Training that ends on rounded Gaussians matches the picture of the file; the gradient passes straight through the
//! rounding to the numbers before it (the straight-through estimator; Bengio, Léonard and Courville 2013). Ranges and codes
//! are the writer's own, of the cloud as it is at each step. With the bits that [`super::precision`] chooses it wins
//! 0.15 dB at the coarsest levels and loses 0.01 of all Gaussians (notes/training.md).

use anyhow::{Context, Result};
use dermis_format::{Disc, DiscWidths, order, writer};
use rayon::prelude::*;

use super::cloud::{Cloud, Parameters};

/// What a reader gets of a level of `cloud`, opacities within 10⁻⁴, its discs' numbers having `widths` bits at each layer of
/// the file (8 each where there are none). It costs about 0.2 µs for each Gaussian.
///
/// # Errors
///
/// Where a number is not finite.
pub(super) fn level_as_stored(
    cloud: &Cloud,
    level: &[Parameters],
    widths: &[DiscWidths],
) -> Result<Vec<Parameters>> {
    // A level ends with a layer, and so with a block.
    let blocks = order::blocks(&cloud.layers);
    let blocks: Vec<_> = blocks.take_while(|block| (block.1 as usize) < level.len()).collect();
    let last = blocks.last().map(|&(layer, ..)| layer);
    let stored: Vec<Vec<Disc>> = blocks
        .into_par_iter()
        .map(|(layer, first, count)| {
            let places = first as usize..(first + count) as usize;
            let discs: Vec<Disc> = level[places].iter().map(Parameters::disc).collect();
            // A single level is no level of the file's: each Gaussian has the record of its layer.
            let level = if cloud.levels.len() > 1 { last.unwrap_or(layer) } else { layer };
            let (level, layer) = (usize::from(level), usize::from(layer));
            writer::stored(&discs, writer::widths_at(widths, level, layer, cloud.coarser))
        })
        .collect::<Result<_, _>>()
        .context("the avatar cannot be written")?;
    Ok(stored.iter().flatten().map(Parameters::of_disc).collect())
}
