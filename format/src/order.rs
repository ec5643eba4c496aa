//! Which Gaussians come first.
//!
//! A region's nested order is cut into bands, one block each. Inside a block Gaussians stand by
//! triangle, which makes indices cheap and lets neighbours share a triangle frame. Their rank in
//! the block is not stored: places are taken in the order of their reversed bits (van der Corput's
//! sequence: 0, 2048, 1024, 3072, 512, …, those past the end left out), so
//!
//! ```text
//! rank(i) = Σ ⌈(n − (i mod 2ᵗ)) / 2ᵗ⁺¹⌉ over the bits t that are set in i
//! ```
//!
//! Whatever prefix of it one takes, the places are evenly spread, hence evenly spread over the mesh,
//! too: place 0 is the first, and from each place to the next, and from the last to the block's
//! end, it is at most twice the mean gap (count / prefix).

/// At most this many Gaussians stand in a block.
pub const BLOCK_LEN: u32 = 4096;
/// So many Gaussians of a block in a row share ranges; the last ones of it may be fewer.
pub const GROUP_LEN: usize = 256;

/// Rank of the Gaussian at place `place` of a block of `count`: a permutation of 0..count. `place` is
/// below `count`.
#[inline]
pub fn rank(place: u32, count: u32) -> u32 {
    let mut rank = 0;
    let mut bits = place;
    while bits != 0 {
        let bit = bits & bits.wrapping_neg();
        // Places that agree below this bit and have a 0 here come before; each 2 · bit apart.
        let before = place & (bit - 1);
        // ⌈n / 2ᵗ⁺¹⌉ by shifts, which cannot divide by zero, whatever the place.
        rank += ((count - before - 1) >> bit.trailing_zeros() >> 1) + 1;
        bits ^= bit;
    }
    rank
}

/// Cuts a region's layers into blocks: (layer, first rank, count) in order.
pub fn blocks(layer_counts: &[u32]) -> impl Iterator<Item = (u8, u32, u32)> + '_ {
    let mut start = 0;
    layer_counts.iter().enumerate().flat_map(move |(layer, &count)| {
        let layer_start = start;
        start += count;
        let pieces = count.div_ceil(BLOCK_LEN);
        (0..pieces).map(move |piece| {
            // Pieces of one layer differ by at most one in length.
            let from = (u64::from(count) * u64::from(piece) / u64::from(pieces)) as u32;
            let to = (u64::from(count) * u64::from(piece + 1) / u64::from(pieces)) as u32;
            (layer as u8, layer_start + from, to - from)
        })
    })
}

/// Seats of a layer's blocks, where its Gaussians are dealt to them like cards, one to each in every round: in the order of
/// reversed bits, so that the first blocks sit evenly apart, and each half way between two that came before.
#[cfg(feature = "std")]
pub fn seats(blocks: usize) -> Vec<usize> {
    let mut seats: Vec<usize> = (0..blocks).collect();
    seats.sort_by_key(|seat| seat.reverse_bits());
    seats
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_a_permutation_for_every_length() {
        for count in 1..=BLOCK_LEN {
            let mut seen = [false; BLOCK_LEN as usize];
            for rank in (0..count).map(|place| rank(place, count)) {
                assert!(
                    !core::mem::replace(&mut seen[rank as usize], true),
                    "{rank} twice in {count}"
                );
            }
        }
    }

    #[test]
    fn ranks_follow_reversed_bits() {
        for count in [1, 2, 3, 100, 256, 1000, 4095, 4096] {
            let mut places: Vec<u32> = (0..count).collect();
            places.sort_by_key(|place| place.reverse_bits());
            for (expected, place) in places.into_iter().enumerate() {
                assert_eq!(rank(place, count), expected as u32);
            }
        }
    }

    #[test]
    fn gaps_of_a_prefix_are_at_most_twice_the_mean() {
        for count in (1..=300).chain((301..=BLOCK_LEN).step_by(173)).chain([BLOCK_LEN]) {
            let mut places: Vec<u32> = (0..count).collect();
            places.sort_by_key(|&place| rank(place, count));
            let step = if count <= 300 { 1 } else { 37 };
            for prefix in (1..=count).step_by(step).chain([count - count / 2, count]) {
                let mut drawn = places[..prefix as usize].to_vec();
                drawn.sort_unstable();
                assert_eq!(drawn[0], 0, "{prefix} of {count}");
                for (place, next) in drawn.iter().zip(drawn[1..].iter().chain([&count])) {
                    assert!((next - place) * prefix <= 2 * count, "{prefix} of {count}: {place}");
                }
            }
        }
    }

    #[test]
    fn blocks_cover_layers_without_overlap() {
        let layers = [3, 0, 5000, 12_288, 1];
        let mut next = 0;
        for (layer, first, count) in blocks(&layers) {
            assert_eq!(first, next);
            assert!(count > 0 && count <= BLOCK_LEN);
            next += count;
            let end: u32 = layers[..=usize::from(layer)].iter().sum();
            assert!(next <= end, "a block crosses the end of layer {layer}");
        }
        assert_eq!(next, layers.iter().sum::<u32>());
    }
}
