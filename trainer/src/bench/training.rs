//! The time of a training step, part by part.

use std::slice;
use std::time::Instant;

use anyhow::{Result, ensure};
use dermis_format::{Avatar, LowPass, Records};
use dermis_runtime::{Camera, Plan, Pose};
use rayon::ThreadPoolBuilder;
use serde::Serialize;

use super::clock::median;
use super::error::Difference;
use super::machine;
use crate::camera_file::Shot;
use crate::eval::reference::draw_reference;
use crate::optimize::cloud::{Cloud, Freedom, Parameters, Prefix, Seed};
use crate::optimize::descend::{Advance, Descent, Problem, Times};
use crate::optimize::forward::{Forward, Stage, draw};
use crate::optimize::loss::Loss;
use crate::optimize::schedule::{Prefixes, Random, Schedule};
use crate::options::{Options, Preset};
use crate::picture::Picture;
use crate::progress;
use crate::scene::Truth;
use crate::truth::{Crop, Store, TrainingView};

/// Turns before those that count.
const WARM_UP: usize = 3;

/// A step's time, medians.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Threads that worked.
    pub threads: usize,
    /// px.
    pub width: u32,
    /// px.
    pub height: u32,
    /// Gaussians drawn.
    pub gaussians: usize,
    /// Those that touch a pixel.
    pub gaussians_visible: usize,
    /// Steps that count.
    pub steps: u32,
    /// Time that passes for a step, ms.
    pub step_ms: f64,
    /// Time of each part of a step, ms. Two pictures are on their way at once, so with several threads they add up to
    /// more than passes.
    pub ms: Times,
    /// Of the picture that the step draws, to the reference in f64 that makes the runtime's decisions.
    #[serde(flatten)]
    pub error: Difference,
}

/// Measures steps of all Gaussians of `avatar`, which must be discs on a mesh. The truth to be matched is
/// its own picture of half of its Gaussians.
///
/// # Errors
///
/// Where the file holds something else, or the runtime refuses the pose.
pub fn measure(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    shots: &[Shot],
    threads: &[usize],
    steps: u32,
) -> Result<Vec<Row>> {
    let cloud = cloud_of(avatar)?;
    let stages = [Stage::of(avatar, pose)?];
    let low_pass = avatar.header().low_pass;
    let mut rows = Vec::new();
    let bar = progress::bar("measuring", (shots.len() * threads.len()) as u64);
    for shot in shots {
        let (camera, background) = (shot.camera, shot.background);
        let error = error(avatar, pose, &cloud, &stages[0], shot, low_pass)?;
        let truth = half(&cloud, &stages[0], &camera, low_pass);
        let store = Store::new(u64::MAX, &std::env::temp_dir());
        let views =
            [TrainingView { stage: 0, camera, truth: store.keep(Crop::of(&truth, [1.0; 3]))? }];
        let loss = Loss::default();
        let problem = Problem {
            stages: &stages,
            views: &views,
            background,
            low_pass,
            loss,
            blend_price: 0.0,
        };
        for &threads in threads {
            let threads = if threads == 0 { machine::cores() } else { threads };
            let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
            let schedule = Schedule {
                // Two steps a turn.
                steps: steps + 2 * WARM_UP as u32,
                ..Options::preset(Preset::Default).schedule(Prefixes::All)
            };
            let (step_ms, ms) = pool.install(|| times(cloud.clone(), &problem, &schedule))?;
            let drawn = forward(&cloud, &stages[0], &camera, low_pass, background);
            rows.push(Row {
                threads,
                width: camera.width,
                height: camera.height,
                gaussians: cloud.len(),
                gaussians_visible: drawn.splats.len(),
                steps,
                step_ms,
                ms,
                error,
            });
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok(rows)
}

/// Medians of a step's time and of its parts.
fn times(cloud: Cloud, problem: &Problem<'_>, schedule: &Schedule) -> Result<(f64, Times)> {
    let mut descent = Descent::new(vec![cloud], problem, schedule, Random::new(1));
    let mut laps = Vec::new();
    while !descent.is_done() {
        let start = Instant::now();
        let Advance { steps, times, .. } = descent.advance()?;
        let passed = start.elapsed().as_secs_f64() * 1e3;
        laps.push((f64::from(steps), passed, times));
    }
    let laps = laps.get(WARM_UP..).unwrap_or(&[]);
    let of = |part: fn(&Times) -> f64| median(laps.iter().map(|(n, _, times)| part(times) / n));
    let times = Times {
        forward: of(|times| times.forward),
        loss: of(|times| times.loss),
        backward: of(|times| times.backward),
        update: of(|times| times.update),
    };
    Ok((median(laps.iter().map(|(n, passed, _)| passed / n)), times))
}

/// The file's Gaussians at its last level, all free.
fn cloud_of(avatar: &Avatar<'_>) -> Result<Cloud> {
    let mut seeds = Vec::new();
    let plan = Plan::with_budget(avatar, u32::MAX);
    let levels = |region: u8| plan.regions().get(usize::from(region)).map(|plan| plan.levels);
    for block in avatar.blocks_at(|region| levels(region).unwrap_or_default()) {
        let Records::Disc(discs) = block.records else { break };
        seeds.extend(discs.iter().zip(block.triangles.iter()).map(|(disc, triangle)| {
            let parameters = Parameters::of_disc(&disc);
            Seed { triangle, parameters, freedom: Freedom::Free }
        }));
    }
    ensure!(
        !seeds.is_empty(),
        "holds no discs on a mesh, which is what training moves; give a trained avatar"
    );
    Ok(Cloud::arrange(vec![seeds.len() as u32], &seeds))
}

fn forward(
    cloud: &Cloud,
    stage: &Stage,
    camera: &Camera,
    low_pass: LowPass,
    background: [f32; 3],
) -> Forward {
    let clouds = slice::from_ref(cloud);
    draw(clouds, &Prefix::whole(clouds), stage, camera, low_pass, background)
}

/// What half of the Gaussians show before white, and how much of each pixel they cover.
fn half(cloud: &Cloud, stage: &Stage, camera: &Camera, low_pass: LowPass) -> Truth {
    let prefix = Prefix::of((cloud.len() / 2).max(1) as u32, cloud);
    let over = |background| {
        draw(slice::from_ref(cloud), &[prefix], stage, camera, low_pass, background).picture
    };
    let (white, black) = (over([1.0; 3]), over([0.0; 3]));
    let coverage = white.rgb.iter().zip(&black.rgb).map(|(w, b)| 1.0 - (w[0] - b[0])).collect();
    Truth { picture: white, coverage, seen: Vec::new() }
}

fn error(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    cloud: &Cloud,
    stage: &Stage,
    shot: &Shot,
    low_pass: LowPass,
) -> Result<Difference> {
    let (camera, background) = (&shot.camera, shot.background);
    let Picture { rgb, .. } = &forward(cloud, stage, camera, low_pass, background).picture;
    let plan = Plan::with_budget(avatar, u32::MAX);
    let exact = draw_reference(avatar, pose, &plan, camera, background)?;
    let bytes: Vec<u8> =
        rgb.iter().flat_map(|rgb| rgb.map(dermis_runtime::framebuffer::to_byte)).collect();
    Ok(Difference::new(&bytes, rgb, &exact))
}
