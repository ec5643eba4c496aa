//! Discs in a row to bytes, and what becomes of them.

use crate::bits::BitWriter;
use crate::discs::DiscLayout;
use crate::order::GROUP_LEN;
use crate::quant::{Disc, last_code, rooted, ycocg_of_rgb};
use crate::record::{DiscGroup, DiscWidths, ShortRange};

use super::{EncodeError, bytes_of, extent, refuse};

/// Bits of the numbers that discs of a layer have at a level of a file whose levels have `widths`, 8 each where there are none.
///
/// Frames of coarser meshes, on which the first `coarser` layers stand, are large, and so is a step of a position there. Later
/// levels show more than those meshes are for: at these such positions have all 8 bits.
pub fn widths_at(widths: &[DiscWidths], level: usize, layer: usize, coarser: usize) -> DiscWidths {
    let usual = widths.get(level).copied().unwrap_or_default();
    if layer < coarser && layer < level {
        DiscWidths { position: DiscWidths::default().position, ..usual }
    } else {
        usual
    }
}

/// The discs of one block at one level: widths, groups, records.
pub(super) fn disc_bytes(discs: &[Disc], widths: DiscWidths) -> Result<Vec<u8>, EncodeError> {
    let layout = layout(widths)?;
    let (mut groups, mut codes) = (Vec::new(), Vec::with_capacity(discs.len()));
    for discs in discs.chunks(GROUP_LEN) {
        let group = group_of(discs, widths)?;
        codes.extend(discs.iter().map(|disc| group.encode(&disc.upright(), layout)));
        groups.push(group);
    }
    Ok([bytes_of(&[widths]), bytes_of(&groups), &packed(&codes, widths)].concat())
}

/// Records of codes, of each the lowest bits.
pub fn packed(codes: &[Disc<u16>], widths: DiscWidths) -> Vec<u8> {
    let mut records = BitWriter::default();
    let widths = widths.numbers();
    for codes in codes {
        for (code, bits) in codes.numbers().into_iter().zip(widths) {
            records.push(code.into(), bits.into());
        }
    }
    records.finish()
}

/// What a reader gets of the discs of one block, at one level: each number rounded to a code of the group's range, which
/// follows from all discs of the group; scales have changed places where that is another quarter turn.
///
/// # Errors
///
/// Where a number is not finite, or a width is above 8.
pub fn stored(discs: &[Disc], widths: DiscWidths) -> Result<Vec<Disc>, EncodeError> {
    let layout = layout(widths)?;
    let mut stored = Vec::with_capacity(discs.len());
    for discs in discs.chunks(GROUP_LEN) {
        let group = group_of(discs, widths)?;
        stored.extend(discs.iter().map(|disc| {
            let codes = group.encode(&disc.upright(), layout).map(f32::from);
            group.disc_of_codes(&codes, widths.angle, |x| x)
        }));
    }
    Ok(stored)
}

fn layout(widths: DiscWidths) -> Result<DiscLayout, EncodeError> {
    DiscLayout::new(widths)
        .map_or_else(|| refuse(format!("{widths:?}: numbers have at most 8 bits")), Ok)
}

fn group_of(discs: &[Disc], widths: DiscWidths) -> Result<DiscGroup, EncodeError> {
    if !discs.iter().all(|disc| disc.angle.is_finite()) {
        return refuse("a Gaussian has a number that is not finite");
    }
    let position =
        |i: usize| spanning(discs.iter().map(|d| rooted(d.position)[i]), widths.position[i]);
    let color =
        |i: usize| spanning(discs.iter().map(|d| ycocg_of_rgb(d.color)[i]), widths.color[i]);
    Ok(DiscGroup {
        position: [position(0)?, position(1)?, position(2)?],
        log2_scale: spanning(discs.iter().flat_map(|d| d.log2_scale), widths.scale)?,
        color: [color(0)?, color(1)?, color(2)?],
        opacity: spanning(discs.iter().map(|d| d.opacity), widths.opacity)?,
    })
}

/// Far below the greatest f32, near which ranges end; the reader refuses less (SPEC, section 7).
const GREATEST: f32 = 1e30;

fn spanning(values: impl Iterator<Item = f32>, bits: u8) -> Result<ShortRange, EncodeError> {
    match extent(values) {
        Some((low, high)) if low.abs().max(high.abs()) < GREATEST => {
            Ok(ShortRange::spanning(low, high, last_code(bits)))
        }
        _ => refuse("a Gaussian has a number that is not finite"),
    }
}
