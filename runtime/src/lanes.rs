//! Vectors of f32 whose lanes do what one f32 does, bit for bit.
//!
//! Only + − × ÷ √, comparisons, selections and bit operations are used: they are equal at every
//! level of fearless_simd. Its `mul_add`, reciprocals and roundings are not, nor are its `min` and
//! `max` for NaN and zeros.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, f32x16, i32x4, i32x8, i32x16, u32x4, u32x8, u32x16};

use crate::math::{ROOT_HALF_BITS, Real, Single};

/// Most lanes of any vector.
pub const MAX_LANES: usize = 16;

/// One number of each of sixteen things.
pub type Column = [f32; MAX_LANES];

/// Lanes `at..` of a column.
#[inline(always)]
pub(crate) fn load<V: Lanes>(token: V::Token, column: &Column, at: usize) -> V {
    V::load(token, column.get(at..).unwrap_or(&[]))
}

#[inline(always)]
pub(crate) fn store<V: Lanes>(value: V, column: &mut Column, at: usize) {
    value.store(column.get_mut(at..).unwrap_or(&mut []));
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
    /// The integers in the bits of `mask` of `LEN` words, moved down by `shift` first; `mask` is below
    /// 2²⁴.
    fn load_field(token: Self::Token, from: &[u32], shift: u32, mask: u32) -> Self;
    /// A word for each lane: numbers in 0..=65,535, rounded down, each moved up by its shift. None may
    /// reach the bits of the next one.
    fn store_fields<const N: usize>(fields: [Self; N], shifts: [u32; N], to: &mut [u32]);
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
    fn load_field((): (), from: &[u32], shift: u32, mask: u32) -> Self {
        from.first().map_or(0.0, |&word| (word >> shift & mask) as f32)
    }
    #[inline(always)]
    fn store_fields<const N: usize>(fields: [Self; N], shifts: [u32; N], to: &mut [u32]) {
        if let Some(to) = to.first_mut() {
            *to = 0;
            for i in 0..N {
                *to |= (fields[i] as i32 as u32) << shifts[i];
            }
        }
    }
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
            fn load_field(token: S, from: &[u32], shift: u32, mask: u32) -> Self {
                match from.first_chunk::<$len>() {
                    Some(from) => {
                        let words = $unsigned::load_array_ref(token, from);
                        // Below 2²⁴ a word is the same number with and without a sign.
                        let field: $signed<S> = ((words >> shift) & mask).bitcast();
                        Self::float_from(field)
                    }
                    None => <Self as SimdBase<S>>::splat(token, 0.0),
                }
            }
            #[inline(always)]
            fn store_fields<const N: usize>(fields: [Self; N], shifts: [u32; N], to: &mut [u32]) {
                let (Some(to), Some(first)) = (to.first_chunk_mut::<$len>(), fields.first()) else {
                    return;
                };
                let mut words = $signed::splat(first.token(), 0);
                for i in 0..N {
                    // Of numbers from 0 to 65,535 every level makes the same integers.
                    let field: $signed<S> = fields[i].to_int();
                    words |= field << shifts[i];
                }
                let words: $unsigned<S> = words.bitcast();
                words.store_array(to);
            }
        }
    };
}
lanes!(f32x4, i32x4, u32x4, 4);
lanes!(f32x8, i32x8, u32x8, 8);
lanes!(f32x16, i32x16, u32x16, 16);
