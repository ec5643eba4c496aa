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

/// Blocks of a level of so many Gaussians: layer, first Gaussian and how many. It ends with a layer, and so with a block.
pub(super) fn blocks(cloud: &Cloud, len: usize) -> impl Iterator<Item = (u8, u32, u32)> {
    order::blocks(&cloud.layers).take_while(move |block| (block.1 as usize) < len)
}

/// Bits of the discs of each layer at that level, if those of the file's levels are `widths`.
pub(super) fn widths_of<'w>(
    cloud: &Cloud,
    len: usize,
    widths: &'w [DiscWidths],
) -> impl Fn(u8) -> DiscWidths + use<'w> {
    // A single level is no level of the file's: each Gaussian has the record of its layer.
    let level = blocks(cloud, len).last().map(|block| block.0).filter(|_| cloud.levels.len() > 1);
    let coarser = cloud.coarser_layers;
    move |layer| {
        let level = level.unwrap_or(layer);
        writer::widths_at(widths, level.into(), layer.into(), coarser)
    }
}

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
    let blocks: Vec<_> = blocks(cloud, level.len()).collect();
    let widths = widths_of(cloud, level.len(), widths);
    let stored: Vec<Vec<Disc>> = blocks
        .into_par_iter()
        .map(|(layer, first, count)| {
            let places = first as usize..(first + count) as usize;
            let discs: Vec<Disc> = level[places].iter().map(Parameters::disc).collect();
            writer::stored(&discs, widths(layer))
        })
        .collect::<Result<_, _>>()
        .context("the avatar cannot be written")?;
    Ok(stored.iter().flatten().map(Parameters::of_disc).collect())
}
