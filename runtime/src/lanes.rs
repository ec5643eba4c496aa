//! Vectors of f32 whose lanes do what one f32 does, bit for bit.
//!
//! Only + − × ÷ √, comparisons, selections and bit operations are used: they are equal at every
//! level of fearless_simd. Its `mul_add`, reciprocals and roundings are not, nor are its `min` and
//! `max` for NaN and zeros.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, f32x16, i32x4, i32x8, i32x16, u32x4, u32x8, u32x16};

use crate::math::{ROOT_HALF_BITS, Real, Single, each};

/// Most lanes of any vector.
pub const MAX_LANES: usize = 16;

/// Four numbers of one thing.
pub type Row = [f32; 4];

/// Those of `LEN` things from `at` on; none where there are fewer.
#[inline(always)]
pub(crate) fn lanes_at<T, V: Lanes>(rows: &[T], at: usize) -> &[T] {
    rows.get(at..at + V::LEN).unwrap_or(&[])
}

#[inline(always)]
pub(crate) fn load<V: Lanes>(token: V::Token, from: &[f32], at: usize) -> V {
    V::load(token, lanes_at::<_, V>(from, at))
}

#[inline(always)]
pub(crate) fn load_rows<V: Lanes>(token: V::Token, from: &[Row], at: usize) -> [V; 4] {
    V::load_rows(token, lanes_at::<_, V>(from, at))
}

/// `LEN` numbers side by side. `Token` proves that the CPU has the vector's instructions.
pub trait Lanes: Single {
    /// How many; divides [`MAX_LANES`].
    const LEN: usize;
    /// The proof.
    type Token: Copy;
    /// `x` in every lane.
    fn splat(token: Self::Token, x: f32) -> Self;
    /// From `LEN` numbers.
    fn load(token: Self::Token, from: &[f32]) -> Self;
    /// From `LEN` integers below 2²⁴.
    fn load_integers(token: Self::Token, from: &[i32]) -> Self;
    /// To `LEN` numbers.
    fn store(self, to: &mut [f32]);
    /// Bit i is lane i.
    fn bits(mask: Self::Mask) -> u32;
    /// The first, second, third and fourth numbers of `LEN` things.
    fn load_rows(token: Self::Token, from: &[Row]) -> [Self; 4];
    /// The inverse of [`Self::load_rows`].
    fn store_rows(columns: [Self; 4], to: &mut [Row]);

    /// `LEN` words of 32 bits side by side.
    type Words: Copy;
    /// From `LEN` words.
    fn load_words(token: Self::Token, from: &[u32]) -> Self::Words;
    /// The first, second, third and fourth words of `LEN` things.
    fn load_word_rows(token: Self::Token, from: &[[u32; 4]]) -> [Self::Words; 4];
    /// To `LEN` words.
    fn store_words(words: Self::Words, to: &mut [u32]);
    /// The integers in the bits of `mask`, which is below 2²⁴, after the words are moved down by `shift`.
    fn field(words: Self::Words, shift: u32, mask: u32) -> Self;
    /// Numbers from 0 to below 2²⁴, rounded down, each moved up by its shift. None may reach the bits of
    /// the next one. A lane with another number gives anything.
    fn pack<const N: usize>(token: Self::Token, fields: [Self; N], shifts: [u32; N])
    -> Self::Words;
    /// Numbers of the same bits.
    fn of_bits(words: Self::Words) -> Self;
}

impl Lanes for f32 {
    const LEN: usize = 1;
    type Token = ();
    #[inline(always)]
    fn splat((): (), x: f32) -> Self {
        x
    }
    #[inline(always)]
    fn load((): (), from: &[f32]) -> Self {
        from.first().copied().unwrap_or(0.0)
    }
    #[inline(always)]
    fn load_integers((): (), from: &[i32]) -> Self {
        from.first().map_or(0.0, |&x| x as f32)
    }
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        if let Some(to) = to.first_mut() {
            *to = self;
        }
    }
    #[inline(always)]
    fn bits(mask: bool) -> u32 {
        u32::from(mask)
    }
    #[inline(always)]
    fn load_rows((): (), from: &[Row]) -> [Self; 4] {
        from.first().copied().unwrap_or_default()
    }
    #[inline(always)]
    fn store_rows(columns: [Self; 4], to: &mut [Row]) {
        if let Some(to) = to.first_mut() {
            *to = columns;
        }
    }

    type Words = u32;
    #[inline(always)]
    fn load_words((): (), from: &[u32]) -> u32 {
        from.first().copied().unwrap_or(0)
    }
    #[inline(always)]
    fn load_word_rows((): (), from: &[[u32; 4]]) -> [u32; 4] {
        from.first().copied().unwrap_or_default()
    }
    #[inline(always)]
    fn store_words(words: u32, to: &mut [u32]) {
        if let Some(to) = to.first_mut() {
            *to = words;
        }
    }
    #[inline(always)]
    fn field(words: u32, shift: u32, mask: u32) -> Self {
        (words >> shift & mask) as f32
    }
    #[inline(always)]
    fn pack<const N: usize>((): (), fields: [Self; N], shifts: [u32; N]) -> u32 {
        let mut words = 0;
        for i in 0..N {
            words |= (fields[i] as i32 as u32) << shifts[i];
        }
        words
    }
    #[inline(always)]
    fn of_bits(words: u32) -> Self {
        Self::from_bits(words)
    }
}

/// Rows of four to columns: even and odd elements told apart, twice.
#[inline(always)]
fn rows_to_columns<S: Simd, T: SimdBase<S>>([a, b, c, d]: [T; 4]) -> [T; 4] {
    let ((xz, yw), (xz_2, yw_2)) = (a.deinterleave(b), c.deinterleave(d));
    let ((x, z), (y, w)) = (xz.deinterleave(xz_2), yw.deinterleave(yw_2));
    [x, y, z, w]
}

/// The inverse of [`rows_to_columns`].
#[inline(always)]
fn columns_to_rows<S: Simd, T: SimdBase<S>>([x, y, z, w]: [T; 4]) -> [T; 4] {
    let ((xz, xz_2), (yw, yw_2)) = (x.interleave(z), y.interleave(w));
    let ((a, b), (c, d)) = (xz.interleave(yw), xz_2.interleave(yw_2));
    [a, b, c, d]
}

macro_rules! lanes {
    ($float:ident, $signed:ident, $unsigned:ident, $len:literal) => {
        impl<S: Simd> Real for $float<S> {
            type Mask = <Self as SimdBase<S>>::Mask;
            #[inline(always)]
            fn like(self, x: f32) -> Self {
                <Self as SimdBase<S>>::splat(self.token(), x)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                SimdFloat::sqrt(self)
            }
            #[inline(always)]
            fn exp2(self) -> Self {
                crate::math::exp2(self)
            }
            #[inline(always)]
            fn log2(self) -> Self {
                crate::math::log2(self)
            }
            #[inline(always)]
            fn line(self) -> [Self; 2] {
                crate::math::line(self)
            }
            #[inline(always)]
            fn below(self, other: Self) -> Self::Mask {
                self.simd_lt(other)
            }
            #[inline(always)]
            fn reaches(self, other: Self) -> Self::Mask {
                self.simd_ge(other)
            }
            #[inline(always)]
            fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
                mask.select(yes, no)
            }
        }

        impl<S: Simd> Single for $float<S> {
            #[inline(always)]
            fn times_power_of_two(self, rounded: Self) -> Self {
                let (bits, exponent): ($signed<S>, $signed<S>) =
                    (self.bitcast(), rounded.bitcast());
                (bits + (exponent << 23)).bitcast()
            }
            #[inline(always)]
            fn least(self, other: Self) -> Self {
                // Levels differ for NaN and zeros only.
                self.min(other)
            }
            #[inline(always)]
            fn mantissa_and_exponent(self) -> [Self; 2] {
                let bits: $signed<S> = self.bitcast();
                let exponent = (bits - ROOT_HALF_BITS) >> 23;
                let mantissa = bits - (exponent << 23);
                [mantissa.bitcast(), Self::float_from(exponent)]
            }
        }

        impl<S: Simd> Lanes for $float<S> {
            const LEN: usize = $len;
            type Token = S;
            #[inline(always)]
            fn splat(token: S, x: f32) -> Self {
                <Self as SimdBase<S>>::splat(token, x)
            }
            #[inline(always)]
            fn load(token: S, from: &[f32]) -> Self {
                match from.first_chunk::<$len>() {
                    Some(from) => Self::load_array_ref(token, from),
                    None => <Self as SimdBase<S>>::splat(token, 0.0),
                }
            }
            #[inline(always)]
            fn load_integers(token: S, from: &[i32]) -> Self {
                match from.first_chunk::<$len>() {
                    Some(from) => Self::float_from($signed::load_array_ref(token, from)),
                    None => <Self as SimdBase<S>>::splat(token, 0.0),
                }
            }
            #[inline(always)]
            fn store(self, to: &mut [f32]) {
                if let Some(to) = to.first_chunk_mut::<$len>() {
                    self.store_array(to);
                }
            }
            #[inline(always)]
            fn bits(mask: Self::Mask) -> u32 {
                mask.to_bitmask() as u32
            }
            #[inline(always)]
            fn load_rows(token: S, from: &[Row]) -> [Self; 4] {
                match from.as_flattened().first_chunk::<{ 4 * $len }>() {
                    Some(from) => rows_to_columns(each(
                        [0, 1, 2, 3],
                        #[inline(always)]
                        |i: usize| Lanes::load(token, &from[i * $len..]),
                    )),
                    None => [<Self as SimdBase<S>>::splat(token, 0.0); 4],
                }
            }
            #[inline(always)]
            fn store_rows(columns: [Self; 4], to: &mut [Row]) {
                if let Some(to) = to.as_flattened_mut().first_chunk_mut::<{ 4 * $len }>() {
                    let rows = columns_to_rows(columns);
                    for i in 0..4 {
                        rows[i].store(&mut to[i * $len..]);
                    }
                }
            }

            type Words = $unsigned<S>;
            #[inline(always)]
            fn load_words(token: S, from: &[u32]) -> $unsigned<S> {
                match from.first_chunk::<$len>() {
                    Some(from) => $unsigned::load_array_ref(token, from),
                    None => <$unsigned<S> as SimdBase<S>>::splat(token, 0),
                }
            }
            #[inline(always)]
            fn load_word_rows(token: S, from: &[[u32; 4]]) -> [$unsigned<S>; 4] {
                match from.as_flattened().first_chunk::<{ 4 * $len }>() {
                    Some(from) => rows_to_columns(each(
                        [0, 1, 2, 3],
                        #[inline(always)]
                        |i: usize| <Self as Lanes>::load_words(token, &from[i * $len..]),
                    )),
                    None => [<$unsigned<S> as SimdBase<S>>::splat(token, 0); 4],
                }
            }
            #[inline(always)]
            fn store_words(words: $unsigned<S>, to: &mut [u32]) {
                if let Some(to) = to.first_chunk_mut::<$len>() {
                    words.store_array(to);
                }
            }
            #[inline(always)]
            fn field(words: $unsigned<S>, shift: u32, mask: u32) -> Self {
                // Below 2²⁴ a word is the same number with and without a sign.
                let field: $signed<S> = ((words >> shift) & mask).bitcast();
                Self::float_from(field)
            }
            #[inline(always)]
            fn pack<const N: usize>(token: S, fields: [Self; N], shifts: [u32; N]) -> $unsigned<S> {
                let mut words = <$signed<S> as SimdBase<S>>::splat(token, 0);
                for i in 0..N {
                    // Of numbers from 0 to below 2²⁴ every level makes the same integers.
                    let field: $signed<S> = fields[i].to_int();
                    words |= field << shifts[i];
                }
                words.bitcast()
            }
            #[inline(always)]
            fn of_bits(words: $unsigned<S>) -> Self {
                words.bitcast()
            }
        }
    };
}
lanes!(f32x4, i32x4, u32x4, 4);
lanes!(f32x8, i32x8, u32x8, 8);
lanes!(f32x16, i32x16, u32x16, 16);
