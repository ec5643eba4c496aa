//! The encoder: [`Source`] to bytes.

mod blocks;
mod discs;
mod levels;
mod mesh;
mod rig;

use core::fmt;

use crate::header::{Header, PerLevel, RecordKind};
use crate::section::{MAGIC, Section, VERSION, preamble, preamble_crc, section_crc, tag};
use crate::source::{Gaussians, Source};

pub use discs::{packed, stored, widths_at};

use blocks::{write_blocks, write_regions};
use levels::has_levels;
use mesh::{check_mesh, morph_payload, position_grid, write_mesh};
use rig::{clip_payload, write_rig};

/// Why a source cannot be encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodeError(String);

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for EncodeError {}

/// What may be asked of a step.
const STEPS: core::ops::RangeInclusive<f32> = 0.0..=1e6;

fn refuse<T>(why: impl Into<String>) -> Result<T, EncodeError> {
    Err(EncodeError(why.into()))
}

/// Encodes an avatar. The bytes depend on the source alone.
pub fn encode(source: &Source) -> Result<Vec<u8>, EncodeError> {
    check_mesh(&source.mesh, source.rig.binds.len())?;
    let header = header(source)?;
    let mut out = Vec::new();
    write_header(&mut out, &header)?;
    write_mesh(&mut out, &source.mesh, &header)?;
    write_rig(&mut out, &source.rig)?;
    for morph in &source.mesh.morph_targets {
        section(&mut out, tag::MORPH, &morph_payload(morph, header.vertices)?)?;
    }
    write_regions(&mut out, source)?;
    write_blocks(&mut out, source)?;
    // A file that is cut short is first of all a picture.
    for clip in &source.rig.clips {
        section(&mut out, tag::CLIP, &clip_payload(clip)?)?;
    }
    // The reader is the judge: what it refuses is never handed out.
    match crate::Avatar::parse(&out) {
        Ok(_) => Ok(out),
        Err(error) => refuse(format!("the avatar cannot be encoded: {error}")),
    }
}

fn header(source: &Source) -> Result<Header, EncodeError> {
    let mesh = &source.mesh;
    let Some(first) = source.regions.first() else {
        return refuse("an avatar needs at least one region");
    };
    let layers = first.layers.len();
    let gaussians: usize = source.regions.iter().map(|region| region.gaussians.len()).sum();
    let (position_min, position_step) = position_grid(mesh)?;
    let record =
        match source.regions.iter().find(|r| !r.gaussians.is_empty()).unwrap_or(first).gaussians {
            Gaussians::Disc(_) => RecordKind::Disc,
            Gaussians::Full(_) => RecordKind::Full,
        };
    Ok(Header {
        vertices: narrow("vertices", mesh.positions.len())?,
        triangles: narrow("triangles", mesh.triangles.len())?,
        joints: narrow("joints", source.rig.joints.len())?,
        binds: narrow("binds", source.rig.binds.len())?,
        morph_targets: narrow("morph targets", mesh.morph_targets.len())?,
        clips: narrow("clips", source.rig.clips.len())?,
        regions: narrow("regions", source.regions.len())?,
        layers: narrow("layers", layers)?,
        gaussians: narrow("Gaussians", gaussians)?,
        frame: source.mathematics.frame,
        record,
        low_pass: source.mathematics.low_pass,
        scale_law: source.mathematics.scale_law,
        harmonics_degree: source.mathematics.harmonics_degree,
        per_level: per_level(source),
        box_min: source.bounds[0],
        box_max: source.bounds[1],
        position_min,
        position_step,
    })
}

fn per_level(source: &Source) -> PerLevel {
    if source.regions.iter().any(has_levels) {
        PerLevel::All
    } else if source.regions.iter().any(|region| !region.later_opacities.is_empty()) {
        PerLevel::Opacity
    } else {
        PerLevel::Nothing
    }
}

/// A number in the type that the file has for it.
fn narrow<T: TryFrom<usize>>(what: &str, n: usize) -> Result<T, EncodeError> {
    T::try_from(n).or_else(|_| refuse(format!("{n} {what} are more than the format can hold")))
}

/// Least and greatest; infinite if any is not finite.
fn extent(values: impl Iterator<Item = f32>) -> Option<(f32, f32)> {
    values.fold(None, |extent, x| {
        if !x.is_finite() {
            return Some((f32::NEG_INFINITY, f32::INFINITY));
        }
        let (low, high) = extent.unwrap_or((x, x));
        Some((if x < low { x } else { low }, if x > high { x } else { high }))
    })
}

fn write_header(out: &mut Vec<u8>, header: &Header) -> Result<(), EncodeError> {
    let Ok(bytes) = postcard::to_stdvec(header) else {
        return refuse("the header cannot be encoded");
    };
    let mut fixed = [0; preamble::LEN];
    fixed[preamble::MAGIC].copy_from_slice(&MAGIC);
    fixed[preamble::VERSION].copy_from_slice(&VERSION.to_le_bytes());
    fixed[preamble::HEADER_LEN]
        .copy_from_slice(&narrow::<u16>("header bytes", bytes.len())?.to_le_bytes());
    let crc = preamble_crc(&fixed, &bytes);
    fixed[preamble::CRC].copy_from_slice(&crc.to_le_bytes());
    out.extend(fixed);
    out.extend(bytes);
    Ok(())
}

fn section(out: &mut Vec<u8>, tag: [u8; 4], payload: &[u8]) -> Result<(), EncodeError> {
    let len: u32 = narrow("bytes of a section", payload.len())?;
    out.extend(tag);
    out.extend(len.to_le_bytes());
    out.extend(section_crc(&Section { tag, payload }).to_le_bytes());
    out.extend(payload);
    Ok(())
}

fn bytes_of<T: bytemuck::Pod>(records: &[T]) -> &[u8] {
    bytemuck::cast_slice(records)
}

fn name_bytes(names: impl Iterator<Item = impl AsRef<str>>) -> Vec<u8> {
    let mut out = Vec::new();
    for name in names {
        let name = shortened(name.as_ref(), 255);
        out.push(name.len() as u8);
        out.extend(name.as_bytes());
    }
    out
}

/// At most `limit` bytes, whole characters.
fn shortened(name: &str, limit: usize) -> &str {
    let mut end = name.len().min(limit);
    while !name.is_char_boundary(end) {
        end -= 1;
    }
    &name[..end]
}
