//! What the blend loop can do at most: the runtime's own, on one tile that stays in the nearest cache.
//!
//! Few splats, each much wider than the tile and hardly opaque: every lane does useful work, no pixel
//! is ever finished, and nothing is waited for.

use anyhow::Result;
use dermis_runtime::Kernel;
use dermis_runtime::lists::Pair;
use dermis_runtime::project::Splat;
use dermis_runtime::raster::{Counts, TilePixels, draw_tile};
use dermis_runtime::tiles::TILE;

use super::clock::Clock;

/// Splats: 2 KB.
const SPLATS: u32 = 32;
/// Splats drawn one after the other: with an alpha of 1/128 each T stays above e⁻⁴.
const DRAWN: u32 = 16 * SPLATS;
/// log₂ of 1/128, which is above the least alpha that is blended.
const LOG2_OPACITY: f32 = -7.0;

/// The tile and what is drawn in it.
#[derive(Debug)]
pub struct Roofline {
    splats: Vec<Splat>,
    order: Vec<Pair>,
    pixels: TilePixels,
}

impl Roofline {
    /// Ready to be measured.
    pub fn new() -> Self {
        let middle = TILE as f32 / 2.0;
        let splat = |i: u32| Splat {
            mean: [middle + i as f32 / 8.0, middle - i as f32 / 16.0],
            // 0.01 px⁻¹: 30 px from the centre the exponent is less by 0.1.
            falloff: [0.01, 0.001, 0.01],
            log2_opacity: LOG2_OPACITY,
            color: [0.2, 0.4, 0.6],
            depth: 1.0 + i as f32,
            bounds: [0, 0, TILE as u16, TILE as u16],
        };
        let pair = |i: u32| Pair { depth: i, splat: i % SPLATS };
        Self {
            splats: (0..SPLATS).map(splat).collect(),
            order: (0..DRAWN).map(pair).collect(),
            pixels: TilePixels::clear(),
        }
    }

    /// Draws the tile once: evaluations a second, all lanes counted, and what was counted.
    ///
    /// # Errors
    ///
    /// None.
    pub fn sample(&mut self, kernel: Kernel) -> Result<(f64, Counts)> {
        self.pixels = TilePixels::clear();
        let (counts, ms) = Clock::ONE_THREAD.time(|| {
            let tile = [0..TILE, 0..TILE];
            Ok::<_, anyhow::Error>(draw_tile(
                kernel,
                &self.splats,
                &self.order,
                tile,
                &mut self.pixels,
            ))
        })?;
        Ok((counts.evaluations as f64 / (ms * 1e-3), counts))
    }
}

impl Default for Roofline {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lane_is_useful_in_every_kernel() {
        let mut roofline = Roofline::new();
        for kernel in Kernel::available() {
            let (_, counts) = roofline.sample(kernel).expect("it does not fail");
            let all = u64::from(DRAWN * TILE * TILE);
            assert_eq!([counts.evaluations, counts.blends], [all; 2], "{}", kernel.name());
        }
    }
}
