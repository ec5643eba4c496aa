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

/// The triangle of each Gaussian, where they hang on a mesh.
pub(super) const BINDING: &str = "binding_0";

/// The comment by which Brush and PlayCanvas' tools tell a low-pass as Mip-Splatting's.
pub(crate) const COMPENSATED: &str = "SplatRenderMode: mip";

/// A PLY whose properties are those of 3D Gaussian Splatting.
pub(super) struct SplatPly<R> {
    ply: Ply<R>,
    /// Of [`NUMBERS`], of the harmonics, of what [`Self::with`] asked for.
    columns: Vec<usize>,
    /// Properties `f_rest`.
    rest: usize,
    /// Degree of the harmonics, 0..=3.
    pub(super) degree: u8,
    /// Whether the low-pass that they were trained for is compensated.
    pub(super) compensated: bool,
}

impl<R: BufRead> SplatPly<R> {
    /// Reads the header of a file of `len` bytes.
    pub(super) fn open(file: R, len: u64) -> Result<Self> {
        let ply = Ply::open(file, len, "vertex")?;
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
        Ok(Self { ply, columns, rest: rest.len(), degree, compensated })
    }

    /// How many rows there are.
    pub(super) fn count(&self) -> usize {
        self.ply.element().count
    }

    /// Whether there is such a property.
    pub(super) fn has(&self, name: &str) -> Result<bool> {
        Ok(self.ply.column(name)?.is_some())
    }

    /// Reads one more property.
    pub(super) fn with(mut self, name: &str) -> Result<Self> {
        let column = self.ply.column(name)?;
        self.columns
            .push(column.with_context(|| format!("has no property {name}; export it again"))?);
        Ok(self)
    }

    /// What its Gaussians go into, still empty.
    pub(super) fn splats(&self) -> Splats {
        let Self { degree, compensated, .. } = *self;
        Splats { degree, compensated, ..Splats::default() }
    }

    /// Calls `visit` with each row's number, its Gaussian, and the numbers that [`Self::with`] asked
    /// for, up to its first error.
    pub(super) fn for_each(
        self,
        mut visit: impl FnMut(usize, &Splat<'_>, &[f64]) -> Result<()>,
    ) -> Result<()> {
        let mut harmonics = vec![0.0; self.rest];
        let mut number = 0;
        let mut visited = Ok(());
        self.ply.for_each_row(&self.columns, |row| {
            if visited.is_err() {
                return;
            }
            let (numbers, row) = row.split_at(NUMBERS.len());
            let (rest, more) = row.split_at(self.rest);
            per_coefficient(|i| rest[i] as f32, &mut harmonics);
            visited = visit(number, &gaussian(numbers, &harmonics), more);
            number += 1;
        })?;
        visited
    }
}

/// Reads Gaussians that stand free, or are taken as if they did.
pub(super) fn read(ply: SplatPly<impl BufRead>) -> Result<(Splats, LeftOut)> {
    let mut splats = ply.splats();
    let mut left_out = LeftOut::default();
    ply.for_each(|_, splat, _| {
        splats.push(splat, &mut left_out);
        Ok(())
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
