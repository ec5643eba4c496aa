//! How much each region matters, measured where face-lod (4.1.1) sets it by hand.
//!
//! Density follows the error of each triangle already ([`super::density`]), and with it what is seen of it: a weight
//! by either would count them twice. What no picture says is that the eye follows what moves, so the weight
//! that is measured is one by mobility; area and error are told beside it.

use dermis_format::source::Importance;
use glam::Vec3;
use rayon::prelude::*;

use super::regions::Regions;
use super::surface::Surface;
use crate::model::Model;
use crate::scene::{Pose, SideCount, posed_vertices};

/// Moments of each clip at which speeds are taken, ...
const MOMENTS: usize = 32;
/// ... each over this time, s.
const SHUTTER: f32 = 1.0 / 30.0;
/// The format's bound, m/s.
const FASTEST: f32 = 1e6;
/// Weights of what stands still, and of the liveliest.
const RANGE: [f32; 2] = [0.5, 4.0];

/// Importance of each region. `seen` counts sub-samples of each triangle in the training views, `residuals` are sums
/// of squared differences over it there, empty if nobody looked.
pub fn of_regions(
    regions: &Regions,
    mobilities: &[f32],
    seen: &[SideCount],
    residuals: &[f64],
) -> Vec<Importance> {
    let seen = seen.iter().map(|count| f64::from(count.front) + f64::from(count.back));
    let visible = regions.shares(seen);
    let residual = regions.shares(residuals.iter().copied());
    let mean: f32 = mobilities.iter().zip(&visible).map(|(m, share)| m * share).sum();
    let of_region = |region: usize| {
        let mobility = mobilities[region];
        Importance {
            weight: regions.weights[region].unwrap_or_else(|| weight(mobility, mean)),
            mobility,
            visible: visible[region],
            residual: residual[region],
        }
    };
    (0..regions.len()).map(of_region).collect()
}

/// Half for being there, half for how much a region moves beside the mean of what is seen.
fn weight(mobility: f32, mean: f32) -> f32 {
    let [still, liveliest] = RANGE;
    if mean > 0.0 { (0.5 + 0.5 * mobility / mean).clamp(still, liveliest) } else { 1.0 }
}

/// Mean speed of each region's surface in `clips`, m/s, relative to the mean velocity of the avatar's whole surface:
/// walking is no news, swinging arms are. Areas are those at rest; moments stand evenly in each clip, and clips
/// count alike. Costs 64 poses for each clip.
pub fn mobilities(
    model: &Model,
    surface: &Surface,
    clips: &[usize],
    regions: &Regions,
) -> Vec<f32> {
    let moving = clips.iter().filter(|&&clip| model.clips[clip].seconds > 0.0);
    let moments: Vec<(usize, f32)> = moving
        .flat_map(|&clip| (0..MOMENTS).map(move |moment| (clip, moment as f32 / MOMENTS as f32)))
        .collect();
    let speeds: Vec<Vec<f64>> = moments
        .par_iter()
        .map(|&(clip, at)| {
            let seconds = model.clips[clip].seconds;
            let span = SHUTTER.min(seconds);
            let start = at * (seconds - span);
            let shape = |seconds| posed_vertices(model, &Pose::of_clip(model, clip, seconds));
            speeds(model, surface, regions, [&shape(start), &shape(start + span)], span)
        })
        .collect();
    let mean = |region: usize| {
        // From +0: an empty sum is −0.
        let sum = speeds.iter().fold(0.0, |sum, speeds| sum + speeds[region]);
        ((sum / speeds.len().max(1) as f64) as f32).min(FASTEST)
    };
    (0..regions.len()).map(mean).collect()
}

/// Mean speed of each region between two shapes that are `span` seconds apart.
fn speeds(
    model: &Model,
    surface: &Surface,
    regions: &Regions,
    [before, after]: [&[Vec3]; 2],
    span: f32,
) -> Vec<f64> {
    let velocity = |corners: [u32; 3]| -> Vec3 {
        let moved = corners.map(|corner| after[corner as usize] - before[corner as usize]);
        moved.iter().sum::<Vec3>() / (3.0 * span)
    };
    let velocities: Vec<Vec3> = model.triangles.iter().map(|t| velocity(t.corners)).collect();
    let weighted = || (0..).zip(&velocities).map(|(t, velocity)| (surface.area(t), *velocity));
    let area: f32 = weighted().map(|(area, _)| area).sum();
    let mean = weighted().map(|(area, velocity)| area * velocity).sum::<Vec3>() / area;
    let mut sums = vec![[0.0f64; 2]; regions.len()];
    for ((area, velocity), &region) in weighted().zip(&regions.of_triangles) {
        let [speed, covered] = &mut sums[usize::from(region)];
        *speed += f64::from(area * velocity.distance(mean));
        *covered += f64::from(area);
    }
    sums.iter().map(|[speed, covered]| if *covered > 0.0 { speed / covered } else { 0.0 }).collect()
}
