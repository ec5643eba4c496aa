//! Levels of a region to bytes.

use crate::header::ScaleLaw;
use crate::order;
use crate::quant::Disc;
use crate::record::BlockRecord;
use crate::section::tag;
use crate::source::{Gaussians, Region, Source};

use super::discs::{disc_bytes, widths_at};
use super::{EncodeError, bytes_of, narrow, refuse, section};

/// Whether any Gaussian has parameters of its own at a later level.
pub(super) fn has_levels(region: &Region) -> bool {
    region.levels.iter().any(|level| !level.is_empty())
}

/// Whether each level has a disc for every Gaussian that it must have one for, in every region or in none.
pub(super) fn check_levels(region: &Region, source: &Source) -> Result<(), EncodeError> {
    if !source.regions.iter().any(has_levels) {
        return Ok(());
    }
    let name = &region.name;
    if source.regions.iter().any(|region| !region.later_opacities.is_empty()) {
        return refuse(format!("region {name}: levels hold opacities, later ones are too many"));
    }
    let are_discs = matches!(region.gaussians, Gaussians::Disc(_)) || region.gaussians.is_empty();
    if !are_discs || source.mathematics.scale_law != ScaleLaw::SquareRoot {
        return refuse(format!(
            "region {name}: only discs under the scale law SquareRoot have levels of their own"
        ));
    }
    if region.levels.len() >= region.layers.len().max(1) {
        return refuse(format!("region {name}: it has levels without a layer"));
    }
    let mut earlier = 0;
    for (level, &len) in region.layers.iter().enumerate() {
        let needed = if len > 0 { earlier as usize } else { 0 };
        let found = level.checked_sub(1).and_then(|index| region.levels.get(index));
        let found = found.map_or(0, Vec::len);
        if found != needed {
            return refuse(format!(
                "region {name}: level {level} needs {needed} discs of earlier layers, not {found}"
            ));
        }
        earlier += len;
    }
    Ok(())
}

/// What leads the block of rank `first` and layer `layer`: all earlier blocks at its level, if it is the first
/// of its layer.
pub(super) fn write_levels(
    out: &mut Vec<u8>,
    region: &Region,
    index: u8,
    layer: u8,
    first: u32,
    source: &Source,
) -> Result<(), EncodeError> {
    let start: u32 = region.layers.iter().take(layer.into()).sum();
    if !has_levels(region) || first == 0 || first != start {
        return Ok(());
    }
    let discs = &region.levels[usize::from(layer) - 1];
    let coarser = source.mesh.coarser.len();
    let is_shape = is_shape(region, layer.into());
    for (own, first, count) in order::blocks(&region.layers).take_while(|block| block.1 < start) {
        let head = BlockRecord {
            region: index,
            layer,
            count: narrow::<u16>("Gaussians of a block", count as usize)?.into(),
            first: first.into(),
        };
        let discs = &discs[first as usize..(first + count) as usize];
        let widths = widths_at(&source.widths, layer.into(), own.into(), coarser);
        let (tag, discs) = if is_shape {
            (tag::SHAPE, disc_bytes(&shapes(discs), widths.of_shape())?)
        } else {
            (tag::LEVEL, disc_bytes(discs, widths)?)
        };
        section(out, tag, &[bytes_of(&[head]), &discs].concat())?;
    }
    Ok(())
}

/// What a shape has of discs; its ranges of other numbers are zeros.
fn shapes(discs: &[Disc]) -> Vec<Disc> {
    let shape = |disc: &Disc| {
        let Disc { log2_scale, opacity, .. } = disc.upright();
        Disc { log2_scale, opacity, ..Disc::default() }
    };
    discs.iter().map(shape).collect()
}

/// Whether discs of a level differ from those of the level before in scales and opacities alone.
fn is_shape(region: &Region, level: usize) -> bool {
    let Gaussians::Disc(own) = &region.gaussians else { return false };
    let levels = &region.levels[..level];
    let Some((here, before)) = levels.split_last() else { return false };
    let before = before.iter().rfind(|level| !level.is_empty()).map_or(&[][..], Vec::as_slice);
    let before = before.iter().chain(own.iter().skip(before.len()));
    here.iter().zip(before).all(|(here, before)| {
        let Disc { log2_scale, opacity, .. } = *here;
        Disc { log2_scale, opacity, ..*before } == *here
    })
}
