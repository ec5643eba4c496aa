//! Tiles of the frame, and which splats each draws in which order, in bounded memory.

use core::ops::Range;

use bytemuck::{Pod, Zeroable};

use crate::project::Splat;
use crate::sort::by_depth;

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
    pub fn for_each_tile(&self, bounds: [u32; 4], visit: impl FnMut(u32)) {
        self.for_each_tile_in(&(0..self.rows), bounds, visit);
    }

    /// The same in rows `rows` of tiles alone.
    #[inline(always)]
    fn for_each_tile_in(
        &self,
        rows: &Range<u32>,
        [x0, y0, x1, y1]: [u32; 4],
        mut visit: impl FnMut(u32),
    ) {
        for row in (y0 / TILE).max(rows.start)..y1.div_ceil(TILE).min(rows.end) {
            for column in x0 / TILE..x1.div_ceil(TILE) {
                visit(row * self.columns + column);
            }
        }
    }
}

/// A splat in a tile's list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Pair {
    /// Bits of the depth: above 0, so they order as the numbers do.
    pub depth: u32,
    /// Index of the splat.
    pub splat: u32,
}

/// Counts for each tile the splats whose bounds meet it.
pub fn count_tiles(grid: &TileGrid, splats: &[Splat], counts: &mut [u32]) {
    counts.fill(0);
    for splat in splats {
        grid.for_each_tile(splat.bounds.map(u32::from), |tile| {
            if let Some(count) = counts.get_mut(tile as usize) {
                *count += 1;
            }
        });
    }
}

/// The longest run of tiles from `tiles.start` on whose pairs fit into `capacity`; at least one tile.
pub fn next_run(counts: &[u32], tiles: Range<u32>, capacity: usize) -> Range<u32> {
    // Ends of lists are words.
    let capacity = capacity.min(u32::MAX as usize);
    let mut sum = 0;
    let mut end = tiles.start;
    while end < tiles.end {
        sum += counts.get(end as usize).map_or(0, |&count| count as usize);
        if sum > capacity && end > tiles.start {
            break;
        }
        end += 1;
    }
    tiles.start..end
}

/// Fills `pairs` with the lists of the tiles of `run`, one after the other in the order of tiles,
/// each sorted front to back, ties by index. `ends[i]` becomes the end of the i-th list; `spare` is
/// working space as long as the longest list.
pub fn fill_run(
    grid: &TileGrid,
    splats: &[Splat],
    counts: &[u32],
    run: Range<u32>,
    pairs: &mut [Pair],
    spare: &mut [Pair],
    ends: &mut [u32],
) {
    // Each list's end starts as its beginning and moves on with every pair.
    let mut start = 0;
    for (end, tile) in ends.iter_mut().zip(run.clone()) {
        *end = start;
        start += counts.get(tile as usize).copied().unwrap_or(0);
    }
    let columns = grid.columns.max(1);
    let rows = run.start / columns..run.end.div_ceil(columns);
    let open = ends.get_mut(..run.len()).unwrap_or(&mut []);
    for (splat, index) in splats.iter().zip(0..) {
        let pair = Pair { depth: splat.depth.to_bits(), splat: index };
        grid.for_each_tile_in(&rows, splat.bounds.map(u32::from), |tile| {
            // A tile before the run wraps to one far behind it.
            if let Some(end) = open.get_mut(tile.wrapping_sub(run.start) as usize)
                && let Some(slot) = pairs.get_mut(*end as usize)
            {
                *slot = pair;
                *end += 1;
            }
        });
    }
    let mut start = 0;
    for (&end, _) in ends.iter().zip(run) {
        if let Some(list) = pairs.get_mut(start as usize..end as usize) {
            by_depth(list, spare);
        }
        start = end;
    }
}
