//! The properties of 3D Gaussian Splatting in a PLY.

use std::io::BufRead;

use anyhow::{Context, Result, bail};

use super::ply::Ply;
use super::splats::{LeftOut, Splat, Splats};

/// √(1/4π): the constant harmonic. Colour = ½ + this · `f_dc`.
pub(crate) const CONSTANT_HARMONIC: f64 = 0.282_094_791_773_878_14;

/// What every Gaussian has, in the order of [`gaussian`].
const NUMBERS: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
    "rot_0", "rot_1", "rot_2", "rot_3",
];

/// Properties `f_rest` of degree 3.
const MOST_HARMONICS: usize = 45;

/// Written by programs whose Gaussians stand in frames of a mesh's triangles.
const BINDING: &str = "binding_0";

/// The comment by which Brush and PlayCanvas' tools tell a low-pass as Mip-Splatting's.
pub(crate) const COMPENSATED: &str = "SplatRenderMode: mip";

/// Whether Gaussians that hang on a mesh are taken as if they stood free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bound {
    Refused,
    AsTheyStand,
}

/// Reads a file of `len` bytes.
pub(super) fn read(file: impl BufRead, len: u64, bound: Bound) -> Result<(Splats, LeftOut)> {
    let ply = Ply::open(file, len, "vertex")?;
    if bound == Bound::Refused && ply.column(BINDING)?.is_some() {
        bail!(
            "its Gaussians hang on a mesh ({BINDING}), which convert cannot read yet; \
             give Gaussians that stand free, or take them as they stand with --from ply"
        );
    }
    let mut columns = Vec::new();
    for name in NUMBERS {
        let column = ply.column(name)?.with_context(|| {
            format!("has no property {name}; export it as a PLY of 3D Gaussian Splatting")
        })?;
        columns.push(column);
    }
    let (degree, rest) = harmonics_columns(&ply)?;
    columns.extend(&rest);
    let compensated = is_compensated(&ply);
    let mut splats = Splats { degree, compensated, ..Splats::default() };
    let mut left_out = LeftOut::default();
    let mut harmonics = vec![0.0; rest.len()];
    ply.for_each_row(&columns, |row| {
        let (numbers, rest) = row.split_at(NUMBERS.len());
        per_coefficient(|i| rest[i] as f32, &mut harmonics);
        splats.push(&gaussian(numbers, &harmonics), &mut left_out);
    })?;
    splats.lower_degree();
    Ok((splats, left_out))
}

/// Degree of the harmonics, and places of their properties.
pub(super) fn harmonics_columns<R: BufRead>(ply: &Ply<R>) -> Result<(u8, Vec<usize>)> {
    let mut columns = Vec::new();
    while columns.len() <= MOST_HARMONICS
        && let Some(column) = ply.column(&format!("f_rest_{}", columns.len()))?
    {
        columns.push(column);
    }
    let degree = match columns.len() {
        0 => 0,
        9 => 1,
        24 => 2,
        MOST_HARMONICS => 3,
        rest => bail!("has {rest} properties f_rest in a row, not 0, 9, 24 or 45; export it again"),
    };
    Ok((degree, columns))
}

/// Fills `harmonics`, (r, g, b) after (r, g, b), from `rest`, where all of red stands before green and blue.
pub(super) fn per_coefficient(rest: impl Fn(usize) -> f32, harmonics: &mut [f32]) {
    let bands = harmonics.len() / 3;
    for (i, coefficient) in harmonics.iter_mut().enumerate() {
        *coefficient = rest(i % 3 * bands + i / 3);
    }
}

/// Whether the file says that its Gaussians were trained with a compensated low-pass.
pub(super) fn is_compensated<R: BufRead>(ply: &Ply<R>) -> bool {
    ply.comments().any(|comment| comment == COMPENSATED)
}

/// The Gaussian of a row: opacity by its logit, scales by their natural logarithms.
fn gaussian<'a>(numbers: &[f64], harmonics: &'a [f32]) -> Splat<'a> {
    let at = |i: usize| numbers[i];
    Splat {
        position: [at(0), at(1), at(2)],
        color: [at(3), at(4), at(5)].map(|dc| 0.5 + CONSTANT_HARMONIC * dc),
        opacity: 1.0 / (1.0 + libm::exp(-at(6))),
        log2_scale: [at(7), at(8), at(9)].map(|ln| ln * std::f64::consts::LOG2_E),
        rotation: [at(10), at(11), at(12), at(13)],
        harmonics,
    }
}
