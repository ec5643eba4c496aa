//! How far the Gaussians of a plan reach from their triangles, by the ranges of their groups alone.

use dermis_format::quant::{Linear, last_code};
use dermis_format::{Avatar, Discs, Fulls, Records};

use crate::math::{Real, dot};
use crate::plan::Plan;
use crate::select::{for_each_block, log2_factor};

/// Bounds over all Gaussians of a plan, in units of the size of their triangle's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Extent {
    /// Distance of a centre from the frame's origin at most.
    pub(crate) offset: f32,
    /// Standard deviation at most.
    pub(crate) sigma: f32,
}

impl Extent {
    pub(crate) fn of_plan(avatar: &Avatar<'_>, plan: &Plan) -> Self {
        let mut reach = Reach { square: 0.0, log2_sigma: f32::MIN };
        for_each_block(avatar, plan, |block, region, _| {
            let factor = log2_factor(block, region);
            match &block.records {
                Records::Disc(discs) => reach.add_discs(discs, factor),
                Records::Full(fulls) => reach.add_fulls(fulls, factor),
            }
            // What is between two levels is between the ranges of both.
            block.below.iter().for_each(|below| reach.add_discs(below, factor));
        });
        // A little more than rounding can take away.
        Self { offset: reach.square.sqrt() * 1.001, sigma: reach.log2_sigma.exp2() * 1.001 }
    }
}

/// The greatest seen so far.
struct Reach {
    /// Square of a centre's distance.
    square: f32,
    /// log₂ of a standard deviation.
    log2_sigma: f32,
}

impl Reach {
    fn add_discs(&mut self, discs: &Discs<'_>, log2_factor: f32) {
        let widths = discs.layout().widths();
        let [x, y, z] = widths.position.map(last_code);
        for (group, scale) in discs.groups().iter().zip(discs.greatest_log2_scales()) {
            let [a, b, c] = group.position;
            let root = greatest(c, z);
            let furthest = [greatest(a, x), greatest(b, y), root * root * root];
            self.add(furthest, scale + log2_factor);
        }
    }

    fn add_fulls(&mut self, fulls: &Fulls<'_>, log2_factor: f32) {
        for group in fulls.groups {
            self.add(
                group.position.map(|range| greatest(range, u16::MAX)),
                group.log2_scale.value(255) + log2_factor,
            );
        }
    }

    fn add(&mut self, furthest: [f32; 3], log2_sigma: f32) {
        self.square = self.square.at_least(dot(furthest, furthest));
        self.log2_sigma = self.log2_sigma.at_least(log2_sigma);
    }
}

/// Greatest |value| of a range.
fn greatest(range: impl Linear, last: u16) -> f32 {
    range.value(0).abs().at_least(range.value(last).abs())
}
