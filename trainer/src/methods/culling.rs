//! What culling backs costs a trained cloud, and what it saves.

use anyhow::Result;
use serde::{Deserialize, Serialize};

use crate::metrics::psnr::psnr_db;
use crate::optimize::cloud::{Cloud, Prefix};
use crate::optimize::descend::Problem;
use crate::optimize::forward::{Stage, draw};
use crate::optimize::price;
use crate::picture::Picture;
use crate::truth::Scratch;

/// Pictures that are looked at, at most.
const MOST_VIEWS: usize = 84;

/// A cloud's pictures with backs culled by the two-sided bits, as they are drawn, and with nothing culled.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Culling {
    /// Backs culled.
    pub culled: Drawn,
    /// Nothing culled.
    pub all: Drawn,
    /// Training pictures that were looked at.
    pub pictures: usize,
}

/// Means over training pictures.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Drawn {
    /// Over the pixels that the mesh covers, before rounding to the file's codes.
    pub psnr_foreground_db: f64,
    /// Gaussians blended for each pixel that the mesh covers, as their footprints predict.
    pub blends_per_pixel: f64,
}

/// Measures both on some of the views, evenly chosen.
pub(super) fn measure(clouds: &[Cloud], problem: &Problem<'_>) -> Result<Culling> {
    let prefixes = Prefix::whole(clouds);
    let everything: Vec<Stage> = (problem.stages.iter())
        .map(|stage| Stage {
            frames: stage.frames.clone(),
            two_sided: vec![true; stage.two_sided.len()].into(),
        })
        .collect();
    let mut reading = Scratch::default();
    let [mut white, mut black] = [Picture::default(), Picture::default()];
    let mut sums = [Drawn::default(); 2];
    let mut pictures = 0u32;
    for view in problem.some_views(MOST_VIEWS) {
        view.truth.draw([1.0; 3], 0, &mut reading, &mut white)?;
        view.truth.draw([0.0; 3], 0, &mut reading, &mut black)?;
        let mask = covered(&white, &black);
        let pixels = mask.iter().filter(|covered| **covered).count();
        if pixels == 0 {
            continue;
        }
        pictures += 1;
        for (sum, stages) in sums.iter_mut().zip([problem.stages, &everything]) {
            let stage = &stages[view.stage];
            let forward = draw(clouds, &prefixes, stage, &view.camera, problem.low_pass, [1.0; 3]);
            let (drawn, exact) = (forward.picture.to_bytes(), white.to_bytes());
            sum.psnr_foreground_db += psnr_db(&exact, &drawn, Some(&mask)).unwrap_or(0.0);
            let blends: f64 = forward.splats.iter().map(|s| f64::from(price::blends(s))).sum();
            sum.blends_per_pixel += blends / pixels as f64;
        }
    }
    let mean = |sum: Drawn| Drawn {
        psnr_foreground_db: sum.psnr_foreground_db / f64::from(pictures.max(1)),
        blends_per_pixel: sum.blends_per_pixel / f64::from(pictures.max(1)),
    };
    let [culled, all] = sums.map(mean);
    Ok(Culling { culled, all, pictures: pictures as usize })
}

/// Pixels in which a change of background is not all there is.
fn covered(white: &Picture, black: &Picture) -> Vec<bool> {
    white.rgb.iter().zip(&black.rgb).map(|(w, b)| w[0] - b[0] < 1.0 - 0.5 / 255.0).collect()
}
