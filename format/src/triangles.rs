//! Triangles of a block's Gaussians: numbers that never descend, by Elias and Fano's code.
//!
//! Of each number above the first one the lowest bits stand as they are. The others are written in
//! unary, as steps from one number to the next: so many zeros, and a one. For n numbers up to u the two take about
//! n · (2 + log₂(u / n)) bits, within half a bit of the least that any code of such numbers needs (Elias 1974).

use crate::bits::{bits, bytes_for};
use crate::record::{TrianglesRecord, take_plane};

/// Widest lower part; with a `bits` of 25 to spare.
pub(crate) const MOST_LOW_BITS: u8 = 24;

/// Triangle of each Gaussian of a block, in ascending order; empty without a mesh.
#[derive(Clone, Copy, Debug, Default)]
pub struct Triangles<'a> {
    base: u32,
    low_bits: u8,
    count: u32,
    lows: &'a [u8],
    steps: &'a [u8],
}

impl<'a> Triangles<'a> {
    /// Splits the triangles of `count` Gaussians off the front of a block's bytes. Lengths are checked, numbers are not.
    pub(crate) fn split(bytes: &'a [u8], count: u32) -> Option<(Self, &'a [u8])> {
        let (head, rest) = take_plane::<TrianglesRecord>(bytes, 1)?;
        let head = head.first()?;
        if head.low_bits > MOST_LOW_BITS {
            return None;
        }
        let lows = bytes_for(count as usize * usize::from(head.low_bits));
        let (lows, rest) = take_plane(rest, lows)?;
        let (steps, rest) = take_plane(rest, usize::from(head.step_bytes.get()))?;
        let base = head.base.get();
        Some((Self { base, low_bits: head.low_bits, count, lows, steps }, rest))
    }

    /// Whether there are as many as Gaussians, none is less than the one before, and each is below `triangles`.
    pub(crate) fn are_valid(&self, triangles: u32) -> bool {
        // At most 2¹⁹ steps and 24 bits below each: the sum needs 44.
        let ones: u32 = self.steps.iter().map(|byte| byte.count_ones()).sum();
        let mut places = Places::new(self.steps);
        let (mut index, mut before) = (0, 0);
        ones == self.count
            && core::iter::from_fn(|| places.next()).all(|place| {
                let high = u64::from(place - index) << self.low_bits;
                let low = bits(
                    self.lows,
                    index as usize * usize::from(self.low_bits),
                    self.low_bits.into(),
                );
                index += 1;
                let triangle = u64::from(self.base) + (high | u64::from(low));
                let follows = triangle >= before;
                before = triangle;
                follows && triangle < u64::from(triangles)
            })
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The triangles, one after the other.
    pub fn iter(&self) -> Iter<'a> {
        Iter { of: *self, places: Places::new(self.steps), index: 0 }
    }
}

/// Walks triangles.
#[derive(Clone, Debug)]
pub struct Iter<'a> {
    of: Triangles<'a>,
    places: Places<'a>,
    index: u32,
}

impl Iterator for Iter<'_> {
    type Item = u32;

    #[inline]
    fn next(&mut self) -> Option<u32> {
        let place = self.places.next()?;
        let width = u32::from(self.of.low_bits);
        let low = bits(self.of.lows, self.index as usize * width as usize, width);
        let high = place.wrapping_sub(self.index) << width;
        self.index += 1;
        Some(self.of.base.wrapping_add(high | low))
    }
}

/// Places of the ones in a row of bits.
#[derive(Clone, Debug)]
struct Places<'a> {
    rest: &'a [u8],
    /// Bits that are yet to be looked at, of those before `rest`.
    word: u64,
    /// Place of the word's lowest bit.
    start: u32,
    /// Place of `rest`'s lowest bit.
    next: u32,
}

impl<'a> Places<'a> {
    fn new(bits: &'a [u8]) -> Self {
        Self { rest: bits, word: 0, start: 0, next: 0 }
    }

    #[inline]
    fn next(&mut self) -> Option<u32> {
        while self.word == 0 {
            if self.rest.is_empty() {
                return None;
            }
            self.start = self.next;
            if let Some((word, rest)) = self.rest.split_first_chunk() {
                (self.word, self.rest) = (u64::from_le_bytes(*word), rest);
            } else {
                let mut word = [0; 8];
                word.iter_mut().zip(self.rest).for_each(|(to, from)| *to = *from);
                (self.word, self.rest) = (u64::from_le_bytes(word), &[]);
            }
            self.next += u64::BITS;
        }
        let place = self.start + self.word.trailing_zeros();
        self.word &= self.word - 1;
        Some(place)
    }
}

/// The bytes of triangles that ascend: head, lower parts, steps. `None` if they span more than the code can hold.
#[cfg(feature = "std")]
pub(crate) fn encode(triangles: &[u32]) -> Option<Vec<u8>> {
    use crate::bits::BitWriter;

    let base = triangles.first().copied().unwrap_or(0);
    let span = triangles.last().map_or(0, |last| last - base);
    let steps = |low_bits: u8| triangles.len() as u64 + u64::from(span >> low_bits);
    let bits = |low_bits: u8| triangles.len() as u64 * u64::from(low_bits) + steps(low_bits);
    let low_bits = (0..=MOST_LOW_BITS).min_by_key(|&low_bits| bits(low_bits))?;
    let step_bytes = u16::try_from(steps(low_bits).div_ceil(8)).ok()?;
    let (mut lows, mut unary) = (BitWriter::default(), BitWriter::default());
    let mut before = 0;
    for triangle in triangles.iter().map(|triangle| triangle - base) {
        lows.push(triangle, low_bits.into());
        let high = triangle >> low_bits;
        (before..high).for_each(|_| unary.push(0, 1));
        unary.push(1, 1);
        before = high;
    }
    let head = TrianglesRecord { base: base.into(), low_bits, step_bytes: step_bytes.into() };
    Some([bytemuck::bytes_of(&head), &lows.finish(), &unary.finish()].concat())
}
