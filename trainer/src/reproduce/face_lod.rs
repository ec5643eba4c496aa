//! Table 1 of "Levels of Detail Technique for Virtual Human Face Models": what levels of a face take to animate and to draw.
//!
//! A level here is a distance: the plan of an avatar alone, of all Gaussians that are worth drawing there, in which what moves less than
//! a quarter of a pixel stays as it rests. Each is twice as far as the one before, until nothing moves any more and animation costs nothing.

use anyhow::{Context, Result, ensure};
use dermis_runtime::budget::Budget;
use dermis_runtime::rate::frames_to_hold;
use dermis_runtime::{Avatar, Camera, Kernel, Plan, Pose, Posed, Prepared};
use serde::Serialize;

use super::made;
use crate::bench::clock::{Clock, least};
use crate::bench::team::{Canvas, Team};
use crate::draw::{planned, rgb_of};
use crate::metrics::psnr::{PSNR_CAP_DB, psnr_db};
use crate::model::Model;
use crate::options::Options;
use crate::orbit::Orbit;
use crate::progress;

/// What moves less than so many pixels stays as it rests.
pub const UNSEEN: f32 = 0.25;
/// Levels at most: the last one is 16,000 times as far as the first.
const MOST_LEVELS: usize = 15;
/// Expressions, as in the paper.
const CLIPS: usize = 2;
/// Frames of a clip that are looked at, each second.
const FRAMES_PER_SECOND: f32 = 10.0;
/// Time from frame to frame of a display, s.
pub const FRAME_SECONDS: f32 = 1.0 / 30.0;
/// Each frame is posed as many times; the least time counts.
const REPEATS: usize = 5;

/// An avatar seen from one distance.
#[derive(Clone, Debug, Serialize)]
pub struct Level {
    /// From its middle, metres.
    pub distance_m: f32,
    /// Its height in the picture, px.
    pub height_px: f32,
    /// Of the plan.
    pub gaussians: u32,
    /// Triangles that are posed, of all meshes.
    pub triangles: usize,
    /// Vertices that are skinned.
    pub vertices: usize,
    /// Joints that move.
    pub joints: usize,
    /// Morph targets that move at weight 1.
    pub targets: usize,
    /// Mean time to draw a frame, posing left out, ms of one thread.
    pub render_ms: f64,
    /// Greatest time to pose a frame of each clip, ms of one thread; 0 where nothing moves.
    pub animation_ms: Vec<f64>,
    /// PSNR of the worst frame to the same where everything moves, over the pixels of that, dB; 100 where they are the same.
    pub least_psnr_db: f64,
    /// Frames, of [`FRAME_SECONDS`], that a pose of each clip may be held ([`frames_to_hold`]).
    pub frames_held: Vec<u32>,
    /// As `least_psnr_db`, but of poses that are as late as holding makes them.
    pub least_held_psnr_db: f64,
}

/// All levels.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// Names of the clips.
    pub clips: Vec<String>,
    /// Of the mesh.
    pub triangles: u32,
    /// Of the mesh.
    pub vertices: u32,
    /// Width and height of a picture, px.
    pub size: u32,
    /// Training by [`CLOCK`](super::CLOCK).
    pub seconds: f64,
    /// Posing all of it, greatest time of each clip, ms of one thread.
    pub whole_animation_ms: Vec<f64>,
    /// From near to far.
    pub levels: Vec<Level>,
}

/// Trains an avatar and measures it.
///
/// # Errors
///
/// Where the mesh cannot be trained, or has no clip.
pub fn table(model: &Model, options: &Options) -> Result<Table> {
    ensure!(!model.clips.is_empty(), "it has no clip; give a mesh that has one or two");
    let file = made(model, options)?;
    let avatar = Avatar::parse(&file.bytes)?;
    let header = avatar.header();
    let clips: Vec<usize> = (0..model.clips.len().min(CLIPS)).collect();
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let rest = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut scratch)?;
    let near = Orbit { yaw: 0.0, pitch: 0.0, distance: None };
    let near = near.camera(&avatar, &Pose::Rest, options.size, options.size)?;
    let first = distance(&avatar, &near);
    let bench = Bench { avatar: &avatar, rest: &rest, clips: &clips, size: options.size };
    let bar = progress::bar("levels", MOST_LEVELS as u64);
    let mut levels = Vec::new();
    for level in 0..MOST_LEVELS {
        let measured = bench.level(first * (1 << level) as f32)?;
        let is_last = measured.joints + measured.targets == 0;
        levels.push(measured);
        bar.inc(1);
        if is_last {
            break;
        }
    }
    bar.finish_and_clear();
    let all = Plan::with_budget(&avatar, u32::MAX);
    let whole = clips.iter().map(|&clip| bench.animation_ms(&all, clip)).collect::<Result<_>>()?;
    Ok(Table {
        clips: clips.iter().map(|&clip| model.clips[clip].name.clone()).collect(),
        triangles: avatar.mesh_levels().surface(),
        vertices: header.vertices,
        size: options.size,
        seconds: file.seconds,
        whole_animation_ms: whole,
        levels,
    })
}

/// From a camera to the middle of the box at rest.
fn distance(avatar: &Avatar<'_>, camera: &Camera) -> f32 {
    let (min, max) = (avatar.header().box_min, avatar.header().box_max);
    let eye = camera.position::<f32>();
    let squares = (0..3).map(|i| (0.5 * (min[i] + max[i]) - eye[i]).powi(2));
    squares.sum::<f32>().sqrt()
}

/// What frames of all clips come to.
struct Pictures {
    /// Mean.
    render_ms: f64,
    least_psnr_db: f64,
    least_held_psnr_db: f64,
}

/// An avatar that is looked at.
struct Bench<'b, 'a> {
    avatar: &'b Avatar<'a>,
    rest: &'b Posed<'b, 'a>,
    clips: &'b [usize],
    size: u32,
}

impl Bench<'_, '_> {
    fn level(&self, distance_m: f32) -> Result<Level> {
        let Self { avatar, rest, clips, size } = *self;
        let orbit = Orbit { yaw: 0.0, pitch: 0.0, distance: Some(distance_m) };
        let camera = orbit.camera(avatar, &Pose::Rest, size, size)?;
        let budget = Budget { movement: UNSEEN, ..Budget::of_gaussians(u32::MAX) };
        let (plan, _) = planned(rest, &camera, &budget)?;
        let (min, max) = (avatar.header().box_min, avatar.header().box_max);
        let mut scratch = vec![0; Posed::scratch_len_for_plan(avatar)];
        let posed = Posed::for_plan(avatar, &Pose::Rest, &plan, rest.kernel(), &mut scratch)?;
        let triangles = (0..avatar.header().triangles).filter(|&t| posed.frame(t).is_some());
        let moving = |of: &dyn Fn(usize) -> Option<f32>| {
            (0..).map_while(of).filter(|&metres| metres >= plan.still_below()).count()
        };
        let movements = avatar.movements().context("the file does not say what moves")?;
        let animation = clips.iter().map(|&clip| self.animation_ms(&plan, clip));
        let footprints = rest.footprints(&camera);
        let density = footprints.iter().map(|footprint| footprint.density).fold(0.0, f32::max);
        let held = |&clip: &usize| frames_to_hold(avatar, clip, density, FRAME_SECONDS, UNSEEN);
        let frames_held: Vec<u32> = clips.iter().map(held).collect();
        let Pictures { render_ms, least_psnr_db, least_held_psnr_db } =
            self.pictures(&plan, &camera, &frames_held)?;
        Ok(Level {
            distance_m,
            height_px: camera.fy.abs() * (max[1] - min[1]) / distance_m,
            gaussians: plan.gaussians(),
            triangles: triangles.count(),
            vertices: posed.vertices().iter().filter(|vertex| vertex[0].is_finite()).count(),
            joints: moving(&|joint| movements.of_joint(joint)),
            targets: moving(&|target| movements.of_target(target)),
            render_ms,
            animation_ms: animation.collect::<Result<_>>()?,
            least_psnr_db,
            frames_held,
            least_held_psnr_db,
        })
    }

    /// Seconds into a clip.
    fn moments(&self, clip: usize) -> impl Iterator<Item = f32> {
        let length = self.avatar.clips().nth(clip).map_or(0.0, |clip| clip.seconds);
        let frames = (length * FRAMES_PER_SECOND) as usize;
        (0..=frames).map(|frame| frame as f32 / FRAMES_PER_SECOND)
    }

    /// Of the frame that takes longest. Where nothing moves the rest pose, made once, is everyone's.
    fn animation_ms(&self, plan: &Plan, clip: usize) -> Result<f64> {
        if plan.is_still(self.avatar) {
            return Ok(0.0);
        }
        let mut scratch = vec![0; Posed::scratch_len_for_plan(self.avatar)];
        let mut greatest = 0.0f64;
        for seconds in self.moments(clip) {
            let pose = Pose::Clip { clip, seconds };
            let mut times = Vec::new();
            for _ in 0..REPEATS {
                let kernel = self.rest.kernel();
                let posing = || -> Result<()> {
                    Posed::for_plan(self.avatar, &pose, plan, kernel, &mut scratch)?;
                    Ok(())
                };
                times.push(Clock::ONE_THREAD.time(posing)?.1);
            }
            greatest = greatest.max(least(times));
        }
        Ok(greatest)
    }

    /// Frames of all clips, beside the same where everything moves.
    fn pictures(&self, plan: &Plan, camera: &Camera, frames_held: &[u32]) -> Result<Pictures> {
        let whole = plan.clone().with_still_below(0.0);
        let (mut times, mut worst) = (Vec::new(), [PSNR_CAP_DB; 2]);
        for (&clip, &held) in self.clips.iter().zip(frames_held) {
            let late = FRAME_SECONDS * (held - 1) as f32;
            for now in self.moments(clip) {
                let pose = |seconds: f32| Pose::Clip { clip, seconds: seconds.max(0.0) };
                let (moving, _) = self.picture(&pose(now), &whole, camera)?;
                let (still, ms) = self.picture(&pose(now), plan, camera)?;
                let (held, _) = self.picture(&pose(now - late), plan, camera)?;
                times.push(ms);
                let covered: Vec<bool> =
                    moving.chunks_exact(3).map(|rgb| rgb != [255; 3]).collect();
                for (worst, picture) in worst.iter_mut().zip([still, held]) {
                    let psnr = psnr_db(&moving, &picture, Some(&covered));
                    *worst = worst.min(psnr.unwrap_or(PSNR_CAP_DB));
                }
            }
        }
        let render_ms = times.iter().sum::<f64>() / times.len().max(1) as f64;
        let [least_psnr_db, least_held_psnr_db] = worst;
        Ok(Pictures { render_ms, least_psnr_db, least_held_psnr_db })
    }

    /// RGB over white, and the time to draw it.
    fn picture(&self, pose: &Pose<'_>, plan: &Plan, camera: &Camera) -> Result<(Vec<u8>, f64)> {
        let (width, height, budget) = (camera.width, camera.height, plan.gaussians());
        let mut posing = vec![0; Posed::scratch_len_for_plan(self.avatar)];
        let posed = Posed::for_plan(self.avatar, pose, plan, self.rest.kernel(), &mut posing)?;
        let mut preparing = vec![0; Prepared::scratch_len(self.avatar, budget, width, height)];
        let mut band = [vec![0; Prepared::band_scratch_len(budget, width, height)]];
        let mut rgba = vec![0; width as usize * height as usize * 4];
        let mut canvas = Canvas { rgba: &mut rgba, width, background: [1.0; 3] };
        let ((), ms) = Clock::ONE_THREAD.time(|| {
            let prepared = Prepared::new(&posed, plan, camera, &mut preparing)?;
            Team::ONE.draw(&prepared, &mut band, &mut canvas).map(|_| ())
        })?;
        Ok((rgb_of(&rgba), ms))
    }
}
