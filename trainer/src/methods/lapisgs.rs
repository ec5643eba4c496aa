//! LapisGS (3.1): layers trained one after the other on an image pyramid.
//!
//! Layer i of L + 1 is trained on pictures reduced by 2^(L − i), while all earlier layers keep everything but
//! their opacity, of which they have one for each level; with *freeze*, the paper's ablation, they keep that, too.
//! The paper's layers grow by densification; ours are placed evenly, each up to four times the Gaussians of
//! the one before, as the pixels.

use anyhow::Result;

use super::workshop::Workshop;
use crate::optimize::cloud::{Cloud, Freedom};
use crate::optimize::schedule::Prefixes;

/// Trains layer after layer; `earlier` says what training may move of the layers before.
pub(super) fn train(shop: &mut Workshop<'_>, earlier: Freedom) -> Result<Cloud> {
    let options = shop.options;
    let layers = options.layers(options.gaussians);
    let up_to = |layer: usize| layers[..=layer.min(layers.len() - 1)].iter().sum::<u32>();
    let seeds = shop.place(&layers, up_to)?;
    let layers = options.layers(seeds.len() as u32);
    let mut cloud = Cloud::arrange(layers, &seeds);
    cloud.split_into_levels(|_| 0.0);
    let levels = cloud.levels.len();
    for level in 0..levels {
        let before = level.checked_sub(1).map_or(0, |lower| cloud.levels[lower].len());
        cloud.freedoms[..before].fill(earlier);
        if let [.., lower, this] = &mut cloud.levels[..=level] {
            this[..before].copy_from_slice(lower);
        }
        let mut schedule = options.schedule(Prefixes::Level(level));
        schedule.steps /= levels as u32;
        schedule.shift = (levels - 1 - level) as u32;
        // The pyramid is a warm-up of its own.
        schedule.warm_up = 0.0;
        cloud = shop.descend_one(cloud, &schedule)?;
    }
    Ok(cloud)
}
