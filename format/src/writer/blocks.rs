//! Regions and their blocks of Gaussians to bytes.

use core::iter;
use core::ops::Range;

use crate::curves::{CurvePoint, MAX_OCTAVES, stops};
use crate::movement::MOST;
use crate::order::{self, GROUP_LEN};
use crate::quant::{Full, opacity_code, ycocg_of_rgb};
use crate::record::{
    self, Bf16, BlockRecord, CurvePointRecord, CurvesRecord, FullGroup, ImportanceRecord,
    KeyFrameRecord, SampleRecord, U32,
};
use crate::samples::{self, Sample};
use crate::section::tag;
use crate::source::{Gaussians, Importance, MeasuredCurves, MeasuredMovements, Region, Source};
use crate::triangles;

use super::discs::{disc_bytes, widths_at};
use super::levels::{check_levels, write_levels};
use super::{EncodeError, bytes_of, extent, name_bytes, narrow, refuse, section};

pub(super) fn write_regions(out: &mut Vec<u8>, source: &Source) -> Result<(), EncodeError> {
    section(out, tag::REGIONS, &name_bytes(source.regions.iter().map(|region| &region.name)))?;
    let layers: Vec<U32> =
        source.regions.iter().flat_map(|region| &region.layers).map(|&n| n.into()).collect();
    section(out, tag::LAYERS, bytes_of(&layers))?;
    if source.regions.iter().any(|region| region.importance.is_some()) {
        let records: Vec<ImportanceRecord> = source.regions.iter().map(importance).collect();
        section(out, tag::IMPORTANCES, bytes_of(&records))?;
    }
    if let Some(curves) = &source.curves {
        section(out, tag::CURVES, &curve_bytes(curves, source)?)?;
    }
    if !source.samples.is_empty() {
        section(out, tag::SAMPLES, &sample_bytes(source)?)?;
    }
    if let Some(movements) = &source.movements {
        section(out, tag::MOVEMENTS, &movement_bytes(movements, source)?)?;
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

fn curve_bytes(curves: &MeasuredCurves, source: &Source) -> Result<Vec<u8>, EncodeError> {
    let MeasuredCurves { density, octaves, points } = curves;
    let layers = source.regions.first().map_or(0, |region| region.layers.len());
    let wanted = source.regions.len() * usize::from(*octaves) * stops(layers);
    let in_range = |number: &f32| (0.0..=1e6).contains(number);
    let numbers = points.iter().flat_map(|point| [point.error, point.blends]);
    let fits = points.len() == wanted
        && (1..=MAX_OCTAVES).contains(&usize::from(*octaves))
        && *density > 0.0
        && *density <= 1e12
        && numbers.into_iter().all(|number| in_range(&number));
    if !fits {
        let len = points.len();
        return refuse(format!(
            "curves of {len} points and {octaves} octaves: {wanted} fit the layers"
        ));
    }
    let record = |point: &CurvePoint| CurvePointRecord {
        error: Bf16::at_most(point.error),
        blends: Bf16::at_most(point.blends),
    };
    let records: Vec<CurvePointRecord> = points.iter().map(record).collect();
    let head = CurvesRecord { density: (*density).into(), octaves: *octaves };
    Ok([bytes_of(&[head]), bytes_of(&records)].concat())
}

fn sample_bytes(source: &Source) -> Result<Vec<u8>, EncodeError> {
    let (samples, triangles) = (&source.samples, source.mesh.triangles.len());
    let in_range = |number: f32| (0.0..=samples::MOST).contains(&number);
    let fits = |sample: &Sample| {
        (sample.triangle as usize) < triangles && in_range(sample.area) && in_range(sample.fill)
    };
    let ascend = samples.is_sorted_by(|a, b| a.triangle < b.triangle);
    if !samples.iter().all(fits) || !ascend {
        return refuse(format!(
            "samples: they are of {triangles} triangles, ascend, and have numbers of 0 to {}",
            samples::MOST
        ));
    }
    let record = |sample: &Sample| SampleRecord {
        triangle: sample.triangle.into(),
        area: Bf16::at_most(sample.area),
        fill: Bf16::at_most(sample.fill),
    };
    let records: Vec<SampleRecord> = samples.iter().map(record).collect();
    Ok(bytes_of(&records).to_vec())
}

fn movement_bytes(movements: &MeasuredMovements, source: &Source) -> Result<Vec<u8>, EncodeError> {
    let MeasuredMovements { joints, targets, clips } = movements;
    let (mesh, rig) = (&source.mesh, &source.rig);
    let lens = [joints.len(), targets.len(), clips.len()];
    let wanted = [rig.joints.len(), mesh.morph_targets.len(), rig.clips.len()];
    let mut numbers = joints.iter().chain(targets).chain(clips);
    if lens != wanted || !numbers.clone().all(|number| (0.0..=MOST).contains(number)) {
        return refuse(format!(
            "movements of {lens:?} joints, morph targets and clips: there are {wanted:?}, of 0 to {MOST}"
        ));
    }
    // Rounded up: what is left out must not move further than is said.
    let records: Vec<Bf16> = numbers.by_ref().map(|&number| Bf16::at_least(number)).collect();
    Ok(bytes_of(&records).to_vec())
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
        let region = &source.regions[index];
        write_levels(out, region, index as u8, layer, first, source)?;
        let payload = block_payload(region, index as u8, layer, (first, count), source)?;
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
    if !region.later_opacities.iter().flatten().all(|opacity| opacity.is_finite()) {
        return refuse("a Gaussian has a number that is not finite");
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
    (first, count): (u32, u32),
    source: &Source,
) -> Result<Vec<u8>, EncodeError> {
    let places = first as usize..(first + count) as usize;
    let head = BlockRecord {
        region: region_index,
        layer,
        count: narrow::<u16>("Gaussians of a block", places.len())?.into(),
        first: first.into(),
    };
    let mut payload = bytes_of(&[head]).to_vec();
    if let Some(triangles) = region.triangles.get(places.clone()) {
        payload.extend(triangle_bytes(triangles, region)?);
    }
    match &region.gaussians {
        Gaussians::Disc(discs) => {
            let layer = usize::from(layer);
            let widths = widths_at(&source.widths, layer, layer, source.mesh.coarser.len());
            payload.extend(disc_bytes(&discs[places.clone()], widths)?);
        }
        Gaussians::Full(_) => payload.extend(full_bytes(region, places.clone())?),
    }
    let levels = source.regions.iter().any(|region| !region.later_opacities.is_empty());
    if levels {
        let later = region.layers.len() - usize::from(layer) - 1;
        for place in places.clone() {
            match region.later_opacities.get(place) {
                Some(opacities) => payload.extend(opacities.iter().map(|&o| opacity_code(o))),
                // The same at all levels.
                None => payload.extend(iter::repeat_n(own_opacity_code(region, place), later)),
            }
        }
    }
    payload.extend(harmonic_bytes(region.harmonics.get(places).unwrap_or(&[])));
    Ok(payload)
}

fn triangle_bytes(triangles: &[u32], region: &Region) -> Result<Vec<u8>, EncodeError> {
    if !triangles.is_sorted() {
        return refuse(format!(
            "region {}: a block's Gaussians do not stand by triangle",
            region.name
        ));
    }
    let Some(bytes) = triangles::encode(triangles) else {
        return refuse(format!("region {}: a block's triangles are too far apart", region.name));
    };
    Ok(bytes)
}

fn own_opacity_code(region: &Region, place: usize) -> u8 {
    opacity_code(match &region.gaussians {
        Gaussians::Disc(discs) => discs[place].opacity,
        Gaussians::Full(fulls) => fulls[place].opacity,
    })
}

/// Step of a group's harmonics: codes are −127 to 127.
fn harmonics_step(harmonics: &[Vec<f32>]) -> f32 {
    let magnitudes = harmonics.iter().flatten().map(|x| x.abs());
    extent(magnitudes).map_or(0.0, |(_, greatest)| greatest) / 127.0
}

fn harmonic_bytes(harmonics: &[Vec<f32>]) -> Vec<u8> {
    let groups = harmonics.chunks(GROUP_LEN);
    let codes = groups.flat_map(|group| {
        let step = harmonics_step(group);
        let code = move |&x: &f32| if step > 0.0 { (x / step).round() as i8 as u8 } else { 0 };
        group.iter().flatten().map(code)
    });
    codes.collect()
}

/// Groups and records of Gaussians with three scales.
fn full_bytes(region: &Region, places: Range<usize>) -> Result<Vec<u8>, EncodeError> {
    let Gaussians::Full(fulls) = &region.gaussians else { return Ok(Vec::new()) };
    let (fulls, harmonics) = (&fulls[places.clone()], region.harmonics.get(places).unwrap_or(&[]));
    if !fulls.iter().flat_map(|g| g.rotation.into_iter().chain([g.opacity])).all(f32::is_finite) {
        return refuse("a Gaussian has a number that is not finite");
    }
    let (mut groups, mut records) = (Vec::new(), Vec::new());
    for (index, fulls) in fulls.chunks(GROUP_LEN).enumerate() {
        let harmonics = harmonics.chunks(GROUP_LEN).nth(index).unwrap_or(&[]);
        let group = full_group(fulls, harmonics_step(harmonics))?;
        records.extend(fulls.iter().map(|full| group.encode(full)));
        groups.push(group);
    }
    Ok([bytes_of(&groups), bytes_of(&records)].concat())
}

fn full_group(fulls: &[Full], harmonics_step: f32) -> Result<FullGroup, EncodeError> {
    let position = |i: usize| spanning(fulls.iter().map(|g| g.position[i]), u16::MAX);
    let color = |i: usize| spanning(fulls.iter().map(|g| ycocg_of_rgb(g.color)[i]), 255);
    Ok(FullGroup {
        position: [position(0)?, position(1)?, position(2)?],
        log2_scale: spanning(fulls.iter().flat_map(|g| g.log2_scale), 255)?,
        color: [color(0)?, color(1)?, color(2)?],
        harmonics_step: harmonics_step.into(),
    })
}

fn spanning(values: impl Iterator<Item = f32>, last: u16) -> Result<record::Range, EncodeError> {
    match extent(values) {
        Some((low, high)) if high.is_finite() => Ok(record::Range::spanning(low, high, last)),
        _ => refuse("a Gaussian has a number that is not finite"),
    }
}
