//! `dermis reproduce`.

use std::path::PathBuf;

use anyhow::{Context, Result};
use dermis_trainer::bench::clock::Clock;
use dermis_trainer::bench::machine;
use dermis_trainer::bench::table::aligned;
use dermis_trainer::embed::choice::Choice;
use dermis_trainer::embed::detail::Detail;
use dermis_trainer::eval::Row;
use dermis_trainer::import;
use dermis_trainer::model::Model;
use dermis_trainer::options::{Options, Preset};
use dermis_trainer::reproduce::{self, Measure, lapisgs, lodavatar};
use serde::Serialize;

use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Whose tables: LoDAvatar's 1 and 2, or LapisGS' 1 and 5.
    #[arg(value_enum)]
    paper: Paper,
    /// A rigged mesh: GLB, glTF or OBJ.
    mesh: PathBuf,
    /// How much effort each row takes: steps and key frames.
    #[arg(long, value_enum, default_value_t = Preset::Draft)]
    preset: Preset,
    /// Steps of each row [default: of the preset].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    steps: Option<u32>,
    /// Poses to train on, and of each split to measure on [default: of the preset].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    keyframes: Option<u32>,
    /// Directions from which each is seen.
    #[arg(long, default_value_t = 42, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=42))]
    views: u32,
    /// Width and height of the pictures, px [default: of the preset].
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// lapisgs: Gaussians of the finest level.
    #[arg(long, default_value_t = 75_000, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=16_000_000))]
    gaussians: u32,
    /// lodavatar: leave out avatars of more Gaussians.
    #[arg(long, default_value_t = 1_500_000, value_name = "N")]
    greatest: u32,
    /// lodavatar: joints whose triangles are detailed [default: those with "head" or "hand" in their names].
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    detail_joints: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Paper {
    /// Levels by subdivision, with selective detail.
    Lodavatar,
    /// Layers on an image pyramid, and its rivals.
    Lapisgs,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<T> {
    cpu: String,
    threads: usize,
    size: u32,
    key_frames: u32,
    steps: u32,
    /// What entries' seconds were measured with.
    clock: Clock,
    entries: Vec<T>,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let model = import::load(&arguments.mesh)?;
    let preset = Options::preset(arguments.preset);
    let options = Options {
        gaussians: arguments.gaussians,
        steps: arguments.steps.unwrap_or(preset.steps),
        key_frames: arguments.keyframes.unwrap_or(preset.key_frames),
        views: arguments.views,
        size: arguments.size.unwrap_or(preset.size),
        seed: common.seed,
        ..preset
    };
    let measure = Measure { key_frames: options.key_frames, views: options.views };
    let named = || arguments.mesh.display().to_string();
    match arguments.paper {
        Paper::Lodavatar => {
            let detail = detail(&model, arguments);
            let entries = lodavatar::tables(
                &model,
                &options,
                &detail,
                measure,
                arguments.greatest,
                |entry| done(&entry.avatar, entry.seconds),
            );
            let report = report(&options, entries.with_context(named)?);
            super::print(common, &report, of_lodavatar)
        }
        Paper::Lapisgs => {
            let entries = lapisgs::table(&model, &options, measure, |entry| {
                done(entry.method, entry.seconds);
            });
            let report = report(&options, entries.with_context(named)?);
            super::print(common, &report, of_lapisgs)
        }
    }
}

fn report<T>(options: &Options, entries: Vec<T>) -> Report<T> {
    Report {
        cpu: machine::cpu(),
        threads: rayon::current_num_threads(),
        size: options.size,
        key_frames: options.key_frames,
        steps: options.steps,
        clock: reproduce::CLOCK,
        entries,
    }
}

/// Says that a row is done.
fn done(row: &str, seconds: f64) {
    eprintln!("{row}: {seconds:.0} s of {}", reproduce::CLOCK.measures());
}

/// The paper details face and hands.
fn detail(model: &Model, arguments: &Arguments) -> Detail {
    let joints = if arguments.detail_joints.is_empty() {
        let named = |name: &&str| {
            let name = name.to_lowercase();
            name.contains("head") || name.contains("hand")
        };
        let names = model.joints.iter().map(|joint| joint.name.as_str());
        names.filter(named).map(String::from).collect()
    } else {
        arguments.detail_joints.clone()
    };
    Detail { choice: Choice { joints, ..Choice::default() }, ..Detail::default() }
}

fn heading<T>(report: &Report<T>) -> String {
    let Report { cpu, threads, size, key_frames, steps, clock, .. } = report;
    let time = clock.measures();
    format!(
        "{size}x{size}, {key_frames} key frames, {steps} steps a row; {cpu}, {threads} threads; seconds: {time} of training\n"
    )
}

fn of_lodavatar(report: &Report<lodavatar::Entry>) -> String {
    let headings =
        ["avatar", "Gaussians", "bytes", "seconds", "PSNR dB", "foreground dB", "SSIM", "FLIP"];
    let table = |of: fn(&lodavatar::Entry) -> Option<&Row>| {
        let rows = report.entries.iter().filter_map(|entry| {
            let row = of(entry)?;
            Some(vec![
                entry.avatar.clone(),
                row.gaussians.to_string(),
                row.bytes.to_string(),
                format!("{:.0}", entry.seconds),
                format!("{:.2}", row.psnr_db),
                format!("{:.2}", row.psnr_foreground_db),
                format!("{:.4}", row.ssim),
                format!("{:.4}", row.flip),
            ])
        });
        aligned(&headings, &rows.collect::<Vec<_>>())
    };
    let novel = table(|entry| entry.novel_view.as_ref());
    let reenactment = table(|entry| entry.reenactment.as_ref());
    format!(
        "{}\nTable 1, novel views\n{novel}\nTable 2, reenactment\n{reenactment}",
        heading(report)
    )
}

fn of_lapisgs(report: &Report<lapisgs::Entry>) -> String {
    let headings =
        ["method", "scale", "Gaussians", "size", "foreground dB", "SSIM", "FLIP", "seconds"];
    let mut rows = Vec::new();
    for entry in &report.entries {
        for (level, scale) in entry.scales.iter().enumerate() {
            rows.push(vec![
                entry.method.to_owned(),
                format!("L{level} {}px", scale.size),
                scale.row.gaussians.to_string(),
                format!("{:.3}", scale.normalised_size),
                format!("{:.2}", scale.row.psnr_foreground_db),
                format!("{:.4}", scale.row.ssim),
                format!("{:.4}", scale.row.flip),
                format!("{:.0}", entry.seconds),
            ]);
        }
    }
    let mut out = format!("{}\nTable 1\n{}", heading(report), aligned(&headings, &rows));
    out += "\nTable 5: LapisGS and ours against Freeze, means over scales\n";
    let freeze = report.entries.iter().find(|entry| entry.method == "Freeze");
    let compared = ["LapisGS", lapisgs::OURS, lapisgs::OURS_AS_LONG];
    let rivals = report.entries.iter().filter(|entry| compared.contains(&entry.method));
    let changes = rivals.filter_map(|entry| Some(against(entry, freeze?))).collect::<Vec<_>>();
    out + &aligned(&["method", "SSIM %", "FLIP %", "size %"], &changes)
}

/// Mean change in percent of SSIM, FLIP and size.
fn against(entry: &lapisgs::Entry, freeze: &lapisgs::Entry) -> Vec<String> {
    let mean = |of: fn(&lapisgs::Scale) -> f64| {
        let pairs = entry.scales.iter().zip(&freeze.scales);
        let changes = pairs.map(|(a, b)| 100.0 * (of(a) - of(b)) / of(b));
        format!("{:+.2}", changes.sum::<f64>() / entry.scales.len() as f64)
    };
    vec![
        entry.method.to_owned(),
        mean(|scale| scale.row.ssim),
        mean(|scale| scale.row.flip),
        mean(|scale| scale.gaussian_bytes as f64),
    ]
}
