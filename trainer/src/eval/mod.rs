//! Quality of a file against its mesh (design.md, section 9).
//!
//! *Novel view*: the poses it was trained on, seen from 42 other directions. *Reenactment*: poses
//! of clips it was not trained on. Pictures are drawn by the runtime from the file's bytes and
//! compared with the textured mesh, 8 bits a channel; each figure is the mean over pictures.
//!
//! [`mod@reference`] is the f64 renderer that the runtime is measured against.

pub mod reference;

use anyhow::{Context, Result, ensure};
use dermis_format::packed;
use dermis_format::section::{self, Sections};
use dermis_runtime::budget::Budget;
use dermis_runtime::{Avatar, Camera, Kernel, Plan, Pose, Posed};
use serde::Serialize;

use crate::draw::{draw, planned, rgb_of};
use crate::metrics::{Rect, flip::flip, psnr::psnr_db, ssim::ssim_u8};
use crate::model::Model;
use crate::progress;
use crate::scene::{self, KeyFrame, Painter, RigScale, Truth};
use crate::train::runtime_pose;

/// What is measured, and on what.
#[derive(Clone, Debug)]
pub struct EvalOptions {
    /// Poses of each split.
    pub key_frames: u32,
    /// Directions from which each is seen, at most 42.
    pub views: u32,
    /// Width and height of the pictures, px.
    pub size: u32,
    /// Behind the avatar.
    pub background: [f32; 3],
    /// Counts to measure beside the file's levels.
    pub budgets: Vec<u32>,
    /// Shares of the file's bytes, its first ones, to measure in place of levels and budgets, in percent.
    pub prefixes: Vec<f32>,
    /// The file's packed form, of whose bytes shares are to be; none: of the file's own.
    pub packed: Option<Vec<u8>>,
    /// Whether budgets are measured as a plan spends them, too.
    pub planned: bool,
    /// How far away cameras are, metres; none: as in training.
    pub distance: Option<f32>,
}

/// Poses that were trained on or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// Training poses from other directions.
    NovelView,
    /// Poses of other clips.
    Reenactment,
}

impl Split {
    /// For people to read.
    pub fn name(self) -> &'static str {
        match self {
            Self::NovelView => "novel view",
            Self::Reenactment => "reenactment",
        }
    }
}

/// Quality at one count of Gaussians.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Which poses.
    pub split: Split,
    /// Level of detail that the count is.
    pub level: f32,
    /// Budget that was asked for; none for the file's own levels.
    pub budget: Option<u32>,
    /// Whether a plan chose how much of the budget is spent, picture by picture.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub planned: bool,
    /// Share of the file's bytes that was read, in percent; none: all of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prefix: Option<f32>,
    /// Gaussians drawn at most; of a plan the mean over pictures.
    pub gaussians: u32,
    /// Bytes of the file that such a picture needs.
    pub bytes: usize,
    /// Pictures that the figures are means of; splits may differ in it.
    pub views: u32,
    /// Over the whole frame.
    pub psnr_db: f64,
    /// Over the pixels that the mesh covers at all.
    pub psnr_foreground_db: f64,
    /// 11 × 11 Gaussian window.
    pub ssim: f64,
    /// Mean FLIP at 67 pixels per degree.
    pub flip: f64,
    /// Gaussians blended in a pixel that the mesh covers, on average over all pictures.
    pub blends_per_pixel: f64,
}

impl Row {
    /// What stands over [`Self::cells`].
    pub const HEADINGS: [&'static str; 10] = [
        "split",
        "level",
        "Gaussians",
        "bytes",
        "pictures",
        "PSNR dB",
        "foreground dB",
        "SSIM",
        "FLIP",
        "blends/px",
    ];

    /// For people to read.
    pub fn cells(&self) -> [String; 10] {
        [
            format!("{}{}", self.split.name(), if self.planned { ", plan" } else { "" }),
            format!("{:.2}", self.level),
            self.gaussians.to_string(),
            self.bytes.to_string(),
            self.views.to_string(),
            format!("{:.2}", self.psnr_db),
            format!("{:.2}", self.psnr_foreground_db),
            format!("{:.4}", self.ssim),
            format!("{:.4}", self.flip),
            format!("{:.1}", self.blends_per_pixel),
        ]
    }
}

/// All rows.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// Pictures of the novel-view split; each row has its own number.
    pub views: usize,
    /// By split, then by count.
    pub rows: Vec<Row>,
    /// Of the shares that were asked for, in percent, those in which mesh and rig do not end.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub too_short: Vec<f32>,
}

/// Measures `avatar` against `model`.
pub fn evaluate(avatar: &Avatar<'_>, model: &Model, options: &EvalOptions) -> Result<Evaluation> {
    check_same(avatar, model)?;
    let (measured, too_short) = if options.prefixes.is_empty() {
        (plans(avatar, options), Vec::new())
    } else {
        prefixes(avatar, options)?
    };
    let painter = Painter::new(model);
    let trained = trained_key_frames(avatar);
    let count = options.key_frames as usize;
    let mut clips: Vec<usize> = trained.iter().filter_map(|frame| frame.clip).collect();
    clips.dedup();
    let unseen = scene::reenactment_key_frames(model, &clips, count);
    let novel = &trained[..trained.len().min(count)];
    let mut rows = Vec::new();
    for (split, frames) in [(Split::NovelView, novel), (Split::Reenactment, &unseen[..])] {
        if frames.is_empty() {
            continue;
        }
        let sums = measure(avatar, &painter, frames, split, &measured, options)?;
        ensure!(
            sums.iter().all(|sum| sum.covered > 0),
            "none of the pictures shows the mesh; measure more views, nearer or larger"
        );
        rows.extend(measured.iter().zip(sums).map(|(one, sum)| one.row(split, &sum)));
    }
    let views = novel.len() * directions(Split::NovelView, options).len();
    Ok(Evaluation { views, rows, too_short })
}

/// Refuses a mesh that the avatar was not trained on, as far as what is measured needs it: key
/// frames name clips by their place.
fn check_same(avatar: &Avatar<'_>, model: &Model) -> Result<()> {
    const REMEDY: &str = "give the mesh that it was trained on";
    let triangles = avatar.mesh_levels().surface() as usize;
    ensure!(
        triangles == model.triangles.len(),
        "the avatar has {triangles} triangles and the mesh has {}; {REMEDY}",
        model.triangles.len()
    );
    let clips = usize::from(avatar.header().clips);
    ensure!(
        clips == model.clips.len(),
        "the avatar has {clips} clips and the mesh has {}; {REMEDY}",
        model.clips.len()
    );
    for (index, (of_avatar, of_mesh)) in avatar.clips().zip(&model.clips).enumerate() {
        ensure!(
            of_avatar.name == of_mesh.name,
            "clip {index} of the avatar is {:?} and that of the mesh is {:?}; {REMEDY}",
            of_avatar.name,
            of_mesh.name
        );
    }
    Ok(())
}

/// The key frames that the file says it was trained on; its rest pose if it says none.
fn trained_key_frames(avatar: &Avatar<'_>) -> Vec<KeyFrame> {
    let frames = avatar.key_frames().iter().map(|frame| KeyFrame {
        clip: Some(usize::from(frame.clip.get())).filter(|&clip| clip != usize::from(u16::MAX)),
        seconds: frame.seconds.get(),
    });
    let frames: Vec<_> = frames.collect();
    if frames.is_empty() { vec![KeyFrame::REST] } else { frames }
}

fn directions(split: Split, options: &EvalOptions) -> Vec<glam::Vec3> {
    let all = match split {
        Split::NovelView => scene::novel_directions(),
        Split::Reenactment => scene::training_directions(),
    };
    all[..options.views.clamp(1, 42) as usize].to_vec()
}

/// What is measured: all of a file or its first bytes, and a count.
struct Measured<'a> {
    avatar: Avatar<'a>,
    budget: Option<u32>,
    /// Percent of the file's bytes, and how many these are.
    prefix: Option<(f32, usize)>,
    /// None: what a plan makes of the budget in each picture.
    plan: Option<Plan>,
}

/// The file's levels and the budgets, by count, each count once; then the budgets as a plan spends them.
fn plans<'a>(avatar: &Avatar<'a>, options: &EvalOptions) -> Vec<Measured<'a>> {
    let budgets = options.budgets.iter();
    let levels =
        (0..avatar.header().layers).map(|level| (None, Plan::at_level(avatar, f32::from(level))));
    let counts = budgets.clone().map(|&budget| (Some(budget), Plan::with_budget(avatar, budget)));
    let mut plans: Vec<(Option<u32>, Plan)> = levels.chain(counts).collect();
    plans.sort_by_key(|(_, plan)| plan.gaussians());
    plans.dedup_by_key(|(_, plan)| plan.gaussians());
    let fixed = plans.into_iter().map(|(budget, plan)| (budget, Some(plan)));
    let planned = budgets.filter(|_| options.planned).map(|&budget| (Some(budget), None));
    let of = |(budget, plan)| Measured { avatar: *avatar, budget, prefix: None, plan };
    fixed.chain(planned).map(of).collect()
}

/// All Gaussians in shares of the file's bytes, and the shares in which mesh and rig do not end.
fn prefixes<'a>(
    avatar: &Avatar<'a>,
    options: &EvalOptions,
) -> Result<(Vec<Measured<'a>>, Vec<f32>)> {
    let (bytes, percents) = (avatar.bytes(), &options.prefixes);
    let all = options.packed.as_deref().unwrap_or(bytes);
    let (mut measured, mut too_short) = (Vec::new(), Vec::new());
    for &percent in percents {
        let share = (all.len() as f64 * f64::from(percent) / 100.0) as usize;
        let share = share.min(all.len());
        // All of the file is valid: what can be wrong with a share of it is its end.
        let len = match &options.packed {
            Some(packed) => packed::unpack_prefix(&packed[..share]).map_or(0, |file| file.len()),
            None => share,
        };
        let Ok(avatar) = Avatar::parse_prefix(&bytes[..len]) else {
            too_short.push(percent);
            continue;
        };
        let plan = Some(Plan::with_budget(&avatar, u32::MAX));
        measured.push(Measured { avatar, budget: None, prefix: Some((percent, share)), plan });
    }
    ensure!(
        !measured.is_empty(),
        "mesh and rig do not end within its first {} %; give a greater --prefix",
        percents.iter().copied().fold(0.0, f32::max)
    );
    Ok((measured, too_short))
}

impl Measured<'_> {
    /// What is drawn in a picture of a camera.
    fn plan(&self, posed: &Posed<'_, '_>, camera: &Camera) -> Result<Plan> {
        if let Some(plan) = &self.plan {
            return Ok(plan.clone());
        }
        let budget = Budget::of_gaussians(self.budget.unwrap_or(u32::MAX));
        planned(posed, camera, &budget).map(|(plan, _)| plan)
    }

    fn row(&self, split: Split, sum: &Sum) -> Row {
        let mean = |value: f64| value / f64::from(sum.pictures.max(1));
        let gaussians = mean(sum.gaussians as f64).round() as u32;
        let plan = Plan::with_budget(&self.avatar, gaussians);
        let plan = self.plan.as_ref().unwrap_or(&plan);
        Row {
            split,
            level: plan.level(&self.avatar),
            budget: self.budget,
            planned: self.plan.is_none(),
            prefix: self.prefix.map(|(percent, _)| percent),
            gaussians,
            bytes: match self.prefix {
                Some((_, bytes)) => bytes,
                None => bytes_of(&self.avatar, plan),
            },
            views: sum.pictures,
            psnr_db: mean(sum.psnr),
            psnr_foreground_db: sum.foreground / f64::from(sum.covered.max(1)),
            ssim: mean(sum.ssim),
            flip: mean(sum.flip),
            blends_per_pixel: sum.blends as f64 / sum.pixels.max(1) as f64,
        }
    }
}

/// Bytes of the file up to the last block that a plan draws from, and with it the levels that it needs, which
/// stand before it.
pub fn bytes_of(avatar: &Avatar<'_>, plan: &Plan) -> usize {
    let mut blocks = avatar.blocks();
    let mut end = 0;
    let mut needed = 0;
    let all: usize = avatar.sections().map(|s| section::head::LEN + s.payload.len()).sum();
    let start = avatar.bytes().len() - all;
    let sections: Sections<'_> = avatar.sections();
    for section in sections {
        end += section::head::LEN + section.payload.len();
        let counts = if section.tag == section::tag::BLOCK {
            let region = |b: dermis_format::Block<'_>| {
                plan.regions().get(usize::from(b.region)).map(|r| r.count > b.first)
            };
            blocks.next().and_then(region).unwrap_or(false)
        } else {
            // A level leads its layer, which decides. Clips come last, and a pose may come from elsewhere.
            section.tag != section::tag::CLIP && !section::holds_gaussians(section.tag)
        };
        if counts {
            needed = end;
        }
    }
    start + needed
}

/// Sums over pictures.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    pictures: u32,
    psnr: f64,
    covered: u32,
    foreground: f64,
    ssim: f64,
    flip: f64,
    blends: u64,
    pixels: u64,
    gaussians: u64,
}

impl Sum {
    fn add(&mut self, other: &Self) {
        self.pictures += other.pictures;
        self.psnr += other.psnr;
        self.covered += other.covered;
        self.foreground += other.foreground;
        self.ssim += other.ssim;
        self.flip += other.flip;
        self.blends += other.blends;
        self.pixels += other.pixels;
        self.gaussians += other.gaussians;
    }
}

fn measure(
    avatar: &Avatar<'_>,
    painter: &Painter<'_>,
    frames: &[KeyFrame],
    split: Split,
    measured: &[Measured<'_>],
    options: &EvalOptions,
) -> Result<Vec<Sum>> {
    let rig = RigScale::of(painter.model());
    let rig = options.distance.map_or(rig, |distance| rig.at(distance));
    let directions = directions(split, options);
    let mut sums = vec![Sum::default(); measured.len()];
    let bar = progress::bar("measuring", (frames.len() * directions.len()) as u64);
    for frame in frames {
        let posed = scene::posed_vertices(painter.model(), &frame.pose(painter.model()));
        let cameras = rig.cameras(&directions, &posed, options.size, options.size);
        let shots: Vec<_> =
            cameras.iter().map(|&camera| scene::View { posed: &posed, camera }).collect();
        // A prefix may lack clips: vertices are posed by the whole file, once for all.
        let mut scratch = vec![0; Posed::scratch_len(avatar)];
        let runtime = Posed::new(avatar, &runtime_pose(frame), Kernel::detect(), &mut scratch)?;
        let pose = Pose::Vertices(runtime.vertices());
        let pictures =
            scene::render_views(painter, &shots, options.background, 4, |index, truth| {
                bar.inc(1);
                let compare = |m: &Measured| -> Result<Sum> {
                    let camera = &cameras[index];
                    let plan = m.plan(&runtime, camera)?;
                    let drawn = draw(&m.avatar, &pose, &plan, camera, options.background)?;
                    Ok(Sum {
                        blends: drawn.statistics.counts.blends,
                        gaussians: plan.gaussians().into(),
                        ..compare(&truth, &rgb_of(&drawn.rgba))
                    })
                };
                measured.iter().map(compare).collect::<Result<Vec<_>>>()
            });
        for picture in pictures {
            let picture = picture.context("the avatar cannot be drawn")?;
            sums.iter_mut().zip(&picture).for_each(|(sum, one)| sum.add(one));
        }
    }
    bar.finish_and_clear();
    Ok(sums)
}

/// Figures of one picture.
fn compare(truth: &Truth, drawn: &[u8]) -> Sum {
    let (width, height) = (truth.picture.width, truth.picture.height);
    let exact = truth.picture.to_bytes();
    let mask: Vec<bool> = truth.coverage.iter().map(|&c| c > 0.0).collect();
    let foreground = psnr_db(&exact, drawn, Some(&mask));
    Sum {
        pictures: 1,
        psnr: psnr_db(&exact, drawn, None).unwrap_or(0.0),
        covered: u32::from(foreground.is_some()),
        foreground: foreground.unwrap_or(0.0),
        ssim: ssim_u8(&exact, drawn, width, height),
        flip: flip(&exact, drawn, width, height, differing(&exact, drawn, width)),
        blends: 0,
        gaussians: 0,
        pixels: mask.iter().filter(|covered| **covered).count() as u64,
    }
}

/// The least rectangle outside of which both pictures are equal.
fn differing(a: &[u8], b: &[u8], width: u32) -> Option<Rect> {
    let pixels = a.as_chunks::<3>().0.iter().zip(b.as_chunks::<3>().0).enumerate();
    let corners = pixels.filter(|(_, (a, b))| a != b).fold(None, |corners, (index, _)| {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let [x0, y0, x1, y1] = corners.unwrap_or([x, y, x, y]);
        Some([x0.min(x), y0.min(y), x1.max(x), y1.max(y)])
    });
    corners.map(|[x0, y0, x1, y1]| Rect { x: x0, y: y0, width: x1 + 1 - x0, height: y1 + 1 - y0 })
}
