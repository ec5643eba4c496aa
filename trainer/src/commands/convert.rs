//! `dermis convert`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use dermis_runtime::Avatar;
use dermis_trainer::convert::{self, Coarsening, Kind, LeftOut, Measured, Taken};
use dermis_trainer::describe::Info;
use dermis_trainer::output;
use serde::Serialize;

use super::options::Turning;
use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Trained Gaussians: a PLY of 3D Gaussian Splatting, PlayCanvas' compressed PLY, SPZ or .splat, or the
    /// levels of LapisGS (PLY) from coarse to fine.
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// The avatar to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Mesh that carries them (GLB, glTF or OBJ): by the triangles that the file names, or the nearest.
    #[arg(long, value_name = "MESH")]
    mesh: Option<PathBuf>,
    /// What the file is taken for [default: what its content says].
    #[arg(long, value_enum, value_name = "KIND")]
    from: Option<Kind>,
    /// Greatest degree of harmonics to keep [default: all, up to 3].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=3))]
    sh_degree: Option<u8>,
    /// Make coarser levels, each a quarter of the next, and train them against renders of all Gaussians.
    #[arg(long)]
    nested: bool,
    /// Training steps of all levels.
    #[arg(long, default_value_t = Coarsening::default().steps, requires = "nested", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    steps: u32,
    #[command(flatten)]
    turning: Turning,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    seconds: f64,
    left_out: Missing,
    /// Degree of the harmonics in the file that was read, where they were cut.
    #[serde(skip_serializing_if = "Option::is_none")]
    sh_degree_cut_from: Option<u8>,
    /// Of each level, where they were trained.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    levels: Vec<Measured>,
    #[serde(flatten)]
    info: Info,
}

/// Gaussians that are not in the file.
#[derive(Serialize)]
struct Missing {
    faint: usize,
    wild: usize,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let start = Instant::now();
    let read: Vec<&Path> =
        arguments.inputs.iter().chain(&arguments.mesh).map(PathBuf::as_path).collect();
    let output = output::Output::create(&arguments.output, &read)?;
    let Arguments { inputs, mesh, from, sh_degree, turning, .. } = arguments;
    let taken = Taken { kind: *from, mesh: mesh.as_deref(), half_turn: turning.half_turn };
    let (mut assembly, left_out) = convert::assemble(inputs, &taken)?;
    let LeftOut { faint, wild } = left_out;
    let splats = &mut assembly.splats;
    if let Some(degree) = sh_degree {
        splats.cut_degree(*degree);
    }
    let (degree, cut_from) = (splats.degree, splats.cut_from);
    let name = inputs.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let (bytes, levels) = if arguments.nested {
        let options =
            Coarsening { steps: arguments.steps, seed: common.seed, ..Coarsening::default() };
        convert::pack_nested(assembly, &options).with_context(|| name.clone())?
    } else {
        (convert::pack(assembly).with_context(|| name.clone())?, Vec::new())
    };
    output.finish(&bytes)?;
    if left_out != LeftOut::default() {
        eprintln!(
            "{name}: left out {} Gaussians: {faint} of an opacity under 1.5/255, which are never drawn, \
             {wild} with numbers that are not finite or too great",
            faint + wild
        );
    }
    if let Some(from) = cut_from {
        eprintln!("{name}: cut harmonics of degree {from} to {degree}");
    }
    let info = Info::of(&Avatar::parse(&bytes)?);
    let seconds = start.elapsed().as_secs_f64();
    let left_out = Missing { faint, wild };
    let report = Report { seconds, left_out, sh_degree_cut_from: cut_from, levels, info };
    super::print(common, &report, |report| {
        super::info::text(&report.info) + &quality(&report.levels)
    })
}

/// How good each level is.
fn quality(levels: &[Measured]) -> String {
    let line = |level: &Measured| {
        format!("first {} Gaussians: {:.2} dB to all\n", level.gaussians, level.psnr_foreground_db)
    };
    levels.iter().map(line).collect()
}
