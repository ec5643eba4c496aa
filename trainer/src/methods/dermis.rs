//! The nested order: even placement, every prefix trained.

use anyhow::Result;
use dermis_runtime::plan::prefix_log2_scale;

use super::workshop::Workshop;
use crate::optimize::cloud::Cloud;
use crate::optimize::schedule::Prefixes;

pub(super) fn train(shop: &mut Workshop<'_>) -> Result<Cloud> {
    let options = shop.options;
    let layers = options.layers(options.gaussians);
    let seeds = shop.place(&layers, |_| options.gaussians)?;
    let mut cloud = Cloud::arrange(options.layers(seeds.len() as u32), &seeds);
    if options.per_level {
        cloud.split_into_levels(|[count, all]| prefix_log2_scale(count, all));
    }
    shop.descend(cloud, &options.schedule(Prefixes::Nested(options.nested)))
}
