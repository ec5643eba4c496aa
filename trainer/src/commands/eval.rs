//! `dermis eval`.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::Result;
use dermis_trainer::eval::{EvalOptions, Evaluation, evaluate};
use dermis_trainer::import;

use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// An avatar.
    file: PathBuf,
    /// The mesh that it was trained on.
    #[arg(long)]
    mesh: PathBuf,
    /// Budgets to measure beside the file's levels.
    #[arg(long, value_delimiter = ',', default_value = "5000,20000", value_name = "N,…")]
    budgets: Vec<u32>,
    /// Poses of each split.
    #[arg(long, default_value_t = 4, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    keyframes: u32,
    /// Directions from which each is seen.
    #[arg(long, default_value_t = 42, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=42))]
    views: u32,
    /// Width and height of the pictures, px.
    #[arg(long, default_value_t = 540, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let model = import::load(&arguments.mesh)?;
    let options = EvalOptions {
        key_frames: arguments.keyframes,
        views: arguments.views,
        size: arguments.size,
        background: [1.0; 3],
        budgets: arguments.budgets.clone(),
    };
    let evaluation =
        super::with_avatar(&arguments.file, |avatar| evaluate(avatar, &model, &options))?;
    super::print(common, &evaluation, text)
}

pub(crate) fn text(evaluation: &Evaluation) -> String {
    let mut out = String::from(
        "split         level  gaussians     bytes  views    psnr  foreground    ssim    flip\n",
    );
    for row in &evaluation.rows {
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "{:12} {:6.2} {:10} {:9} {:6} {:7.2} {:11.2} {:7.4} {:7.4}",
            row.split.name(),
            row.level,
            row.gaussians,
            row.bytes,
            row.views,
            row.psnr_db,
            row.psnr_foreground_db,
            row.ssim,
            row.flip
        );
    }
    out
}
