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

impl Kernel {
    /// "scalar", or the name of the level.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Simd(Level::Sse2(_)) => "sse2",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Simd(Level::Sse4_2(_)) => "sse4.2",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Simd(Level::Avx2(_)) => "avx2",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Simd(Level::Avx512(_)) => "avx512",
            #[cfg(target_arch = "aarch64")]
            Self::Simd(Level::Neon(_)) => "neon",
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd(Level::WasmSimd128(_)) => "simd128",
            Self::Simd(_) => "fallback",
        }
    }

    /// All that this CPU has, from the specification to the widest.
    #[cfg(feature = "std")]
    pub fn available() -> heapless::Vec<Self, 8> {
        let best = Level::new();
        let mut kernels = heapless::Vec::new();
        let _ = kernels.push(Self::Scalar);
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        let levels = [
            best.as_sse2().map(Level::Sse2),
            best.as_sse4_2().map(Level::Sse4_2),
            best.as_avx2().map(Level::Avx2),
            best.as_avx512().map(Level::Avx512),
        ];
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        let levels = [Some(best).filter(|best| !best.is_fallback())];
        kernels.extend(levels.into_iter().flatten().map(Self::Simd));
        kernels
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

impl Kernel {
    /// Does `work` eight numbers at a time, whatever vectors this kernel has: sums over lanes then have
    /// the same bits by every kernel.
    #[inline]
    pub fn run_by_eights<W: Work>(self, work: W) -> W::Output {
        let level = match self {
            Self::Scalar => Level::baseline(),
            Self::Simd(level) => level,
        };
        dispatch!(level, simd => in_eight_lanes(simd, work))
    }
}

#[inline(always)]
fn in_eight_lanes<S: Simd, W: Work>(simd: S, work: W) -> W::Output {
    work.run::<f32x8<S>>(simd)
}

#[inline(always)]
fn in_native_lanes<S: Simd, W: Work>(simd: S, work: W) -> W::Output {
    match S::f32s::LEN {
        16 => work.run::<f32x16<S>>(simd),
        8 => work.run::<f32x8<S>>(simd),
        _ => work.run::<f32x4<S>>(simd),
    }
}
