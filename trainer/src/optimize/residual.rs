//! Where a cloud still differs from the truth.

use anyhow::Result;

use super::backward::by_splats;
use super::cloud::{Cloud, Prefix};
use super::descend::Problem;
use super::forward::{Forward, draw};
use crate::picture::Picture;
use crate::truth::Scratch;

/// Squared differences of all views' pixels, each shared out to the triangles whose Gaussians show in the
/// pixel, by their weight there. One number for each of `triangles` triangles.
pub fn by_triangles(clouds: &[Cloud], problem: &Problem<'_>, triangles: usize) -> Result<Vec<f64>> {
    let mut sums = vec![0.0; triangles];
    let prefixes = Prefix::whole(clouds);
    let (mut reading, mut truth) = (Scratch::default(), Picture::default());
    let mut squares = Vec::new();
    for view in problem.views {
        let stage = &problem.stages[view.stage];
        let background = problem.background;
        let forward = draw(clouds, &prefixes, stage, &view.camera, problem.low_pass, background);
        view.truth.draw(background, 0, &mut reading, &mut truth)?;
        let shares = by_drawn(&forward, &truth, &mut squares);
        for (cloud, drawn) in clouds.iter().zip(&forward.regions) {
            let sources = &forward.sources[drawn.clone()];
            for (&source, share) in sources.iter().zip(&shares[drawn.clone()]) {
                sums[cloud.triangles[source as usize] as usize] += f64::from(*share);
            }
        }
    }
    Ok(sums)
}

/// Squared differences of a picture's pixels, each shared out to its splats by their weight there.
pub fn by_drawn(forward: &Forward, truth: &Picture, squares: &mut Vec<[f32; 3]>) -> Vec<f32> {
    squares.clear();
    squares.extend(forward.picture.rgb.iter().zip(&truth.rgb).map(|(a, b)| {
        let square: f32 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
        [square, 0.0, 0.0]
    }));
    // The way back weighs a gradient by pixels just so when it takes it to a splat's red.
    by_splats(forward, squares).into_iter().map(|share| share.color[0]).collect()
}
