//! Depth order of a tile's list: stable, without a comparison function that could panic.

use crate::tiles::Pair;

/// Lists this short are sorted by insertion.
const SHORT: usize = 24;
/// Bits of a digit at most.
const DIGIT: u32 = 11;

/// Sorts a list by depth; pairs of one depth stay in their order. `spare` must be at least as long,
/// or the list stays as it is.
///
/// Radix sort, least significant digit first, on depths less the list's least one: lists of one
/// tile span so little that two digits do, wide ones for a long list, narrow ones for a short one.
pub(crate) fn by_depth(list: &mut [Pair], spare: &mut [Pair]) {
    if list.len() <= SHORT {
        return insert(list);
    }
    let Some(spare) = spare.get_mut(..list.len()) else { return };
    let (least, greatest) = list.iter().fold((u32::MAX, 0), |(least, greatest), pair| {
        (least.min(pair.depth), greatest.max(pair.depth))
    });
    let bits = u32::BITS - (greatest - least).leading_zeros();
    // A digit has about as many values as there are pairs, so that counting costs no more than moving.
    let widest = (list.len().ilog2() + 2).min(DIGIT);
    let passes = bits.div_ceil(widest);
    let width = bits.checked_div(passes).map_or(0, |_| bits.div_ceil(passes));
    let mut counts = [0; 1 << DIGIT];
    let (mut from, mut to) = (list, spare);
    for pass in 0..passes {
        let digit = |depth: u32| (depth - least) >> (pass * width) & ((1 << width) - 1);
        let places = counts.get_mut(..1 << width).unwrap_or(&mut []);
        places.fill(0);
        count(from, places, digit);
        scatter(from, to, places, digit);
        core::mem::swap(&mut from, &mut to);
    }
    if passes % 2 == 1 {
        // The sorted pairs are in the spare memory.
        to.copy_from_slice(from);
    }
}

/// Counts pairs by bucket.
#[inline(always)]
fn count(list: &[Pair], counts: &mut [u32], bucket: impl Fn(u32) -> u32) {
    for pair in list {
        if let Some(count) = counts.get_mut(bucket(pair.depth) as usize) {
            *count += 1;
        }
    }
}

/// Moves pairs to their buckets, in their order; `places` are the counts of the buckets.
#[inline(always)]
fn scatter(from: &[Pair], to: &mut [Pair], places: &mut [u32], bucket: impl Fn(u32) -> u32) {
    let mut sum = 0;
    for place in places.iter_mut() {
        sum += core::mem::replace(place, sum);
    }
    for pair in from {
        if let Some(place) = places.get_mut(bucket(pair.depth) as usize) {
            if let Some(slot) = to.get_mut(*place as usize) {
                *slot = *pair;
            }
            *place += 1;
        }
    }
}

/// Sorts by insertion.
fn insert(list: &mut [Pair]) {
    for end in 1..list.len() {
        let mut at = end;
        while let Some([before, pair]) = list.get_mut(at.wrapping_sub(1)..=at) {
            if before.depth <= pair.depth {
                break;
            }
            core::mem::swap(before, pair);
            at -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn check(depths: impl Iterator<Item = u32>) {
        let mut list: Vec<Pair> =
            depths.zip(0..).map(|(depth, splat)| Pair { depth, splat }).collect();
        let mut expected = list.clone();
        expected.sort_by_key(|pair| pair.depth);
        by_depth(&mut list, &mut std::vec![Pair::default(); expected.len()]);
        assert_eq!(list, expected);
    }

    proptest! {
        #[test]
        fn sorts_like_the_standard_library(
            least in any::<u32>(),
            shift in 0u32..32,
            depths in prop::collection::vec(any::<u32>(), 0..700),
        ) {
            check(depths.iter().map(|depth| least.saturating_add(depth >> shift)));
        }
    }

    #[test]
    fn ten_thousand_at_one_depth_keep_their_order() {
        check(core::iter::repeat_n(1.0f32.to_bits(), 10_000));
    }
}
