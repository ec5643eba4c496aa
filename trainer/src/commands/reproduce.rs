//! `dermis reproduce`.

use std::path::{Path, PathBuf};

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
use dermis_trainer::reproduce::{self, Measure, face_lod, formats, lapisgs, lodavatar};
use serde::Serialize;

use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Whose tables: LoDAvatar's 1 and 2, LapisGS' 1 and 5, table 1 of levels of detail for faces, or files of several formats.
    #[arg(value_enum)]
    paper: Paper,
    /// A rigged mesh: GLB, glTF or OBJ.
    #[arg(required_unless_present = "splat")]
    mesh: Option<PathBuf>,
    /// formats: trained Gaussians of another program in place of a mesh.
    #[arg(long, value_name = "FILE", conflicts_with = "mesh")]
    splat: Option<PathBuf>,
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
    /// lapisgs, face-lod, formats: Gaussians of the finest level [default: 75000].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=16_000_000))]
    gaussians: Option<u32>,
    /// face-lod: meshes at most, the first Gaussians standing on coarser ones where one is as good as the surface [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4))]
    mesh_levels: Option<u32>,
    /// What the few bits of the file's numbers may cost a level, dB [default: of the preset].
    #[arg(long, value_name = "X", value_parser = super::not_negative)]
    max_loss_db: Option<f32>,
    /// lodavatar: leave out avatars of more Gaussians [default: 1500000].
    #[arg(long, value_name = "N")]
    greatest: Option<u32>,
    /// lodavatar: joints whose triangles are detailed [default: those with "head" or "hand" in their names].
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    detail_joints: Vec<String>,
}

/// Gaussians of the greatest avatar of LoDAvatar's tables: the paper's own has 1,177,850.
const GREATEST: u32 = 1_500_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Paper {
    /// Levels by subdivision, with selective detail.
    Lodavatar,
    /// Layers on an image pyramid, and its rivals.
    Lapisgs,
    /// What a face takes to animate and to draw, from near to far.
    FaceLod,
    /// The same Gaussians as PLY, .splat, SPZ and .dermis.
    Formats,
}

/// What `--json` prints of formats.
#[derive(Serialize)]
struct OfFormats {
    cpu: String,
    threads: usize,
    #[serde(flatten)]
    table: formats::Table,
}

/// What `--json` prints of levels of detail for faces.
#[derive(Serialize)]
struct OfFaceLod {
    cpu: String,
    threads: usize,
    #[serde(flatten)]
    table: face_lod::Table,
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

/// Ends the program for an option that these tables do not have.
fn refuse_foreign(arguments: &Arguments) {
    let Arguments { paper, splat, .. } = arguments;
    let trained = splat.is_none();
    let (lodavatar, face_lod) = (*paper == Paper::Lodavatar, *paper == Paper::FaceLod);
    let options = [
        ("--splat", splat.is_some(), *paper == Paper::Formats),
        ("--gaussians", arguments.gaussians.is_some(), trained && !lodavatar),
        ("--mesh-levels", arguments.mesh_levels.is_some(), face_lod),
        ("--greatest", arguments.greatest.is_some(), lodavatar),
        ("--detail-joints", !arguments.detail_joints.is_empty(), lodavatar),
        ("--steps", arguments.steps.is_some(), trained),
        ("--keyframes", arguments.keyframes.is_some(), trained),
        ("--max-loss-db", arguments.max_loss_db.is_some(), trained),
    ];
    if let Some((name, ..)) = options.iter().find(|(_, given, taken)| *given && !taken) {
        let why = if trained { "are not made with it" } else { "of a file train nothing" };
        super::misuse(&format!("{name}: these tables {why}; leave it out"));
    }
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    refuse_foreign(arguments);
    let mesh = match (&arguments.mesh, &arguments.splat) {
        (Some(mesh), _) => mesh,
        (None, Some(splat)) => return of_splats(splat, arguments, common),
        (None, None) => super::misuse("give a mesh, or formats a --splat"),
    };
    let model = import::load(mesh)?;
    let preset = Options::preset(arguments.preset);
    let options = Options {
        gaussians: arguments.gaussians.unwrap_or(preset.gaussians),
        steps: arguments.steps.unwrap_or(preset.steps),
        key_frames: arguments.keyframes.unwrap_or(preset.key_frames),
        views: arguments.views,
        size: arguments.size.unwrap_or(preset.size),
        seed: common.seed,
        max_loss_db: arguments.max_loss_db.unwrap_or(preset.max_loss_db),
        mesh_levels: arguments.mesh_levels.unwrap_or(preset.mesh_levels),
        ..preset
    };
    let measure = Measure { key_frames: options.key_frames, views: options.views };
    let named = || mesh.display().to_string();
    match arguments.paper {
        Paper::Lodavatar => {
            let detail = detail(&model, arguments);
            let entries = lodavatar::tables(
                &model,
                &options,
                &detail,
                measure,
                arguments.greatest.unwrap_or(GREATEST),
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
        Paper::FaceLod => {
            let table = face_lod::table(&model, &options).with_context(named)?;
            let report =
                OfFaceLod { cpu: machine::cpu(), threads: rayon::current_num_threads(), table };
            super::print(common, &report, of_face_lod)
        }
        Paper::Formats => {
            print_formats(common, formats::of_mesh(&model, &options).with_context(named)?)
        }
    }
}

/// Formats of Gaussians that are trained.
fn of_splats(splat: &Path, arguments: &Arguments, common: &Common) -> Result<()> {
    let options = Options::preset(arguments.preset);
    let size = arguments.size.unwrap_or(options.size);
    print_formats(common, formats::of_splats(splat, arguments.views, size, options.background)?)
}

fn print_formats(common: &Common, table: formats::Table) -> Result<()> {
    let report = OfFormats { cpu: machine::cpu(), threads: rayon::current_num_threads(), table };
    super::print(common, &report, text_of_formats)
}

fn of_face_lod(report: &OfFaceLod) -> String {
    let OfFaceLod { cpu, threads, table } = report;
    let face_lod::Table { clips, triangles, vertices, size, seconds, whole_animation_ms, levels } =
        table;
    let ms = |times: &[f64]| times.iter().map(|ms| format!("{ms:.3}")).collect::<Vec<_>>();
    let mut out = format!(
        "{triangles} triangles, {vertices} vertices, {size}x{size}; {cpu}; one thread, ms of {}; {threads} threads trained for {seconds:.0} s\nposing all of it takes {} at most in {}\n",
        Clock::ONE_THREAD.measures(),
        ms(whole_animation_ms).join(" and "),
        clips.join(" and "),
    );
    let mut headings: Vec<&str> = vec![
        "metres",
        "px tall",
        "Gaussians",
        "triangles",
        "vertices",
        "joints",
        "targets",
        "render",
    ];
    headings.extend(clips.iter().map(String::as_str));
    headings.extend(["least dB", "held", "least dB"]);
    let row = |level: &face_lod::Level| {
        let mut cells = vec![format!("{:.2}", level.distance_m), format!("{:.1}", level.height_px)];
        let counts = [level.triangles, level.vertices, level.joints, level.targets];
        cells.push(level.gaussians.to_string());
        cells.extend(counts.map(|count| count.to_string()));
        cells.push(format!("{:.2}", level.render_ms));
        cells.extend(ms(&level.animation_ms));
        cells.push(format!("{:.1}", level.least_psnr_db));
        let held = level.frames_held.iter().map(u32::to_string).collect::<Vec<_>>();
        cells.push(held.join(" / "));
        cells.push(format!("{:.1}", level.least_held_psnr_db));
        cells
    };
    out += &aligned(&headings, &levels.iter().map(row).collect::<Vec<_>>());
    out
}

fn text_of_formats(report: &OfFormats) -> String {
    let OfFormats { cpu, threads, table } = report;
    let formats::Table { gaussians, views, size, seconds, floats_foreground_db, rows } = table;
    let mut out = format!("{gaussians} Gaussians, {views} pictures of {size}x{size}");
    if let Some(seconds) = seconds {
        let time = reproduce::CLOCK.measures();
        out += &format!("; {cpu}, {threads} threads, {seconds:.0} s of {time} of training");
    }
    out.push('\n');
    if let Some(db) = floats_foreground_db {
        out += &format!("in floats {db:.2} dB to the mesh, over the foreground\n");
    }
    // Not −0.00.
    let db = |db: f64| format!("{:.2}", (100.0 * db).round() / 100.0 + 0.0);
    let cells = |row: &formats::Entry| {
        let mut cells = vec![
            row.format.to_owned(),
            row.bytes.to_string(),
            row.gaussian_bytes.to_string(),
            format!("{:.2}", row.bytes_per_gaussian),
            db(row.psnr_to_floats_db),
        ];
        // Those that need a mesh.
        cells.extend(row.psnr_foreground_db.into_iter().chain(row.lost_db).map(db));
        cells
    };
    let headings =
        ["format", "bytes", "of Gaussians", "a Gaussian", "dB to floats", "dB to mesh", "dB lost"];
    let headings = &headings[..if floats_foreground_db.is_some() { 7 } else { 5 }];
    out + &aligned(headings, &rows.iter().map(cells).collect::<Vec<_>>())
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
