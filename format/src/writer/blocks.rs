//! Regions and their blocks of Gaussians to bytes.

use core::iter;

use crate::order;
use crate::quant::Disc;
use crate::quant::{opacity_code, ycocg_of_rgb};
use crate::record::{BlockRecord, GroupRecord, ImportanceRecord, KeyFrameRecord, Range, U16, U32};
use crate::section::tag;
use crate::source::{Gaussians, Importance, Region, Source};

use super::levels::{check_levels, write_levels};
use super::{EncodeError, bytes_of, extent, name_bytes, narrow, refuse, section};

/// Most Gaussians that share ranges.
const GROUP_LEN: usize = 256;

pub(super) fn write_regions(out: &mut Vec<u8>, source: &Source) -> Result<(), EncodeError> {
    section(out, tag::REGIONS, &name_bytes(source.regions.iter().map(|region| &region.name)))?;
    let layers: Vec<U32> =
        source.regions.iter().flat_map(|region| &region.layers).map(|&n| n.into()).collect();
    section(out, tag::LAYERS, bytes_of(&layers))?;
    if source.regions.iter().any(|region| region.importance.is_some()) {
        let records: Vec<ImportanceRecord> = source.regions.iter().map(importance).collect();
        section(out, tag::IMPORTANCES, bytes_of(&records))?;
    }
    let key_frames: Vec<KeyFrameRecord> = source
        .key_frames
        .iter()
        .map(|&(clip, seconds)| KeyFrameRecord {
            clip: clip.unwrap_or(u16::MAX).into(),
            seconds: seconds.into(),
        })
        .collect();
    if key_frames.is_empty() {
        Ok(())
    } else {
        section(out, tag::KEY_FRAMES, bytes_of(&key_frames))
    }
}

fn importance(region: &Region) -> ImportanceRecord {
    let Importance { weight, mobility, visible, residual } = region.importance.unwrap_or_default();
    ImportanceRecord {
        weight: weight.into(),
        mobility: mobility.into(),
        visible: visible.into(),
        residual: residual.into(),
    }
}

/// Blocks of all regions, interleaved by the share of their region that stands before them: a file
/// cut short is a coarser avatar all over.
pub(super) fn write_blocks(out: &mut Vec<u8>, source: &Source) -> Result<(), EncodeError> {
    let mut blocks = Vec::new();
    for (index, region) in source.regions.iter().enumerate() {
        check_region(region, source)?;
        let total = region.gaussians.len().max(1) as u64;
        for (layer, first, count) in order::blocks(&region.layers) {
            let share = (u64::from(first) << 32) / total;
            blocks.push((share, index, layer, first, count));
        }
    }
    blocks.sort_unstable();
    for (_, index, layer, first, count) in blocks {
        write_levels(out, &source.regions[index], index as u8, layer, first)?;
        let payload =
            block_payload(&source.regions[index], index as u8, layer, first, count, source)?;
        section(out, tag::BLOCK, &payload)?;
    }
    Ok(())
}

fn check_region(region: &Region, source: &Source) -> Result<(), EncodeError> {
    let n = region.gaussians.len();
    let total: u64 = region.layers.iter().map(|&layer| u64::from(layer)).sum();
    if source.regions.first().is_some_and(|first| first.layers.len() != region.layers.len()) {
        return refuse(format!("region {}: it has not as many layers as the first", region.name));
    }
    let fits = |len: usize| len == 0 || len == n;
    let bound = if source.mesh.triangles.is_empty() { 0 } else { n };
    if total != n as u64 || region.triangles.len() != bound || !fits(region.later_opacities.len()) {
        return refuse(format!(
            "region {}: its layers, triangles and Gaussians differ in number",
            region.name
        ));
    }
    check_levels(region, source)?;
    // Levels after each Gaussian's layer; there are as many Gaussians as layers say.
    let layers = region.layers.iter().rev().enumerate().rev();
    let later = layers.flat_map(|(later, &len)| iter::repeat_n(later, len as usize));
    if !region.later_opacities.iter().zip(later).all(|(o, later)| o.len() == later) {
        return refuse(format!(
            "region {}: a Gaussian of layer m of n needs n - 1 - m later opacities",
            region.name
        ));
    }
    let coefficients = 3 * ((usize::from(source.mathematics.harmonics_degree) + 1).pow(2) - 1);
    let expected = if coefficients == 0 { 0 } else { n };
    if region.harmonics.len() != expected
        || region.harmonics.iter().any(|h| h.len() != coefficients)
    {
        return refuse(format!(
            "region {}: every Gaussian needs {coefficients} harmonics",
            region.name
        ));
    }
    Ok(())
}

fn block_payload(
    region: &Region,
    region_index: u8,
    layer: u8,
    first: u32,
    count: u32,
    source: &Source,
) -> Result<Vec<u8>, EncodeError> {
    let places = first as usize..(first + count) as usize;
    let triangles = region.triangles.get(places.clone()).unwrap_or(&[]);
    if !triangles.is_sorted() {
        return refuse(format!(
            "region {}: a block's Gaussians do not stand by triangle",
            region.name
        ));
    }
    let groups = group_ends(triangles, places.len());
    let mut records: Vec<u8> = Vec::new();
    let mut relative = Vec::new();
    let mut group_records = Vec::new();
    let mut harmonics: Vec<u8> = Vec::new();
    let mut start = 0;
    for end in groups {
        let range = places.start + start..places.start + end;
        let base = triangles.get(start).copied().unwrap_or(0);
        let group = group_record(region, range.clone(), base)?;
        relative.extend(
            triangles.get(start..end).unwrap_or(&[]).iter().map(|&t| U16::from((t - base) as u16)),
        );
        match &region.gaussians {
            Gaussians::Disc(discs) => {
                discs[range.clone()]
                    .iter()
                    .for_each(|d| records.extend(bytes_of(&[group.encode_disc(d)])));
            }
            Gaussians::Full(fulls) => {
                fulls[range.clone()]
                    .iter()
                    .for_each(|g| records.extend(bytes_of(&[group.encode_full(g)])));
            }
        }
        let step = group.harmonics_step.get();
        for coefficients in region.harmonics.get(range).unwrap_or(&[]) {
            harmonics.extend(
                coefficients
                    .iter()
                    .map(|&x| if step > 0.0 { (x / step).round() as i8 as u8 } else { 0 }),
            );
        }
        group_records.push(group);
        start = end;
    }
    let head = BlockRecord {
        region: region_index,
        layer,
        groups: narrow::<u16>("groups", group_records.len())?.into(),
        first: first.into(),
        count: count.into(),
    };
    let mut payload = bytes_of(&[head]).to_vec();
    payload.extend(bytes_of(&group_records));
    payload.extend(bytes_of(&relative));
    payload.extend(records);
    let levels = source.regions.iter().any(|region| !region.later_opacities.is_empty());
    if levels {
        let later = region.layers.len() - usize::from(layer) - 1;
        for place in places {
            match region.later_opacities.get(place) {
                Some(opacities) => payload.extend(opacities.iter().map(|&o| opacity_code(o))),
                // The same at all levels.
                None => payload.extend(iter::repeat_n(own_opacity_code(region, place), later)),
            }
        }
    }
    payload.extend(harmonics);
    Ok(payload)
}

fn own_opacity_code(region: &Region, place: usize) -> u8 {
    opacity_code(match &region.gaussians {
        Gaussians::Disc(discs) => discs[place].opacity,
        Gaussians::Full(fulls) => fulls[place].opacity,
    })
}

/// Where groups end: after 256 Gaussians, or before a triangle too far from the group's first.
pub(super) fn group_ends(triangles: &[u32], count: usize) -> Vec<usize> {
    let mut ends = Vec::new();
    let mut start = 0;
    while start < count {
        let mut end = (start + GROUP_LEN).min(count);
        if let Some(base) = triangles.get(start) {
            let near = triangles[start..end].partition_point(|t| t - base <= u32::from(u16::MAX));
            end = start + near;
        }
        ends.push(end);
        start = end;
    }
    ends
}

fn group_record(
    region: &Region,
    places: core::ops::Range<usize>,
    base: u32,
) -> Result<GroupRecord, EncodeError> {
    let harmonics = region.harmonics.get(places.clone()).unwrap_or(&[]);
    let greatest =
        extent(harmonics.iter().flatten().map(|x| x.abs())).map_or(0.0, |(_, high)| high);
    let count_less_one = (places.len() - 1) as u8;
    if !codes_are_finite(region, &places) {
        return refuse("a Gaussian has a number that is not finite");
    }
    let (position, log2_scale, color) = match &region.gaussians {
        Gaussians::Disc(discs) => return disc_group(&discs[places], base),
        Gaussians::Full(fulls) => {
            let fulls = &fulls[places];
            let position = |i: usize| spanning(fulls.iter().map(|g| g.position[i]), u16::MAX);
            (
                [position(0)?, position(1)?, position(2)?],
                spanning(fulls.iter().flat_map(|g| g.log2_scale), 255)?,
                color_ranges(fulls.iter().map(|g| g.color))?,
            )
        }
    };
    Ok(GroupRecord {
        count_less_one,
        base_triangle: base.into(),
        position,
        log2_scale,
        color,
        harmonics_step: (greatest / 127.0).into(),
    })
}

/// The ranges of discs that stand in a row.
pub(super) fn disc_group(discs: &[Disc], base: u32) -> Result<GroupRecord, EncodeError> {
    if !discs.iter().all(|d| d.angle.is_finite() && d.opacity.is_finite()) {
        return refuse("a Gaussian has a number that is not finite");
    }
    let position = |i: usize| spanning(discs.iter().map(|d| d.position[i]), 255);
    Ok(GroupRecord {
        count_less_one: (discs.len() - 1) as u8,
        base_triangle: base.into(),
        position: [position(0)?, position(1)?, position(2)?],
        log2_scale: spanning(discs.iter().flat_map(|d| d.log2_scale), 255)?,
        color: color_ranges(discs.iter().map(|d| d.color))?,
        harmonics_step: 0.0.into(),
    })
}

/// Whether the numbers that have codes of their own (no range of the group) are finite.
fn codes_are_finite(region: &Region, places: &core::ops::Range<usize>) -> bool {
    let later = region.later_opacities.get(places.clone()).unwrap_or(&[]);
    let own = match &region.gaussians {
        // Those of discs are checked with their ranges.
        Gaussians::Disc(_) => true,
        Gaussians::Full(fulls) => fulls[places.clone()]
            .iter()
            .all(|g| g.rotation.iter().all(|x| x.is_finite()) && g.opacity.is_finite()),
    };
    own && later.iter().flatten().all(|x| x.is_finite())
}

fn color_ranges(colors: impl Iterator<Item = [f32; 3]> + Clone) -> Result<[Range; 3], EncodeError> {
    let channel = |i: usize| spanning(colors.clone().map(|rgb| ycocg_of_rgb(rgb)[i]), 255);
    Ok([channel(0)?, channel(1)?, channel(2)?])
}

fn spanning(values: impl Iterator<Item = f32>, last: u16) -> Result<Range, EncodeError> {
    match extent(values) {
        Some((low, high)) if high.is_finite() => Ok(Range::spanning(low, high, last)),
        _ => refuse("a Gaussian has a number that is not finite"),
    }
}
