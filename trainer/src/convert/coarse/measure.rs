//! How far a file's prefixes are from renders of all Gaussians, from where no training picture was taken.

use anyhow::Result;
use dermis_format::{Avatar, LowPass};
use dermis_runtime::{Camera, Plan};
use rayon::prelude::*;
use serde::Serialize;

use super::views::Poses;
use crate::draw::{draw, rgb_of};
use crate::metrics::psnr::psnr_db;
use crate::optimize::fulls::Fulls;

/// Views at each count.
const VIEWS: usize = 12;

/// A count and how good it is.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Measured {
    /// The first so many of the file.
    pub gaussians: u32,
    /// To renders of all Gaussians that came, over the pixels that either covers, mean over views.
    pub psnr_foreground_db: f64,
}

/// Each level of the file, and a count between it and the next one.
pub(super) fn measure(
    avatar: &Avatar<'_>,
    all: &Fulls,
    poses: &Poses,
    low_pass: LowPass,
    shots: &[(usize, Camera)],
) -> Result<Vec<Measured>> {
    let background = [1.0; 3];
    let step = shots.len().div_ceil(VIEWS).max(1);
    let shots: Vec<_> = shots.iter().step_by(step).collect();
    let truths: Vec<Vec<u8>> = shots
        .iter()
        .map(|(pose, camera)| {
            all.draw(&poses.stages[*pose], camera, low_pass, background).picture.to_bytes()
        })
        .collect();
    let mut counts = Vec::new();
    let mut count = 0;
    for layer in 0..usize::from(avatar.header().layers) {
        count += avatar.layer_len(0, layer);
        counts.push(count);
    }
    let measured = counts.into_iter().map(|count| {
        let plan = Plan::with_budget(avatar, count);
        let of_view = |((pose, camera), truth): (&&(usize, Camera), &Vec<u8>)| {
            let drawn = draw(avatar, &poses.poses[*pose], &plan, camera, background)?;
            let drawn = rgb_of(&drawn.rgba);
            let pixels = truth.chunks_exact(3).zip(drawn.chunks_exact(3));
            let touched: Vec<bool> = pixels.map(|(a, b)| a != [255; 3] || b != [255; 3]).collect();
            Ok(psnr_db(truth, &drawn, Some(&touched)))
        };
        let all = shots.par_iter().zip(&truths).map(of_view).collect::<Result<Vec<_>>>()?;
        let all: Vec<f64> = all.into_iter().flatten().collect();
        let psnr_foreground_db = all.iter().sum::<f64>() / all.len().max(1) as f64;
        Ok(Measured { gaussians: count, psnr_foreground_db })
    });
    measured.collect()
}
