//! `dermis convert`.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use dermis_runtime::Avatar;
use dermis_trainer::convert::{self, Kind, LeftOut};
use dermis_trainer::describe::Info;
use dermis_trainer::output;
use serde::Serialize;

use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Trained Gaussians: a PLY of 3D Gaussian Splatting, or the levels of LapisGS from coarse to fine.
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
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    seconds: f64,
    left_out: Missing,
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
    let output = output::Output::create(&arguments.output)?;
    let Arguments { inputs, mesh, from, .. } = arguments;
    let (assembly, left_out) = convert::assemble(inputs, mesh.as_deref(), *from)?;
    let LeftOut { faint, wild } = left_out;
    let name = inputs.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let bytes = convert::pack(assembly).with_context(|| name.clone())?;
    output.finish(&bytes)?;
    if left_out != LeftOut::default() {
        eprintln!(
            "{name}: left out {} Gaussians: {faint} of an opacity under 1.5/255, which are never drawn, \
             {wild} with numbers that are not finite or too great",
            faint + wild
        );
    }
    let info = Info::of(&Avatar::parse(&bytes)?);
    let seconds = start.elapsed().as_secs_f64();
    let report = Report { seconds, left_out: Missing { faint, wild }, info };
    super::print(common, &report, |report| super::info::text(&report.info))
}
