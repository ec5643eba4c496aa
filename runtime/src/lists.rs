//! The list of each tile: which splats it draws in which order, in bounded memory.

use core::ops::Range;

use bytemuck::{Pod, Zeroable};

use crate::lanes::Lanes;
use crate::prepare::MAX_SIZE;
use crate::project::Splat;
use crate::sort::by_depth;
use crate::tiles::{TILE, TileGrid};

/// A splat in a tile's list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Pair {
    /// Bits of the depth: above 0, so they order as the numbers do.
    pub depth: u32,
    /// Index of the splat.
    pub splat: u32,
}

/// All that lists need of most splats, so that making them reads little memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ListKey {
    /// The first tile that the bounds meet, and in the upper bits its extent: how many there are.
    tiles: u32,
    /// Bits of the depth.
    depth: u32,
}

/// Bits below the extent: 1 for a second column of tiles, 2 for a second row.
const EXTENT_SHIFT: u32 = 29;
/// An extent of more than two columns or rows; then the splat's bounds say how many.
const LARGE: u32 = 4 << EXTENT_SHIFT;
/// More than any tile's index: above it stands a splat's place in its chunk.
const TILES: u32 = 1 << 20;
const _: () = assert!(MAX_SIZE.div_ceil(TILE).pow(2) < TILES && TILES < 1 << EXTENT_SHIFT);
/// A tile's middle, px from the index of its first pixel.
const MIDDLE: f32 = (TILE as f32 - 1.0) / 2.0;

impl ListKey {
    /// From the first tile with its extent, and the depth.
    #[inline(always)]
    pub(crate) fn new(tiles: u32, depth: f32) -> Self {
        Self { tiles, depth: depth.to_bits() }
    }

    /// First tiles with their extents, of bounds in a frame of `grid`.
    #[inline(always)]
    pub(crate) fn tiles_of<V: Lanes>(
        token: V::Token,
        [x0, y0, x1, y1]: [V; 4],
        grid: &TileGrid,
    ) -> V::Words {
        let constant = |x: f32| V::splat(token, x);
        // Of an index of a pixel: none is half a tile from its tile's middle.
        let tile = |pixel: V, middle: f32| {
            ((pixel - constant(middle)) * constant(1.0 / TILE as f32)).nearest()
        };
        let first = [tile(x0, MIDDLE), tile(y0, MIDDLE)];
        // Bounds end one past the last pixel.
        let last = [tile(x1, MIDDLE + 1.0), tile(y1, MIDDLE + 1.0)];
        let [columns, rows] = [last[0] - first[0], last[1] - first[1]];
        let large = constant(1.0).below(columns) | constant(1.0).below(rows);
        let extent = V::select(large, constant(4.0), columns + rows + rows);
        let index = first[1] * constant(grid.columns as f32) + first[0];
        V::pack(token, [index, extent], [0, EXTENT_SHIFT])
    }
}

/// The splats of a frame whose lists are made.
#[derive(Clone, Copy, Debug)]
pub struct Listed<'s> {
    /// In the order that breaks ties of depth.
    pub splats: &'s [Splat],
    /// One for each splat.
    pub keys: &'s [ListKey],
    /// The frame's tiles.
    pub grid: TileGrid,
}

/// Splats whose tiles are written down before they are gone through.
const CHUNK: usize = 64;

/// Tiles that the splats of a chunk meet: a tile, and above it the splat's place in the chunk. Room for
/// four of each.
type Met = [u32; 4 * CHUNK];

impl Listed<'_> {
    /// Counts for each tile the splats whose bounds meet it.
    pub fn count(&self, counts: &mut [u32]) {
        counts.fill(0);
        let all = |_, _| true;
        self.for_each_chunk(0..self.grid.rows, all, |_, _, met| {
            for word in met {
                if let Some(count) = counts.get_mut((word % TILES) as usize) {
                    *count += 1;
                }
            }
        });
    }

    /// Fills `pairs` with the lists of the tiles of `run`, one after the other in the order of tiles,
    /// each sorted front to back, ties by index. `ends[i]` becomes the end of the i-th list.
    ///
    /// `counts` are those of [`Self::count`], of `run` no more than fit into `pairs` and into 32 bits; `ends`
    /// is as long as the run, `spare` working space as long as its longest list.
    pub fn fill_run(
        &self,
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
        let open = ends.get_mut(..run.len()).unwrap_or(&mut []);
        let columns = self.grid.columns.max(1);
        let rows = run.start / columns..run.end.div_ceil(columns);
        let meets = |first, last| (first < run.end) & (last >= run.start);
        self.for_each_chunk(rows, meets, |first, chunk, met| {
            for word in met {
                let place = word / TILES;
                let depth = chunk.get(place as usize).map_or(0, |key| key.depth);
                // A tile before the run wraps to one far behind it.
                let tile = (word % TILES).wrapping_sub(run.start);
                if let Some(end) = open.get_mut(tile as usize)
                    && let Some(slot) = pairs.get_mut(*end as usize)
                {
                    *slot = Pair { depth, splat: first + place };
                    *end += 1;
                }
            }
        });
        let mut start = 0;
        for &end in &*open {
            if let Some(list) = pairs.get_mut(start as usize..end as usize) {
                by_depth(list, spare);
            }
            start = end;
        }
    }

    /// Calls `visit` with chunks of splats, in their order: the index of the first one, their keys, and
    /// the tiles that they meet. `meets` is given the first and last tile of a splat, and says whether it
    /// is to be among them; large ones are cut to rows `rows` of tiles instead.
    #[inline(always)]
    fn for_each_chunk(
        &self,
        rows: Range<u32>,
        meets: impl Fn(u32, u32) -> bool,
        mut visit: impl FnMut(u32, &[ListKey], &[u32]),
    ) {
        let mut met: Met = [0; 4 * CHUNK];
        let (mut rest, mut first) = (self.keys, 0);
        while !rest.is_empty() {
            let large = |key: &ListKey| key.tiles & LARGE != 0;
            let chunk = rest.get(..CHUNK).unwrap_or(rest);
            // Most chunks have no large one, which is soon seen of all keys at once.
            let any = chunk.iter().fold(0, |all, key| all | key.tiles) & LARGE;
            let first_large = if any == 0 { None } else { chunk.iter().position(large) };
            let small = first_large.unwrap_or(chunk.len());
            let chunk = chunk.get(..small).unwrap_or(&[]);
            let len = write_tiles(chunk, self.grid.columns, &meets, &mut met);
            visit(first, chunk, met.get(..len).unwrap_or(&[]));
            first += small as u32;
            rest = rest.get(small..).unwrap_or(&[]);
            if let Some((key, behind)) = rest.split_first()
                && large(key)
            {
                let splat = self.splats.get(first as usize);
                let [x0, y0, x1, y1] = splat.map_or([0; 4], |splat| splat.bounds).map(u32::from);
                let bounds = [x0, y0.max(rows.start * TILE), x1, y1.min(rows.end * TILE)];
                let chunk = core::slice::from_ref(key);
                self.grid.for_each_tile(bounds, |tile| visit(first, chunk, &[tile]));
                (rest, first) = (behind, first + 1);
            }
        }
    }
}

/// Writes down the tiles of a chunk of splats that are not large; returns how many.
///
/// How many tiles a splat meets cannot be foreseen, and a wrong guess costs more than the work: four
/// tiles are written for each, of which the next splat overwrites those that are not.
#[inline(always)]
fn write_tiles(
    chunk: &[ListKey],
    down: u32,
    meets: &impl Fn(u32, u32) -> bool,
    met: &mut Met,
) -> usize {
    // By the bits above the first tile.
    let offsets = [[0; 4], [0, 1, 0, 0], [0, down, 0, 0], [0, 1, down, down + 1]];
    let lasts = [0, 1, down, down + 1];
    let mut len = 0;
    for (key, place) in chunk.iter().zip((0..).step_by(TILES as usize)) {
        let tile = key.tiles % TILES;
        let extent = (key.tiles >> EXTENT_SHIFT) as usize % 4;
        if let Some(met) = met.get_mut(len..len + 4) {
            let offsets = offsets[extent];
            for i in 0..4 {
                met[i] = (place | tile) + offsets[i];
            }
        }
        len += usize::from(meets(tile, tile + lasts[extent])) << (extent % 2 + extent / 2);
    }
    len
}

/// The longest run of tiles from `tiles.start` on whose pairs, and the longest list once more, fit into
/// `capacity`; at least one tile. Returns how many pairs they are, too.
pub(crate) fn next_run(counts: &[u32], tiles: Range<u32>, capacity: usize) -> (Range<u32>, usize) {
    // Ends of lists are words.
    let capacity = capacity.min(u32::MAX as usize);
    let (mut sum, mut longest) = (0, 0);
    let mut end = tiles.start;
    while end < tiles.end {
        let count = counts.get(end as usize).map_or(0, |&count| count as usize);
        longest = longest.max(count);
        if sum + count + longest > capacity && end > tiles.start {
            break;
        }
        sum += count;
        end += 1;
    }
    (tiles.start..end, sum)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec;
    use std::vec::Vec;

    fn key(bounds: [u16; 4], depth: f32, grid: &TileGrid) -> ListKey {
        ListKey::new(ListKey::tiles_of((), bounds.map(f32::from), grid), depth)
    }

    /// Every pair of first and last column around tiles' edges, up to the widest frame.
    #[test]
    fn keys_hold_the_tiles_of_bounds() {
        let grid = TileGrid::new(MAX_SIZE, MAX_SIZE);
        let edges: Vec<u16> = (0..=512u16)
            .flat_map(|tile| [-1, 0, 1].map(|by| i32::from(tile) * 32 + by))
            .filter_map(|edge| u16::try_from(edge).ok().filter(|&edge| u32::from(edge) <= MAX_SIZE))
            .collect();
        for (at, &x0) in edges.iter().enumerate() {
            for &x1 in edges[at + 1..].iter().take(12) {
                let columns = (x1 - 1) / 32 - x0 / 32;
                let extent = if columns > 1 { 4 } else { u32::from(columns) * 3 };
                let first = u32::from(x0 / 32) * (grid.columns + 1);
                let found = key([x0, x0, x1, x1], 1.0, &grid).tiles;
                assert_eq!(found, first | extent << EXTENT_SHIFT, "{x0}..{x1}");
            }
        }
    }

    /// Small splats and large ones, in the corners of the greatest frame, too; whole and run by run.
    #[test]
    fn lists_hold_the_tiles_of_bounds() {
        let grid = TileGrid::new(MAX_SIZE, 97);
        let spans = [(0, 1), (31, 33), (60, 97), (0, 97), (16_383, 16_384), (16_300, 16_384)];
        let bounds: Vec<[u16; 4]> = (spans.iter())
            .flat_map(|&(x0, x1)| {
                [(0, 97), (0, 32), (31, 65), (96, 97)].map(|y| [x0, y.0, x1, y.1])
            })
            .chain([[0, 0, 16_384, 97], [0, 32, 16_384, 64]])
            .cycle()
            .take(150)
            .collect();
        let splats: Vec<Splat> = (bounds.iter())
            .zip(0..)
            .map(|(&bounds, i)| Splat { bounds, depth: (i * 37 % 50) as f32, ..Splat::default() })
            .collect();
        let keys: Vec<ListKey> =
            splats.iter().map(|splat| key(splat.bounds, splat.depth, &grid)).collect();
        let mut expected = vec![Vec::new(); grid.tiles()];
        for (splat, index) in splats.iter().zip(0..) {
            let pair = Pair { depth: splat.depth.to_bits(), splat: index };
            grid.for_each_tile(splat.bounds.map(u32::from), |t| expected[t as usize].push(pair));
        }
        expected.iter_mut().for_each(|list| list.sort_by_key(|pair| pair.depth));
        let listed = Listed { splats: &splats, keys: &keys, grid };
        let mut counts = vec![7; grid.tiles()];
        listed.count(&mut counts);
        assert!(counts.iter().zip(&expected).all(|(&count, list)| count as usize == list.len()));
        for capacity in [2 * splats.len(), 1000, 100_000] {
            let mut tiles = 0..grid.tiles() as u32;
            let mut memory = vec![Pair::default(); capacity];
            let mut ends = vec![0; grid.tiles()];
            while !tiles.is_empty() {
                let (run, len) = next_run(&counts, tiles.clone(), capacity);
                let (pairs, spare) = memory.split_at_mut(len);
                listed.fill_run(&counts, run.clone(), pairs, spare, &mut ends);
                let mut start = 0;
                for (tile, &end) in run.clone().zip(&ends) {
                    assert_eq!(pairs[start..end as usize], expected[tile as usize], "tile {tile}");
                    start = end as usize;
                }
                tiles.start = run.end;
            }
        }
    }
}
