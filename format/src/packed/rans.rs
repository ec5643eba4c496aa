//! Static range variants of asymmetric numeral systems (Duda 2013), four states in turn (Giesen 2014).
//!
//! A state x codes symbol s of frequency f and cumulative frequency c, of 4,096 in all, as ⌊x / f⌋ · 4096 + c + x mod f; below 2¹⁶ a
//! state takes in 16 bits more. Symbol i belongs to state i mod 4, so that four chains of arithmetic run at once.

use super::table::{SCALE_BITS, SLOTS, Slots};
use crate::bits::chunk;

/// States are at least this between symbols.
const LOW: u32 = 1 << 16;
/// Side by side.
const LANES: usize = 4;
/// Bytes of the states, before the words.
pub(super) const STATES_LEN: usize = 4 * LANES;

/// Takes symbols out, in the order in which they were put in.
#[derive(Debug)]
pub(super) struct Decoder<'a> {
    states: [u32; LANES],
    words: &'a [u8],
    /// Next byte of `words`.
    at: usize,
}

impl<'a> Decoder<'a> {
    /// Of states and words. What is missing is 0: a checksum tells.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let (states, words) = bytes.split_at(STATES_LEN.min(bytes.len()));
        let state = |lane: usize| u32::from_le_bytes(chunk(states, 4 * lane));
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
    fn take(&mut self, slots: &Slots, states: &mut [u32; LANES], symbols: &mut [u8]) {
        let mut window = u64::from_le_bytes(chunk(self.words, self.at));
        for (state, symbol) in states.iter_mut().zip(symbols) {
            let slot = slots.get(*state as usize % SLOTS);
            *symbol = slot.symbol();
            let next = slot.frequency().wrapping_mul(*state >> SCALE_BITS) + slot.offset();
            let is_low = next < LOW;
            *state = if is_low { next << 16 | (window as u32 & 0xffff) } else { next };
            window >>= if is_low { 16 } else { 0 };
            self.at += if is_low { 2 } else { 0 };
        }
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
    let (mut states, mut words) = ([LOW; LANES], Vec::<u16>::new());
    for Run { symbols, table } in runs.iter().rev() {
        let table = table.ranges();
        for (index, &symbol) in symbols.iter().enumerate().rev() {
            let (frequency, start) = table[usize::from(symbol)];
            let state = &mut states[index % LANES];
            // Above it the step would not fit.
            if u64::from(*state) >= u64::from(frequency) << (32 - SCALE_BITS) {
                words.push(*state as u16);
                *state >>= 16;
            }
            let (whole, rest) = (*state / frequency, *state % frequency);
            *state = (whole << SCALE_BITS) + start + rest;
        }
    }
    let words = words.iter().rev().flat_map(|word| word.to_le_bytes());
    states.iter().flat_map(|state| state.to_le_bytes()).chain(words).collect()
}
