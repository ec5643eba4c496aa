//! `dermis train`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use dermis_runtime::Avatar;
use dermis_trainer::checkpoint::Checkpoint;
use dermis_trainer::describe::Info;
use dermis_trainer::embed::detail::Detail;
use dermis_trainer::embed::hierarchy::gaussians_of;
use dermis_trainer::methods::{Culling, MeshTrial, Method, TriedMesh};
use dermis_trainer::model::Model;
use dermis_trainer::movements::Edit;
use dermis_trainer::options::{Options, Preset};
use dermis_trainer::train::{self, Trained};
use dermis_trainer::{import, output};
use serde::Serialize;

use crate::Common;

/// More than this are no avatar, and would not fit into memory while they are trained.
const MAX_GAUSSIANS: u32 = 16_000_000;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A rigged mesh: GLB, glTF or OBJ.
    mesh: PathBuf,
    /// The avatar to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// How much effort: steps and key frames.
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    preset: Preset,
    /// How Gaussians are placed and trained.
    #[arg(long, value_enum, default_value_t = Method::Dermis)]
    method: Method,
    /// Gaussians wanted [default: 75000].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_GAUSSIANS)))]
    gaussians: Option<u32>,
    /// Layers [default: 4; lodavatar: 2].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=8))]
    levels: Option<u32>,
    /// Steps of one picture each, beside those of the survey [default: of the preset].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    steps: Option<u32>,
    /// Steps of a first, evenly spread avatar, whose error says where Gaussians go; 0: spread evenly [default: of
    /// the preset].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    survey_steps: Option<u32>,
    /// What a blend in each pixel adds to the loss, say 0.001: pictures that are cheaper to draw.
    #[arg(long, default_value_t = 0.0, value_name = "X", value_parser = super::not_negative)]
    blend_price: f32,
    /// Share of the steps before backgrounds of random colours, 0 to 1: the more, the less is seen of a dark world through a white
    /// avatar, and the worse it is before white [default: of the preset].
    #[arg(long, value_name = "SHARE", value_parser = super::share)]
    random_background: Option<f32>,
    /// PSNR that the few bits of the file's numbers may cost, dB; 0: 8 bits for each number [default: of the preset].
    #[arg(long, value_name = "DB", value_parser = super::not_negative)]
    max_loss_db: Option<f32>,
    /// Directions from which each key frame is seen.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=42))]
    views: Option<u32>,
    /// Poses [default: of the preset].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    keyframes: Option<u32>,
    /// Width and height of the pictures, px.
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// Clips to train on, by name [default: all but the last].
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    clips: Vec<String>,
    #[command(flatten)]
    detail: super::detail::DetailArguments,
    #[command(flatten)]
    regions: super::regions::RegionArguments,
    /// Meshes at most: the first Gaussians stand on coarser ones, layer i on the i-th coarsest, so that an avatar far away poses
    /// few vertices, where short trainings find one as good as the surface; 1: all on the surface itself.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=8))]
    mesh_levels: u32,
    /// How far a joint with all below it, or a morph target, moves the surface, in place of what is measured: little is left out
    /// sooner, 1000 never; joints above move as far, joints below no further; repeatable.
    #[arg(long, value_name = "NAME=METRES", value_parser = movement)]
    movement: Vec<Edit>,
    /// Ground truth held in memory, MB of 2^20 bytes; the rest lies in a temporary file (in TMPDIR).
    #[arg(long, value_name = "MB", default_value_t = 2048, value_parser = clap::value_parser!(u64).range(0..=1 << 24))]
    memory: u64,
    /// Folder for checkpoints, made where it is absent: killed at any moment and run again with the same arguments,
    /// training goes on to the same file. When it is done the folder keeps the result alone, so that another run
    /// is over at once; delete it as you like.
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    seconds: f64,
    steps: u32,
    culling: Culling,
    /// Which coarser meshes the first layers stand on.
    mesh_trials: Vec<MeshTrial>,
    #[serde(flatten)]
    info: Info,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let start = Instant::now();
    let seen = arguments.detail.files().chain(arguments.regions.files());
    let read: Vec<&Path> = seen.chain([arguments.mesh.as_path()]).collect();
    let output = output::Output::create(&arguments.output, &read)?;
    let options = options(arguments, common)?;
    if arguments.checkpoint.as_ref().is_some_and(|folder| lies_in(&arguments.output, folder)) {
        super::misuse("--output: lies in the folder of --checkpoint; choose another one");
    }
    let model = import::load(&arguments.mesh)?;
    check_count(&model, &options).with_context(|| arguments.mesh.display().to_string())?;
    let trained = match &arguments.checkpoint {
        Some(folder) => train::train_resumably(&model, &options, &Checkpoint::new(folder.clone())),
        None => train::train(&model, &options),
    };
    let trained = trained.with_context(|| arguments.mesh.display().to_string())?;
    output.finish(&trained.bytes)?;
    let info = Info::of(&Avatar::parse(&trained.bytes)?);
    let seconds = start.elapsed().as_secs_f64();
    let Trained { steps, culling, mesh_trials, .. } = trained;
    let report = Report { seconds, steps, culling, mesh_trials, info };
    super::print(common, &report, text)
}

/// Whether a file, which need not be there, is one of a folder's.
fn lies_in(file: &Path, folder: &Path) -> bool {
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty());
    let [parent, folder] = [parent.unwrap_or(Path::new(".")), folder].map(fs::canonicalize);
    parent.is_ok_and(|parent| folder.is_ok_and(|folder| parent == folder))
}

fn text(report: &Report) -> String {
    let Report { seconds, steps, culling, mesh_trials, info } = report;
    let Culling { culled, all, pictures } = culling;
    let meshes: String = mesh_trials.iter().map(of_trial).collect();
    format!(
        "{steps} steps, those of the survey among them, in {seconds:.1} s\n{meshes}\
         culling: {:.2} dB over the foreground and {:.1} blends a pixel with it, {:.2} dB and {:.1} without \
         ({pictures} training pictures)\n{}",
        culled.psnr_foreground_db,
        culled.blends_per_pixel,
        all.psnr_foreground_db,
        all.blends_per_pixel,
        super::info::text(info)
    )
}

fn of_trial(MeshTrial { gaussians, tried, is_taken }: &MeshTrial) -> String {
    let mesh = |&TriedMesh { triangles, two_sided, loss_db }: &TriedMesh| {
        let sides = if two_sided { "both sides" } else { "front" };
        format!("{triangles} triangles, {sides}: {loss_db:+.2} dB lost")
    };
    let tried: Vec<String> = tried.iter().map(mesh).collect();
    let stands = match (is_taken, tried.is_empty()) {
        (true, _) => "stand on the last mesh tried",
        (false, false) => "stay on the surface, as no coarser mesh does as well",
        (false, true) => "stay on the surface, as no mesh is coarse enough",
    };
    let tried = tried.iter().map(|mesh| format!("  tried {mesh}\n")).collect::<String>();
    format!("{gaussians} Gaussians {stands}\n{tried}")
}

/// LoDAvatar's count follows from the mesh, and grows by 4 with each level.
fn check_count(model: &Model, options: &Options) -> Result<()> {
    if options.method == Method::Lodavatar {
        let count = gaussians_of(model, options)?;
        let levels = options.levels + options.detail_levels();
        let uniform = Options { detail: Detail::default(), ..options.clone() };
        let uniform_fits = gaussians_of(model, &uniform)? <= u64::from(MAX_GAUSSIANS);
        ensure!(
            count <= u64::from(MAX_GAUSSIANS),
            "would have {count} Gaussians in {levels} levels, more than {MAX_GAUSSIANS}; choose fewer {}",
            if uniform_fits { "--detail-levels" } else { "--levels" }
        );
    }
    Ok(())
}

fn options(arguments: &Arguments, common: &Common) -> Result<Options> {
    let preset = Options::preset(arguments.preset);
    let lodavatar = arguments.method == Method::Lodavatar;
    if lodavatar && arguments.gaussians.is_some() {
        super::misuse(
            "--gaussians: lodavatar's count follows from the mesh; choose --levels instead",
        );
    }
    let alone = matches!(arguments.method, Method::Single | Method::Multiscale);
    if alone && arguments.levels.is_some() {
        super::misuse("--levels: a set alone has one; leave it out");
    }
    if lodavatar && arguments.survey_steps.is_some() {
        super::misuse("--survey-steps: lodavatar places Gaussians without; leave it out");
    }
    let levels = arguments.levels.unwrap_or(if lodavatar { 2 } else { preset.levels });
    if arguments.mesh_levels > 1 && arguments.method != Method::Dermis {
        super::misuse("--mesh-levels: only the method dermis has coarser meshes; leave it out");
    }
    if arguments.mesh_levels > levels {
        super::misuse(&format!("--mesh-levels: choose at most {levels}, as many as --levels"));
    }
    Ok(Options {
        method: arguments.method,
        gaussians: arguments.gaussians.unwrap_or(preset.gaussians),
        levels,
        steps: arguments.steps.unwrap_or(preset.steps),
        survey_steps: arguments.survey_steps.unwrap_or(preset.survey_steps),
        blend_price: arguments.blend_price,
        random_background: arguments.random_background.unwrap_or(preset.random_background),
        max_loss_db: arguments.max_loss_db.unwrap_or(preset.max_loss_db),
        views: arguments.views.unwrap_or(preset.views),
        key_frames: arguments.keyframes.unwrap_or(preset.key_frames),
        size: arguments.size.unwrap_or(preset.size),
        clips: arguments.clips.clone(),
        seed: common.seed,
        detail: arguments.detail.detail(arguments.method)?,
        regions: arguments.regions.regions()?,
        mesh_levels: arguments.mesh_levels,
        movements: arguments.movement.clone(),
        memory_bytes: arguments.memory << 20,
        ..preset
    })
}

fn movement(text: &str) -> Result<Edit, String> {
    let (name, metres) = text.rsplit_once('=').ok_or("give NAME=METRES")?;
    let metres = metres.parse().ok().filter(|metres| (0.0..=1e5).contains(metres));
    let metres = metres.ok_or("give metres from 0 to 100000")?;
    Ok(Edit { name: name.into(), metres })
}
