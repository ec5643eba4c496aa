//! How often each symbol comes, in 1/4096.

use crate::bits::Bits;

/// log₂ of what frequencies add up to.
pub(super) const SCALE_BITS: u32 = 12;
/// What frequencies add up to.
pub(super) const SLOTS: usize = 1 << SCALE_BITS;

/// Bits that say how many symbols a table has, less one.
const LEN_BITS: u32 = 8;
/// Bits that say how many low bits of a difference stand as they are.
const PARAMETER_BITS: u32 = 3;
/// A table's unary parts are not longer than what any table needs: more is no table.
const LONGEST_UNARY: u32 = 2 * SLOTS as u32;

/// Frequencies of all symbols; all zero: none yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Frequencies(pub(super) [u16; 256]);

impl Default for Frequencies {
    fn default() -> Self {
        Self([0; 256])
    }
}

impl Frequencies {
    /// Reads a table: the last symbol that comes, a parameter k, then of each symbol up to that one the difference d
    /// to the frequency before it (0 before the first): 2 d, or −2 d − 1 if d is negative, as a Golomb-Rice code: ⌊/
    /// 2ᵏ⌋ ones, a zero, k bits. `None` if it is none: frequencies must be 0 to 4,096 and add up to 4,096.
    pub(super) fn read(bits: &mut Bits<'_>) -> Option<Self> {
        let mut table = Self::default();
        let last = bits.take(LEN_BITS) as usize;
        let parameter = bits.take(PARAMETER_BITS);
        let (mut frequency, mut sum) = (0i32, 0i32);
        for to in table.0.iter_mut().take(last + 1) {
            let mut high = 0;
            while bits.take(1) == 1 {
                high += 1;
                if high > LONGEST_UNARY {
                    return None;
                }
            }
            let folded = high << parameter | bits.take(parameter);
            frequency += (folded >> 1) as i32 ^ -((folded & 1) as i32);
            if !(0..=SLOTS as i32).contains(&frequency) {
                return None;
            }
            *to = frequency as u16;
            sum += frequency;
        }
        (sum == SLOTS as i32).then_some(table)
    }
}

/// A symbol, where it begins and how wide it is: 8 bits of symbol, 12 of its frequency less one, 12 of how far the
/// slot is from its first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot(u32);

impl Slot {
    #[inline(always)]
    pub(super) fn symbol(self) -> u8 {
        self.0 as u8
    }

    #[inline(always)]
    pub(super) fn frequency(self) -> u32 {
        (self.0 >> 8 & 0xfff) + 1
    }

    #[inline(always)]
    pub(super) fn offset(self) -> u32 {
        self.0 >> 20
    }
}

/// Symbol of each of 4,096 slots.
#[derive(Clone, Debug)]
pub(super) struct Slots([u32; SLOTS]);

impl Default for Slots {
    fn default() -> Self {
        Self([0; SLOTS])
    }
}

impl Slots {
    /// Of a table that adds up.
    pub(super) fn fill(&mut self, table: &Frequencies) {
        let mut rest = &mut self.0[..];
        for (symbol, &frequency) in (0u32..).zip(&table.0) {
            let frequency = usize::from(frequency).min(rest.len());
            let (own, others) = rest.split_at_mut(frequency);
            let mut slot = symbol | (frequency.max(1) as u32 - 1) << 8;
            for to in own {
                *to = slot;
                slot = slot.wrapping_add(1 << 20);
            }
            rest = others;
        }
    }

    #[inline(always)]
    pub(super) fn get(&self, slot: usize) -> Slot {
        Slot(self.0[slot % SLOTS])
    }
}

#[cfg(feature = "std")]
mod write {
    use super::{Frequencies, LEN_BITS, PARAMETER_BITS, SCALE_BITS, SLOTS};
    use crate::bits::BitWriter;

    impl Frequencies {
        /// For symbols that come so often: in proportion, none that comes being 0. `None` if none comes.
        pub(in crate::packed) fn of(counts: &[u32; 256]) -> Option<Self> {
            let total: u64 = counts.iter().map(|&count| u64::from(count)).sum();
            let share = |count: u32| (u64::from(count) << SCALE_BITS).checked_div(total);
            let mut table = Self::default();
            for (to, &count) in table.0.iter_mut().zip(counts) {
                *to = (share(count)? as u16).max(u16::from(count > 0));
            }
            // What rounding took or gave: where it changes a frequency least, relatively.
            loop {
                let sum: usize = table.0.iter().map(|&f| usize::from(f)).sum();
                let by = SLOTS as i64 - sum as i64;
                if by == 0 {
                    return Some(table);
                }
                let greatest = (0..256).max_by_key(|&i| (table.0[i], core::cmp::Reverse(i)))?;
                let step = by.clamp(-i64::from(table.0[greatest] / 8 + 1), i64::MAX);
                table.0[greatest] = (i64::from(table.0[greatest]) + step) as u16;
            }
        }

        /// Frequency and cumulative frequency of each symbol.
        pub(in crate::packed) fn ranges(&self) -> [(u32, u32); 256] {
            let mut start = 0;
            self.0.map(|frequency| {
                let range = (u32::from(frequency), start);
                start += u32::from(frequency);
                range
            })
        }

        /// The inverse of [`Self::read`], by the parameter for which it is shortest.
        pub(in crate::packed) fn write(&self, bits: &mut BitWriter) {
            let last = self.0.iter().rposition(|&frequency| frequency > 0).unwrap_or(0);
            let mut before = 0;
            let folded: Vec<u32> = self.0[..=last]
                .iter()
                .map(|&frequency| {
                    let difference = i32::from(frequency) - before;
                    before = frequency.into();
                    (difference << 1 ^ difference >> 31) as u32
                })
                .collect();
            let len = |k: u32| folded.iter().map(|folded| (folded >> k) + 1 + k).sum::<u32>();
            let parameter = (0..1 << PARAMETER_BITS).min_by_key(|&k| len(k)).unwrap_or(0);
            bits.push(last as u32, LEN_BITS);
            bits.push(parameter, PARAMETER_BITS);
            for folded in folded {
                (0..folded >> parameter).for_each(|_| bits.push(1, 1));
                bits.push(0, 1);
                bits.push(folded, parameter);
            }
        }
    }
}
