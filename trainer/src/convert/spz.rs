//! SPZ (Niantic): planes of small codes, compressed. Versions 2 and 3 are one gzip stream, version 4 is a
//! header and a zstd stream for each plane. Axes are x right, y up, z back, which are ours.
//!
//! The first 16 bytes of all versions, in 2 and 3 those of the stream:
//!
//! | bytes | type | what |
//! |---|---|---|
//! | 0..4 | | "NGSP" |
//! | 4..8 | u32 | version |
//! | 8..12 | u32 | Gaussians |
//! | 12 | u8 | degree of the harmonics |
//! | 13 | u8 | bits after the binary point of positions |
//! | 14 | u8 | 1: the low-pass is compensated; 2: there are extensions |
//! | 15 | u8 | zstd streams (version 4) |
//!
//! Version 4 goes on with the place of the table of streams (u32) and 12 bytes of zeros; then extensions, the
//! table (of each stream its bytes and those of its plane, u64), and the streams. In versions 2 and 3 the
//! planes and then extensions follow.

use std::io::{BufRead, Read};

use anyhow::{Context, Result, anyhow, bail, ensure};
use flate2::bufread::GzDecoder;
use ruzstd::decoding::StreamingDecoder;

use super::splats::{LeftOut, Splats};
use super::spz_codes::{MOST_HARMONICS, PLANES, decode, harmonic, widths};

/// First bytes of the header.
pub(crate) const MAGIC: [u8; 4] = *b"NGSP";
/// First bytes of a gzip stream.
pub(super) const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Flags.
pub(crate) const COMPENSATED: u8 = 1;
const EXTENSIONS: u8 = 2;

/// Bytes of the header that all versions have, and of version 4's.
const HEADER: usize = 16;
const HEADER_4: u64 = 32;

/// More bytes of extensions are refused: real ones have some dozens.
const EXTENSIONS_LIMIT: u64 = 1 << 16;

/// Real planes have two to six times the bytes of the file, or some more where all Gaussians agree; more
/// than this many times is refused, unless it is little.
const RATIO_LIMIT: u64 = 64;
const LITTLE: u64 = 1 << 20;

/// Highest degree that is kept.
const KEPT_DEGREE: u8 = 3;

/// Type of the extension (Adobe's) that names other axes, and the value that means x right, y up, z back.
const AXES: u32 = 0xadbe_0003;
const RIGHT_UP_BACK: u32 = 4;

/// Reads a file of `len` bytes.
pub(super) fn read(mut file: impl BufRead, len: u64) -> Result<(Splats, LeftOut)> {
    let is_gzip = file.fill_buf().context("cannot be read; is it a file?")?.starts_with(&GZIP);
    let (header, planes) = if is_gzip { read_gzip(file, len)? } else { read_zstd(file, len)? };
    Ok(header.splats(&planes))
}

/// Versions 2 and 3.
fn read_gzip(file: impl BufRead, len: u64) -> Result<(Header, Vec<Vec<u8>>)> {
    let mut stream = GzDecoder::new(file);
    let header = Header::read(&mut stream, 2..=3, len)?;
    let planes = header.planes().map(|(name, bytes)| read_exactly(&mut stream, bytes, name));
    let planes = planes.collect::<Result<_>>()?;
    // To its end, which holds a checksum.
    let mut rest = Vec::new();
    stream
        .take(EXTENSIONS_LIMIT + 1)
        .read_to_end(&mut rest)
        .map_err(|error| anyhow!("its gzip stream: {error}; copy or export it again"))?;
    header.check_extensions(&rest)?;
    Ok((header, planes))
}

/// Version 4.
fn read_zstd(mut file: impl BufRead, len: u64) -> Result<(Header, Vec<Vec<u8>>)> {
    let header = Header::read(&mut file, 4..=4, len)?;
    let more = read_exactly(&mut file, HEADER_4 - HEADER as u64, "header")?;
    let table = u64::from(word(&more, 0));
    let extensions = table.checked_sub(HEADER_4).filter(|&bytes| bytes <= EXTENSIONS_LIMIT);
    let extensions = extensions.with_context(|| {
        format!("its table of streams cannot stand at byte {table}; export it again")
    })?;
    header.check_extensions(&read_exactly(&mut file, extensions, "extensions")?)?;
    let expected: Vec<_> = header.planes().filter(|(_, bytes)| *bytes > 0).collect();
    ensure!(
        usize::from(header.streams) == expected.len(),
        "has {} streams, not {}; export it again",
        header.streams,
        expected.len()
    );
    let table = read_exactly(&mut file, 16 * expected.len() as u64, "table of streams")?;
    let sizes = table.as_chunks::<8>().0.as_chunks::<2>().0;
    let mut planes = Vec::new();
    for ((name, bytes), size) in expected.into_iter().zip(sizes) {
        let [packed, unpacked] = size.map(u64::from_le_bytes);
        ensure!(
            unpacked == bytes,
            "its {name} have {unpacked} bytes, not {bytes}; export it again"
        );
        planes.push(read_stream(&read_exactly(&mut file, packed, name)?, bytes, name)?);
    }
    // Of degree 0.
    planes.resize(PLANES.len(), Vec::new());
    Ok((header, planes))
}

/// Greatest window of a zstd stream, bytes: zstd's own default limit. The decoder checks no stream's, and none of its blocks
/// against the 128 KB that one may unfold to: there a stream made for it still takes memory.
const WINDOW_LIMIT: u64 = 1 << 27;

/// The window that a zstd frame asks for (RFC 8878, 3.1.1.1); `None` where the header ends early.
fn window(frame: &[u8]) -> Option<u64> {
    let descriptor = *frame.get(4)?;
    if descriptor & 0x20 == 0 {
        let window = *frame.get(5)?;
        let base = 1u64 << (10 + (window >> 3));
        return Some(base + base / 8 * u64::from(window & 7));
    }
    // One segment: as long as the content, which stands behind the dictionary's number.
    let at = 5 + [0, 1, 2, 4][usize::from(descriptor & 3)];
    let (len, least) = [(1, 0), (2, 256), (4, 0), (8, 0)][usize::from(descriptor >> 6)];
    let mut size = [0; 8];
    size[..len].copy_from_slice(frame.get(at..at + len)?);
    Some(u64::from_le_bytes(size).saturating_add(least))
}

fn read_stream(packed: &[u8], bytes: u64, name: &str) -> Result<Vec<u8>> {
    let window = window(packed).unwrap_or(0);
    ensure!(
        window <= WINDOW_LIMIT.max(bytes),
        "the zstd stream of its {name} asks for {window} bytes of memory; export it again"
    );
    let mut stream = StreamingDecoder::new(packed)
        .map_err(|error| anyhow!("the zstd stream of its {name}: {error}; export it again"))?;
    let plane = read_exactly(&mut stream, bytes, name)?;
    let more = read_exactly(&mut stream, 1, name).is_ok();
    ensure!(!more, "its {name} have more than {bytes} bytes; export it again");
    Ok(plane)
}

/// So many bytes, for which memory is taken as they come.
fn read_exactly(from: &mut impl Read, bytes: u64, name: &str) -> Result<Vec<u8>> {
    let mut read = Vec::new();
    from.take(bytes)
        .read_to_end(&mut read)
        .map_err(|error| anyhow!("its {name}: {error}; copy or export it again"))?;
    ensure!(
        read.len() as u64 == bytes,
        "ends after {} of {bytes} bytes of its {name}; copy or export it again",
        read.len()
    );
    Ok(read)
}

/// The u32 at a place.
fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[at + i]))
}

/// What all versions say first.
#[derive(Clone, Copy, Debug)]
struct Header {
    version: u32,
    count: u32,
    degree: u8,
    fraction_bits: u8,
    flags: u8,
    streams: u8,
}

impl Header {
    /// Reads one and holds its claims against the `len` bytes of the file.
    fn read(
        from: &mut impl Read,
        versions: std::ops::RangeInclusive<u32>,
        len: u64,
    ) -> Result<Self> {
        let bytes = read_exactly(from, HEADER as u64, "header")?;
        ensure!(
            bytes.starts_with(&MAGIC),
            "is no SPZ: that begins with NGSP; say what it is with --from"
        );
        let [degree, fraction_bits, flags, streams] = [12, 13, 14, 15].map(|at| bytes[at]);
        let (version, count) = (word(&bytes, 4), word(&bytes, 8));
        let header = Self { version, count, degree, fraction_bits, flags, streams };
        ensure!(
            versions.contains(&version),
            "has SPZ's version {version}; give 2 or 3, compressed by gzip, or 4"
        );
        ensure!(degree <= 4, "has harmonics of degree {degree}, not 0 to 4; export it again");
        ensure!(
            fraction_bits < 32,
            "its positions have {fraction_bits} fractional bits; export it again"
        );
        ensure!(count > 0, "has no Gaussian; export it again");
        let claimed: u64 = header.planes().map(|(_, bytes)| bytes).sum();
        let possible = RATIO_LIMIT.saturating_mul(len).max(LITTLE);
        ensure!(
            claimed <= possible,
            "its header claims {count} Gaussians of {claimed} bytes, its {len} bytes hold at most {possible}; \
             copy or export it again"
        );
        Ok(header)
    }

    /// Name and bytes of each plane.
    fn planes(&self) -> impl Iterator<Item = (&'static str, u64)> + use<> {
        let count = u64::from(self.count);
        let widths = widths(self.version, self.degree);
        PLANES.into_iter().zip(widths.map(|width| count * width as u64))
    }

    /// Refuses other axes. What else extensions say is not about Gaussians.
    fn check_extensions(&self, mut records: &[u8]) -> Result<()> {
        ensure!(
            records.len() as u64 <= EXTENSIONS_LIMIT,
            "has over {EXTENSIONS_LIMIT} bytes behind its Gaussians; export it without extensions"
        );
        if self.flags & EXTENSIONS == 0 {
            return Ok(());
        }
        while records.len() >= 8 {
            let (head, rest) = records.split_at(8);
            let Some((payload, rest)) = rest.split_at_checked(word(head, 4) as usize) else {
                break;
            };
            if word(head, 0) == AXES && payload.len() == 4 && word(payload, 0) != RIGHT_UP_BACK {
                bail!(
                    "has axes of its own (extension SPZ_ADOBE_coordinate_system, {}), \
                     not x right, y up, z back; export it without that extension",
                    word(payload, 0)
                );
            }
            records = rest;
        }
        Ok(())
    }

    fn splats(&self, planes: &[Vec<u8>]) -> (Splats, LeftOut) {
        let widths = widths(self.version, self.degree);
        let degree = self.degree.min(KEPT_DEGREE);
        let compensated = self.flags & COMPENSATED != 0;
        let cut_from = (degree < self.degree).then_some(self.degree);
        let mut splats = Splats { degree, compensated, cut_from, ..Splats::default() };
        let mut left_out = LeftOut::default();
        let mut coefficients = [0.0; MOST_HARMONICS];
        for index in 0..self.count as usize {
            let codes: [&[u8]; 6] = std::array::from_fn(|plane| {
                &planes[plane][index * widths[plane]..(index + 1) * widths[plane]]
            });
            coefficients.iter_mut().zip(codes[5]).for_each(|(to, &code)| *to = harmonic(code));
            let kept = &coefficients[..Splats::harmonics_len(degree)];
            splats.push(&decode(codes, self.fraction_bits, kept), &mut left_out);
        }
        splats.lower_degree();
        (splats, left_out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Headers of RFC 8878: a window of 2^41 bytes, one with an eighth more, and segments of one piece.
    #[test]
    fn windows_of_streams_are_known_before_they_are_opened() {
        let frame = |header: &[u8]| [&[0x28, 0xb5, 0x2f, 0xfd], header].concat();
        assert_eq!(window(&frame(&[0x00, 31 << 3])), Some(1 << 41));
        assert_eq!(window(&frame(&[0x00, 1])), Some(1024 + 128));
        assert_eq!(window(&frame(&[0x20, 200])), Some(200));
        assert_eq!(window(&frame(&[0x61, 9, 1, 2])), Some(256 + 0x0201));
        assert_eq!(window(&frame(&[0xa0, 1, 2, 3, 4])), Some(0x0403_0201));
        assert_eq!(window(&frame(&[0xe0, 255, 255, 255, 255, 255, 255, 255, 255])), Some(u64::MAX));
        assert_eq!(window(&frame(&[0x80])), None);
        let error = read_stream(&frame(&[0x00, 31 << 3, 0, 0, 0]), 100, "positions").unwrap_err();
        assert!(error.to_string().contains("asks for 2199023255552 bytes"), "{error}");
    }
}
