//! Which blocks stand on either side of a block, if its layer is dealt as [`order::seats`] says.

use std::collections::BTreeMap;

use super::between::{BACK_BITS, Sides};
use crate::block::Block;
use crate::header::Header;
use crate::order;
use crate::section::{Sections, tag};
use crate::triangles::Triangles;

/// Which blocks each one stands between, by the index of its section.
pub(super) fn sides(sections: Sections<'_>, header: &Header) -> BTreeMap<usize, Sides> {
    let mut layers: BTreeMap<(u8, u8), Vec<(usize, Triangles<'_>)>> = BTreeMap::new();
    for (index, section) in sections.enumerate() {
        if section.tag == tag::BLOCK
            && let Some(block) = Block::split(section.payload, header)
        {
            let of_layer = layers.entry((block.region, block.layer)).or_default();
            of_layer.push((index, block.triangles));
        }
    }
    layers.values().flat_map(|blocks| sides_in_layer(blocks)).collect()
}

/// The same of one layer, given the index of each block's section and its triangles.
fn sides_in_layer(blocks: &[(usize, Triangles<'_>)]) -> Vec<(usize, Sides)> {
    let seats = order::seats(blocks.len());
    let mut block_at = vec![0; seats.len()];
    seats.iter().enumerate().for_each(|(block, &seat)| block_at[seat] = block);
    let sides = |(block, &seat): (usize, &usize)| {
        // The lowest bit that is set: so far apart are those that have come.
        let step = seat & seat.wrapping_neg();
        let low = block_at[seat - step];
        // After the last seat comes the next round.
        let next = seat + step >= seats.len();
        let high = if next { block_at[0] } else { block_at[seat + step] };
        let [low_back, high_back] = [low, high].map(|other| (block - other) as u32);
        let fits = low_back.max(high_back) >> BACK_BITS == 0
            && stands_between(blocks[block].1, [blocks[low].1, blocks[high].1], next);
        let sides = Sides { low: low_back, high: high_back, next };
        fits.then_some((blocks[block].0, sides))
    };
    seats.iter().enumerate().skip(1).filter_map(sides).collect()
}

/// Whether triangles of a block are mostly between those on either side, and the same where those are.
fn stands_between(here: Triangles<'_>, [low, high]: [Triangles<'_>; 2], next: bool) -> bool {
    let sides = low.iter().zip(high.iter().skip(next.into()));
    let (mut count, mut between) = (0, 0);
    for (here, (low, high)) in here.iter().zip(sides) {
        if low == high && here != low {
            return false;
        }
        count += 1;
        between += u32::from((low..=high).contains(&here));
    }
    2 * between > count
}
