//! `EXT_meshopt_compression`: buffer views packed by meshoptimizer's codecs and filters.

use anyhow::{Context, Result, anyhow, bail, ensure};
use serde::Deserialize;

/// The extension's name.
pub(super) const EXTENSION: &str = "EXT_meshopt_compression";

/// At best the vertex codec packs a block of 256 vertices into 2 bits for each of their bytes.
const GREATEST_RATIO: usize = 1024;

/// The extension's JSON on a buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Parameters {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    byte_stride: usize,
    count: usize,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
}

impl Parameters {
    pub(super) fn parse(json: &serde_json::Value) -> Result<Self> {
        Self::deserialize(json).map_err(|error| anyhow!("{EXTENSION}: {error}"))
    }

    /// Bytes that `source` unfolds to, once stride and count are known to be possible.
    pub(super) fn checked_size(&self, source: &[u8]) -> Result<usize> {
        let stride = self.byte_stride;
        let (strides_fit, most) = match self.mode {
            Mode::Attributes => {
                let most = source.len().saturating_mul(GREATEST_RATIO) / stride.max(1);
                ((4..=256).contains(&stride) && stride.is_multiple_of(4), most)
            }
            // A byte codes a triangle or an index at best.
            Mode::Triangles => (stride == 2 || stride == 4, source.len().saturating_mul(3)),
            Mode::Indices => (stride == 2 || stride == 4, source.len()),
        };
        let filter_fits = match self.filter {
            Filter::None => true,
            Filter::Octahedral => stride == 4 || stride == 8,
            Filter::Quaternion => stride == 8,
            Filter::Exponential => stride.is_multiple_of(4),
        };
        let filter_allowed = self.filter == Filter::None || self.mode == Mode::Attributes;
        ensure!(
            strides_fit && filter_fits && filter_allowed,
            "{EXTENSION}: a stride of {stride} does not fit the mode or filter; export it again"
        );
        let whole = self.mode != Mode::Triangles || self.count.is_multiple_of(3);
        ensure!(
            whole && self.count <= most,
            "{EXTENSION}: {} bytes cannot hold {} elements; export it again",
            source.len(),
            self.count
        );
        Ok(self.count * stride)
    }
}

/// The plain bytes of `source`. Call [`Parameters::checked_size`] before.
pub(super) fn decode(parameters: &Parameters, source: &[u8]) -> Result<Vec<u8>> {
    let Parameters { count, byte_stride: stride, .. } = *parameters;
    let mut bytes = match parameters.mode {
        Mode::Attributes => decode_attributes(source, count, stride)?,
        Mode::Triangles => {
            let indices = meshopt::decode_index_buffer::<u32>(source, count).map_err(broken)?;
            index_bytes(indices, stride)
        }
        Mode::Indices => index_bytes(decode_sequence(source, count)?, stride),
    };
    match parameters.filter {
        Filter::None => {}
        Filter::Octahedral if stride == 4 => {
            bytes.chunks_exact_mut(4).for_each(unfilter_octahedral_8);
        }
        Filter::Octahedral => bytes.chunks_exact_mut(8).for_each(unfilter_octahedral_16),
        Filter::Quaternion => bytes.chunks_exact_mut(8).for_each(unfilter_quaternion),
        Filter::Exponential => bytes.chunks_exact_mut(4).for_each(unfilter_exponential),
    }
    Ok(bytes)
}

fn broken(error: meshopt::Error) -> anyhow::Error {
    anyhow!("{EXTENSION}: broken data ({error}); export it again")
}

fn index_bytes(indices: Vec<u32>, stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

/// A vertex of `WORDS` × 4 bytes: the decoder learns a stride from its type's size.
#[derive(Clone)]
struct Record<const WORDS: usize>([u32; WORDS]);

impl<const WORDS: usize> Default for Record<WORDS> {
    fn default() -> Self {
        Self([0; WORDS])
    }
}

fn decode_records<const WORDS: usize>(source: &[u8], count: usize) -> Result<Vec<u8>> {
    let records: Vec<Record<WORDS>> =
        meshopt::decode_vertex_buffer(source, count).map_err(broken)?;
    Ok(records.iter().flat_map(|record| record.0).flat_map(u32::to_ne_bytes).collect())
}

fn decode_attributes(source: &[u8], count: usize, stride: usize) -> Result<Vec<u8>> {
    macro_rules! by_words {
        ($($words:literal)*) => {
            match stride / 4 {
                $($words => decode_records::<$words>(source, count),)*
                _ => bail!("{EXTENSION}: a stride of {stride} bytes is too long"),
            }
        };
    }
    by_words!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31
        32 33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61
        62 63 64)
}

/// The codec of mode INDICES: a header byte, a variable-length delta for each index against one
/// of two last indices (its lowest bit says which, the rest is zigzag), and four bytes of padding.
fn decode_sequence(source: &[u8], count: usize) -> Result<Vec<u32>> {
    let cut = || format!("{EXTENSION}: index sequence is cut short; export it again");
    let header = *source.first().with_context(cut)?;
    ensure!(header & 0xf0 == 0xd0 && header & 0x0f <= 1, "{EXTENSION}: unknown index codec");
    let body = source.get(1..source.len().saturating_sub(4)).with_context(cut)?;
    let mut bytes = body.iter();
    let mut last = [0u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let code = variable_length(&mut bytes).with_context(cut)?;
        let (baseline, zigzag) = ((code & 1) as usize, code >> 1);
        let delta = (zigzag >> 1) ^ (zigzag & 1).wrapping_neg();
        last[baseline] = last[baseline].wrapping_add(delta);
        indices.push(last[baseline]);
    }
    Ok(indices)
}

/// Seven bits a byte, low ones first, at most five bytes.
fn variable_length<'a>(bytes: &mut impl Iterator<Item = &'a u8>) -> Option<u32> {
    let mut value = 0;
    for shift in [0, 7, 14, 21, 28] {
        let byte = *bytes.next()?;
        value |= u32::from(byte & 127) << shift;
        if byte < 128 {
            break;
        }
    }
    Some(value)
}

/// Unit vector from octahedral x and y; the third value holds one, all in the same integer scale.
fn octahedral([x, y, one]: [f32; 3], max: f32) -> [f32; 3] {
    let z = one - x.abs() - y.abs();
    let fold = z.min(0.0);
    let (x, y) = (x + fold * x.signum(), y + fold * y.signum());
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|value| (value * max / length).round())
}

fn unfilter_octahedral_8(bytes: &mut [u8]) {
    let decoded = octahedral([0, 1, 2].map(|i| f32::from(bytes[i] as i8)), 127.0);
    (0..3).for_each(|i| bytes[i] = decoded[i] as i8 as u8);
}

fn word(bytes: &[u8], index: usize) -> i16 {
    i16::from_le_bytes([bytes[2 * index], bytes[2 * index + 1]])
}

fn set_word(bytes: &mut [u8], index: usize, value: f32) {
    bytes[2 * index..2 * index + 2].copy_from_slice(&(value as i16).to_le_bytes());
}

fn unfilter_octahedral_16(bytes: &mut [u8]) {
    let decoded = octahedral([0, 1, 2].map(|i| f32::from(word(bytes, i))), 32767.0);
    (0..3).for_each(|i| set_word(bytes, i, decoded[i]));
}

/// Three smallest components, scaled by √2; the last word holds one in their scale and, in its two
/// low bits, which component was left out.
fn unfilter_quaternion(bytes: &mut [u8]) {
    let last = word(bytes, 3);
    let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(last | 3);
    let [x, y, z] = [0, 1, 2].map(|i| f32::from(word(bytes, i)) * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    for (offset, value) in [(1, x), (2, y), (3, z), (0, w)] {
        set_word(bytes, (last as usize + offset) & 3, (value * 32767.0).round());
    }
}

/// An 8-bit exponent over a 24-bit mantissa, both signed, to f32.
fn unfilter_exponential(bytes: &mut [u8]) {
    let value = i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let (exponent, mantissa) = (value >> 24, value << 8 >> 8);
    let float = (f64::from(mantissa) * f64::from(exponent).exp2()) as f32;
    bytes.copy_from_slice(&float.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sequence_of_indices_unfolds() {
        // Header, then zigzag deltas 5, -2 and 10 against baseline 0, and the padding.
        let source = [0xd1, 10 << 1, 3 << 1, 20 << 1, 0, 0, 0, 0];
        assert_eq!(decode_sequence(&source, 3).unwrap(), [5, 3, 13]);
        assert!(decode_sequence(&source, 4).is_err());
    }

    #[test]
    fn filters_give_unit_vectors_and_floats() {
        let mut axis = [0i8, 0, 127, 0].map(|v| v as u8);
        unfilter_octahedral_8(&mut axis);
        assert_eq!(axis, [0, 0, 127, 0]);
        // |x| + |y| over one lies on the lower half: (1, 1) is -z.
        let mut down = [127, 127, 127, 0];
        unfilter_octahedral_8(&mut down);
        assert_eq!(down.map(|v| v as i8), [0, 0, -127, 0]);
        let mut half = ((-1i32 << 24) | 1).to_le_bytes();
        unfilter_exponential(&mut half);
        assert_eq!(f32::from_le_bytes(half), 0.5);
        let mut identity = [0; 8];
        identity[6..].copy_from_slice(&32767i16.to_le_bytes());
        unfilter_quaternion(&mut identity);
        assert_eq!(word(&identity, 3), 32767);
    }
}
