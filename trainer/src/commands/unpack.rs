//! `dermis unpack`.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use dermis_format::packed;
use dermis_runtime::Avatar;
use dermis_trainer::output::{self, Output};
use serde::Serialize;

use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A packed avatar.
    file: PathBuf,
    /// The avatar to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    packed_bytes: usize,
    bytes: usize,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let to = Output::create(&arguments.output, &[&arguments.file])?;
    let packed = output::read(&arguments.file)?;
    let name = || arguments.file.display().to_string();
    ensure!(
        Avatar::parse(&packed).is_err(),
        "{}: is not packed: it is an avatar, use it as it is",
        name()
    );
    let bytes = packed::unpack(&packed).with_context(name)?;
    to.finish(&bytes)?;
    let report = Report { packed_bytes: packed.len(), bytes: bytes.len() };
    super::print(common, &report, |r| format!("{} bytes, {} packed\n", r.bytes, r.packed_bytes))
}
