//! Tiles of the frame.

use core::ops::Range;

/// Side of a tile, px.
pub const TILE: u32 = 32;

/// The frame's division into tiles; those at the right and lower border may be smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileGrid {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Tiles in a row.
    pub columns: u32,
    /// Rows of tiles.
    pub rows: u32,
}

impl TileGrid {
    /// Of a frame.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { width, height, columns: width.div_ceil(TILE), rows: height.div_ceil(TILE) }
    }

    /// How many tiles.
    pub const fn tiles(&self) -> usize {
        (self.columns as usize).saturating_mul(self.rows as usize)
    }

    /// Pixels of tile `index` (row-major): columns, then rows; none of what is not of this grid.
    pub fn pixels(&self, index: u32) -> [Range<u32>; 2] {
        let columns = self.columns.max(1);
        let along = |tile: u32, len: u32| {
            let start = tile.saturating_mul(TILE).min(len);
            start..len.min(start.saturating_add(TILE))
        };
        [along(index % columns, self.width), along(index / columns, self.height)]
    }

    /// Calls `visit` with the index of each tile that `bounds` meet, ascending. Bounds: first column
    /// and row of pixels, then one past the last ones.
    #[inline(always)]
    pub fn for_each_tile(&self, [x0, y0, x1, y1]: [u32; 4], mut visit: impl FnMut(u32)) {
        for row in y0 / TILE..y1.div_ceil(TILE) {
            for column in x0 / TILE..x1.div_ceil(TILE) {
                visit(row * self.columns + column);
            }
        }
    }
}
