//! What coarse levels are to look like: renders of all Gaussians, in some poses, from all around.

use anyhow::{Context, Result};
use dermis_format::source::Source;
use dermis_format::{Avatar, LowPass};
use dermis_runtime::frame::Frame;
use dermis_runtime::{Camera, Pose};
use glam::Vec3;
use rayon::prelude::*;

use super::super::Assembly;
use crate::optimize::forward::Stage;
use crate::optimize::fulls::Fulls;
use crate::package;
use crate::progress;
use crate::scene::{RigScale, Truth, camera_towards};
use crate::train::runtime_pose;
use crate::truth::{Crop, Store, TrainingView};

/// Share of the Gaussians that may lie outside of the box that cameras look at, on each side.
const OUTSIDE: f64 = 0.005;

/// Poses in which each direction looks at what hangs on a mesh.
const POSES_EACH: usize = 2;

/// Poses, and a box around each.
pub(super) struct Poses {
    pub(super) poses: Vec<Pose<'static>>,
    pub(super) stages: Vec<Stage>,
    centers: Vec<Vec3>,
    rig: RigScale,
}

impl Poses {
    /// Rest first.
    pub(super) fn of(assembly: &Assembly, fulls: &Fulls) -> Result<Self> {
        let (poses, stages) = match &assembly.mount {
            None => {
                let frames = vec![Some(Frame::world())];
                (vec![Pose::Rest], vec![Stage { frames, two_sided: Box::new([true]) }])
            }
            Some(mount) => {
                let mut source = Source { ..mount.carrier.source.clone() };
                source.mathematics.frame = mount.frame;
                let bytes = package::encode(&source)?;
                let avatar = Avatar::parse(&bytes).context("the mesh alone cannot be read back")?;
                let moving = mount.carrier.key_frames.iter().filter(|frame| frame.clip.is_some());
                let poses: Vec<Pose<'static>> =
                    std::iter::once(Pose::Rest).chain(moving.map(runtime_pose)).collect();
                let stages = poses.par_iter().map(|pose| Stage::of(&avatar, pose));
                let stages = stages.collect::<Result<Vec<_>>>()?;
                (poses, stages)
            }
        };
        let boxes: Vec<[Vec3; 2]> = stages.iter().map(|stage| middle(fulls, stage)).collect();
        let extent = boxes.first().map_or(0.0, |[low, high]| (high - low).max_element());
        let centers = boxes.iter().map(|[low, high]| 0.5 * (low + high)).collect();
        Ok(Self { poses, stages, centers, rig: RigScale::of_extent(extent.max(1e-4)) })
    }

    /// The least that a pixel of a picture as high as this shows of what stands in the middle, metres.
    pub(super) fn pixel(&self, size: u32) -> f32 {
        2.0 * self.rig.distance * (0.5 * self.rig.vertical_fov).tan() / size as f32
    }

    /// A camera in each direction, and the index of the pose that it sees; in each of a few poses.
    pub(super) fn shots(&self, directions: &[Vec3], size: u32) -> Vec<(usize, Camera)> {
        let n = self.poses.len();
        let each = POSES_EACH.min(n);
        let shots = directions.iter().enumerate().flat_map(|(i, &direction)| {
            (0..each).map(move |j| ((i + j * n.div_ceil(each)) % n, direction))
        });
        let RigScale { distance, vertical_fov } = self.rig;
        let camera = |(pose, direction): (usize, Vec3)| {
            let center = self.centers[pose];
            (pose, camera_towards(center, direction, distance, vertical_fov, size, size))
        };
        shots.map(camera).collect()
    }

    /// Renders of all Gaussians.
    pub(super) fn observe(
        &self,
        all: &Fulls,
        low_pass: LowPass,
        shots: &[(usize, Camera)],
        memory_bytes: u64,
    ) -> Result<Vec<TrainingView>> {
        let store = Store::new(memory_bytes, &std::env::temp_dir());
        let bar = progress::bar("ground truth", shots.len() as u64);
        let view = |&(stage, camera): &(usize, Camera)| {
            let over = |background| all.draw(&self.stages[stage], &camera, low_pass, background);
            let [white, black] = [[1.0; 3], [0.0; 3]].map(|background| over(background).picture);
            let pixels = white.rgb.iter().zip(&black.rgb);
            let coverage = pixels
                .map(|(white, black)| (1.0 - (white[1] - black[1])).clamp(0.0, 1.0))
                .collect();
            let truth = Truth { picture: white, coverage, seen: Vec::new() };
            bar.inc(1);
            Ok(TrainingView { stage, camera, truth: store.keep(Crop::of(&truth, [1.0; 3]))? })
        };
        let views = shots.iter().map(view).collect();
        bar.finish_and_clear();
        views
    }
}

/// The box of most Gaussians' centres.
fn middle(fulls: &Fulls, stage: &Stage) -> [Vec3; 2] {
    let center = |(full, &triangle): (&dermis_format::Full, &u32)| {
        Some(stage.frames[triangle as usize].as_ref()?.point(full.position))
    };
    let centers: Vec<[f32; 3]> =
        fulls.gaussians.iter().zip(&fulls.triangles).filter_map(center).collect();
    let mut corners = [[0.0; 3]; 2];
    for axis in 0..3 {
        let mut along: Vec<f32> = centers.iter().map(|center| center[axis]).collect();
        along.sort_unstable_by(f32::total_cmp);
        let Some(last) = along.len().checked_sub(1) else { continue };
        let outside = (OUTSIDE * along.len() as f64) as usize;
        corners[0][axis] = along[outside.min(last)];
        corners[1][axis] = along[last - outside.min(last)];
    }
    corners.map(Vec3::from)
}
