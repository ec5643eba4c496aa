//! Integer formats: the channels of a pixel in the bits of a word.

use core::marker::PhantomData;

use super::dither;
use super::encoding::Encoding;
use crate::lanes::Lanes;
use crate::math::Real;
use crate::tiles::TILE;

/// A word for each pixel of a tile's row.
type Words = [u32; TILE as usize];

/// In [0, 1]; NaN is 0.
#[inline(always)]
pub(super) fn in_unit<R: Real>(value: R) -> R {
    value.at_least(value.like(0.0)).at_most(value.like(1.0))
}

/// A byte each for red, green, blue and alpha; red and blue begin at bits `RED` and `BLUE`.
pub(super) struct Bytes<const RED: u32, const BLUE: u32>;
/// Red first.
pub(super) type Rgba8 = Bytes<0, 16>;
/// Blue first.
pub(super) type Bgra8 = Bytes<16, 0>;

impl<const RED: u32, const BLUE: u32> Encoding for Bytes<RED, BLUE> {
    type Element = u8;
    const ELEMENTS: usize = 4;
    const PERIOD: usize = 1;
    type Row = Words;
    const ROW: Words = [0; TILE as usize];

    #[inline(always)]
    fn read(pixels: &[u8], row: &mut Words) {
        for (word, bytes) in row.iter_mut().zip(pixels.as_chunks::<4>().0) {
            *word = u32::from_le_bytes(*bytes);
        }
    }

    #[inline(always)]
    fn write(row: &Words, pixels: &mut [u8]) {
        for (bytes, word) in pixels.as_chunks_mut::<4>().0.iter_mut().zip(row) {
            *bytes = word.to_le_bytes();
        }
    }

    #[inline(always)]
    fn load<V: Lanes>(token: V::Token, row: &Words, at: usize) -> [V; 4] {
        let words = V::load_words(token, row.get(at..).unwrap_or(&[]));
        let step = V::splat(token, 1.0 / 255.0);
        [
            V::field(words, RED, 0xff) * step,
            V::field(words, 8, 0xff) * step,
            V::field(words, BLUE, 0xff) * step,
            V::field(words, 24, 0xff) * step,
        ]
    }

    #[inline(always)]
    fn bounded<R: Real>(value: R) -> R {
        in_unit(value)
    }

    #[inline(always)]
    fn store<V: Lanes>(token: V::Token, rgba: [V; 4], _: u32, row: &mut Words, at: usize) {
        let (most, half) = (V::splat(token, 255.0), V::splat(token, 0.5));
        let [r, g, b, a] = rgba;
        let fields = [r * most + half, g * most + half, b * most + half, a * most + half];
        let words = V::pack(token, fields, [RED, 8, BLUE, 24]);
        V::store_words(words, row.get_mut(at..).unwrap_or(&mut []));
    }
}

/// 5 bits of blue, 6 of green, 5 of red, from the lowest on.
pub(super) struct Rgb565<R>(PhantomData<R>);

/// What is added to a value before it is rounded down.
pub(super) trait Rounding {
    /// Rows after which it repeats.
    const PERIOD: usize;
    /// For columns `at..at + V::LEN` of a tile in the frame's row `y`.
    fn bias<V: Lanes>(token: V::Token, y: u32, at: usize) -> V;
}

/// To nearest, halves up.
pub(super) struct Nearest;
/// By Bayer's matrix.
pub(super) struct Dithered;

impl Rounding for Nearest {
    const PERIOD: usize = 1;

    #[inline(always)]
    fn bias<V: Lanes>(token: V::Token, _: u32, _: usize) -> V {
        V::splat(token, 0.5)
    }
}

impl Rounding for Dithered {
    const PERIOD: usize = dither::PERIOD;

    #[inline(always)]
    fn bias<V: Lanes>(token: V::Token, y: u32, at: usize) -> V {
        V::load(token, dither::biases(y, at))
    }
}

impl<R: Rounding> Encoding for Rgb565<R> {
    type Element = u8;
    const ELEMENTS: usize = 2;
    const PERIOD: usize = R::PERIOD;
    type Row = Words;
    const ROW: Words = [0; TILE as usize];

    #[inline(always)]
    fn read(pixels: &[u8], row: &mut Words) {
        for (word, bytes) in row.iter_mut().zip(pixels.as_chunks::<2>().0) {
            *word = u32::from(u16::from_le_bytes(*bytes));
        }
    }

    #[inline(always)]
    fn write(row: &Words, pixels: &mut [u8]) {
        for (bytes, word) in pixels.as_chunks_mut::<2>().0.iter_mut().zip(row) {
            *bytes = (*word as u16).to_le_bytes();
        }
    }

    #[inline(always)]
    fn load<V: Lanes>(token: V::Token, row: &Words, at: usize) -> [V; 4] {
        let words = V::load_words(token, row.get(at..).unwrap_or(&[]));
        let (step, green_step) = (V::splat(token, 1.0 / 31.0), V::splat(token, 1.0 / 63.0));
        [
            V::field(words, 11, 31) * step,
            V::field(words, 5, 63) * green_step,
            V::field(words, 0, 31) * step,
            V::splat(token, 1.0),
        ]
    }

    #[inline(always)]
    fn bounded<T: Real>(value: T) -> T {
        in_unit(value)
    }

    #[inline(always)]
    fn store<V: Lanes>(token: V::Token, [r, g, b, _]: [V; 4], y: u32, row: &mut Words, at: usize) {
        let (most, green_most) = (V::splat(token, 31.0), V::splat(token, 63.0));
        let bias: V = R::bias(token, y, at);
        let fields = [r * most + bias, g * green_most + bias, b * most + bias];
        let words = V::pack(token, fields, [11, 5, 0]);
        V::store_words(words, row.get_mut(at..).unwrap_or(&mut []));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every value of every channel, loaded and stored again, is what it was, by any dither: what
    /// nothing touches stays.
    fn check_round_trips<E: Encoding<Row = Words>>(words: impl Iterator<Item = u32>) {
        for (word, y) in words.zip(0u32..) {
            let (row, mut stored) = ([word; TILE as usize], E::ROW);
            for at in 0..TILE as usize {
                E::store::<f32>((), E::load((), &row, at), y / 64, &mut stored, at);
            }
            assert_eq!(stored, row, "row {}", y / 64);
        }
    }

    #[test]
    fn every_value_stays_when_loaded_and_stored() {
        let bytes = || (0..=255).map(|byte| byte * 0x0101_0101);
        check_round_trips::<Rgba8>(bytes());
        check_round_trips::<Bgra8>(bytes());
        let steps = || (0..64).map(|step| step >> 1 << 11 | step << 5 | step >> 1);
        check_round_trips::<Rgb565<Nearest>>(steps());
        check_round_trips::<Rgb565<Dithered>>((0..8).flat_map(|_| steps()));
    }
}
