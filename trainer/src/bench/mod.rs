//! `dermis bench`: the time of every stage of a frame, and beside it its error.
//!
//! 1. [`stages`] draws one frame with a [`clock`] beside each stage; [`team`] shares its work among threads.
//! 2. [`roofline`] measures the blend loop alone, out of the nearest cache: what rows are held against.
//! 3. [`error`] compares the picture with the references in f64.
//! 4. [`measure`] goes round and round over kernels and numbers of threads, so that a neighbour's work on a
//!    shared machine falls on all of them alike, and takes medians.
//! 5. [`approximations`] switches what is approximated to its exact form, one at a time.
//! 6. [`training`] measures a step of training, part by part.
//! 7. [`unpacking`] measures how soon a packed file is one that can be drawn.
//! 8. [`approach`] looks for what pops when a camera comes nearer.
//! 9. [`stereo`] measures what a second eye costs.
//! 10. [`table`] and [`plot`] show it; [`once`] draws frames for counters of instructions; [`machine`] names the CPU.
//!
//! Times of one thread are CPU time of that thread (time that passes where the system does not tell);
//! those of several threads are time that passes. `project` holds what `Prepared::new` does, `sort` the
//! lists of the tiles, `raster` blending and writing bytes.

pub mod approach;
pub mod approximations;
pub mod clock;
pub mod error;
pub mod machine;
pub mod once;
pub mod plot;
pub mod roofline;
pub mod row;
pub mod stages;
pub mod stereo;
pub mod table;
pub mod team;
pub mod training;
pub mod unpacking;

use anyhow::Result;
use dermis_runtime::{Avatar, Kernel, Plan, Pose};
use indicatif::ProgressBar;
use serde::Serialize;

use crate::camera_file::Shot;
use crate::draw::{Milliseconds, draw_unrounded, rgb_of};
use crate::eval::reference::{draw_own_reference, draw_reference};
use crate::progress;
use approximations::{Approximations, Source};
use clock::{Clock, median};
use error::{Difference, unrounded_errors};
use roofline::Roofline;
use row::{Measured, Round, Row};
use stages::{Memory, Scene};
use team::Team;

/// Rounds before those that count.
const WARM_UP: u32 = 1;

/// What is measured: every kernel in every picture with every budget by every number of threads.
#[derive(Clone, Debug)]
pub struct Options {
    /// Instructions.
    pub kernels: Vec<Kernel>,
    /// Cameras, each with its size.
    pub shots: Vec<Shot>,
    /// Greatest numbers of Gaussians.
    pub budgets: Vec<u32>,
    /// Numbers of threads; 0: one for each core.
    pub threads: Vec<usize>,
    /// Frames of each row that count; at least 1.
    pub runs: u32,
    /// Whether approximations are measured, too.
    pub approximations: bool,
}

/// What came out.
#[derive(Debug, Serialize)]
pub struct Bench {
    /// Its name.
    pub cpu: String,
    /// Threads that may run at once.
    pub cores: usize,
    /// Gaussians of the avatar.
    pub gaussians: u32,
    /// Frames of each row.
    pub runs: u32,
    /// What the blend loop of each kernel can do.
    pub rooflines: Vec<KernelRoofline>,
    /// One for each kernel, size, budget and number of threads.
    pub rows: Vec<Row>,
    /// One for each size and budget; empty where they were not asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub approximations: Vec<Approximations>,
}

/// What a kernel's blend loop can do.
#[derive(Debug, Serialize)]
pub struct KernelRoofline {
    /// Its name.
    pub kernel: &'static str,
    /// In the nearest cache, all lanes counted, by one thread: the best of all samples.
    pub evaluations_per_s: f64,
    /// Median of all samples.
    pub median_evaluations_per_s: f64,
}

/// Measures frames of an avatar. `source` has its Gaussians before they were quantized, where they
/// are known.
///
/// # Errors
///
/// Where the runtime refuses a frame, or threads cannot be started.
pub fn measure(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    source: Option<&Source>,
    options: &Options,
) -> Result<Bench> {
    let threads = options.threads.iter().map(|&n| if n == 0 { machine::cores() } else { n });
    let teams = threads.map(Team::of).collect::<Result<Vec<_>>>()?;
    let mut scenes = Vec::new();
    for &shot in &options.shots {
        scenes.extend(options.budgets.iter().map(|&budget| Scene { avatar, pose, shot, budget }));
    }
    let rounds = options.runs + WARM_UP;
    let bar = progress::bar("measuring", scenes.len() as u64 * u64::from(rounds));
    let mut samples = vec![Vec::new(); options.kernels.len()];
    let mut measured = Vec::new();
    let mut approximations = Vec::new();
    for scene in &scenes {
        measured.extend(measure_scene(scene, options, &teams, &mut samples, &bar)?);
        if options.approximations {
            approximations.push(approximations::measure(scene, source, options.runs)?);
        }
    }
    bar.finish_and_clear();
    let rooflines: Vec<KernelRoofline> = options
        .kernels
        .iter()
        .zip(samples)
        .map(|(kernel, samples)| KernelRoofline {
            kernel: kernel.name(),
            evaluations_per_s: samples.iter().copied().fold(0.0, f64::max),
            median_evaluations_per_s: median(samples),
        })
        .collect();
    let roof = |kernel: &str| {
        let roofline = rooflines.iter().find(|roofline| roofline.kernel == kernel);
        roofline.map_or(0.0, |roofline| roofline.evaluations_per_s)
    };
    let rows = measured.iter().map(|row| row.row(roof(row.kernel.name()))).collect();
    Ok(Bench {
        cpu: machine::cpu(),
        cores: machine::cores(),
        gaussians: avatar.header().gaussians,
        runs: options.runs,
        rooflines,
        rows,
        approximations,
    })
}

/// All kernels and teams on one scene, in rounds.
fn measure_scene(
    scene: &Scene<'_>,
    options: &Options,
    teams: &[Team],
    samples: &mut [Vec<f64>],
    bar: &ProgressBar,
) -> Result<Vec<Measured>> {
    let bands = teams.iter().map(Team::bands).max().unwrap_or(1);
    let mut memory = Memory::new(scene, bands);
    let references = References::of(scene)?;
    let mut rows = Vec::new();
    for &kernel in &options.kernels {
        for team in teams {
            rows.push(first_frame(scene, kernel, team, &references, &mut memory)?);
        }
    }
    let mut roofline = Roofline::new();
    for round in 0..options.runs + WARM_UP {
        let counts = round >= WARM_UP;
        for (&kernel, samples) in options.kernels.iter().zip(samples.iter_mut()) {
            samples.push(roofline.sample(kernel)?.0);
        }
        let mut row = rows.iter_mut();
        for &kernel in &options.kernels {
            for (team, row) in teams.iter().zip(&mut row) {
                let round = round_of(scene, kernel, team, row, &mut memory)?;
                row.rounds.extend(counts.then_some(round));
            }
        }
        bar.inc(1);
    }
    Ok(rows)
}

/// Draws a frame that is not timed: what it takes, and how far its picture is from the references.
fn first_frame(
    scene: &Scene<'_>,
    kernel: Kernel,
    team: &Team,
    references: &References,
    memory: &mut Memory,
) -> Result<Measured> {
    let clock = if team.threads() == 1 { Clock::ONE_THREAD } else { Clock::Wall };
    let (_, work) = scene.timed(kernel, team, clock, memory)?;
    let rgb = rgb_of(&memory.rgba);
    let Shot { camera, background } = scene.shot;
    let plan = scene.plan();
    let unrounded = draw_unrounded(scene.avatar, scene.pose, &plan, kernel, &camera, background)?;
    let values = unrounded.as_flattened().iter().map(|&x| f64::from(x));
    let all = references.all.as_ref().unwrap_or(&references.own);
    let (_, rms_to_all) = unrounded_errors(values, all.as_flattened().iter().copied());
    let least = scene.least_band_scratch(kernel, memory)?;
    // All lists at once.
    let plenty = least + 2 * work.counts.pairs as usize;
    Ok(Measured {
        kernel,
        camera,
        budget: scene.budget,
        threads: team.threads(),
        clock,
        scratch_bytes: memory.scratch_bytes(team.bands()),
        scratches: (team.threads() == 1).then(|| [vec![0; least], vec![0; plenty]]),
        fixed_bytes: memory.scratch_bytes(0),
        work,
        error: Difference::new(&rgb, &unrounded, &references.follows),
        own_decisions: Difference::new(&rgb, &unrounded, &references.own),
        rms_to_all,
        rounds: Vec::new(),
    })
}

/// Frames before the one that counts, where several threads draw and where one does beside them.
const WARMING_FRAMES: usize = 10;

/// One frame of a row, and what it is compared with in the same round.
fn round_of(
    scene: &Scene<'_>,
    kernel: Kernel,
    team: &Team,
    row: &mut Measured,
    memory: &mut Memory,
) -> Result<Round> {
    let clock = row.clock;
    let (ms, one_thread) = if team.threads() == 1 {
        (scene.timed(kernel, team, clock, memory)?.0, Milliseconds::default())
    } else {
        let ms = team.awake(|| {
            // Their caches are warm for the frame that counts.
            for _ in 0..WARMING_FRAMES {
                scene.timed(kernel, team, clock, memory)?;
            }
            Ok::<_, anyhow::Error>(scene.timed(kernel, team, clock, memory)?.0)
        })?;
        // Its caches as warm.
        for _ in 0..WARMING_FRAMES {
            scene.timed(kernel, &Team::ONE, Clock::Wall, memory)?;
        }
        (ms, scene.timed(kernel, &Team::ONE, Clock::Wall, memory)?.0)
    };
    let mut drawn = [0.0; 2];
    for (scratch, drawn) in row.scratches.iter_mut().flatten().zip(&mut drawn) {
        *drawn = scene.timed_with(kernel, row.clock, memory, scratch)?;
    }
    let [drawn_with_least, drawn_with_plenty] = drawn;
    Ok(Round { ms, one_thread, drawn_with_least, drawn_with_plenty })
}

/// A scene as it should be.
struct References {
    /// With the runtime's decisions.
    follows: Vec<[f64; 3]>,
    /// With decisions in f64.
    own: Vec<[f64; 3]>,
    /// All Gaussians, with decisions in f64; none where the budget is no less.
    all: Option<Vec<[f64; 3]>>,
}

impl References {
    fn of(scene: &Scene<'_>) -> Result<Self> {
        let &Scene { avatar, pose, shot: Shot { camera, background }, .. } = scene;
        let plan = scene.plan();
        let all = Plan::with_budget(avatar, u32::MAX);
        let own = |plan| draw_own_reference(avatar, pose, plan, &camera, background);
        Ok(Self {
            follows: draw_reference(avatar, pose, &plan, &camera, background)?,
            own: own(&plan)?,
            all: (plan != all).then(|| own(&all)).transpose()?,
        })
    }
}
