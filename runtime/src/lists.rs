//! The list of each tile: which splats it draws in which order, in bounded memory.

use core::ops::Range;

use bytemuck::{Pod, Zeroable};

use crate::lanes::Lanes;
use crate::math::Real;
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

/// In the extent: more than two columns or rows of tiles; then the splat's bounds say how many.
const LARGE: u32 = 4 << EXTENT;
/// Bits below the extent: 1 for a second column of tiles, 2 for a second row.
const EXTENT: u32 = 29;
/// More than any tile's index.
const PLACE: u32 = 1 << 20;

/// From a tile's first pixel.
const MIDDLE: f32 = (TILE as f32 - 1.0) / 2.0;

impl ListKey {
    /// Of a splat whose bounds hold a pixel.
    pub fn of(splat: &Splat, grid: &TileGrid) -> Self {
        let fields = first_and_extent(splat.bounds.map(f32::from), grid.columns as f32);
        Self { tiles: f32::pack((), fields, [0, EXTENT]), depth: splat.depth.to_bits() }
    }

    /// [`Self::tiles`] of several splats.
    #[inline(always)]
    pub(crate) fn tiles_of<V: Lanes>(token: V::Token, bounds: [V; 4], grid: &TileGrid) -> V::Words {
        let fields = first_and_extent(bounds, V::splat(token, grid.columns as f32));
        V::pack(token, fields, [0, EXTENT])
    }

    /// From its words.
    #[inline(always)]
    pub(crate) fn new(tiles: u32, depth: f32) -> Self {
        Self { tiles, depth: depth.to_bits() }
    }
}

/// Index of the first tile that bounds meet in a frame of `columns` of them, and their extent.
#[inline(always)]
fn first_and_extent<R: Real>([x0, y0, x1, y1]: [R; 4], columns: R) -> [R; 2] {
    let constant = |x: f32| columns.like(x);
    // Of an integer: a tile's pixels are less than half a tile from its middle.
    let tile = |pixel: R, from: f32| {
        (pixel * constant(1.0 / TILE as f32) - constant((from + MIDDLE) / TILE as f32)).nearest()
    };
    let (first, last) = ([tile(x0, 0.0), tile(y0, 0.0)], [tile(x1, 1.0), tile(y1, 1.0)]);
    let [more_columns, more_rows] = [last[0] - first[0], last[1] - first[1]];
    let large = constant(1.0).below(more_columns) | constant(1.0).below(more_rows);
    let extent = R::select(large, constant(4.0), more_columns + more_rows + more_rows);
    [first[1] * columns + first[0], extent]
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
        self.for_each_chunk(all, |_, _, met| {
            for word in met {
                if let Some(count) = counts.get_mut((word % PLACE) as usize) {
                    *count += 1;
                }
            }
        });
    }

    /// Fills `pairs` with the lists of the tiles of `run`, one after the other in the order of tiles,
    /// each sorted front to back, ties by index. `ends[i]` becomes the end of the i-th list; `spare` is
    /// working space as long as the longest list.
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
        let meets = |first, last| (first < run.end) & (last >= run.start);
        self.for_each_chunk(meets, |first, chunk, met| {
            for word in met {
                let place = word / PLACE;
                let depth = chunk.get(place as usize).map_or(0, |key| key.depth);
                // A tile before the run wraps to one far behind it.
                let tile = (word % PLACE).wrapping_sub(run.start);
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
    /// is to be among them; for large ones it is not asked.
    #[inline(always)]
    fn for_each_chunk(
        &self,
        meets: impl Fn(u32, u32) -> bool,
        mut visit: impl FnMut(u32, &[ListKey], &[u32]),
    ) {
        let mut met: Met = [0; 4 * CHUNK];
        let (mut rest, mut first) = (self.keys, 0);
        while !rest.is_empty() {
            let large = |key: &ListKey| key.tiles & LARGE != 0;
            let (chunk, next) = rest.split_at_checked(CHUNK).unwrap_or((rest, &[]));
            let any = chunk.iter().fold(0, |all, key| all | key.tiles) & LARGE;
            let first_large = if any == 0 { None } else { chunk.iter().position(large) };
            let small = first_large.unwrap_or(chunk.len());
            let (chunk, _) = chunk.split_at_checked(small).unwrap_or_default();
            let len = write_tiles(chunk, self.grid.columns, &meets, &mut met);
            visit(first, chunk, met.get(..len).unwrap_or(&[]));
            first += small as u32;
            rest = rest.get(small..).unwrap_or(next);
            if let Some((key, behind)) = rest.split_first()
                && large(key)
            {
                let splat = self.splats.get(first as usize);
                let bounds = splat.map_or([0; 4], |splat| splat.bounds).map(u32::from);
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
    for (key, place) in chunk.iter().zip((0..).step_by(PLACE as usize)) {
        let tile = key.tiles % PLACE;
        let extent = (key.tiles >> EXTENT) as usize % 4;
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
pub fn next_run(counts: &[u32], tiles: Range<u32>, capacity: usize) -> (Range<u32>, usize) {
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
