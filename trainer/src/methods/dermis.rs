//! The nested order: even placement, every prefix trained, in each region an order of its own.

use anyhow::Result;
use dermis_runtime::plan::prefix_log2_scale;

use super::workshop::Workshop;
use crate::optimize::cloud::{Cloud, Seed};
use crate::optimize::schedule::Prefixes;
use crate::options::Options;

pub(super) fn train(shop: &mut Workshop<'_>) -> Result<Vec<Cloud>> {
    let options = shop.options;
    let seeds = shop.place(&options.layers(options.gaussians), |_| options.gaussians)?;
    let mut clouds = clouds(shop, &seeds, options);
    if options.per_level {
        for cloud in &mut clouds {
            cloud.split_into_levels(|[count, all]| prefix_log2_scale(count, all));
            cloud.last_is_shape = true;
        }
    }
    shop.descend(clouds, &options.schedule(Prefixes::Nested(options.nested)))
}

/// A cloud for each region, of the layers that options ask for, the first of which stand on coarser meshes.
pub(super) fn clouds(shop: &Workshop<'_>, seeds: &[Seed], options: &Options) -> Vec<Cloud> {
    let region = |(region, mut seeds): (usize, Vec<Seed>)| {
        let layers = options.layers(seeds.len() as u32);
        shop.carry(region, &layers, &mut seeds);
        let mut cloud = Cloud::arrange(layers, &seeds);
        cloud.coarser_layers = shop.coarser_layers();
        cloud
    };
    shop.parts.regions.split(seeds).into_iter().enumerate().map(region).collect()
}
