//! Which instructions draw a frame. The bytes do not depend on it.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x4, f32x8, f32x16};

use crate::lanes::Lanes;

pub use fearless_simd::Level;

/// Which instructions draw a frame.
#[derive(Clone, Copy, Debug)]
pub enum Kernel {
    /// One number after the other: the specification, and best where there are no vectors.
    Scalar,
    /// Vectors of 4, 8 or 16 numbers, as wide as the level has them.
    Simd(Level),
}

impl Kernel {
    /// The best that this CPU has.
    #[cfg(feature = "std")]
    pub fn detect() -> Self {
        Self::of_level(Level::new())
    }

    /// The best that the target this is compiled for surely has.
    pub fn baseline() -> Self {
        Self::of_level(Level::baseline())
    }

    /// Vectors of this level; scalar if that has none.
    pub fn of_level(level: Level) -> Self {
        if level.is_fallback() { Self::Scalar } else { Self::Simd(level) }
    }
}

/// Work written once for all widths of vectors.
pub trait Work {
    /// What it gives.
    type Output;
    /// Does it, `V::LEN` numbers at a time.
    fn run<V: Lanes>(self, token: V::Token) -> Self::Output;
}

impl Kernel {
    /// Does `work` in the vectors that are natural to this kernel.
    #[inline]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        match self {
            Self::Scalar => work.run::<f32>(()),
            Self::Simd(level) => dispatch!(level, simd => in_native_lanes(simd, work)),
        }
    }
}

#[inline(always)]
fn in_native_lanes<S: Simd, W: Work>(simd: S, work: W) -> W::Output {
    match S::f32s::LEN {
        16 => work.run::<f32x16<S>>(simd),
        8 => work.run::<f32x8<S>>(simd),
        _ => work.run::<f32x4<S>>(simd),
    }
}
