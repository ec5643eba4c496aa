//! PlayCanvas' compressed PLY: chunks of 256 Gaussians that share ranges, and 16 bytes for each of them.
//!
//! | element | properties |
//! |---|---|
//! | `chunk` | f32 `min_` and `max_` of x, y, z, of `scale_x` … (natural logarithms), mostly of r, g, b |
//! | `vertex` | u32 `packed_position`, `packed_rotation`, `packed_scale`, `packed_color` |
//! | `sh`, if any | u8 `f_rest_0` …: all of red, then green, then blue |
//!
//! Positions and scales have 11, 10 and 11 bits from the highest on; rotations two bits that name the
//! greatest component of w, x, y, z, and 10 for each of the others; colours and opacity 8 each. Axes are
//! those of the PLY that it was made of.

use std::fs::File;
use std::io::{BufRead, BufReader, Seek};

use anyhow::{Context, Result, ensure};

use super::ply::Ply;
use super::splat_ply::{harmonics_columns, is_compensated, per_coefficient};
use super::splats::{LeftOut, Splat, Splats};

/// Gaussians of a chunk.
const CHUNK: usize = 256;

/// What every chunk has, in the order of [`Chunk::of`].
const RANGES: [&str; 12] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
];

/// What chunks of newer files have behind that: in older ones colours are in [0, 1].
const COLOR_RANGES: [&str; 6] = ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"];

/// What every Gaussian has, in the order of [`Chunk::gaussian`].
const PACKED: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

/// Reads a file of `len` bytes, once for each element: they may stand in any order.
pub(super) fn read(mut file: &File, len: u64) -> Result<(Splats, LeftOut)> {
    let mut open = |element| {
        file.rewind().context("cannot be read; is it a file?")?;
        Ply::open(BufReader::new(file), len, element)
    };
    let chunks = chunks(open("chunk")?)?;
    let vertices = open("vertex")?;
    let count = vertices.element().count;
    ensure!(
        chunks.len() == count.div_ceil(CHUNK),
        "has {} chunks for its {count} Gaussians, not one for each {CHUNK}; export it again",
        chunks.len()
    );
    let (degree, harmonics) =
        if vertices.has_element("sh") { harmonics(open("sh")?, count)? } else { (0, Vec::new()) };
    let columns = columns(&vertices, &PACKED)?;
    let compensated = is_compensated(&vertices);
    let mut splats = Splats { degree, compensated, ..Splats::default() };
    let mut left_out = LeftOut::default();
    let mut harmonics = harmonics.chunks_exact(Splats::harmonics_len(degree).max(1));
    let mut coefficients = vec![0.0; Splats::harmonics_len(degree)];
    let mut chunks = chunks.iter().flat_map(|chunk| [chunk; CHUNK]);
    vertices.for_each_row(&columns, |row| {
        let codes = harmonics.next().unwrap_or(&[]);
        per_coefficient(|i| harmonic(codes[i]), &mut coefficients);
        if let Some(chunk) = chunks.next() {
            splats.push(&chunk.gaussian(row, &coefficients), &mut left_out);
        }
    })?;
    splats.lower_degree();
    Ok((splats, left_out))
}

/// Places of properties that must be there.
fn columns<R: BufRead>(ply: &Ply<R>, names: &[&str]) -> Result<Vec<usize>> {
    let column = |name: &&str| {
        let element = &ply.element().name;
        ply.column(name)?
            .with_context(|| format!("its element {element} has no {name}; export it again"))
    };
    names.iter().map(column).collect()
}

/// Ranges that the Gaussians of a chunk share, least and greatest, of position (m), ln σ and colour.
struct Chunk([[[f64; 3]; 2]; 3]);

fn chunks<R: BufRead>(ply: Ply<R>) -> Result<Vec<Chunk>> {
    let mut names = RANGES.to_vec();
    if ply.column(COLOR_RANGES[0])?.is_some() {
        names.extend(COLOR_RANGES);
    }
    let mut chunks = Vec::new();
    let columns = columns(&ply, &names)?;
    ply.for_each_row(&columns, |row| chunks.push(Chunk::of(row)))?;
    Ok(chunks)
}

/// Degree and codes of all Gaussians, as many for each as the degree has.
fn harmonics<R: BufRead>(ply: Ply<R>, count: usize) -> Result<(u8, Vec<u8>)> {
    let rows = ply.element().count;
    ensure!(rows == count, "has {rows} rows of sh for {count} Gaussians; export it again");
    let (degree, columns) = harmonics_columns(&ply)?;
    let mut codes = Vec::new();
    ply.for_each_row(&columns, |row| codes.extend(row.iter().map(|&code| code as u8)))?;
    Ok((degree, codes))
}

/// A coefficient in [−4, 4]: codes stand for the middles of 256 parts, the first and last one for the ends.
fn harmonic(code: u8) -> f32 {
    let share = match code {
        0 => 0.0,
        255 => 1.0,
        _ => (f32::from(code) + 0.5) / 256.0,
    };
    8.0 * (share - 0.5)
}

/// `bits` bits of a code from `shift` on, in [0, 1].
fn share(code: u32, shift: u32, bits: u32) -> f64 {
    let greatest = (1 << bits) - 1;
    f64::from(code >> shift & greatest) / f64::from(greatest)
}

/// Three shares of 11, 10 and 11 bits.
fn shares(code: u32) -> [f64; 3] {
    [(21, 11), (11, 10), (0, 11)].map(|(shift, bits)| share(code, shift, bits))
}

impl Chunk {
    /// Of [`RANGES`], and of [`COLOR_RANGES`] where there are any.
    fn of(row: &[f64]) -> Self {
        let mut ranges = [[[0.0; 3], [0.0; 3]], [[0.0; 3], [0.0; 3]], [[0.0; 3], [1.0; 3]]];
        ranges
            .as_flattened_mut()
            .as_flattened_mut()
            .iter_mut()
            .zip(row)
            .for_each(|(x, of)| *x = *of);
        Self(ranges)
    }

    /// A Gaussian of the chunk by its four codes.
    fn gaussian<'a>(&self, row: &[f64], harmonics: &'a [f32]) -> Splat<'a> {
        let code = |i: usize| row[i] as u32;
        let of = |range: usize, shares: [f64; 3]| {
            let [least, greatest] = self.0[range];
            let at = |i: usize| least[i] * (1.0 - shares[i]) + greatest[i] * shares[i];
            [0, 1, 2].map(at)
        };
        let [red, green, blue, opacity] = [24, 16, 8, 0].map(|shift| share(code(3), shift, 8));
        Splat {
            position: of(0, shares(code(0))),
            rotation: rotation(code(1)),
            log2_scale: of(1, shares(code(2))).map(|ln| ln * std::f64::consts::LOG2_E),
            color: of(2, [red, green, blue]),
            opacity,
            harmonics,
        }
    }
}

/// w, x, y, z by the three that are not the greatest.
fn rotation(code: u32) -> [f64; 4] {
    let greatest = (code >> 30) as usize;
    let rest = [20, 10, 0].map(|shift| (share(code, shift, 10) - 0.5) * std::f64::consts::SQRT_2);
    let left = 1.0 - rest.iter().map(|x| x * x).sum::<f64>();
    let mut rotation = [0.0; 4];
    rotation[greatest] = left.max(0.0).sqrt();
    let others = rotation.iter_mut().enumerate().filter(|(i, _)| *i != greatest);
    others.zip(rest).for_each(|((_, x), of)| *x = of);
    rotation
}
