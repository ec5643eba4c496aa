//! The nested order: even placement, every prefix trained, in each region an order of its own.

use anyhow::Result;
use dermis_runtime::plan::prefix_log2_scale;

use super::workshop::Workshop;
use crate::optimize::cloud::{Cloud, Seed};
use crate::optimize::schedule::Prefixes;

pub(super) fn train(shop: &mut Workshop<'_>) -> Result<Vec<Cloud>> {
    let options = shop.options;
    let layers = options.layers(options.gaussians);
    let seeds = shop.place(&layers, |_| options.gaussians)?;
    let region = |(region, mut seeds): (usize, Vec<Seed>)| {
        let layers = options.layers(seeds.len() as u32);
        shop.carry(region, &layers, &mut seeds);
        let mut cloud = Cloud::arrange(layers, &seeds);
        cloud.coarser_layers = shop.coarser_layers();
        if options.per_level {
            cloud.split_into_levels(|[count, all]| prefix_log2_scale(count, all));
            cloud.last_is_shape = true;
        }
        cloud
    };
    let clouds = shop.parts.regions.split(&seeds).into_iter().enumerate().map(region).collect();
    shop.descend(clouds, &options.schedule(Prefixes::Nested(options.nested)))
}
