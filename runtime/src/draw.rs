//! Bands of tile rows: lists, pixels, framebuffer.

use core::ops::Range;

use crate::error::Error;
use crate::framebuffer::{Area, Framebuffer};
use crate::lists::{Pair, next_run};
use crate::prepare::Prepared;
use crate::raster::{Counts, TileDepths, TilePixels, draw_tile, draw_tile_with_depths};
use crate::scratch::{Scratch, words};
use crate::tiles::TILE;

/// Words of scratch that a band, or a frame, takes beyond the others if its framebuffer has depths:
/// those of one tile.
pub const DEPTH_SCRATCH_LEN: usize = words::<TileDepths>(1);

impl Prepared<'_> {
    /// Words of scratch that a band takes at least: one tile's pixels, a list that holds every splat
    /// of a budget, and as much to sort it; with depths [`DEPTH_SCRATCH_LEN`] more. More words mean
    /// longer lists and fewer passes, never other pixels.
    pub fn band_scratch_len(budget: u32, width: u32, height: u32) -> usize {
        let tiles = crate::tiles::TileGrid::new(width, height).tiles();
        let lists = words::<Pair>(budget as usize).saturating_mul(2);
        words::<TilePixels>(1).saturating_add(tiles).saturating_add(lists)
    }

    /// Rows of tiles in the frame.
    pub fn tile_rows(&self) -> u32 {
        self.listed.grid.rows
    }

    /// Cuts the frame into at most `bands` bands of about the same work: rows of tiles with about as
    /// many pairs of tile and splat.
    pub fn bands(&self, bands: u32) -> impl Iterator<Item = Range<u32>> + '_ {
        let columns = self.listed.grid.columns as usize;
        // An empty tile costs something, too.
        let row_cost = |row: &[u32]| row.iter().map(|&count| u64::from(count) + 8).sum::<u64>();
        let rows = self.tile_counts.chunks(columns.max(1)).map(row_cost);
        let total: u64 = rows.clone().sum();
        let (mut rows, mut row, mut cost) = (rows, 0, 0);
        (1..=u64::from(bands.max(1))).filter_map(move |band| {
            let start = row;
            while cost * u64::from(bands.max(1)) < total * band
                && let Some(next) = rows.next()
            {
                cost += next;
                row += 1;
            }
            (start < row).then_some(start..row)
        })
    }

    /// Draws rows `tile_rows` of tiles. Row 0 of `framebuffer` is the band's first row of pixels.
    pub fn draw_band(
        &self,
        tile_rows: Range<u32>,
        scratch: &mut [u32],
        framebuffer: &mut Framebuffer<'_>,
    ) -> Result<Counts, Error> {
        let tile_rows =
            tile_rows.start.min(self.listed.grid.rows)..tile_rows.end.min(self.listed.grid.rows);
        let first_row = tile_rows.start * TILE;
        let end_row = (tile_rows.end * TILE).min(self.listed.grid.height);
        framebuffer.check(self.listed.grid.width, end_row.saturating_sub(first_row) as usize)?;
        let depth_tiles = usize::from(framebuffer.depth.is_some());
        let needed = words::<TilePixels>(1)
            .saturating_add(words::<TileDepths>(depth_tiles))
            .saturating_add(self.lists_len(&tile_rows));
        let mut scratch = Scratch::new(scratch, needed)?;
        let pixels = scratch.take::<TilePixels>(1)?;
        let depths = scratch.take::<TileDepths>(depth_tiles)?;
        let mut counts = Counts::default();
        self.for_each_list(tile_rows, scratch.take_rest(), |tile, order| {
            let [columns, rows] = self.listed.grid.pixels(tile);
            let area = Area { columns, rows, first_row };
            if order.is_empty() {
                framebuffer.clear(self.kernel, &area);
                return;
            }
            let Some(pixels) = pixels.first_mut() else { return };
            counts += self.draw_tile(tile, order, pixels, depths.first_mut());
            framebuffer.write(self.kernel, &area, pixels, depths.first());
        })?;
        Ok(counts)
    }

    /// Draws the whole frame.
    pub fn draw(
        &self,
        scratch: &mut [u32],
        framebuffer: &mut Framebuffer<'_>,
    ) -> Result<Counts, Error> {
        self.draw_band(0..self.listed.grid.rows, scratch, framebuffer)
    }

    /// Calls `finished` with each tile of a band: its index, its splats front to back, its pixels.
    pub fn for_each_tile(
        &self,
        tile_rows: Range<u32>,
        scratch: &mut [u32],
        mut finished: impl FnMut(u32, &[Pair], &TilePixels),
    ) -> Result<Counts, Error> {
        let needed = words::<TilePixels>(1).saturating_add(self.lists_len(&tile_rows));
        let mut scratch = Scratch::new(scratch, needed)?;
        let pixels = scratch.take::<TilePixels>(1)?;
        let mut counts = Counts::default();
        self.for_each_list(tile_rows, scratch.take_rest(), |tile, order| {
            if let Some(pixels) = pixels.first_mut() {
                counts += self.draw_tile(tile, order, pixels, None);
                finished(tile, order, pixels);
            }
        })?;
        Ok(counts)
    }

    fn draw_tile(
        &self,
        tile: u32,
        order: &[Pair],
        pixels: &mut TilePixels,
        depths: Option<&mut TileDepths>,
    ) -> Counts {
        let area = self.listed.grid.pixels(tile);
        pixels.reset();
        let Some(depths) = depths else {
            return draw_tile(self.kernel, self.listed.splats, order, area, pixels);
        };
        depths.0.as_flattened_mut().fill(f32::INFINITY);
        draw_tile_with_depths(self.kernel, self.listed.splats, order, area, pixels, depths)
    }

    /// Calls `visit` with each tile of a band: its index, and its splats front to back. As many
    /// tiles are sorted at once as the scratch has room for, and at least one.
    pub fn for_each_list(
        &self,
        tile_rows: Range<u32>,
        scratch: &mut [u32],
        mut visit: impl FnMut(u32, &[Pair]),
    ) -> Result<(), Error> {
        let mut tiles = self.tiles_of(&tile_rows);
        let mut scratch = Scratch::new(scratch, self.lists_len(&tile_rows))?;
        let ends = scratch.take::<u32>(tiles.len())?;
        let memory = scratch.take_rest::<Pair>();
        while !tiles.is_empty() {
            let (run, len) = next_run(self.tile_counts, tiles.clone(), memory.len());
            let (pairs, spare) = memory.split_at_mut_checked(len).unwrap_or_default();
            self.listed.fill_run(self.tile_counts, run.clone(), pairs, spare, ends);
            let mut start = 0;
            for (tile, &end) in run.clone().zip(ends.iter()) {
                visit(tile, pairs.get(start as usize..end as usize).unwrap_or(&[]));
                start = end;
            }
            tiles.start = run.end;
        }
        Ok(())
    }

    /// Words that the lists of a band take at least: a tile may hold every splat.
    fn lists_len(&self, tile_rows: &Range<u32>) -> usize {
        let lists = words::<Pair>(self.listed.splats.len()).saturating_mul(2);
        self.tiles_of(tile_rows).len().saturating_add(lists)
    }

    fn tiles_of(&self, tile_rows: &Range<u32>) -> Range<u32> {
        let row = |row: u32| row.min(self.listed.grid.rows) * self.listed.grid.columns;
        row(tile_rows.start)..row(tile_rows.end)
    }
}
