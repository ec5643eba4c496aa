//! Converters: from Gaussians that another program trained to an avatar.
//!
//! 1. [`read`] opens a file of Gaussians that stand free and picks a reader by content (`detect`); `ply`
//!    reads tables of numbers, and `splat_ply` knows what 3D Gaussian Splatting calls them,
//!    `compressed_ply` what PlayCanvas packs into them; `splat` and `spz` (codes in `spz_codes`) have
//!    files of their own. [`splats`] holds Gaussians, and leaves out those that can never be seen.
//! 2. [`assemble`] tells kinds that do not stand free apart by content, and adds what a kind has besides:
//!    `gaussian_avatars` and `splatting_avatar` say which triangle carries a Gaussian, `lapisgs` joins a
//!    series of files to levels, and `bind` hangs free Gaussians on a mesh: `nearest` finds the triangle,
//!    `local` turns them into its frame. [`assembly`] is what comes of it.
//! 3. `nested` puts them in an order whose every prefix is a picture.
//!    [`coarse`] makes coarser levels of them, if asked to: merged, and trained to look like all.
//! 4. [`pack`] encodes them: full records, the low-pass that they were trained for; frame World where
//!    they stand free.
//!
//! Harmonics are kept as they are. The format looks them up by the direction in world axes, so they
//! do not turn with what carries a Gaussian: a highlight stays on the side of the room where it was
//! trained, also where an arm turns. GaussianAvatars and, by default, SplattingAvatar do the same.
//!
//! Files are hostile until proven otherwise: what a header claims is held against the bytes that
//! are there before anything is read. Errors are one line when printed with `{:#}`.

pub mod assembly;
mod bind;
pub mod coarse;
mod compressed_ply;
mod detect;
mod gaussian_avatars;
mod lapisgs;
mod local;
mod nested;
mod ply;
mod splat;
pub(crate) mod splat_ply;
pub mod splats;
mod splatting_avatar;
pub(crate) mod spz;
pub(crate) mod spz_codes;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use dermis_format::source::{Gaussians, Mathematics, Region, Source};
use dermis_format::{FrameKind, Full, LowPass, ScaleLaw};
use dermis_runtime::math::rotation_rows;

use crate::output::regular_file;
use crate::{import, package};
use assembly::Levels;
pub use assembly::{Assembly, Carrier};
pub use coarse::{Coarsening, Measured, pack_nested};
use nested::Nested;
use splat_ply::{BINDING, SplatPly};
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
    /// PLY of GaussianAvatars, on the mesh given with --mesh.
    GaussianAvatars,
    /// PLY of SplattingAvatar, with embedding.json beside it.
    SplattingAvatar,
    /// PLYs of LapisGS, from coarse to fine.
    #[value(name = "lapisgs")]
    LapisGs,
}

/// What Gaussians that hang on a mesh are refused with where there is none.
const NEEDS_MESH: &str = "its Gaussians hang on a mesh (binding_0); give it with --mesh, or take them \
                          as they stand with --from ply";

/// How files are taken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Taken<'a> {
    /// What the files are taken for; without it their content decides.
    pub kind: Option<Kind>,
    /// A mesh (GLB, glTF or OBJ) that carries them: by the triangles that the file names, else by the
    /// nearest ones in its rest pose. A SplattingAvatar has a mesh of its own; one that is given has the
    /// same triangles, and moves them in its stead.
    pub mesh: Option<&'a Path>,
    /// Whether free Gaussians are [turned](Splats::half_turn), before a mesh gets them; the mesh stays.
    pub half_turn: bool,
}

/// Reads what another program trained: one file, or the levels of a series from coarse to fine.
///
/// # Errors
///
/// Where a file is missing, malformed, of another kind, holds no Gaussian that can be drawn, or does
/// not fit the others. Print the error with `{:#}` for one line that begins with a file's name.
pub fn assemble(inputs: &[PathBuf], taken: &Taken<'_>) -> Result<(Assembly, LeftOut)> {
    let first = inputs.first().context("there is no file; give at least one")?;
    let name = || first.display().to_string();
    let kind = taken.kind.or_else(|| guess(inputs));
    ensure!(
        inputs.len() == 1 || kind == Some(Kind::LapisGs),
        "{}: is one of {} files, but only LapisGS trains several to be one; give one",
        name(),
        inputs.len()
    );
    ensure!(
        !(taken.half_turn && matches!(kind, Some(Kind::GaussianAvatars | Kind::SplattingAvatar))),
        "{}: its Gaussians hang on a mesh and stand as it does; leave --half-turn out",
        name()
    );
    let carrier = taken.mesh.map(carrier).transpose()?;
    let (mut free, left_out) = match kind {
        Some(Kind::LapisGs) => lapisgs::read(inputs)?,
        Some(Kind::GaussianAvatars) => {
            return carrier
                .context(NEEDS_MESH)
                .and_then(|carrier| gaussian_avatars::read(first, carrier))
                .with_context(name);
        }
        Some(Kind::SplattingAvatar) => return splatting_avatar::read(first, carrier),
        kind => read(first, kind).map(|(splats, left_out)| (splats.into(), left_out))?,
    };
    if taken.half_turn {
        free.splats.half_turn();
    }
    let assembly = match carrier {
        Some(carrier) => bind::to_nearest(free, carrier)?,
        None => free,
    };
    Ok((assembly, left_out))
}

/// What files are, where they do not stand free.
fn guess(inputs: &[PathBuf]) -> Option<Kind> {
    let [path] = inputs else { return Some(Kind::LapisGs) };
    let ply = open(path).ok()?;
    if ply.has(BINDING).unwrap_or(false) {
        Some(Kind::GaussianAvatars)
    } else if splatting_avatar::embedding(path).is_file() {
        Some(Kind::SplattingAvatar)
    } else {
        None
    }
}

/// Reads a mesh to hang Gaussians on.
fn carrier(path: &Path) -> Result<Carrier> {
    Carrier::of(&import::load(path)?, path.display().to_string())
}

/// Opens a PLY of 3D Gaussian Splatting and reads its header.
fn open(path: &Path) -> Result<SplatPly<BufReader<File>>> {
    let (file, len) = opened(path)?;
    SplatPly::open(BufReader::new(file), len)
}

/// A file and how many bytes it has.
fn opened(path: &Path) -> Result<(File, u64)> {
    let about = regular_file(path)?;
    let file = File::open(path).context("cannot be read; may you read it?")?;
    Ok((file, about.len()))
}

/// Reads Gaussians that another program trained, and that stand free. Those of a PLY whose `kind` is said are
/// taken as they stand, whatever they hang on.
///
/// # Errors
///
/// Where the file is missing, malformed, of another kind, or holds no Gaussian that can be drawn.
/// Print the error with `{:#}` for one line that begins with the file's name.
pub fn read(path: &Path, kind: Option<Kind>) -> Result<(Splats, LeftOut)> {
    read_file(path, kind).with_context(|| path.display().to_string())
}

fn read_file(path: &Path, kind: Option<Kind>) -> Result<(Splats, LeftOut)> {
    let (mut file, len) = opened(path)?;
    let found = kind.map_or_else(|| detect::kind(&mut file, path), Ok)?;
    let (splats, left_out) = match found {
        Kind::Splat => splat::read(BufReader::new(file), len)?,
        Kind::Spz => spz::read(BufReader::new(file), len)?,
        Kind::CompressedPly => compressed_ply::read(&file, len)?,
        Kind::Ply | Kind::GaussianAvatars | Kind::SplattingAvatar | Kind::LapisGs => {
            let ply = SplatPly::open(BufReader::new(file), len)?;
            ensure!(kind.is_some() || !ply.has(BINDING)?, NEEDS_MESH);
            splat_ply::read(ply)?
        }
    };
    splats.ensure_any(&left_out)?;
    Ok((splats, left_out))
}

/// Bytes of an avatar.
///
/// # Errors
///
/// Where there are no Gaussians, or more than the format can hold.
pub fn pack(assembly: impl Into<Assembly>) -> Result<Vec<u8>> {
    let Assembly { mut splats, mount, levels } = assembly.into();
    let count = splats.gaussians.len();
    ensure!(count > 0, "there is no Gaussian; give at least one");
    ensure!(u32::try_from(count).is_ok(), "{count} Gaussians are more than the format can hold");
    let (centers, triangles) = match &mount {
        Some(mount) => (mount.centers(), mount.triangles.as_slice()),
        None => (splats.gaussians.iter().map(|g| g.position).collect(), &[][..]),
    };
    let (nested, scale_law, mut later_opacities) = match levels {
        Some(Levels { layers, later_opacities }) => {
            (Nested::of_layers(&centers, triangles, layers), ScaleLaw::Constant, later_opacities)
        }
        None => (Nested::of(&centers, triangles), ScaleLaw::SquareRoot, Vec::new()),
    };
    let Nested { layers, order } = nested;
    let at = |&index: &u32| index as usize;
    let gaussians = order.iter().map(|index| splats.gaussians[at(index)]).collect();
    let triangles = order.iter().filter_map(|index| triangles.get(at(index)).copied()).collect();
    let in_order = |of_each: &mut [Vec<f32>]| -> Vec<Vec<f32>> {
        order.iter().filter_map(|index| of_each.get_mut(at(index)).map(std::mem::take)).collect()
    };
    let region = Region {
        name: "all".into(),
        layers,
        gaussians: Gaussians::Full(gaussians),
        triangles,
        harmonics: in_order(&mut splats.harmonics),
        later_opacities: in_order(&mut later_opacities),
        ..Region::default()
    };
    let frame = mount.as_ref().map_or(FrameKind::World, |mount| mount.frame);
    let mesh = match mount {
        Some(mount) => mount.carrier.source,
        None => Source { bounds: bounds(&splats.gaussians), ..Source::default() },
    };
    package::encode(&Source {
        regions: vec![region],
        mathematics: Mathematics {
            frame,
            low_pass: if splats.compensated { LowPass::Compensated } else { LowPass::Classic },
            scale_law,
            harmonics_degree: splats.degree,
        },
        ..mesh
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
