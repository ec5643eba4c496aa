//! The picture of a prefix, drawn by the runtime's own stages: culled, projected, sorted and
//! blended as a file is. The parameters are not rounded to the file's codes; [`super::rounding`] does that.

use core::ops::Range;

use anyhow::Result;
use dermis_format::{Disc, FrameKind, LowPass};
use dermis_runtime::batch::{BATCH, Batch, Discs};
use dermis_runtime::frame::Frame;
use dermis_runtime::lists::{ListKey, Listed, Pair};
use dermis_runtime::project::{Splat, View};
use dermis_runtime::raster::{self, TilePixels, draw_tile};
use dermis_runtime::screen::{Slots, SplatCamera};
use dermis_runtime::select::LEAST_OPACITY;
use dermis_runtime::tiles::{TILE, TileGrid};
use dermis_runtime::{Avatar, Camera, Kernel, Pose, Posed};
use rayon::prelude::*;

use super::cloud::{Cloud, Prefix};
use crate::picture::Picture;

/// Gaussians that one task projects.
const CHUNK: usize = 4096;

/// A posed mesh: the frame of each triangle, and which backs are seen.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Of each triangle; `None` where it has no area.
    pub frames: Vec<Option<Frame<f32>>>,
    /// Whether the triangle's back is seen.
    pub two_sided: Box<[bool]>,
}

impl Stage {
    /// Of an avatar in a pose: what is trained on is what the runtime draws on.
    ///
    /// # Errors
    ///
    /// Where the runtime refuses the pose.
    pub fn of(avatar: &Avatar<'_>, pose: &Pose<'_>) -> Result<Self> {
        let mut scratch = vec![0; Posed::scratch_len(avatar)];
        let posed = Posed::new(avatar, pose, Kernel::detect(), &mut scratch)?;
        let triangles = avatar.header().triangles;
        Ok(Self {
            frames: (0..triangles).map(|triangle| posed.frame(triangle)).collect(),
            two_sided: (0..triangles).map(|t| avatar.is_two_sided(t as usize)).collect(),
        })
    }

    /// The frame of a triangle that can be seen from `eye`.
    pub fn visible(&self, triangle: u32, eye: [f32; 3]) -> Option<&Frame<f32>> {
        let frame = self.frames[triangle as usize].as_ref()?;
        frame.shows(FrameKind::Area, self.two_sided[triangle as usize], eye).then_some(frame)
    }
}

/// A drawn picture, and all that the way back needs.
#[derive(Debug, Default)]
pub struct Forward {
    /// What was drawn.
    pub splats: Vec<Splat>,
    /// Splats of each region, one region after the other.
    pub regions: Vec<Range<usize>>,
    /// Index into its region's cloud of each splat's Gaussian; they ascend in a region.
    pub sources: Vec<u32>,
    /// What each of those was in this picture.
    pub discs: Vec<Disc>,
    /// Rows of tiles.
    pub bands: Vec<Band>,
    /// Over the background.
    pub picture: Picture,
}

impl Forward {
    /// Gaussians blended into pixels.
    pub fn blends(&self) -> u64 {
        self.bands.iter().map(|band| band.blends).sum()
    }

    /// The list of each tile that has one, front to back.
    pub fn lists(&self) -> impl Iterator<Item = (u32, &[Pair])> {
        let tiles = self.bands.iter().flat_map(|band| {
            let starts = core::iter::once(&0).chain(&band.ends);
            starts.zip(&band.ends).map(|(&start, &end)| &band.pairs[start as usize..end as usize])
        });
        (0..).zip(tiles).filter(|(_, list)| !list.is_empty())
    }

    /// Draws the splats, whose keys are `keys`, over the picture, which is all `background`.
    pub(super) fn blend(&mut self, keys: &[ListKey], background: [f32; 3]) {
        let kernel = Kernel::detect();
        let (width, height) = (self.picture.width, self.picture.height);
        let grid = TileGrid::new(width, height);
        let listed = Listed { splats: &self.splats, keys, grid };
        let mut counts = vec![0; grid.tiles()];
        listed.count(&mut counts);
        let rows = self.picture.rgb.par_chunks_mut((width * TILE) as usize).enumerate();
        self.bands = rows
            .map(|(row, pixels)| {
                draw_band(kernel, &listed, row as u32, &counts, background, pixels)
            })
            .collect();
    }
}

/// Lists of a row of tiles.
#[derive(Debug, Default)]
pub struct Band {
    /// All tiles' lists in a row, each front to back.
    pub pairs: Vec<Pair>,
    /// End of each tile's list.
    pub ends: Vec<u32>,
    /// Gaussians blended into its pixels.
    pub blends: u64,
}

/// Draws a prefix of each region's cloud over `background`.
pub fn draw(
    clouds: &[Cloud],
    prefixes: &[Prefix],
    stage: &Stage,
    camera: &Camera,
    low_pass: LowPass,
    background: [f32; 3],
) -> Forward {
    let kernel = Kernel::detect();
    let screen = SplatCamera { view: View::new(camera), low_pass };
    let grid = TileGrid::new(camera.width, camera.height);
    let regions = clouds.par_iter().zip(prefixes).map(|(cloud, &prefix)| {
        let chunks = (0..cloud.len().div_ceil(CHUNK)).into_par_iter().map(|chunk| {
            let places = chunk * CHUNK..cloud.len().min((chunk + 1) * CHUNK);
            project(kernel, cloud, places, prefix, stage, &screen, &grid)
        });
        chunks.collect()
    });
    let regions: Vec<Vec<Seen>> = regions.collect();
    let mut forward = Forward {
        picture: Picture::filled(camera.width, camera.height, background),
        ..Forward::default()
    };
    let mut keys = Vec::new();
    for chunks in regions {
        let first = forward.splats.len();
        for seen in chunks {
            forward.splats.extend(seen.splats);
            forward.sources.extend(seen.sources);
            forward.discs.extend(seen.discs);
            keys.extend(seen.keys);
        }
        forward.regions.push(first..forward.splats.len());
    }
    forward.blend(&keys, background);
    forward
}

/// Gaussians that are seen.
#[derive(Default)]
struct Seen {
    splats: Vec<Splat>,
    keys: Vec<ListKey>,
    sources: Vec<u32>,
    discs: Vec<Disc>,
}

/// The Gaussians at `places` that are seen.
fn project(
    kernel: Kernel,
    cloud: &Cloud,
    places: Range<usize>,
    prefix: Prefix,
    stage: &Stage,
    screen: &SplatCamera,
    grid: &TileGrid,
) -> Seen {
    let mut seen = Seen::default();
    let mut batch = Discs::new();
    let mut sources = Vec::with_capacity(BATCH);
    let mut flush = |batch: &mut Discs, sources: &mut Vec<(u32, Disc)>| {
        let filled = seen.splats.len();
        seen.splats.resize(filled + BATCH, Splat::default());
        seen.keys.resize(filled + BATCH, ListKey::default());
        let slots = Slots { splats: &mut seen.splats[filled..], keys: &mut seen.keys[filled..] };
        let touching = screen.splats(kernel, batch, grid, slots);
        for (lane, (source, disc)) in (0..).zip(sources.drain(..)) {
            if touching >> lane & 1 == 1 {
                seen.sources.push(source);
                seen.discs.push(disc);
            }
        }
        seen.splats.truncate(seen.sources.len());
        seen.keys.truncate(seen.sources.len());
        batch.clear();
    };
    for i in places.filter(|&i| cloud.ranks[i] < prefix.count) {
        let Some(frame) = stage.visible(cloud.triangles[i], screen.view.eye) else { continue };
        let disc = cloud.disc(&prefix, i);
        if !(disc.opacity >= LEAST_OPACITY) {
            continue;
        }
        batch.push(&disc, frame);
        sources.push((i as u32, disc));
        if batch.len() == BATCH {
            flush(&mut batch, &mut sources);
        }
    }
    flush(&mut batch, &mut sources);
    seen
}

fn draw_band(
    kernel: Kernel,
    listed: &Listed<'_>,
    row: u32,
    counts: &[u32],
    background: [f32; 3],
    pixels: &mut [[f32; 3]],
) -> Band {
    let Listed { splats, grid, .. } = listed;
    let run = row * grid.columns..(row + 1) * grid.columns;
    let pairs = counts[run.start as usize..run.end as usize].iter().sum::<u32>();
    let mut band =
        Band { pairs: vec![Pair::default(); pairs as usize], ends: vec![0; run.len()], blends: 0 };
    let longest = counts[run.start as usize..run.end as usize].iter().max().map_or(0, |&n| n);
    let mut spare = vec![Pair::default(); longest as usize];
    listed.fill_run(counts, run.clone(), &mut band.pairs, &mut spare, &mut band.ends);
    let mut tile_pixels = Box::new(TilePixels::clear());
    let mut start = 0;
    for (tile, &end) in run.zip(&band.ends) {
        let order = &band.pairs[start as usize..end as usize];
        start = end;
        if order.is_empty() {
            continue;
        }
        tile_pixels.reset();
        let [columns, rows] = grid.pixels(tile);
        let area = [columns.clone(), rows.clone()];
        band.blends += draw_tile(kernel, splats, order, area, &mut tile_pixels).blends;
        for (y, row) in (0..rows.len()).zip(&tile_pixels.0) {
            let to = y * grid.width as usize + columns.start as usize;
            for (column, pixel) in pixels[to..to + columns.len()].iter_mut().enumerate() {
                let [r, g, b, t] = raster::pixel(row, column);
                *pixel = [r + t * background[0], g + t * background[1], b + t * background[2]];
            }
        }
    }
    band
}
