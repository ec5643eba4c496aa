//! `dermis demo`: the whole path on a small avatar that the program itself makes.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use dermis_runtime::{Avatar, Plan};
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::describe::Info;
use dermis_trainer::draw::{draw, rgb_of};
use dermis_trainer::eval::{EvalOptions, Evaluation, evaluate};
use dermis_trainer::model::Model;
use dermis_trainer::options::{Options, Preset};
use dermis_trainer::output::{self, Output};
use dermis_trainer::page::{Figure, Gallery, html};
use dermis_trainer::progress;
use dermis_trainer::scene::{self, KeyFrame, Painter, RigScale};
use dermis_trainer::train::{self, runtime_pose};
use glam::Vec3;
use serde::Serialize;

use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Folder for the avatar, its pictures and the page.
    #[arg(long, default_value = "demo", value_name = "DIR")]
    out: PathBuf,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    seconds: f64,
    page: PathBuf,
    avatar: PathBuf,
    evaluation: Evaluation,
    info: Info,
}

const SIZE: u32 = 400;
const GAUSSIANS: u32 = 20_000;
const BUDGETS: [u32; 4] = [500, 2_000, 8_000, GAUSSIANS];
const WHITE: [f32; 3] = [1.0; 3];

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let start = Instant::now();
    let out = &arguments.out;
    std::fs::create_dir_all(out).with_context(|| {
        format!("{}: cannot be made; choose another folder with --out", out.display())
    })?;
    let (avatar_path, page) = (out.join("avatar.dermis"), out.join("index.html"));
    let avatar_file = Output::create(&avatar_path, &[])?;
    let page_file = Output::create(&page, &[])?;
    let model = demo_avatar();
    let preset = Options::preset(Preset::Draft);
    let options = Options {
        gaussians: GAUSSIANS,
        key_frames: 3,
        size: SIZE,
        steps: 500,
        seed: common.seed,
        ..preset
    };
    let trained = train::train(&model, &options)?;
    avatar_file.finish(&trained.bytes)?;
    let avatar = Avatar::parse(&trained.bytes)?;
    let measure = EvalOptions {
        key_frames: 2,
        views: 12,
        size: SIZE,
        background: WHITE,
        budgets: BUDGETS.to_vec(),
        prefixes: Vec::new(),
        packed: None,
        planned: false,
        distance: None,
    };
    let evaluation = evaluate(&avatar, &model, &measure)?;
    let galleries = galleries(&avatar, &model, out)?;
    let info = Info::of(&avatar);
    let seconds = start.elapsed().as_secs_f64();
    let intro = format!(
        "A figure of {} triangles, made and trained by this program in {seconds:.0} s ({} steps of one {SIZE}×{SIZE} \
         picture each), then drawn from the bytes of its file under fixed budgets of Gaussians.",
        model.triangles.len(),
        trained.steps
    );
    let text = html("Dermis: one small avatar", &intro, &galleries, &evaluation, &info);
    page_file.finish(text.as_bytes())?;
    let report = Report { seconds, page, avatar: avatar_path, evaluation, info };
    super::print(common, &report, |r| {
        format!(
            "trained, packed, drawn and measured in {:.0} s\n{}\n{}\nopen {}\n",
            r.seconds,
            super::eval::text(&r.evaluation).trim_end(),
            super::info::text(&r.info).lines().next().unwrap_or(""),
            r.page.display()
        )
    })
}

/// Moments of the clips, each as mesh and at every budget; the pictures are written beside the page, too.
fn galleries(avatar: &Avatar<'_>, model: &Model, out: &Path) -> Result<Vec<Gallery>> {
    let painter = Painter::new(model);
    let bar = progress::bar("drawing", model.clips.len() as u64);
    let mut galleries = Vec::new();
    for (index, clip) in model.clips.iter().enumerate() {
        let frame = KeyFrame { clip: Some(index), seconds: clip.seconds * 0.3 };
        let posed = scene::posed_vertices(model, &frame.pose(model));
        let direction = Vec3::new(0.4 * index as f32 - 0.2, 0.15, 1.0).normalize();
        let cameras = RigScale::of(model).cameras(&[direction], &posed, SIZE, SIZE);
        let truth = scene::render(&painter, &posed, &cameras[0], WHITE, 4).picture.to_bytes();
        let mut figures =
            vec![figure(out, &format!("{}_mesh.png", clip.name), &truth, "mesh".into())?];
        for budget in BUDGETS {
            let plan = Plan::with_budget(avatar, budget);
            let drawn = draw(avatar, &runtime_pose(&frame), &plan, &cameras[0], WHITE)?;
            let name = format!("{}_{budget}.png", clip.name);
            let caption = format!(
                "{} Gaussians, {} blends",
                plan.gaussians(),
                drawn.statistics.counts.blends
            );
            figures.push(figure(out, &name, &rgb_of(&drawn.rgba), caption)?);
        }
        galleries
            .push(Gallery { title: format!("{} at {:.1} s", clip.name, frame.seconds), figures });
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(galleries)
}

fn figure(out: &Path, name: &str, rgb: &[u8], caption: String) -> Result<Figure> {
    let png = output::png(rgb, SIZE, SIZE)?;
    output::write(&out.join(name), &png)?;
    Ok(Figure { png, caption })
}
