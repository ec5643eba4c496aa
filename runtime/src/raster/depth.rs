//! Median depth: of the splat at which a pixel becomes more opaque than not.

use bytemuck::{Pod, Zeroable};

use crate::lanes::Lanes;
use crate::tiles::TILE;

/// A pixel has the depth of the first splat behind which T is below this.
const MEDIAN_TRANSMITTANCE: f32 = 0.5;

/// Median depths of a tile's pixels, row by row: z in camera axes, metres.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(transparent)]
pub struct TileDepths(pub [[f32; TILE as usize]; TILE as usize]);

/// Keeps depths, or does not, at no cost.
pub(super) trait Keep {
    /// A splat at depth `depth` was blended into pixels `x..x + V::LEN` of the tile's row `y`, which
    /// changed their T from the first to the second number. Lanes that do not blend it have one
    /// number twice.
    fn blended<V: Lanes>(&mut self, token: V::Token, at: [usize; 2], t: [V; 2], depth: f32);
}

/// For frames without depths.
pub(super) struct NoDepths;

impl Keep for NoDepths {
    #[inline(always)]
    fn blended<V: Lanes>(&mut self, _: V::Token, _: [usize; 2], _: [V; 2], _: f32) {}
}

impl Keep for TileDepths {
    #[inline(always)]
    fn blended<V: Lanes>(&mut self, token: V::Token, [x, y]: [usize; 2], t: [V; 2], depth: f32) {
        let [before, after] = t;
        let median = V::splat(token, MEDIAN_TRANSMITTANCE);
        let passes = before.reaches(median) & after.below(median);
        if let Some(row) = self.0.get_mut(y)
            && let Some(lanes) = row.get_mut(x..x + V::LEN)
        {
            V::select(passes, V::splat(token, depth), V::load(token, lanes)).store(lanes);
        }
    }
}
