//! Converters: from Gaussians that another program trained to an avatar.
//!
//! 1. [`read`] opens a file of Gaussians that stand free; `ply` reads tables of numbers, and
//!    `splat_ply` knows what 3D Gaussian Splatting calls them. [`splats`] holds them, and leaves out
//!    those that can never be seen.
//! 2. [`assemble`] tells kinds apart by content, and adds what a kind has besides: `gaussian_avatars`
//!    and `splatting_avatar` say which triangle carries a Gaussian, `lapisgs` joins a series of files
//!    to levels, and `bind` hangs free Gaussians on a mesh: `nearest` finds the triangle, `local` turns
//!    them into its frame. [`assembly`] is what comes of it.
//! 3. `nested` puts them in an order whose every prefix is a picture.
//! 4. [`pack`] encodes them: full records, classic low-pass; frame World where they stand free.
//!
//! Harmonics are kept as they are. The format looks them up by the direction in world axes, so they
//! do not turn with what carries a Gaussian: a highlight stays on the side of the room where it was
//! trained, also where an arm turns. GaussianAvatars and, by default, SplattingAvatar do the same.
//!
//! Files are hostile until proven otherwise: what a header claims is held against the bytes that
//! are there before anything is read. Errors are one line when printed with `{:#}`.

pub mod assembly;
mod bind;
mod gaussian_avatars;
mod lapisgs;
mod local;
mod nearest;
mod nested;
mod ply;
mod splat_ply;
pub mod splats;
mod splatting_avatar;

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
use nested::Nested;
use splat_ply::{BINDING, SplatPly};
pub use splats::{LeftOut, Splats};

/// What a file is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// PLY of 3D Gaussian Splatting.
    Ply,
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

/// Reads what another program trained: one file, or the levels of a series from coarse to fine.
///
/// `mesh` (GLB, glTF or OBJ) carries the Gaussians: by the triangles that the file names, else by the
/// nearest ones in its rest pose. A SplattingAvatar has a mesh of its own; one that is given has the
/// same triangles, and moves them in its stead.
///
/// # Errors
///
/// Where a file is missing, malformed, of another kind, holds no Gaussian that can be drawn, or does
/// not fit the others. Print the error with `{:#}` for one line that begins with a file's name.
pub fn assemble(
    inputs: &[PathBuf],
    mesh: Option<&Path>,
    kind: Option<Kind>,
) -> Result<(Assembly, LeftOut)> {
    let first = inputs.first().context("there is no file; give at least one")?;
    let name = || first.display().to_string();
    let kind = kind.or_else(|| guess(inputs));
    ensure!(
        inputs.len() == 1 || kind == Some(Kind::LapisGs),
        "{}: is one of {} files, but only LapisGS trains several to be one; give one",
        name(),
        inputs.len()
    );
    let carrier = mesh.map(carrier).transpose()?;
    let (free, left_out) = match kind {
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
    let about = regular_file(path)?;
    let file = File::open(path).context("cannot be read; may you read it?")?;
    SplatPly::open(BufReader::new(file), about.len())
}

/// Reads Gaussians that another program trained, and that stand free.
///
/// # Errors
///
/// Where the file is missing, malformed, of another kind, or holds no Gaussian that can be drawn.
/// Print the error with `{:#}` for one line that begins with the file's name.
pub fn read(path: &Path, kind: Option<Kind>) -> Result<(Splats, LeftOut)> {
    read_file(path, kind).with_context(|| path.display().to_string())
}

fn read_file(path: &Path, kind: Option<Kind>) -> Result<(Splats, LeftOut)> {
    let ply = open(path)?;
    ensure!(kind.is_some() || !ply.has(BINDING)?, NEEDS_MESH);
    let (splats, left_out) = splat_ply::read(ply)?;
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
            low_pass: LowPass::Classic,
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
