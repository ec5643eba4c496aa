//! One set trained for one count: the rivals of layered models that LapisGS names (4.1).
//!
//! *Single* is trained at full size and shown at every scale. *Multiscale* is one of a series, each trained for its
//! own count or scale, and so what a layered model can at most reach; one of them is trained as *single* is.
//! *Downsample* is *single* with the less significant Gaussians left out.

use anyhow::Result;

use super::workshop::Workshop;
use crate::optimize::cloud::{Cloud, Freedom, Parameters, Seed};
use crate::optimize::schedule::Prefixes;

/// All Gaussians in one layer.
pub(super) fn train(shop: &mut Workshop<'_>) -> Result<Cloud> {
    let options = shop.options;
    let seeds = shop.place(&[options.gaussians], |_| options.gaussians)?;
    let cloud = Cloud::arrange(vec![seeds.len() as u32], &seeds);
    shop.descend_one(cloud, &options.schedule(Prefixes::All))
}

/// The same, in the order of significance: opacity times area.
pub(super) fn downsample(shop: &mut Workshop<'_>) -> Result<Cloud> {
    let cloud = train(shop)?;
    let area = |triangle| shop.surface.area(triangle);
    let significance = |p: &Parameters, triangle: u32| {
        let [s, t] = p.log2_scale;
        p.opacity() * libm::exp2f(s + t) * area(triangle)
    };
    let mut seeds: Vec<(f32, Seed)> = (cloud.full().iter().zip(&cloud.triangles))
        .map(|(&parameters, &triangle)| {
            let seed = Seed { triangle, parameters, freedom: Freedom::Free };
            (significance(&parameters, triangle), seed)
        })
        .collect();
    seeds.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let seeds: Vec<Seed> = seeds.into_iter().map(|(_, seed)| seed).collect();
    Ok(Cloud::arrange(shop.options.layers(seeds.len() as u32), &seeds))
}
