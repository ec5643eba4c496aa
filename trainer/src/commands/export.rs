//! `dermis export`.

use std::path::{Path, PathBuf};

use anyhow::Result;
use dermis_format::LowPass;
use dermis_runtime::Avatar;
use dermis_trainer::convert::LeftOut;
use dermis_trainer::export::{self, Packed};
use dermis_trainer::output;
use serde::Serialize;

use super::options::{Detail, Posing, Turning};
use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// An avatar.
    file: PathBuf,
    /// The file to write: a PLY of 3D Gaussian Splatting (.ply), SPZ of version 3 (.spz), or .splat.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    posing: Posing,
    #[command(flatten)]
    detail: Detail,
    #[command(flatten)]
    turning: Turning,
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Ply,
    Spz,
    Splat,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    bytes: usize,
    gaussians_selected: u32,
    /// In the file.
    gaussians: usize,
    sh_degree: u8,
    level: f32,
    left_out: Missing,
    /// Gaussians with a number beyond the range of the file's codes.
    clamped: usize,
    /// Degree of the avatar's harmonics, where the file has colours alone: on a mesh those from the front.
    #[serde(skip_serializing_if = "Option::is_none")]
    sh_degree_cut_from: Option<u8>,
    /// Whether other programs draw with another low-pass than the avatar has.
    other_low_pass: bool,
    #[serde(skip)]
    kind: Kind,
    #[serde(skip)]
    low_pass: LowPass,
}

/// Gaussians of the plan that are not in the file.
#[derive(Serialize)]
struct Missing {
    /// Under what is drawn.
    faint: usize,
    /// With numbers that are not finite, or further off than the format goes.
    wild: usize,
    /// Not drawn in this pose or at this level: on triangles without area, or under an opacity of 0.005.
    undrawn: usize,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let kind = kind(&arguments.output);
    let output = output::Output::create(&arguments.output, &[&arguments.file])?;
    let (report, bytes) =
        super::with_avatar(&arguments.file, |avatar| exported(avatar, arguments, kind))?;
    output.finish(&bytes)?;
    losses(&report).for_each(|loss| eprintln!("{}: {loss}", arguments.output.display()));
    super::print(common, &report, |r| {
        format!(
            "{} of {} Gaussians, harmonics of degree {}, level {:.2}, {} bytes\n",
            r.gaussians, r.gaussians_selected, r.sh_degree, r.level, r.bytes
        )
    })
}

/// What a file of this name holds.
fn kind(output: &Path) -> Kind {
    let extension = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("ply") => Kind::Ply,
        Some("spz") => Kind::Spz,
        Some("splat") => Kind::Splat,
        _ => {
            super::misuse("--output: its name says what is written; end it in .ply, .spz or .splat")
        }
    }
}

fn exported(avatar: &Avatar<'_>, arguments: &Arguments, kind: Kind) -> Result<(Report, Vec<u8>)> {
    let plan = arguments.detail.plan(avatar);
    let (mut splats, LeftOut { faint, wild }) =
        export::posed(avatar, &arguments.posing.pose(avatar)?, &plan)?;
    if arguments.turning.half_turn {
        splats.half_turn();
    }
    if kind == Kind::Splat {
        splats.cut_degree(0);
    }
    let Packed { bytes, clamped } = match kind {
        Kind::Ply => Packed { bytes: export::ply(&splats), clamped: 0 },
        Kind::Spz => export::spz(&splats)?,
        Kind::Splat => export::splat(&splats),
    };
    let (selected, gaussians) = (plan.gaussians(), splats.gaussians.len());
    let low_pass = avatar.header().low_pass;
    let undrawn = (selected as usize).saturating_sub(gaussians + faint + wild);
    let report = Report {
        bytes: bytes.len(),
        gaussians_selected: selected,
        gaussians,
        sh_degree: splats.degree,
        level: plan.level(avatar),
        left_out: Missing { faint, wild, undrawn },
        clamped,
        sh_degree_cut_from: splats.cut_from,
        other_low_pass: low_pass == LowPass::Pixel
            || kind == Kind::Splat && low_pass == LowPass::Compensated,
        kind,
        low_pass,
    };
    Ok((report, bytes))
}

/// A line for each thing that the file does not hold.
fn losses(report: &Report) -> impl Iterator<Item = String> {
    let Missing { faint, wild, undrawn } = report.left_out;
    let missing = faint + wild + undrawn;
    let left_out = (missing > 0).then(|| {
        format!(
            "left out {missing} Gaussians: {undrawn} that this pose and level do not draw, {faint} of an \
             opacity under 1.5/255, {wild} with numbers that are not finite or too great"
        )
    });
    let clamped = (report.clamped > 0).then(|| {
        format!(
            "{} Gaussians have a colour, harmonic or scale beyond the file's range and got the nearest; \
             a PLY holds them",
            report.clamped
        )
    });
    let cut = report.sh_degree_cut_from.map(|degree| {
        if report.kind == Kind::Splat {
            format!("harmonics of degree {degree} are not in a .splat: colours are constant")
        } else {
            format!(
                "harmonics of degree {degree} hang on a mesh: colours are those seen from the front"
            )
        }
    });
    let low_pass = report.other_low_pass.then(|| {
        let loss = if report.low_pass == LowPass::Pixel {
            "the avatar was trained for a low-pass of 1/12 px²; other programs have 0.3 px² and show it softer"
        } else {
            "a .splat does not say that the low-pass is compensated; other programs show small Gaussians stronger"
        };
        loss.to_owned()
    });
    [left_out, clamped, cut, low_pass].into_iter().flatten()
}
