//! The frame around everything: a preamble, the header, then tagged sections.

use crate::error::{Error, malformed};

/// The first bytes of a file. The line ending shows transfers that rewrite text.
pub const MAGIC: [u8; 8] = *b"DERMIS\r\n";
/// The version this crate reads and writes.
pub const VERSION: u16 = 3;

/// Byte ranges of the preamble.
pub mod preamble {
    use core::ops::Range;
    /// [`super::MAGIC`].
    pub const MAGIC: Range<usize> = 0..8;
    /// u16, [`super::VERSION`].
    pub const VERSION: Range<usize> = 8..10;
    /// u16, length of the header in bytes.
    pub const HEADER_LEN: Range<usize> = 10..12;
    /// u32, CRC32 of bytes 0..12 and of the header.
    pub const CRC: Range<usize> = 12..16;
    /// Where the header starts.
    pub const LEN: usize = 16;
}

/// Byte ranges of a section's head.
pub mod head {
    use core::ops::Range;
    /// Four letters.
    pub const TAG: Range<usize> = 0..4;
    /// u32, length of the payload in bytes.
    pub const PAYLOAD_LEN: Range<usize> = 4..8;
    /// u32, CRC32 of tag, length and payload.
    pub const CRC: Range<usize> = 8..12;
    /// Where the payload starts.
    pub const LEN: usize = 12;
}

/// Tags of the sections that version 3 knows. Others are skipped.
pub mod tag {
    /// Vertex positions.
    pub const VERTICES: [u8; 4] = *b"VERT";
    /// Bind indices and weights of each vertex.
    pub const SKIN: [u8; 4] = *b"SKIN";
    /// Corner indices of each triangle.
    pub const TRIANGLES: [u8; 4] = *b"TRIS";
    /// A bit per triangle: its back is seen.
    pub const SIDES: [u8; 4] = *b"SIDE";
    /// Triangles of each coarser mesh.
    pub const MESH_LEVELS: [u8; 4] = *b"MLEV";
    /// Region of each triangle.
    pub const TRIANGLE_REGIONS: [u8; 4] = *b"TREG";
    /// Names of the regions.
    pub const REGIONS: [u8; 4] = *b"REGN";
    /// Gaussians of each region and layer.
    pub const LAYERS: [u8; 4] = *b"LAYR";
    /// How much each region matters.
    pub const IMPORTANCES: [u8; 4] = *b"IMPO";
    /// How near each region's picture is to the mesh, by level and distance.
    pub const CURVES: [u8; 4] = *b"CURV";
    /// Which triangles stand for the others.
    pub const SAMPLES: [u8; 4] = *b"SAMP";
    /// How far joints and morph targets move the mesh.
    pub const MOVEMENTS: [u8; 4] = *b"MOVE";
    /// The skeleton.
    pub const JOINTS: [u8; 4] = *b"JNTS";
    /// Names of the joints.
    pub const JOINT_NAMES: [u8; 4] = *b"JNAM";
    /// Inverse bind matrices.
    pub const BINDS: [u8; 4] = *b"BIND";
    /// One morph target.
    pub const MORPH: [u8; 4] = *b"MRPH";
    /// One clip.
    pub const CLIP: [u8; 4] = *b"CLIP";
    /// Key frames that the avatar was trained on.
    pub const KEY_FRAMES: [u8; 4] = *b"KEYF";
    /// A band of a region's order.
    pub const BLOCK: [u8; 4] = *b"BLCK";
    /// The Gaussians of an earlier block at a later level.
    pub const LEVEL: [u8; 4] = *b"LEVL";
    /// The same where they differ from the level before in scales and opacity alone.
    pub const SHAPE: [u8; 4] = *b"SHAP";
}

/// Whether a section holds Gaussians, of a block or of a level.
pub fn holds_gaussians(tag: [u8; 4]) -> bool {
    [tag::BLOCK, tag::LEVEL, tag::SHAPE].contains(&tag)
}

/// Of a tag, for errors.
pub(crate) fn name(tag: [u8; 4]) -> &'static str {
    match tag {
        tag::VERTICES => "VERT",
        tag::SKIN => "SKIN",
        tag::TRIANGLES => "TRIS",
        tag::SIDES => "SIDE",
        tag::MESH_LEVELS => "MLEV",
        tag::TRIANGLE_REGIONS => "TREG",
        tag::REGIONS => "REGN",
        tag::LAYERS => "LAYR",
        tag::IMPORTANCES => "IMPO",
        tag::CURVES => "CURV",
        tag::SAMPLES => "SAMP",
        tag::MOVEMENTS => "MOVE",
        tag::JOINTS => "JNTS",
        tag::JOINT_NAMES => "JNAM",
        tag::BINDS => "BIND",
        tag::MORPH => "MRPH",
        tag::CLIP => "CLIP",
        tag::KEY_FRAMES => "KEYF",
        tag::BLOCK => "BLCK",
        tag::LEVEL => "LEVL",
        tag::SHAPE => "SHAP",
        _ => "unknown section",
    }
}

/// A section: its tag and its payload.
#[derive(Clone, Copy, Debug)]
pub struct Section<'a> {
    /// What it holds.
    pub tag: [u8; 4],
    /// Its bytes, checked against its CRC.
    pub payload: &'a [u8],
}

/// Splits the preamble off: the header's bytes (checked against their CRC) and the rest.
pub fn split_header(bytes: &[u8]) -> Result<(&[u8], &[u8]), Error> {
    let present = bytes.len() as u64;
    if bytes.get(preamble::MAGIC) != Some(&MAGIC[..]) {
        return malformed("preamble", "the file does not start with DERMIS, as avatars do");
    }
    let Some((fixed, rest)) = bytes.split_at_checked(preamble::LEN) else {
        return Err(Error::Truncated { place: "preamble", needed: preamble::LEN as u64, present });
    };
    let version = u16_at(fixed, preamble::VERSION.start);
    if version != VERSION {
        return Err(Error::Version { found: version });
    }
    let len = u16_at(fixed, preamble::HEADER_LEN.start) as usize;
    let Some((header, rest)) = rest.split_at_checked(len) else {
        return Err(Error::Truncated {
            place: "header",
            needed: len as u64,
            present: rest.len() as u64,
        });
    };
    if u32_at(fixed, preamble::CRC.start) != preamble_crc(fixed, header) {
        return Err(Error::Damaged { place: "header" });
    }
    Ok((header, rest))
}

/// Walks the sections after the header, without checking their CRC.
#[derive(Clone, Copy, Debug)]
pub struct Sections<'a> {
    rest: &'a [u8],
}

impl<'a> Sections<'a> {
    /// `bytes` is what [`split_header`] left.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    /// The next section and its stored CRC, or an error if the bytes end inside it.
    pub fn next_with_crc(&mut self) -> Option<Result<(Section<'a>, u32), Error>> {
        if self.rest.is_empty() {
            return None;
        }
        let present = self.rest.len() as u64;
        let Some((fixed, rest)) = self.rest.split_at_checked(head::LEN) else {
            self.rest = &[];
            return Some(Err(Error::Truncated {
                place: "section head",
                needed: head::LEN as u64,
                present,
            }));
        };
        let len = u32_at(fixed, head::PAYLOAD_LEN.start);
        let Some((payload, rest)) =
            usize::try_from(len).ok().and_then(|len| rest.split_at_checked(len))
        else {
            self.rest = &[];
            let needed = head::LEN as u64 + u64::from(len);
            return Some(Err(Error::Truncated { place: "section", needed, present }));
        };
        self.rest = rest;
        let tag = [fixed[0], fixed[1], fixed[2], fixed[3]];
        Some(Ok((Section { tag, payload }, u32_at(fixed, head::CRC.start))))
    }
}

impl<'a> Iterator for Sections<'a> {
    type Item = Section<'a>;

    /// The next section; stops at the first one that is not whole.
    fn next(&mut self) -> Option<Section<'a>> {
        self.next_with_crc()?.ok().map(|(section, _)| section)
    }
}

/// CRC32 of the preamble before its CRC, and of the header.
pub fn preamble_crc(fixed: &[u8], header: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(fixed.get(..preamble::CRC.start).unwrap_or(&[]));
    crc.update(header);
    crc.finalize()
}

/// CRC32 of a section: tag, length, payload.
pub fn section_crc(section: &Section<'_>) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&section.tag);
    crc.update(&(section.payload.len() as u32).to_le_bytes());
    crc.update(section.payload);
    crc.finalize()
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    match bytes.get(at..) {
        Some([a, b, ..]) => u16::from_le_bytes([*a, *b]),
        _ => 0,
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    match bytes.get(at..) {
        Some([a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]),
        _ => 0,
    }
}
