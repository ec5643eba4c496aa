//! The encoder: [`Source`] to bytes.

use core::{fmt, iter};

use crate::header::{Header, RecordKind};
use crate::order;
use crate::quant::{opacity_code, ycocg_of_rgb};
use crate::record::{
    BindRecord, BlockRecord, ChannelRecord, ClipRecord, GroupRecord, JointRecord, KeyFrameRecord,
    MorphRecord, Range, U16, U32, VertexRecord,
};
use crate::section::{MAGIC, Section, VERSION, preamble, preamble_crc, section_crc, tag};
use crate::source::{Channel, Clip, Gaussians, Mesh, Morph, Region, Rig, Source};

/// Most Gaussians that share ranges.
const GROUP_LEN: usize = 256;
/// How far from 1 the weights of a vertex may add up.
const WEIGHT_SUM_TOLERANCE: f32 = 1e-3;

/// Why a source cannot be encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodeError(String);

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for EncodeError {}

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
    for clip in &source.rig.clips {
        section(&mut out, tag::CLIP, &clip_payload(clip)?)?;
    }
    write_regions(&mut out, source)?;
    write_blocks(&mut out, source)?;
    // The reader is the judge: what it refuses is never handed out.
    match crate::Avatar::parse(&out) {
        Ok(_) => Ok(out),
        Err(error) => refuse(format!("the avatar cannot be encoded: {error}")),
    }
}

/// Indices are narrowed when they are written, so a reader could not tell that one was too large.
fn check_mesh(mesh: &Mesh, binds: usize) -> Result<(), EncodeError> {
    let exists = |vertex: &u32| (*vertex as usize) < mesh.positions.len();
    if !mesh.triangles.iter().flatten().all(exists) {
        return refuse("a triangle's corner does not exist");
    }
    if !mesh.morph_targets.iter().flat_map(|m| &m.deltas).all(|(vertex, _)| exists(vertex)) {
        return refuse("a morph target moves a vertex that does not exist");
    }
    for morph in &mesh.morph_targets {
        if !morph.deltas.is_sorted_by(|(a, _), (b, _)| a < b) {
            let name = &morph.name;
            return refuse(format!("morph target {name}: its vertices do not ascend, each once"));
        }
    }
    if mesh.influences.iter().flatten().any(|&(bind, _)| usize::from(bind) >= binds) {
        return refuse("a vertex hangs on a bind that does not exist");
    }
    for influences in &mesh.influences {
        let weights = influences.map(|(_, weight)| weight);
        if !weights.iter().all(|weight| weight.is_finite()) {
            return refuse("a skin weight is not finite");
        }
        if weights.iter().any(|&weight| weight < 0.0) {
            return refuse("a skin weight is negative");
        }
        let sum: f32 = weights.iter().sum();
        if !((sum - 1.0).abs() <= WEIGHT_SUM_TOLERANCE) {
            return refuse(format!("a vertex's skin weights add up to {sum}, not to 1"));
        }
    }
    if !mesh.two_sided.is_empty() && mesh.two_sided.len() != mesh.triangles.len() {
        return refuse("triangles and their two-sided bits differ in number");
    }
    Ok(())
}

fn header(source: &Source) -> Result<Header, EncodeError> {
    let mesh = &source.mesh;
    let Some(first) = source.regions.first() else {
        return refuse("an avatar needs at least one region");
    };
    let layers = first.layers.len();
    let gaussians: usize = source.regions.iter().map(|region| region.gaussians.len()).sum();
    let (position_min, position_step) = position_grid(&mesh.positions)?;
    let record =
        match source.regions.iter().find(|r| !r.gaussians.is_empty()).unwrap_or(first).gaussians {
            Gaussians::Disc(_) => RecordKind::Disc,
            Gaussians::Full(_) => RecordKind::Full,
        };
    Ok(Header {
        vertices: count("vertices", mesh.positions.len())?,
        triangles: count("triangles", mesh.triangles.len())?,
        joints: count("joints", source.rig.joints.len())?,
        binds: count("binds", source.rig.binds.len())?,
        morph_targets: count("morph targets", mesh.morph_targets.len())?,
        clips: count("clips", source.rig.clips.len())?,
        regions: count("regions", source.regions.len())?,
        layers: count("layers", layers)?,
        gaussians: count("Gaussians", gaussians)?,
        frame: source.mathematics.frame,
        record,
        low_pass: source.mathematics.low_pass,
        scale_law: source.mathematics.scale_law,
        harmonics_degree: source.mathematics.harmonics_degree,
        opacity_per_level: source.regions.iter().any(|region| !region.later_opacities.is_empty()),
        box_min: source.bounds[0],
        box_max: source.bounds[1],
        position_min,
        position_step,
    })
}

fn count<T: TryFrom<usize>>(what: &str, n: usize) -> Result<T, EncodeError> {
    T::try_from(n).or_else(|_| refuse(format!("{n} {what} are more than the format can hold")))
}

fn position_grid(positions: &[[f32; 3]]) -> Result<([f32; 3], [f32; 3]), EncodeError> {
    let mut min = [0.0; 3];
    let mut step = [0.0; 3];
    for axis in 0..3 {
        let values = positions.iter().map(|p| p[axis]);
        let Some((low, high)) = extent(values) else { continue };
        if !(low.is_finite() && high.is_finite()) {
            return refuse("a vertex is not finite");
        }
        min[axis] = low;
        step[axis] = (high - low) / f32::from(u16::MAX);
    }
    Ok((min, step))
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
        .copy_from_slice(&count::<u16>("header bytes", bytes.len())?.to_le_bytes());
    let crc = preamble_crc(&fixed, &bytes);
    fixed[preamble::CRC].copy_from_slice(&crc.to_le_bytes());
    out.extend(fixed);
    out.extend(bytes);
    Ok(())
}

fn section(out: &mut Vec<u8>, tag: [u8; 4], payload: &[u8]) -> Result<(), EncodeError> {
    let len: u32 = count("bytes of a section", payload.len())?;
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

fn write_mesh(out: &mut Vec<u8>, mesh: &Mesh, header: &Header) -> Result<(), EncodeError> {
    if mesh.triangles.is_empty() {
        return Ok(());
    }
    let grid = |axis: usize| Range {
        offset: header.position_min[axis].into(),
        step: header.position_step[axis].into(),
    };
    let vertices: Vec<VertexRecord> = mesh
        .positions
        .iter()
        .map(|p| VertexRecord {
            position: core::array::from_fn(|i| grid(i).code(p[i], u16::MAX).into()),
        })
        .collect();
    section(out, tag::VERTICES, bytes_of(&vertices))?;
    section(
        out,
        tag::TRIANGLES,
        &vertex_indices(mesh.triangles.iter().flatten().copied(), header.vertices),
    )?;
    if !mesh.influences.is_empty() {
        section(out, tag::SKIN, &skin_payload(mesh, header.binds))?;
    }
    if mesh.two_sided.contains(&true) {
        let mut bits = vec![0u8; mesh.triangles.len().div_ceil(8)];
        for (index, _) in mesh.two_sided.iter().enumerate().filter(|(_, side)| **side) {
            bits[index / 8] |= 1 << (index % 8);
        }
        section(out, tag::SIDES, &bits)?;
    }
    if header.regions > 1 {
        section(out, tag::TRIANGLE_REGIONS, &mesh.triangle_regions)?;
    }
    Ok(())
}

fn vertex_indices(indices: impl Iterator<Item = u32>, vertices: u32) -> Vec<u8> {
    if vertices <= 1 << 16 {
        indices.flat_map(|i| (i as u16).to_le_bytes()).collect()
    } else {
        indices.flat_map(u32::to_le_bytes).collect()
    }
}

fn skin_payload(mesh: &Mesh, binds: u16) -> Vec<u8> {
    let codes: Vec<[u8; 4]> =
        mesh.influences.iter().map(|i| weight_codes(i.map(|(_, weight)| weight))).collect();
    // An influence that is not used is (0, 0).
    let indices = mesh.influences.iter().flatten().zip(codes.iter().flatten());
    let indices = indices.map(|(&(bind, _), &code)| if code == 0 { 0 } else { bind });
    let mut payload: Vec<u8> = if binds <= 1 << 8 {
        indices.map(|bind| bind as u8).collect()
    } else {
        indices.flat_map(u16::to_le_bytes).collect()
    };
    payload.extend(codes.iter().flatten());
    payload
}

/// Weights that add up to 1, in 1/255 that add up to 255: the greatest takes what rounding left over.
fn weight_codes(weights: [f32; 4]) -> [u8; 4] {
    let mut codes = weights.map(|weight| (weight * 255.0 + 0.5) as u8);
    let mut greatest = 0;
    for i in 1..4 {
        if weights[i] > weights[greatest] {
            greatest = i;
        }
    }
    let sum: i32 = codes.iter().map(|&code| i32::from(code)).sum();
    // The greatest is at least 63/255, more than rounding leaves over: this is in 0..=255.
    codes[greatest] = (i32::from(codes[greatest]) + 255 - sum) as u8;
    codes
}

fn write_rig(out: &mut Vec<u8>, rig: &Rig) -> Result<(), EncodeError> {
    if rig.joints.is_empty() {
        return Ok(());
    }
    let joints: Vec<JointRecord> = rig
        .joints
        .iter()
        .map(|joint| JointRecord {
            parent: joint.parent.unwrap_or(u16::MAX).into(),
            translation: joint.translation.map(Into::into),
            rotation: joint.rotation.map(Into::into),
            scale: joint.scale.map(Into::into),
        })
        .collect();
    section(out, tag::JOINTS, bytes_of(&joints))?;
    section(out, tag::JOINT_NAMES, &name_bytes(rig.joints.iter().map(|joint| &joint.name)))?;
    let binds: Vec<BindRecord> = rig
        .binds
        .iter()
        .map(|&(joint, inverse)| BindRecord {
            joint: joint.into(),
            inverse: inverse.map(|row| row.map(Into::into)),
        })
        .collect();
    section(out, tag::BINDS, bytes_of(&binds))
}

fn morph_payload(morph: &Morph, vertices: u32) -> Result<Vec<u8>, EncodeError> {
    let name = shortened(&morph.name, usize::from(u16::MAX));
    let greatest = extent(morph.deltas.iter().flat_map(|(_, d)| d.iter().map(|x| x.abs())))
        .map_or(0.0, |(_, high)| high);
    if !greatest.is_finite() {
        return refuse(format!("morph target {name}: a displacement is not finite"));
    }
    let step = greatest / f32::from(i16::MAX);
    let head = MorphRecord {
        step: step.into(),
        default_weight: morph.default_weight.into(),
        name_len: count::<u16>("bytes of a name", name.len())?.into(),
    };
    let mut payload = bytes_of(&[head]).to_vec();
    payload.extend(name.as_bytes());
    payload.extend(vertex_indices(morph.deltas.iter().map(|(vertex, _)| *vertex), vertices));
    for (_, delta) in &morph.deltas {
        let codes = delta.map(|x| if step > 0.0 { (x / step).round() as i16 } else { 0 });
        payload.extend(codes.into_iter().flat_map(i16::to_le_bytes));
    }
    Ok(payload)
}

fn clip_payload(clip: &Clip) -> Result<Vec<u8>, EncodeError> {
    let name = shortened(&clip.name, usize::from(u16::MAX));
    let head = ClipRecord {
        seconds: clip.seconds.into(),
        channels: count::<u16>("channels", clip.channels.len())?.into(),
        name_len: count::<u16>("bytes of a name", name.len())?.into(),
    };
    let mut payload = bytes_of(&[head]).to_vec();
    payload.extend(name.as_bytes());
    let ranges: Vec<Range> = clip.channels.iter().map(channel_range).collect::<Result<_, _>>()?;
    for (channel, &range) in clip.channels.iter().zip(&ranges) {
        let (property, target) = channel.property.code();
        let record = ChannelRecord {
            property,
            interpolation: u8::from(!channel.holds),
            target: target.into(),
            keys: count::<u32>("keys", channel.values.len() / channel.property.width())?.into(),
            range,
        };
        payload.extend(bytes_of(&[record]));
    }
    for (channel, range) in clip.channels.iter().zip(ranges) {
        payload.extend(
            channel.values.iter().flat_map(|&value| range.code(value, u16::MAX).to_le_bytes()),
        );
    }
    Ok(payload)
}

fn channel_range(channel: &Channel) -> Result<Range, EncodeError> {
    match extent(channel.values.iter().copied()) {
        Some((low, high)) if high.is_finite() => Ok(Range::spanning(low, high, u16::MAX)),
        _ => refuse("a clip has a channel without keys, or with a key that is not finite"),
    }
}

fn write_regions(out: &mut Vec<u8>, source: &Source) -> Result<(), EncodeError> {
    section(out, tag::REGIONS, &name_bytes(source.regions.iter().map(|region| &region.name)))?;
    let layers: Vec<U32> =
        source.regions.iter().flat_map(|region| &region.layers).map(|&n| n.into()).collect();
    section(out, tag::LAYERS, bytes_of(&layers))?;
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

/// Blocks of all regions, interleaved by the share of their region that stands before them: a file
/// cut short is a coarser avatar all over.
fn write_blocks(out: &mut Vec<u8>, source: &Source) -> Result<(), EncodeError> {
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
        groups: self::count::<u16>("groups", group_records.len())?.into(),
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
fn group_ends(triangles: &[u32], count: usize) -> Vec<usize> {
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
        Gaussians::Disc(discs) => {
            let discs = &discs[places];
            let position = |i: usize| spanning(discs.iter().map(|d| d.position[i]), 255);
            (
                [position(0)?, position(1)?, position(2)?],
                spanning(discs.iter().flat_map(|d| d.log2_scale), 255)?,
                color_ranges(discs.iter().map(|d| d.color))?,
            )
        }
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

/// Whether the numbers that have codes of their own (no range of the group) are finite.
fn codes_are_finite(region: &Region, places: &core::ops::Range<usize>) -> bool {
    let later = region.later_opacities.get(places.clone()).unwrap_or(&[]);
    let own = match &region.gaussians {
        Gaussians::Disc(discs) => {
            discs[places.clone()].iter().all(|d| d.angle.is_finite() && d.opacity.is_finite())
        }
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
