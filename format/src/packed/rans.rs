//! Static range variants of asymmetric numeral systems (Duda 2013), four states in turn (Giesen 2014).
//!
//! A state x codes symbol s of frequency f and cumulative frequency c, of 4,096 in all, as ⌊x / f⌋ · 4096 + c + x mod
//! f; below 2³¹ a state takes in 32 bits more. Symbol i belongs to state i mod 4, so that four chains of arithmetic
//! run at once.

use super::table::{SCALE_BITS, SLOTS, Slots};
use crate::bits::chunk;

/// States are at least this between symbols.
const LOW: u64 = 1 << 31;
/// Side by side.
const LANES: usize = 4;
/// Bytes of the states, before the words.
pub(super) const STATES_LEN: usize = 8 * LANES;

/// Takes symbols out, in the order in which they were put in.
#[derive(Debug)]
pub(super) struct Decoder<'a> {
    states: [u64; LANES],
    words: &'a [u8],
    /// Next byte of `words`.
    at: usize,
}

impl<'a> Decoder<'a> {
    /// Of states and words. What is missing is 0: a checksum tells.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let (states, words) = bytes.split_at(STATES_LEN.min(bytes.len()));
        let state = |lane: usize| u64::from_le_bytes(chunk(states, 8 * lane));
        Self { states: core::array::from_fn(state), words, at: 0 }
    }

    /// The next symbols. Calls between which the states are to stay in turn fill multiples of 4.
    #[inline]
    pub(super) fn fill(&mut self, slots: &Slots, symbols: &mut [u8]) {
        let mut states = self.states;
        let mut groups = symbols.chunks_exact_mut(LANES);
        for group in &mut groups {
            self.take(slots, &mut states, group);
        }
        self.take(slots, &mut states, groups.into_remainder());
        self.states = states;
    }

    /// A symbol of each state.
    #[inline(always)]
    fn take(&mut self, slots: &Slots, states: &mut [u64; LANES], symbols: &mut [u8]) {
        let words: [u8; 4 * LANES] = chunk(self.words, self.at);
        let words: [u32; LANES] = bytemuck::cast(words);
        let mut taken = 0;
        for (state, symbol) in states.iter_mut().zip(symbols) {
            let slot = slots.get(*state as usize % SLOTS);
            *symbol = slot.symbol();
            // At most 4096 · (2⁵² − 1) + 4095.
            let next =
                u64::from(slot.frequency()) * (*state >> SCALE_BITS) + u64::from(slot.offset());
            let is_low = next < LOW;
            let word = u32::from_le(words[taken % LANES]);
            *state = if is_low { next << 32 | u64::from(word) } else { next };
            taken += usize::from(is_low);
        }
        self.at += 4 * taken;
    }
}

/// Symbols of one table.
#[cfg(feature = "std")]
#[derive(Debug)]
pub(super) struct Run {
    pub(super) symbols: Vec<u8>,
    pub(super) table: super::table::Frequencies,
}

/// States and words of runs of symbols.
#[cfg(feature = "std")]
pub(super) fn encode(runs: &[Run]) -> Vec<u8> {
    let (mut states, mut words) = ([LOW; LANES], Vec::<u32>::new());
    for Run { symbols, table } in runs.iter().rev() {
        let table = table.ranges();
        for (index, &symbol) in symbols.iter().enumerate().rev() {
            let (frequency, start) = table[usize::from(symbol)];
            let state = &mut states[index % LANES];
            // Above it the step would not fit.
            let (frequency, start) = (u64::from(frequency), u64::from(start));
            if *state >= frequency << (63 - SCALE_BITS) {
                words.push(*state as u32);
                *state >>= 32;
            }
            let (whole, rest) = (*state / frequency, *state % frequency);
            *state = (whole << SCALE_BITS) + start + rest;
        }
    }
    let words = words.iter().rev().flat_map(|word| word.to_le_bytes());
    states.iter().flat_map(|state| state.to_le_bytes()).chain(words).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::table::{Frequencies, Slots};
    use super::*;
    use crate::bits::{BitWriter, Bits};

    fn table(symbols: &[u8]) -> Frequencies {
        let mut counts = [0; 256];
        symbols.iter().for_each(|&symbol| counts[usize::from(symbol)] += 1);
        Frequencies::of(&counts).expect("there are symbols")
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn symbols_and_tables_return(
            runs in prop::collection::vec(
                prop::collection::vec(prop_oneof![9 => 0u8..4, 1 => any::<u8>()], 1..600),
                1..4,
            ),
        ) {
            let runs: Vec<Run> = runs
                .into_iter()
                .map(|symbols| Run { table: table(&symbols), symbols })
                .collect();
            let bytes = encode(&runs);
            let (mut decoder, mut slots) = (Decoder::new(&bytes), Slots::default());
            for Run { symbols, table } in &runs {
                let mut written = BitWriter::default();
                table.write(&mut written);
                let written = written.finish();
                prop_assert_eq!(Frequencies::read(&mut Bits::new(&written)), Some(*table));
                slots.fill(table);
                let mut found = vec![0; symbols.len()];
                // In pieces, as a reader takes them.
                found.chunks_mut(256).for_each(|piece| decoder.fill(&slots, piece));
                prop_assert_eq!(&found, symbols);
            }
        }

        #[test]
        fn tables_of_any_bytes_add_up_or_are_none(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            if let Some(table) = Frequencies::read(&mut Bits::new(&bytes)) {
                prop_assert_eq!(table.0.iter().map(|&f| usize::from(f)).sum::<usize>(), 4096);
            }
        }
    }

    #[test]
    fn a_symbol_takes_what_its_frequency_says() {
        // Nine of ten are 0: 0.47 bits each, and states of 32 bytes.
        let symbols: Vec<u8> = (0..40_000u32).map(|i| u8::from(i % 10 == 0)).collect();
        let len = encode(&[Run { table: table(&symbols), symbols }]).len();
        assert!((2345..2345 + 40).contains(&len), "{len}");
    }
}
