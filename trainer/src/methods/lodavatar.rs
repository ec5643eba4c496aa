//! LoDAvatar (3.4 to 3.6): levels by uniform subdivision, each trained on top of the ones before.

use anyhow::Result;

use super::workshop::Workshop;
use crate::embed::hierarchy::Hierarchy;
use crate::optimize::cloud::Cloud;
use crate::optimize::schedule::Prefixes;

/// Everything in an earlier level is fixed; the last levels are those of chosen triangles alone.
pub(super) fn train(shop: &mut Workshop<'_>) -> Result<Cloud> {
    let options = shop.options;
    let uniform = options.levels.max(1);
    let levels = uniform + options.detail_levels();
    let mut schedule = options.schedule(Prefixes::All);
    schedule.steps /= levels;
    let vertices = shop.painter.model().vertices.len();
    let (mut hierarchy, seeds) =
        Hierarchy::base(&shop.surface, shop.painter, &shop.corners, vertices);
    let mut cloud = shop.descend_one(Cloud::arrange(hierarchy.layers(), &seeds), &schedule)?;
    for level in 1..levels {
        let detail = shop.parts.detail.as_deref().filter(|_| level >= uniform);
        let seeds = hierarchy.refine(&shop.surface, shop.painter, &cloud, detail);
        cloud = shop.descend_one(Cloud::arrange(hierarchy.layers(), &seeds), &schedule)?;
    }
    Ok(cloud)
}
