//! How far the Gaussians of a plan reach from their triangles, by the ranges of their groups alone.

use dermis_format::Avatar;
use dermis_format::record::Range;

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
        let (mut square, mut log2_sigma) = (0.0f32, f32::MIN);
        for_each_block(avatar, plan, |block, region, _| {
            let last = block.records.last_position_code();
            let factor = log2_factor(block, region);
            // What is between two levels is between the ranges of both.
            for group in block.groups.iter().chain(block.below.map_or(&[][..], |b| b.groups)) {
                let furthest = group.position.map(|range| greatest(range, last));
                square = square.at_least(dot(furthest, furthest));
                let log2_scale = group.log2_scale.value(255) + factor;
                log2_sigma = log2_sigma.at_least(log2_scale);
            }
        });
        // A little more than rounding can take away.
        Self { offset: square.sqrt() * 1.001, sigma: log2_sigma.exp2() * 1.001 }
    }
}

/// Greatest |value| of a range.
fn greatest(range: Range, last: u16) -> f32 {
    range.value(0).abs().at_least(range.value(last).abs())
}
