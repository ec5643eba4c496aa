//! Depth order of a tile's list: a radix sort, stable, without a comparison function.

use crate::tiles::Pair;

/// Bits of a digit at most.
const DIGIT: u32 = 8;
/// Digits of a depth at most.
const PASSES: usize = 4;
/// Lists this short are sorted by insertion.
const SHORT: usize = 24;

/// Sorts a list by depth; pairs of one depth stay in their order. `spare` must be at least as long,
/// or the list stays as it is.
///
/// Least significant digit first, on depths less the list's least one: lists of one tile span
/// little, so two or three passes suffice.
pub(crate) fn by_depth(list: &mut [Pair], spare: &mut [Pair]) {
    if list.len() <= SHORT {
        return insert(list);
    }
    let (least, greatest) = list.iter().fold((u32::MAX, 0), |(least, greatest), pair| {
        (least.min(pair.depth), greatest.max(pair.depth))
    });
    let bits = u32::BITS - (greatest - least).leading_zeros();
    let passes = bits.div_ceil(DIGIT);
    let Some(spare) = spare.get_mut(..list.len()).filter(|_| passes > 0) else { return };
    let width = bits.div_ceil(passes);
    let mask = (1u32 << width) - 1;
    let mut counts = [[0u32; 1 << DIGIT]; PASSES];
    for pair in list.iter() {
        let key = pair.depth - least;
        for (pass, counts) in (0..passes).zip(&mut counts) {
            counts[(key >> (pass * width) & mask) as usize % (1 << DIGIT)] += 1;
        }
    }
    let (mut from, mut to) = (list, spare);
    for (pass, counts) in (0..passes).zip(&mut counts) {
        let mut place = 0;
        for count in counts.iter_mut() {
            place += core::mem::replace(count, place);
        }
        for pair in from.iter() {
            let digit = (pair.depth - least) >> (pass * width) & mask;
            let place = &mut counts[digit as usize % (1 << DIGIT)];
            if let Some(slot) = to.get_mut(*place as usize) {
                *slot = *pair;
            }
            *place += 1;
        }
        core::mem::swap(&mut from, &mut to);
    }
    if passes % 2 == 1 {
        // The sorted pairs are in the spare memory.
        to.copy_from_slice(from);
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
