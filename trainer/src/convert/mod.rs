//! Converters: from Gaussians that another program trained to an avatar without a mesh.
//!
//! 1. [`read`] opens the file and picks a reader by content (`detect`); `ply` reads tables of numbers, and
//!    `splat_ply` knows what 3D Gaussian Splatting calls them, `compressed_ply` what PlayCanvas packs into
//!    them; `splat` and `spz` (codes in `spz_codes`) have files of their own.
//! 2. [`splats`] holds Gaussians that stand free, and leaves out those that can never be seen.
//! 3. `nested` puts them in an order whose every prefix is a picture.
//! 4. [`pack`] encodes them: frame World, full records, the low-pass that they were trained for.
//!
//! Files are hostile until proven otherwise: what a header claims is held against the bytes that
//! are there before anything is read. Errors are one line when printed with `{:#}`.

mod compressed_ply;
mod detect;
mod nested;
mod ply;
mod splat;
pub(crate) mod splat_ply;
pub mod splats;
pub(crate) mod spz;
pub(crate) mod spz_codes;

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::output::regular_file;
use dermis_format::source::{Gaussians, Mathematics, Region, Source};
use dermis_format::{FrameKind, Full, LowPass, ScaleLaw};
use dermis_runtime::math::rotation_rows;

use crate::package;
use nested::Nested;
use splat_ply::Bound;
pub use splats::{LeftOut, Splats};

/// What a file is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// PLY of 3D Gaussian Splatting.
    Ply,
    /// 32 bytes a Gaussian, without a header.
    Splat,
    /// SPZ, versions 2 to 4.
    Spz,
    /// PlayCanvas' compressed PLY.
    CompressedPly,
}

/// Reads Gaussians that another program trained.
///
/// # Errors
///
/// Where the file is missing, malformed, of another kind, or holds no Gaussian that can be drawn.
/// Print the error with `{:#}` for one line that begins with the file's name.
pub fn read(path: &Path, kind: Option<Kind>) -> Result<(Splats, LeftOut)> {
    read_file(path, kind).with_context(|| path.display().to_string())
}

fn read_file(path: &Path, kind: Option<Kind>) -> Result<(Splats, LeftOut)> {
    let about = regular_file(path)?;
    let mut file = File::open(path).context("cannot be read; may you read it?")?;
    let (len, bound) = (about.len(), kind.map_or(Bound::Refused, |_| Bound::AsTheyStand));
    let kind = kind.map_or_else(|| detect::kind(&mut file, path), Ok)?;
    let (splats, left_out) = match kind {
        Kind::Ply => splat_ply::read(BufReader::new(file), len, bound)?,
        Kind::Splat => splat::read(BufReader::new(file), len)?,
        Kind::Spz => spz::read(BufReader::new(file), len)?,
        Kind::CompressedPly => compressed_ply::read(&file, len)?,
    };
    ensure!(
        !splats.gaussians.is_empty(),
        "none of its {} Gaussians can be drawn ({} too faint, {} with numbers that are not finite \
         or too great); export it again",
        left_out.faint + left_out.wild,
        left_out.faint,
        left_out.wild
    );
    Ok((splats, left_out))
}

/// Bytes of an avatar that holds these Gaussians and nothing else.
///
/// # Errors
///
/// Where there are none, or more than the format can hold.
pub fn pack(mut splats: Splats) -> Result<Vec<u8>> {
    let count = splats.gaussians.len();
    ensure!(count > 0, "there is no Gaussian; give at least one");
    ensure!(u32::try_from(count).is_ok(), "{count} Gaussians are more than the format can hold");
    let Nested { layers, order } = Nested::of(&splats.gaussians);
    let at = |&index: &u32| index as usize;
    let gaussians = order.iter().map(|index| splats.gaussians[at(index)]).collect();
    let harmonics = if splats.degree == 0 {
        Vec::new()
    } else {
        order.iter().map(|index| std::mem::take(&mut splats.harmonics[at(index)])).collect()
    };
    let bounds = bounds(&splats.gaussians);
    let region = Region {
        name: "all".into(),
        layers,
        gaussians: Gaussians::Full(gaussians),
        harmonics,
        ..Region::default()
    };
    package::encode(&Source {
        regions: vec![region],
        mathematics: Mathematics {
            frame: FrameKind::World,
            low_pass: if splats.compensated { LowPass::Compensated } else { LowPass::Classic },
            scale_law: ScaleLaw::SquareRoot,
            harmonics_degree: splats.degree,
        },
        bounds,
        ..Source::default()
    })
}

/// The box of the centres and of one standard deviation around them, so that a single Gaussian has a
/// size.
fn bounds(gaussians: &[Full]) -> [[f32; 3]; 2] {
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for g in gaussians {
        let sigma = g.log2_scale.map(libm::exp2f);
        let rows = rotation_rows(g.rotation);
        for axis in 0..3 {
            let squares = rows[axis].iter().zip(sigma).map(|(r, s)| (r * s) * (r * s));
            let reach = squares.sum::<f32>().sqrt();
            bounds[0][axis] = bounds[0][axis].min(g.position[axis] - reach);
            bounds[1][axis] = bounds[1][axis].max(g.position[axis] + reach);
        }
    }
    bounds
}
