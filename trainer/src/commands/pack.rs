//! `dermis pack`.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use dermis_format::packed;
use dermis_runtime::Avatar;
use dermis_trainer::output::{self, Output};
use serde::Serialize;

use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// An avatar.
    file: PathBuf,
    /// The packed file to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    /// Of the avatar.
    unpacked_bytes: usize,
    bytes: usize,
    gaussians: u32,
    /// Of blocks and levels.
    bytes_per_gaussian: f64,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let to = Output::create(&arguments.output, &[&arguments.file])?;
    let name = || arguments.file.display().to_string();
    let bytes = output::read(&arguments.file)?;
    ensure!(
        !packed::is_packed(&bytes),
        "{}: is packed already: use it as it is, all other commands read it",
        name()
    );
    let packed = packed::pack(&bytes).with_context(name)?;
    let gaussians = Avatar::parse(&bytes).with_context(name)?.header().gaussians;
    let report = Report {
        unpacked_bytes: bytes.len(),
        bytes: packed.len(),
        gaussians,
        bytes_per_gaussian: packed::bytes_of_gaussians(&packed).with_context(name)? as f64
            / f64::from(gaussians.max(1)),
    };
    to.finish(&packed)?;
    super::print(common, &report, |r| {
        format!(
            "{} of {} bytes, {} Gaussians, {:.2} bytes each\n",
            r.bytes, r.unpacked_bytes, r.gaussians, r.bytes_per_gaussian
        )
    })
}
