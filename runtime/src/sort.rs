//! Depth order of a tile's list: stable, without a comparison function that could panic.

use crate::lists::Pair;

/// Lists this short are sorted by insertion.
const SHORT: usize = 24;
/// Bits of a digit at most.
const DIGIT: u32 = 10;

/// Sorts a list by depth; pairs of one depth stay in their order. `spare` must be at least as long,
/// or the list stays as it is.
///
/// Two passes of radix sort order it by the leading bits of the depths less the list's least one;
/// insertion finishes the few pairs that these bits do not tell apart. Where they are many, it is
/// sorted anew by all bits, the lowest digits first.
pub(crate) fn by_depth(list: &mut [Pair], spare: &mut [Pair]) {
    if list.len() <= SHORT {
        insert(list, usize::MAX);
        return;
    }
    let Some(spare) = spare.get_mut(..list.len()) else { return };
    let (least, greatest) = list.iter().fold((u32::MAX, 0), |(least, greatest), pair| {
        (least.min(pair.depth), greatest.max(pair.depth))
    });
    let bits = u32::BITS - (greatest - least).leading_zeros();
    // A digit has no more values than there are pairs, so that counting costs no more than moving.
    let width = list.len().ilog2().saturating_sub(1).min(DIGIT).min(bits.div_ceil(2));
    let left_out = bits.saturating_sub(2 * width);
    by_two_digits(list, spare, least, left_out, width);
    if left_out > 0 && !insert(list, list.len()) {
        let mut low = 0;
        while low < bits {
            by_two_digits(list, spare, least, low, width);
            low += 2 * width;
        }
    }
}

/// Sorts by the 2 · `width` bits from bit `low` on of depths less `least`.
fn by_two_digits(list: &mut [Pair], spare: &mut [Pair], least: u32, low: u32, width: u32) {
    let mask = (1 << width) - 1;
    let lower = |depth: u32| (depth - least) >> low & mask;
    let upper = |depth: u32| ((depth - least) >> low) >> width & mask;
    let mut counts = [[0; 1 << DIGIT]; 2];
    let [lowers, uppers] = &mut counts;
    for pair in &*list {
        if let Some(count) = lowers.get_mut(lower(pair.depth) as usize) {
            *count += 1;
        }
        if let Some(count) = uppers.get_mut(upper(pair.depth) as usize) {
            *count += 1;
        }
    }
    scatter(list, spare, lowers.get_mut(..1 << width).unwrap_or(&mut []), lower);
    scatter(spare, list, uppers.get_mut(..1 << width).unwrap_or(&mut []), upper);
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

/// Sorts by insertion, unless it takes more than `most` moves: then the list is sorted in part,
/// and pairs of one depth are still in their order. Says whether it is sorted.
fn insert(list: &mut [Pair], most: usize) -> bool {
    let mut moves = 0;
    for end in 1..list.len() {
        let mut at = end;
        while let Some([before, pair]) = list.get_mut(at.wrapping_sub(1)..=at) {
            if before.depth <= pair.depth {
                break;
            }
            core::mem::swap(before, pair);
            at -= 1;
            moves += 1;
        }
        if moves > most {
            return false;
        }
    }
    true
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

        /// A few far away take the leading bits from the others.
        #[test]
        fn sorts_what_leading_bits_do_not_tell_apart(
            shift in 8u32..32,
            depths in prop::collection::vec(any::<u32>(), 25..700),
        ) {
            let near = depths.iter().map(|depth| 1 << 20 | depth >> shift);
            check(near.chain([u32::MAX, 0, u32::MAX >> 1]));
        }
    }

    #[test]
    fn ten_thousand_at_one_depth_keep_their_order() {
        check(core::iter::repeat_n(1.0f32.to_bits(), 10_000));
    }
}
