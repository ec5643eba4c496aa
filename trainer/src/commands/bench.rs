//! `dermis bench`.

mod tables;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, Result, bail};
use dermis_runtime::{Avatar, Camera, Kernel};
use dermis_trainer::bench::approach::{self, Approach, Track, Way};
use dermis_trainer::bench::approximations::Source;
use dermis_trainer::bench::once::draw_once;
use dermis_trainer::bench::stages::Scene;
use dermis_trainer::bench::stereo;
use dermis_trainer::bench::unpacking::{self, Unpacking};
use dermis_trainer::bench::{Bench, Options, machine, measure, plot, training};
use dermis_trainer::camera_file::{self, Shot};
use dermis_trainer::orbit::Orbit;
use dermis_trainer::{mannequin, output};
use serde::Serialize;

use super::options::{Posing, Size};
use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// An avatar.
    #[arg(required_unless_present = "scene", conflicts_with = "scene")]
    file: Option<PathBuf>,
    /// A made figure in place of a file: avatar:N has N Gaussians.
    #[arg(long, value_name = "avatar:N")]
    scene: Option<Mannequin>,
    /// A camera file; otherwise the camera stands in front.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["distance", "size"])]
    camera: Option<PathBuf>,
    /// Metres from the middle of the avatar [default: all of it is seen; of a made figure 2].
    #[arg(long, value_name = "METRES", value_parser = super::positive)]
    distance: Option<f32>,
    #[command(flatten)]
    posing: Posing,
    /// Instructions, or all that this CPU has.
    #[arg(long, value_delimiter = ',', default_value = "all", value_name = "scalar|sse2|…|all", value_parser = kernel_name)]
    kernel: Vec<String>,
    /// At most so many Gaussians [default: all].
    #[arg(long, value_delimiter = ',', value_name = "N,…")]
    budget: Vec<u32>,
    /// Pixels.
    #[arg(long, value_delimiter = ',', default_value = "540x540", value_name = "WxH,…")]
    size: Vec<Size>,
    /// Frames of each row that count, after one that does not.
    #[arg(long, default_value_t = 9, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    runs: u32,
    /// Switch each approximation to its exact form, and show what it saves and costs.
    #[arg(long)]
    approximations: bool,
    /// Write a plot of speed against error.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Measure steps of training all Gaussians of the file, --runs of them, on each number of threads.
    #[arg(long, conflicts_with_all = ["scene", "kernel", "budget", "approximations", "svg"])]
    training: bool,
    /// Pack the avatar, and measure what unpacking takes, --runs times.
    #[arg(long, conflicts_with_all = ["training", "camera", "distance", "kernel", "budget", "size", "approximations", "svg"])]
    unpacking: bool,
    /// Let a camera come from 8 m to 1 m in --runs pictures, by a plan of each --budget, and of the first one that becomes the
    /// last one half way: what changes from one to the next beside all Gaussians, and how well blends are foretold.
    #[arg(long, conflicts_with_all = ["scene", "training", "unpacking", "camera", "distance", "kernel", "approximations", "svg"])]
    approach: bool,
    /// With --approach: degrees around the avatar from where it comes; 0 looks at its front.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true, value_name = "DEGREES", value_parser = super::finite, requires = "approach")]
    yaw: f32,
    /// Draw both eyes of a headset, 63 mm apart, --runs times, and show what the second one costs.
    #[arg(long, conflicts_with_all = ["training", "unpacking", "approach", "approximations", "svg"])]
    stereo: bool,
    /// Draw one frame for each kernel, size and budget, and measure nothing: for programs that count
    /// instructions.
    #[arg(long, conflicts_with_all = ["runs", "approximations", "svg", "stereo", "approach", "training", "unpacking"])]
    once: bool,
}

/// A figure of so many Gaussians.
#[derive(Clone, Copy, Debug)]
struct Mannequin(u32);

impl FromStr for Mannequin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let count = text.strip_prefix("avatar:").and_then(|count| count.parse().ok());
        count
            .filter(|count| (1..=MOST_GAUSSIANS).contains(count))
            .map(Self)
            .ok_or_else(|| format!("give avatar:N, N from 1 to {MOST_GAUSSIANS}"))
    }
}

/// Of a made figure.
const MOST_GAUSSIANS: u32 = 10_000_000;
/// Names of all kernels, on whatever CPU.
const KERNELS: [&str; 8] = ["all", "scalar", "sse2", "sse4.2", "avx2", "avx512", "neon", "simd128"];
/// Where a camera that comes nearer begins and ends, metres.
const FAR: f32 = 8.0;
const NEAR: f32 = 1.0;
/// By which counts rise from picture to picture where a budget does.
const RISING: f32 = 1.1;
/// From where a made figure is seen, metres.
const DISTANCE: f32 = 2.0;

fn kernel_name(text: &str) -> Result<String, String> {
    let known = KERNELS.contains(&text).then(|| text.to_owned());
    known.ok_or_else(|| format!("choose of {}", KERNELS.join(", ")))
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    /// File or made figure.
    avatar: String,
    #[serde(flatten)]
    bench: Bench,
}

/// What `--training --json` prints.
#[derive(Serialize)]
struct TrainingReport {
    avatar: String,
    cpu: String,
    rows: Vec<training::Row>,
}

/// What `--stereo --json` prints.
#[derive(Serialize)]
struct StereoReport {
    avatar: String,
    cpu: String,
    rows: Vec<stereo::Row>,
}

/// What `--approach --json` prints.
#[derive(Serialize)]
struct ApproachReport {
    avatar: String,
    cpu: String,
    width: u32,
    height: u32,
    approaches: Vec<Approach>,
}

/// What `--unpacking --json` prints.
#[derive(Serialize)]
struct UnpackingReport {
    avatar: String,
    cpu: String,
    #[serde(flatten)]
    unpacking: Unpacking,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    if arguments.once && common.json {
        super::misuse("--once: measures nothing that --json could print; leave one out");
    }
    let read: Vec<&Path> =
        arguments.file.iter().chain(&arguments.camera).map(PathBuf::as_path).collect();
    let svg =
        arguments.svg.as_deref().map(|path| output::Output::create(path, &read)).transpose()?;
    let (name, bytes, source) = match (&arguments.scene, &arguments.file) {
        (Some(Mannequin(count)), _) => {
            let source = arguments.approximations.then(|| mannequin::gaussians(*count));
            (format!("avatar:{count}"), mannequin::avatar(*count)?, source)
        }
        (None, Some(file)) => (file.display().to_string(), super::avatar_bytes(file)?, None),
        (None, None) => super::misuse("give the file of an avatar, or --scene avatar:N"),
    };
    let avatar = Avatar::parse(&bytes).with_context(|| name.clone())?;
    if arguments.once {
        return once(&avatar, arguments).context(name);
    }
    if arguments.unpacking {
        let unpacking = unpacking::measure(&avatar, arguments.runs)?;
        let report = UnpackingReport { avatar: name, cpu: machine::cpu(), unpacking };
        return super::print(common, &report, tables::unpacking);
    }
    if arguments.approach {
        let pose = arguments.posing.pose(&avatar)?;
        let Some(&Size(width, height)) = arguments.size.first() else {
            super::misuse("give --size WxH")
        };
        let ways = ways(&budgets(&avatar, arguments));
        let size = [width, height];
        let (yaw, pictures) = (arguments.yaw, arguments.runs);
        let track = Track { yaw, far: FAR, near: NEAR, pictures };
        let approaches =
            approach::measure(&avatar, &pose, size, &ways, &track).with_context(|| name.clone())?;
        let report =
            ApproachReport { avatar: name, cpu: machine::cpu(), width, height, approaches };
        return super::print(common, &report, tables::approach);
    }
    if arguments.stereo {
        let rows = stereo(&avatar, arguments).with_context(|| name.clone())?;
        let report = StereoReport { avatar: name, cpu: machine::cpu(), rows };
        return super::print(common, &report, tables::stereo);
    }
    if arguments.training {
        let rows = training(&avatar, arguments, common).with_context(|| name.clone())?;
        let report = TrainingReport { avatar: name, cpu: machine::cpu(), rows };
        return super::print(common, &report, tables::training);
    }
    let bench = bench(&avatar, source.as_ref(), arguments, common).with_context(|| name.clone())?;
    if let Some(svg) = svg {
        let title =
            Path::new(&name).file_name().map_or(name.clone().into(), |n| n.to_string_lossy());
        svg.finish(plot::svg(&bench, &title)?.as_bytes())?;
    }
    super::print(common, &Report { avatar: name, bench }, tables::text)
}

fn bench(
    avatar: &Avatar<'_>,
    source: Option<&Source>,
    arguments: &Arguments,
    common: &Common,
) -> Result<Bench> {
    let pose = arguments.posing.pose(avatar)?;
    let options = Options {
        kernels: kernels(&arguments.kernel)?,
        shots: shots(avatar, arguments)?,
        budgets: budgets(avatar, arguments),
        threads: threads(common),
        runs: arguments.runs,
        approximations: arguments.approximations,
    };
    measure(avatar, &pose, source, &options)
}

fn training(
    avatar: &Avatar<'_>,
    arguments: &Arguments,
    common: &Common,
) -> Result<Vec<training::Row>> {
    let pose = arguments.posing.pose(avatar)?;
    let shots = shots(avatar, arguments)?;
    training::measure(avatar, &pose, &shots, &threads(common), arguments.runs)
}

fn stereo(avatar: &Avatar<'_>, arguments: &Arguments) -> Result<Vec<stereo::Row>> {
    let pose = arguments.posing.pose(avatar)?;
    let mut rows = Vec::new();
    for kernel in kernels(&arguments.kernel)? {
        for shot in shots(avatar, arguments)? {
            for budget in budgets(avatar, arguments) {
                let scene = Scene { avatar, pose: &pose, shot, budget };
                rows.push(stereo::measure(&scene, kernel, arguments.runs)?);
            }
        }
    }
    Ok(rows)
}

fn threads(common: &Common) -> Vec<usize> {
    match common.threads.as_slice() {
        [] => vec![1],
        some => some.iter().map(|&n| usize::from(n)).collect(),
    }
}

fn once(avatar: &Avatar<'_>, arguments: &Arguments) -> Result<()> {
    let pose = arguments.posing.pose(avatar)?;
    for shot in shots(avatar, arguments)? {
        for budget in budgets(avatar, arguments) {
            let scene = Scene { avatar, pose: &pose, shot, budget };
            for kernel in kernels(&arguments.kernel)? {
                draw_once(&scene, kernel)?;
            }
        }
    }
    Ok(())
}

/// Each budget on the whole way, and from the first to the last one half way: at once, and rising.
fn ways(budgets: &[u32]) -> Vec<Way> {
    let mut ways: Vec<Way> = budgets.iter().map(|&budget| Way::of_budget(budget)).collect();
    if let [first, .., last] = *budgets {
        let stepping = |rising| Way { budget: first, later_budget: last, rising };
        ways.extend([None, Some(RISING)].map(stepping));
    }
    ways
}

fn budgets(avatar: &Avatar<'_>, arguments: &Arguments) -> Vec<u32> {
    match arguments.budget.as_slice() {
        [] => vec![avatar.header().gaussians],
        some => some.to_vec(),
    }
}

fn kernels(names: &[String]) -> Result<Vec<Kernel>> {
    let available = Kernel::available();
    let mut chosen = Vec::new();
    for name in names {
        let of_name: Vec<Kernel> =
            available.iter().copied().filter(|k| name == "all" || k.name() == name).collect();
        if of_name.is_empty() {
            let names: Vec<&str> = available.iter().map(|kernel| kernel.name()).collect();
            bail!("this CPU has no {name}; choose of --kernel {}", names.join(", "));
        }
        chosen.extend(of_name);
    }
    Ok(chosen)
}

fn shots(avatar: &Avatar<'_>, arguments: &Arguments) -> Result<Vec<Shot>> {
    if let Some(path) = &arguments.camera {
        return Ok(vec![camera_file::read(path)?]);
    }
    let pose = arguments.posing.pose(avatar)?;
    let distance = arguments.distance;
    let shot = |&Size(width, height): &Size| {
        if arguments.scene.is_some() {
            let shot = mannequin::camera(distance.unwrap_or(DISTANCE), height);
            let camera = Camera { width, cx: width as f32 / 2.0, ..shot.camera };
            return Ok(Shot { camera, ..shot });
        }
        let orbit = Orbit { yaw: 0.0, pitch: 0.0, distance };
        Ok(Shot { camera: orbit.camera(avatar, &pose, width, height)?, background: [1.0; 3] })
    };
    arguments.size.iter().map(shot).collect()
}
