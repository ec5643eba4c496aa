//! One frame, stage by stage with a clock beside it.
//!
//! What `Prepared::draw` does first, the lists of its tiles, cannot be told apart from outside. So each
//! frame is prepared once more, which leaves the caches as they were before it was drawn, and its lists
//! are made alone: their time is taken off the drawing.

use anyhow::Result;
use dermis_runtime::raster::Counts;
use dermis_runtime::{Avatar, Camera, Error, Kernel, Plan, Pose, Posed, Prepared};

use super::clock::{Clock, least, median};
use super::team::{Canvas, Team};
use crate::camera_file::Shot;
use crate::draw::Milliseconds;

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// From its bytes.
    pub avatar: &'a Avatar<'a>,
    /// In which pose.
    pub pose: &'a Pose<'a>,
    /// By whom it is seen, and before what.
    pub shot: Shot,
    /// At most so many Gaussians.
    pub budget: u32,
}

/// Memory for the frames of one scene.
#[derive(Debug)]
pub struct Memory {
    posing: Vec<u32>,
    preparing: Vec<u32>,
    /// One for each band, as long as the runtime asks for.
    bands: Vec<Vec<u32>>,
    /// The picture, RGBA8.
    pub rgba: Vec<u8>,
}

/// What a frame took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Gaussians of the plan.
    pub gaussians_selected: u32,
    /// Those whose bounds hold a pixel of the frame.
    pub gaussians_visible: u32,
    /// Of the pixels.
    pub counts: Counts,
}

impl Memory {
    /// Enough for `scene`, drawn in so many bands.
    pub fn new(scene: &Scene<'_>, bands: usize) -> Self {
        let Camera { width, height, .. } = scene.shot.camera;
        let budget = scene.plan().gaussians();
        let band = vec![0; Prepared::band_scratch_len(budget, width, height)];
        Self {
            posing: vec![0; Posed::scratch_len(scene.avatar)],
            preparing: vec![0; Prepared::scratch_len(scene.avatar, budget, width, height)],
            bands: vec![band; bands],
            rgba: vec![0; width as usize * height as usize * 4],
        }
    }

    /// Bytes of scratch that are lent to draw in so many bands.
    pub fn scratch_bytes(&self, bands: usize) -> usize {
        let bands = self.bands.iter().take(bands).map(Vec::len).sum::<usize>();
        4 * (self.posing.len() + self.preparing.len() + bands)
    }
}

impl Scene<'_> {
    /// The Gaussians of the frame.
    pub fn plan(&self) -> Plan {
        Plan::with_budget(self.avatar, self.budget)
    }

    /// Draws a frame with a clock beside each stage.
    ///
    /// # Errors
    ///
    /// Where the runtime refuses.
    pub fn timed(
        &self,
        kernel: Kernel,
        team: &Team,
        clock: Clock,
        memory: &mut Memory,
    ) -> Result<(Milliseconds, Work)> {
        let Shot { camera, background } = self.shot;
        let Memory { posing, preparing, bands, rgba } = memory;
        let mut canvas = Canvas { rgba, width: camera.width, background };
        let (posed, pose) = clock.time(|| Posed::new(self.avatar, self.pose, kernel, posing))?;
        let (plan, select) = clock.time(|| Ok::<_, Error>(self.plan()))?;
        let (prepared, project) = clock.time(|| team.prepare(&posed, &plan, &camera, preparing))?;
        let (counts, drawn) = clock.time(|| team.draw(&prepared, bands, &mut canvas))?;
        let prepared = team.prepare(&posed, &plan, &camera, preparing)?;
        let ((), sort) = clock.time(|| team.lists(&prepared, bands))?;
        let raster = (drawn - sort).max(0.0);
        let total = pose + select + project + drawn;
        let work = Work {
            gaussians_selected: prepared.gaussians_selected(),
            gaussians_visible: prepared.splats().len() as u32,
            counts,
        };
        Ok((Milliseconds { pose, select, project, sort, raster, total }, work))
    }

    /// The time to draw a frame, lists and pixels, with the scratch of one band given: ms.
    ///
    /// # Errors
    ///
    /// Where it is too short.
    pub fn timed_with(
        &self,
        kernel: Kernel,
        clock: Clock,
        memory: &mut Memory,
        scratch: &mut Vec<u32>,
    ) -> Result<f64> {
        let Shot { camera, background } = self.shot;
        let Memory { posing, preparing, rgba, .. } = memory;
        let mut canvas = Canvas { rgba, width: camera.width, background };
        let posed = Posed::new(self.avatar, self.pose, kernel, posing)?;
        let prepared = Prepared::new(&posed, &self.plan(), &camera, preparing)?;
        let scratch = std::slice::from_mut(scratch);
        Ok(clock.time(|| Team::ONE.draw(&prepared, scratch, &mut canvas))?.1)
    }

    /// Words of scratch that one band of this frame takes at least.
    ///
    /// # Errors
    ///
    /// Where the runtime refuses the frame for another reason.
    pub fn least_band_scratch(&self, kernel: Kernel, memory: &mut Memory) -> Result<usize> {
        let posed = Posed::new(self.avatar, self.pose, kernel, &mut memory.posing)?;
        let camera = self.shot.camera;
        let prepared = Prepared::new(&posed, &self.plan(), &camera, &mut memory.preparing)?;
        match prepared.for_each_tile(0..prepared.tile_rows(), &mut [], |_, _, _| ()) {
            Ok(_) => Ok(0),
            Err(Error::Scratch { needed, .. }) => Ok(needed),
            Err(error) => Err(error.into()),
        }
    }
}

/// Medians of each stage.
pub fn medians(frames: &[Milliseconds]) -> Milliseconds {
    of_each(frames, median)
}

/// The least of each stage.
pub fn leasts(frames: &[Milliseconds]) -> Milliseconds {
    of_each(frames, least)
}

fn of_each(frames: &[Milliseconds], choose: impl Fn(Vec<f64>) -> f64) -> Milliseconds {
    let of = |stage: fn(&Milliseconds) -> f64| choose(frames.iter().map(stage).collect());
    Milliseconds {
        pose: of(|ms| ms.pose),
        select: of(|ms| ms.select),
        project: of(|ms| ms.project),
        sort: of(|ms| ms.sort),
        raster: of(|ms| ms.raster),
        total: of(|ms| ms.total),
    }
}
