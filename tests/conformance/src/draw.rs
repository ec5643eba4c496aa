//! Draws cases in memory that the caller lends.

use core::ops::Range;

use dermis_runtime::tiles::TILE;
use dermis_runtime::{Avatar, Part, Plan, Posed, Prepared, render};

use crate::cases::{Amount, Case};
use crate::frame::Frame;
use crate::how::{Format, How, Kernel};

/// Words of scratch that are enough for every case.
pub const SCRATCH_WORDS: usize = 1 << 18;
/// Words of frame that are enough for every case in every format.
pub const FRAME_WORDS: usize = 1 << 18;

/// Why a case was not drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Its avatar was not read.
    Avatar(dermis_format::Error),
    /// The runtime refused it.
    Runtime(dermis_runtime::Error),
    /// Too few words were lent.
    Memory {
        /// Words of scratch, or of frame, that are needed.
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
    /// How many rows of pixels.
    pub rows: usize,
}

/// Cuts a case's frame into at most `how.bands` bands, top to bottom.
pub fn bands(case: &Case, how: &How, prepared: &Prepared<'_>) -> impl Iterator<Item = Band> {
    let height = case.size[1];
    let row = move |tile_row: u32| tile_row.saturating_mul(TILE).min(height) as usize;
    prepared.bands(how.bands).map(move |tile_rows| {
        let rows = row(tile_rows.end) - row(tile_rows.start);
        Band { tile_rows, rows }
    })
}

/// Draws a case into the front of `frame`: the CRC32 of its bytes, padding included.
pub fn run(case: &Case, how: &How, scratch: &mut [u32], frame: &mut [u32]) -> Result<u32, Error> {
    let mut frame = frame_of(case, how, frame)?;
    prepare(case, how, scratch, |prepared, scratch| {
        let mut rest = frame.all();
        for band in bands(case, how, prepared) {
            let mut framebuffer = rest.take_rows(band.rows).framebuffer();
            prepared.draw_band(band.tile_rows, scratch, &mut framebuffer)?;
        }
        Ok(())
    })?;
    Ok(frame.crc32())
}

/// The same by [`dermis_runtime::render`], which does all stages at once.
pub fn run_at_once(
    case: &Case,
    how: &How,
    scratch: &mut [u32],
    frame: &mut [u32],
) -> Result<u32, Error> {
    let mut frame = frame_of(case, how, frame)?;
    let avatar = Avatar::parse(case.avatar.bytes()).map_err(Error::Avatar)?;
    let plan = plan(case, &avatar);
    let needed = words(case, how.format, &avatar, &plan);
    let missing = Error::Memory { needed, lent: scratch.len() };
    let (vertices, scratch) =
        scratch.split_at_mut_checked(case.stand.vertices(&avatar) * 3).ok_or(missing)?;
    let vertices = bytemuck::try_cast_slice_mut(vertices).map_err(|_| missing)?;
    let pose = case.stand.pose(&avatar, vertices);
    let camera = case.view.camera(case.size);
    let mut framebuffer = frame.all().framebuffer();
    render(&avatar, &pose, &plan, &camera, how.kernel, scratch, &mut framebuffer)?;
    Ok(frame.crc32())
}

/// The front of `words` that a case's frame takes, filled with what is there before.
pub fn frame_of<'m>(case: &'m Case, how: &How, words: &'m mut [u32]) -> Result<Frame<'m>, Error> {
    let (needed, lent) = (how.format.frame_len(case), words.len());
    Frame::new(case, how.format, words).ok_or(Error::Memory { needed, lent })
}

/// Makes a case ready to be drawn; `draw` gets the rest of the scratch, which is enough for a band.
pub fn prepare<R>(
    case: &Case,
    how: &How,
    scratch: &mut [u32],
    draw: impl FnOnce(&Prepared<'_>, &mut [u32]) -> Result<R, Error>,
) -> Result<R, Error> {
    let (needed, lent) = (scratch_len(case, how.format)?, scratch.len());
    let missing = Error::Memory { needed, lent };
    pose(case, how.kernel, scratch, |posed, plan, rest| {
        let [width, height] = case.size;
        let len = Prepared::scratch_len(posed.avatar(), plan.gaussians(), width, height);
        let (preparing, drawing) = rest.split_at_mut_checked(len).ok_or(missing)?;
        let camera = case.view.camera(case.size);
        // As many shares as bands, the last one first: neither shows.
        let parts = how.bands as usize;
        let prepared = Prepared::in_parts(posed, plan, &camera, preparing, parts, |parts| {
            parts.iter_mut().rev().for_each(Part::project);
        })?;
        draw(&prepared, drawing)
    })
}

/// Poses a case's avatar; `use_it` gets the plan and the rest of the scratch, too.
pub fn pose<R>(
    case: &Case,
    kernel: Kernel,
    scratch: &mut [u32],
    use_it: impl FnOnce(&Posed<'_, '_>, &Plan, &mut [u32]) -> Result<R, Error>,
) -> Result<R, Error> {
    let avatar = Avatar::parse(case.avatar.bytes()).map_err(Error::Avatar)?;
    let (moving, posing) = (case.stand.vertices(&avatar) * 3, Posed::scratch_len(&avatar));
    let missing = Error::Memory { needed: moving.saturating_add(posing), lent: scratch.len() };
    let (vertices, rest) = scratch.split_at_mut_checked(moving).ok_or(missing)?;
    let (posing, rest) = rest.split_at_mut_checked(posing).ok_or(missing)?;
    // Three words for each vertex, so this cannot fail.
    let vertices = bytemuck::try_cast_slice_mut(vertices).map_err(|_| missing)?;
    let posed = Posed::new(&avatar, &case.stand.pose(&avatar, vertices), kernel, posing)?;
    use_it(&posed, &plan(case, &avatar), rest)
}

/// Words of scratch that a case takes.
pub fn scratch_len(case: &Case, format: Format) -> Result<usize, Error> {
    let avatar = Avatar::parse(case.avatar.bytes()).map_err(Error::Avatar)?;
    Ok(words(case, format, &avatar, &plan(case, &avatar)))
}

fn words(case: &Case, format: Format, avatar: &Avatar<'_>, plan: &Plan) -> usize {
    let (budget, [width, height]) = (plan.gaussians(), case.size);
    (case.stand.vertices(avatar) * 3)
        .saturating_add(Posed::scratch_len(avatar))
        .saturating_add(Prepared::scratch_len(avatar, budget, width, height))
        .saturating_add(Prepared::band_scratch_len(budget, width, height))
        .saturating_add(format.scratch_len())
}

fn plan(case: &Case, avatar: &Avatar<'_>) -> Plan {
    match case.amount {
        Amount::Budget(budget) => Plan::with_budget(avatar, budget),
        Amount::Level(level) => Plan::at_level(avatar, level),
        Amount::Counts(counts) => Plan::of_counts(avatar, counts.iter().copied()),
    }
}
