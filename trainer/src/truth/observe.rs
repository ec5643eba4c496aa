//! What all cameras see of all key frames.

use anyhow::Result;

use super::{Crop, Store, TrainingView};
use crate::options::Options;
use crate::progress;
use crate::scene::{self, KeyFrame, Painter, RigScale, SideCount};

/// Sub-samples along each side of a pixel.
const SAMPLES: u32 = 4;

/// Renders the truth of all views, and counts what sides of the triangles they see.
pub fn observe(
    painter: &Painter<'_>,
    key_frames: &[KeyFrame],
    options: &Options,
) -> Result<(Vec<TrainingView>, Vec<SideCount>)> {
    let store = Store::new(options.memory_bytes, &std::env::temp_dir());
    let model = painter.model();
    let rig = RigScale::of(model);
    let directions = &scene::training_directions()[..options.views.clamp(1, 42) as usize];
    let mut views = Vec::new();
    let mut seen = vec![SideCount::default(); model.triangles.len()];
    let bar = progress::bar("ground truth", (key_frames.len() * directions.len()) as u64);
    for (stage, key_frame) in key_frames.iter().enumerate() {
        let posed = scene::posed_vertices(model, &key_frame.pose(model));
        let cameras = rig.cameras(directions, &posed, options.size, options.size);
        let shots: Vec<_> =
            cameras.iter().map(|&camera| scene::View { posed: &posed, camera }).collect();
        let made = scene::render_views(painter, &shots, options.background, SAMPLES, |_, truth| {
            bar.inc(1);
            let kept = store.keep(Crop::of(&truth, options.background));
            kept.map(|kept| (kept, truth.seen))
        });
        for (camera, made) in cameras.into_iter().zip(made) {
            let (truth, counts) = made?;
            seen.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
            views.push(TrainingView { stage, camera, truth });
        }
    }
    bar.finish_and_clear();
    Ok((views, seen))
}
