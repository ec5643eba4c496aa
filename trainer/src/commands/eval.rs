//! `dermis eval`.

use std::path::PathBuf;

use anyhow::Result;
use dermis_format::packed;
use dermis_trainer::eval::{EvalOptions, Evaluation, Row, evaluate};
use dermis_trainer::{import, output};

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
    /// Shares of the file's bytes, its first ones, to measure in place of levels and budgets.
    #[arg(long, value_delimiter = ',', value_name = "PERCENT,…", value_parser = percent, conflicts_with = "budgets")]
    prefix: Vec<f32>,
    /// Measure budgets as a plan spends them, too, which draws no more than can be seen.
    #[arg(long, conflicts_with = "prefix")]
    planned: bool,
    /// How far away cameras are; else as in training.
    #[arg(long, value_name = "METRES", value_parser = super::positive)]
    distance: Option<f32>,
    /// Poses of each split.
    #[arg(long, default_value_t = 4, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    keyframes: u32,
    /// Directions from which each is seen.
    #[arg(long, default_value_t = 42, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=42))]
    views: u32,
    /// Width and height of the pictures, px.
    #[arg(long, default_value_t = 540, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Behind the avatar, 0 to 1.
    #[arg(long, default_value = "1,1,1", value_name = "R,G,B", value_parser = super::color)]
    background: [f32; 3],
}

/// In (0, 100].
fn percent(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|percent| *percent > 0.0 && *percent <= 100.0);
    number.ok_or_else(|| String::from("give percents above 0, at most 100, as in 10,25,50"))
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let model = import::load(&arguments.mesh)?;
    let bytes = output::read(&arguments.file)?;
    let options = EvalOptions {
        key_frames: arguments.keyframes,
        views: arguments.views,
        size: arguments.size,
        background: arguments.background,
        budgets: arguments.budgets.clone(),
        prefixes: arguments.prefix.clone(),
        packed: packed::is_packed(&bytes).then_some(bytes),
        planned: arguments.planned,
        distance: arguments.distance,
    };
    let evaluation =
        super::with_avatar(&arguments.file, |avatar| evaluate(avatar, &model, &options))?;
    for percent in &evaluation.too_short {
        let name = arguments.file.display();
        eprintln!("{name}: mesh and rig do not end within its first {percent} %: no picture yet");
    }
    super::print(common, &evaluation, text)
}

pub(crate) fn text(evaluation: &Evaluation) -> String {
    let mut out = line(&Row::HEADINGS.map(String::from));
    out.extend(evaluation.rows.iter().map(|row| line(&row.cells())));
    out
}

/// The first cell to the left, the others to the right.
fn line(cells: &[String]) -> String {
    let mut line = String::new();
    for (column, cell) in cells.iter().enumerate() {
        line += &if column == 0 { format!("{cell:18}") } else { format!(" {cell:>13}") };
    }
    line + "\n"
}
