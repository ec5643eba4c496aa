//! Draws cases in memory that the caller lends.

use core::ops::Range;

use dermis_runtime::tiles::TILE;
use dermis_runtime::{Avatar, Plan, Posed, Prepared, render};

use crate::cases::{Amount, Case};
use crate::how::How;

/// Words of scratch that are enough for every case.
pub const SCRATCH_WORDS: usize = 1 << 18;
/// Bytes of pixels that are enough for every case in every format.
pub const PIXEL_BYTES: usize = 1 << 20;

/// Why a case was not drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Its avatar was not read.
    Avatar(dermis_format::Error),
    /// The runtime refused it.
    Runtime(dermis_runtime::Error),
    /// Too few words or bytes were lent.
    Memory {
        /// Words of scratch, or bytes of pixels, that are needed.
        needed: usize,
        /// As many were lent.
        lent: usize,
    },
}

impl From<dermis_runtime::Error> for Error {
    fn from(error: dermis_runtime::Error) -> Self {
        Self::Runtime(error)
    }
}

/// A part of a frame that a thread may draw by itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Band {
    /// Rows of tiles.
    pub tile_rows: Range<u32>,
    /// Where its pixels are in the frame's bytes.
    pub bytes: Range<usize>,
}

/// Cuts a case's frame into `how.bands` bands, top to bottom; some may be empty.
pub fn bands(case: &Case, how: &How, prepared: &Prepared<'_>) -> impl Iterator<Item = Band> {
    let (rows, bands) = (u64::from(prepared.tile_rows()), how.bands.max(1));
    let (height, stride) = (case.size[1], how.format.stride(case));
    let start = move |band: u32| (rows * u64::from(band) / u64::from(bands)) as u32;
    let byte = move |tile_row: u32| tile_row.saturating_mul(TILE).min(height) as usize * stride;
    (0..bands).map(move |band| {
        let tile_rows = start(band)..start(band + 1);
        let bytes = byte(tile_rows.start)..byte(tile_rows.end);
        Band { tile_rows, bytes }
    })
}

/// Draws a case into the front of `pixels`: the CRC32 of its frame, padding included.
pub fn run(case: &Case, how: &How, scratch: &mut [u32], pixels: &mut [u8]) -> Result<u32, Error> {
    let pixels = frame(case, how, pixels)?;
    prepare(case, how, scratch, |prepared, scratch| {
        for band in bands(case, how, prepared) {
            let pixels = pixels.get_mut(band.bytes).unwrap_or(&mut []);
            let mut framebuffer = how.format.framebuffer(case, pixels);
            prepared.draw_band(band.tile_rows, scratch, &mut framebuffer)?;
        }
        Ok(())
    })?;
    Ok(crc32fast::hash(pixels))
}

/// The same by [`dermis_runtime::render`], which does all stages at once.
pub fn run_at_once(
    case: &Case,
    how: &How,
    scratch: &mut [u32],
    pixels: &mut [u8],
) -> Result<u32, Error> {
    let pixels = frame(case, how, pixels)?;
    let avatar = Avatar::parse(case.avatar.bytes()).map_err(Error::Avatar)?;
    let plan = plan(case, &avatar);
    let missing = Error::Memory { needed: words(case, &avatar, &plan), lent: scratch.len() };
    let (vertices, scratch) =
        scratch.split_at_mut_checked(case.stand.vertices(&avatar) * 3).ok_or(missing)?;
    let vertices = bytemuck::try_cast_slice_mut(vertices).map_err(|_| missing)?;
    let pose = case.stand.pose(&avatar, vertices);
    let camera = case.view.camera(case.size);
    let mut framebuffer = how.format.framebuffer(case, pixels);
    render(&avatar, &pose, &plan, &camera, how.kernel, scratch, &mut framebuffer)?;
    Ok(crc32fast::hash(pixels))
}

/// The front of `pixels` that a case's frame takes, filled with what is there before.
pub fn frame<'p>(case: &Case, how: &How, pixels: &'p mut [u8]) -> Result<&'p mut [u8], Error> {
    let (needed, lent) = (how.format.frame_len(case), pixels.len());
    let pixels = pixels.get_mut(..needed).ok_or(Error::Memory { needed, lent })?;
    how.format.fill(pixels);
    Ok(pixels)
}

/// Makes a case ready to be drawn; `draw` gets the rest of the scratch, which is enough for a band.
pub fn prepare<R>(
    case: &Case,
    how: &How,
    scratch: &mut [u32],
    draw: impl FnOnce(&Prepared<'_>, &mut [u32]) -> Result<R, Error>,
) -> Result<R, Error> {
    let avatar = Avatar::parse(case.avatar.bytes()).map_err(Error::Avatar)?;
    let plan = plan(case, &avatar);
    let [width, height] = case.size;
    let missing = Error::Memory { needed: words(case, &avatar, &plan), lent: scratch.len() };
    let (vertices, rest) =
        scratch.split_at_mut_checked(case.stand.vertices(&avatar) * 3).ok_or(missing)?;
    let (posing, rest) = rest.split_at_mut_checked(Posed::scratch_len(&avatar)).ok_or(missing)?;
    let preparing = Prepared::scratch_len(&avatar, plan.gaussians(), width, height);
    let (preparing, drawing) = rest.split_at_mut_checked(preparing).ok_or(missing)?;
    // Three words for each vertex, so this cannot fail.
    let vertices = bytemuck::try_cast_slice_mut(vertices).map_err(|_| missing)?;
    let posed = Posed::new(&avatar, &case.stand.pose(&avatar, vertices), how.kernel, posing)?;
    let prepared = Prepared::new(&posed, &plan, &case.view.camera(case.size), preparing)?;
    draw(&prepared, drawing)
}

/// Words of scratch that a case takes.
pub fn scratch_len(case: &Case) -> Result<usize, Error> {
    let avatar = Avatar::parse(case.avatar.bytes()).map_err(Error::Avatar)?;
    Ok(words(case, &avatar, &plan(case, &avatar)))
}

fn words(case: &Case, avatar: &Avatar<'_>, plan: &Plan) -> usize {
    let (budget, [width, height]) = (plan.gaussians(), case.size);
    (case.stand.vertices(avatar) * 3)
        .saturating_add(Posed::scratch_len(avatar))
        .saturating_add(Prepared::scratch_len(avatar, budget, width, height))
        .saturating_add(Prepared::band_scratch_len(budget, width, height))
}

fn plan(case: &Case, avatar: &Avatar<'_>) -> Plan {
    match case.amount {
        Amount::Budget(budget) => Plan::with_budget(avatar, budget),
        Amount::Level(level) => Plan::at_level(avatar, level),
        Amount::Counts(counts) => Plan::of_counts(avatar, counts.iter().copied()),
    }
}
