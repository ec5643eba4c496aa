//! What a number is likely to be.

use super::columns::Column;
use super::earlier::Earlier;
use crate::bits::{bits, flip, mask};
use crate::order::GROUP_LEN;

/// How a number is told from those before it: what is coded is the difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Prediction {
    /// 0.
    Zero,
    /// The one `lag` numbers before, 0 where there is none.
    Previous,
    /// The same number of the same disc at an earlier level. Not for numbers of more than 8 bits.
    Earlier,
    /// What stands half way between the same number of the discs on either side, for [`super::between::ALIKE`].
    Between,
}

/// Bits that say which.
pub(super) const PREDICTION_BITS: u32 = 2;

impl Prediction {
    pub(super) const ALL: [Self; 4] = [Self::Zero, Self::Previous, Self::Earlier, Self::Between];

    /// Of a code of [`PREDICTION_BITS`].
    pub(super) fn of(code: u32) -> Self {
        let [zero, previous, earlier, between] = Self::ALL;
        match code {
            0 => zero,
            1 => previous,
            2 => earlier,
            _ => between,
        }
    }

    /// Its code.
    #[cfg(feature = "std")]
    pub(super) fn code(self) -> u32 {
        self as u32
    }
}

/// Numbers of a column from differences, and back: [`BATCH`] at a time, from the first one on.
pub(super) trait Predictor {
    /// Adds to each of a batch what it was likely to be. What the payload holds before the column is known.
    fn add(&mut self, payload: &[u8], batch: &mut [u8]);
    /// The inverse.
    #[cfg(feature = "std")]
    fn subtract(&mut self, payload: &[u8], batch: &mut [u8]);
}

/// Numbers in a batch: discs with the same ranges.
pub(super) const BATCH: usize = GROUP_LEN;

/// [`Prediction::Zero`].
pub(super) struct Zero;

impl Predictor for Zero {
    #[inline(always)]
    fn add(&mut self, _: &[u8], _: &mut [u8]) {}

    #[cfg(feature = "std")]
    fn subtract(&mut self, _: &[u8], _: &mut [u8]) {}
}

/// [`Prediction::Previous`], of numbers of at most 8 bits.
#[derive(Default)]
pub(super) struct Previous {
    number: u8,
}

impl Predictor for Previous {
    #[inline(always)]
    fn add(&mut self, _: &[u8], batch: &mut [u8]) {
        for number in batch {
            self.number = self.number.wrapping_add(*number);
            *number = self.number;
        }
    }

    #[cfg(feature = "std")]
    fn subtract(&mut self, _: &[u8], batch: &mut [u8]) {
        for number in batch {
            let here = *number;
            *number = here.wrapping_sub(self.number);
            self.number = here;
        }
    }
}

/// [`Prediction::Earlier`].
pub(super) struct FromEarlier<'a> {
    earlier: Earlier<'a>,
    batch: usize,
}

impl<'a> FromEarlier<'a> {
    pub(super) fn new(earlier: Earlier<'a>) -> Self {
        Self { earlier, batch: 0 }
    }

    #[inline(always)]
    fn each(&mut self, payload: &[u8], batch: &mut [u8], apply: impl Fn(u8, u8) -> u8) {
        let map = self.earlier.map(payload, self.batch);
        let (at, width) = self.earlier.field();
        let stride = self.earlier.discs.layout().bits() as usize;
        let mut at = at as usize + self.batch * BATCH * stride;
        for number in batch {
            let there = bits(self.earlier.discs.records(), at, width);
            *number = apply(*number, map.apply(there) as u8);
            at += stride;
        }
        self.batch += 1;
    }
}

impl Predictor for FromEarlier<'_> {
    #[inline(always)]
    fn add(&mut self, payload: &[u8], batch: &mut [u8]) {
        self.each(payload, batch, u8::wrapping_add);
    }

    #[cfg(feature = "std")]
    fn subtract(&mut self, payload: &[u8], batch: &mut [u8]) {
        self.each(payload, batch, u8::wrapping_sub);
    }
}

/// Numbers of more than 8 bits from folded differences, in place; `false` if they cannot be predicted so.
pub(super) fn unfold_column(
    payload: &mut [u8],
    column: &Column<'_>,
    prediction: Prediction,
) -> bool {
    if prediction == Prediction::Zero {
        return true;
    }
    for index in 0..column.count {
        let folded = number(payload, column, index);
        let Some(there) = predicted(payload, column, prediction, index) else { return false };
        let here = there.wrapping_add(unfold(folded, column.width)) & mask(column.width);
        flip(payload, column.at + index * column.stride, folded ^ here);
    }
    true
}

/// The inverse, not in place.
#[cfg(feature = "std")]
pub(super) fn folded(
    payload: &[u8],
    column: &Column<'_>,
    prediction: Prediction,
) -> Option<Vec<u32>> {
    let difference = |index: usize| {
        let here = number(payload, column, index);
        if prediction == Prediction::Zero {
            return Some(here);
        }
        let there = predicted(payload, column, prediction, index)?;
        Some(fold(here.wrapping_sub(there), column.width))
    };
    (0..column.count).map(difference).collect()
}

/// A number of a column.
pub(super) fn number(payload: &[u8], column: &Column<'_>, index: usize) -> u32 {
    bits(payload, column.at + index * column.stride, column.width)
}

/// What a number of more than 8 bits is likely to be.
fn predicted(
    payload: &[u8],
    column: &Column<'_>,
    prediction: Prediction,
    index: usize,
) -> Option<u32> {
    match prediction {
        Prediction::Zero => Some(0),
        Prediction::Previous => {
            Some(index.checked_sub(column.lag).map_or(0, |before| number(payload, column, before)))
        }
        Prediction::Earlier | Prediction::Between => None,
    }
}

/// A difference as a number that is small if it is: 0, −1, 1, −2, … of `width` bits.
#[cfg(feature = "std")]
fn fold(difference: u32, width: u32) -> u32 {
    let signed = (difference << (32 - width)) as i32 >> (32 - width);
    (signed << 1 ^ signed >> 31) as u32 & mask(width)
}

/// The inverse of [`fold`].
fn unfold(folded: u32, width: u32) -> u32 {
    (folded >> 1 ^ (folded & 1).wrapping_neg()) & mask(width)
}
