//! A row of the table: what was measured, and what follows from it.

use dermis_runtime::{Camera, Kernel};
use serde::Serialize;

use super::clock::{Clock, least, median};
use super::error::Difference;
use super::stages::{Work, leasts, medians};
use crate::draw::Milliseconds;

/// What is measured of one kernel, size, budget and number of threads.
#[derive(Debug)]
pub struct Measured {
    /// Instructions.
    pub kernel: Kernel,
    /// By whom it is seen.
    pub camera: Camera,
    /// At most so many Gaussians.
    pub budget: u32,
    /// Threads.
    pub threads: usize,
    /// What time is measured with.
    pub clock: Clock,
    /// Lent to the runtime, as much as it asks for.
    pub scratch_bytes: usize,
    /// Of that what does not depend on the scratch of bands.
    pub fixed_bytes: usize,
    /// The least scratch of a band that is legal, and one with room for all lists; one thread only.
    pub scratches: Option<[Vec<u32>; 2]>,
    /// What a frame takes.
    pub work: Work,
    /// To the reference that follows the runtime's decisions.
    pub error: Difference,
    /// To the reference that decides by itself.
    pub own_decisions: Difference,
    /// To the reference of all Gaussians, before rounding, in 1/255.
    pub rms_to_all: f64,
    /// Frames that count.
    pub rounds: Vec<Round>,
}

/// Frames that were drawn one after the other.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// Of the row.
    pub ms: Milliseconds,
    /// The same by one thread, time that passes; zero where the row is of one thread.
    pub one_thread: Milliseconds,
    /// Lists and pixels with the least scratch, ms.
    pub drawn_with_least: f64,
    /// Lists and pixels with plenty of it, ms.
    pub drawn_with_plenty: f64,
}

/// A row of the table. Medians over frames, unless they say otherwise.
#[derive(Debug, Serialize)]
pub struct Row {
    /// Instructions.
    pub kernel: &'static str,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Greatest number of Gaussians.
    pub budget: u32,
    /// Threads.
    pub threads: usize,
    /// What time is measured with.
    pub clock: Clock,
    /// Gaussians of the plan.
    pub gaussians_selected: u32,
    /// Those that touch a pixel's bounds.
    pub gaussians_visible: u32,
    /// Gaussians in the lists of all tiles.
    pub pairs: u64,
    /// Exponents computed, all lanes counted.
    pub evaluations: u64,
    /// Gaussians blended into pixels.
    pub blends: u64,
    /// Blends of each evaluation.
    pub useful_lanes: f64,
    /// Lent to the runtime.
    pub scratch_bytes: usize,
    /// Medians of the stages.
    pub ms: Milliseconds,
    /// The least of each stage.
    pub ms_least: Milliseconds,
    /// Pose, project and sort for each Gaussian of the plan; none without any.
    pub front_end_ns_per_gaussian: Option<f64>,
    /// In the stage `raster`; none where that took no time.
    pub blends_per_s: Option<f64>,
    /// In the stage `raster`, all lanes counted.
    pub evaluations_per_s: Option<f64>,
    /// Share of what the blend loop of as many threads can do.
    pub roofline_fraction: Option<f64>,
    /// To the reference that follows the runtime's decisions: rounding alone.
    #[serde(flatten)]
    pub error: Difference,
    /// To the reference that decides by itself.
    pub own_decisions: Difference,
    /// To the reference of all Gaussians: what the budget costs. Root mean square before rounding.
    pub rms_error_to_all_gaussians_8bit: f64,
    /// What scratch costs in time; one thread only.
    pub scratch: Option<Scratch>,
    /// What threads save; more than one thread only.
    pub speed_up: Option<SpeedUp>,
}

/// Frames with little scratch and with much.
#[derive(Debug, Serialize)]
pub struct Scratch {
    /// The least with which this frame can be drawn.
    pub least_bytes: usize,
    /// A whole frame with it.
    pub least_total_ms: f64,
    /// Enough for the lists of all tiles at once.
    pub plenty_bytes: usize,
    /// A whole frame with it.
    pub plenty_total_ms: f64,
    /// Time with the least over time with plenty: median of frames in turn.
    pub least_over_plenty: f64,
}

/// One thread's time over that of all, time that passes: medians of frames in turn, and the least time
/// over the least, which is what a machine that others leave alone would show.
#[derive(Debug, Serialize)]
pub struct SpeedUp {
    /// A whole frame by one thread.
    pub one_thread_total_ms: f64,
    /// Of making lists and drawing pixels.
    pub bands: f64,
    /// Of the whole frame.
    pub frame: f64,
    /// Of lists and pixels, by the least times.
    pub bands_of_least: f64,
    /// Of the whole frame, by the least times.
    pub frame_of_least: f64,
}

impl Measured {
    /// What follows from it, with what the blend loop can do in a second.
    pub fn row(&self, roof: f64) -> Row {
        let frames: Vec<Milliseconds> = self.rounds.iter().map(|round| round.ms).collect();
        let (ms, work) = (medians(&frames), self.work);
        let per_s = |count: u64| (ms.raster > 0.0).then(|| count as f64 / (ms.raster * 1e-3));
        let evaluations_per_s = per_s(work.counts.evaluations);
        let roof = roof * self.threads as f64;
        let front_end = ms.pose + ms.project + ms.sort;
        let selected = work.gaussians_selected;
        Row {
            kernel: self.kernel.name(),
            width: self.camera.width,
            height: self.camera.height,
            budget: self.budget,
            threads: self.threads,
            clock: self.clock,
            gaussians_selected: selected,
            gaussians_visible: work.gaussians_visible,
            pairs: work.counts.pairs,
            evaluations: work.counts.evaluations,
            blends: work.counts.blends,
            useful_lanes: work.counts.blends as f64 / work.counts.evaluations.max(1) as f64,
            scratch_bytes: self.scratch_bytes,
            ms,
            ms_least: leasts(&frames),
            front_end_ns_per_gaussian: (selected > 0)
                .then(|| front_end * 1e6 / f64::from(selected)),
            blends_per_s: per_s(work.counts.blends),
            evaluations_per_s,
            roofline_fraction: evaluations_per_s.filter(|_| roof > 0.0).map(|rate| rate / roof),
            error: self.error,
            own_decisions: self.own_decisions,
            rms_error_to_all_gaussians_8bit: self.rms_to_all,
            scratch: self.scratch(),
            speed_up: (self.threads > 1).then(|| self.speed_up()),
        }
    }

    fn scratch(&self) -> Option<Scratch> {
        let [least, plenty] = self.scratches.as_ref()?;
        let bytes = |band: &[u32]| self.fixed_bytes + 4 * band.len();
        let with =
            |round: &Round, drawn: f64| round.ms.pose + round.ms.select + round.ms.project + drawn;
        let with_least = |round: &Round| with(round, round.drawn_with_least);
        let with_plenty = |round: &Round| with(round, round.drawn_with_plenty);
        Some(Scratch {
            least_bytes: bytes(least),
            least_total_ms: self.median(with_least),
            plenty_bytes: bytes(plenty),
            plenty_total_ms: self.median(with_plenty),
            least_over_plenty: self.median(|round| with_least(round) / with_plenty(round)),
        })
    }

    fn speed_up(&self) -> SpeedUp {
        let bands = |ms: &Milliseconds| ms.sort + ms.raster;
        let total = |ms: &Milliseconds| ms.total;
        let least_one = |of: &dyn Fn(&Milliseconds) -> f64| {
            least(self.rounds.iter().map(|round| of(&round.one_thread)))
        };
        let least_all = |of: &dyn Fn(&Milliseconds) -> f64| {
            least(self.rounds.iter().map(|round| of(&round.ms)))
        };
        SpeedUp {
            one_thread_total_ms: self.median(|round| round.one_thread.total),
            bands: self.median(|round| bands(&round.one_thread) / bands(&round.ms)),
            frame: self.median(|round| round.one_thread.total / round.ms.total),
            bands_of_least: least_one(&bands) / least_all(&bands),
            frame_of_least: least_one(&total) / least_all(&total),
        }
    }

    fn median(&self, of: impl Fn(&Round) -> f64) -> f64 {
        median(self.rounds.iter().map(of))
    }
}
