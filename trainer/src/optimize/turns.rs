//! Which Gaussian of a layer stands where in the file.
//!
//! Gaussians of a layer, by triangle, are dealt to its blocks like cards: one to each in every round. By the seats of the
//! blocks ([`order::seats`]) the first ones, however many have come, are spread evenly over the layer, and each lies between
//! two that came before: the packed form tells its triangles, shapes and colours from theirs.

use dermis_format::order;

/// Places in the file in the order in which Gaussians that stand by triangle, layer by layer, take them.
pub fn turns(layers: &[u32]) -> Vec<u32> {
    let blocks: Vec<_> = order::blocks(layers).collect();
    let mut turns = Vec::new();
    for blocks in blocks.chunk_by(|a, b| a.0 == b.0) {
        let mut seated: Vec<_> = order::seats(blocks.len()).into_iter().zip(blocks).collect();
        seated.sort_by_key(|&(seat, _)| seat);
        // Lengths differ by one at most.
        let rounds = blocks.iter().map(|&(.., count)| count).max().unwrap_or(0);
        for round in 0..rounds {
            let takes_part = seated.iter().filter(|(_, (.., count))| round < *count);
            turns.extend(takes_part.map(|(_, (_, first, _))| first + round));
        }
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_one_turn_in_its_layer() {
        for layers in [&[][..], &[5], &[3, 0, 9000, 1], &[56_250, 12_289], &[4096, 4097]] {
            let mut turns = turns(layers);
            let mut rest = &mut turns[..];
            for &layer in layers {
                let (own, later) = rest.split_at_mut(layer as usize);
                own.sort_unstable();
                rest = later;
            }
            assert!(turns.into_iter().eq(0..layers.iter().sum()), "{layers:?}");
        }
    }

    #[test]
    fn the_first_blocks_are_spread_over_a_layer() {
        let len = 14 * 4000;
        let turns = turns(&[len]);
        let blocks: Vec<_> = order::blocks(&[len]).collect();
        for sent in 1..=blocks.len() {
            let end = blocks[sent - 1].1 + blocks[sent - 1].2;
            let come: Vec<usize> = (0..turns.len()).filter(|&turn| turns[turn] < end).collect();
            let widest = come.windows(2).map(|pair| pair[1] - pair[0]).max();
            assert!(widest.is_some_and(|gap| gap * sent <= 2 * blocks.len()), "{sent} blocks");
        }
    }
}
