//! Triangles that stand for a region where a plan asks what it covers, and how many blends that makes.
//!
//! Triangles that are near each other and look the same way, in several poses, are seen or not seen together: one of each
//! such cluster stands for all, by what they cover and blend in training pictures.

use dermis_format::curves::stops;
use dermis_format::{FrameKind, Sample};
use rayon::prelude::*;

use super::curves::{footprint_of_each, prefixes};
use crate::embed::regions::Regions;
use crate::optimize::cloud::Cloud;
use crate::optimize::descend::Problem;
use crate::optimize::forward::{Stage, draw};
use crate::optimize::price;

/// Samples of all regions together, about: 8 bytes of the file each.
const SAMPLES: usize = 256;
/// Of each region, where it has as many triangles.
const LEAST_SAMPLES: usize = 32;
/// Training pictures that are looked at, at most.
const MOST_VIEWS: usize = 24;
/// Poses by which triangles are near each other, at most.
const MOST_POSES: usize = 4;
/// Rounds in which clusters settle.
const ROUNDS: usize = 10;
/// Triangles that look to opposite sides are as far apart as two such shares of the avatar's extent.
const TURNED: f32 = 0.125;

/// Samples of clouds that are as the file will hold them, on frames of a kind.
pub(super) fn choose(
    clouds: &[Cloud],
    problem: &Problem<'_>,
    kind: FrameKind,
    regions: &Regions,
) -> Vec<Sample> {
    let seen = look(clouds, problem, kind, regions);
    let places = places(problem, kind);
    let all = Seen::sum(&seen);
    let mut samples = Vec::new();
    for region in 0..regions.len() {
        let is_own = |&triangle: &usize| usize::from(regions.of_triangles[triangle]) == region;
        let shows = |&triangle: &usize| seen[triangle].footprint > 0.0;
        let own: Vec<usize> = (0..seen.len()).filter(is_own).filter(shows).collect();
        let of_own = |members: &[usize]| Seen::sum(members.iter().map(|&triangle| &seen[triangle]));
        let region = of_own(&own);
        let wanted = (SAMPLES as f64 * region.footprint / all.footprint).round() as usize;
        for cluster in clusters(&places, &seen, &own, wanted.max(LEAST_SAMPLES)) {
            let Cluster { members, stands_for_all } = cluster;
            let (cluster, own) = (of_own(&members), seen[stands_for_all].footprint);
            let blends = cluster.blends / region.blends.max(1e-9) * region.footprint;
            let times = |footprint: f64| (footprint / own).min(1e5) as f32;
            samples.push(Sample {
                triangle: stands_for_all as u32,
                area: times(cluster.footprint),
                fill: times(blends),
            });
        }
    }
    samples.sort_by_key(|sample| sample.triangle);
    samples
}

/// What training pictures show of a triangle, or of several.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// Footprint, px².
    footprint: f64,
    /// Share of its region's blends, mean over levels.
    blends: f64,
}

impl Seen {
    fn sum<'s>(of: impl IntoIterator<Item = &'s Self>) -> Self {
        of.into_iter().fold(Self::default(), |sum, of| Self {
            footprint: sum.footprint + of.footprint,
            blends: sum.blends + of.blends,
        })
    }
}

/// What is seen of each triangle.
fn look(clouds: &[Cloud], problem: &Problem<'_>, kind: FrameKind, regions: &Regions) -> Vec<Seen> {
    let mut seen = vec![Seen::default(); regions.of_triangles.len()];
    let views = || problem.some_views(MOST_VIEWS);
    for view in views() {
        let stage = &problem.stages[view.stage];
        for (triangle, area, _) in footprint_of_each(view, stage, kind, regions.of_triangles.len())
        {
            seen[triangle].footprint += area;
        }
    }
    let layers = clouds.iter().map(|cloud| cloud.layers.len()).max().unwrap_or(0);
    // Counts of all layers up to each.
    for prefixes in (3..stops(layers)).step_by(2).map(|stop| prefixes(clouds, stop)) {
        let mut blends = vec![0.0; seen.len()];
        let mut of_regions = vec![0.0; clouds.len()];
        for view in views() {
            let (stage, low_pass) = (&problem.stages[view.stage], problem.low_pass);
            let forward =
                draw(clouds, &prefixes, stage, &view.camera, low_pass, problem.background);
            for ((cloud, drawn), all) in clouds.iter().zip(&forward.regions).zip(&mut of_regions) {
                let splats = &forward.splats[drawn.clone()];
                for (&source, splat) in forward.sources[drawn.clone()].iter().zip(splats) {
                    let predicted = f64::from(price::blends(splat));
                    *all += predicted;
                    // What stands on a coarser mesh blends about where the others do.
                    let triangle = cloud.triangles[source as usize] as usize;
                    if let Some(blends) = blends.get_mut(triangle) {
                        *blends += predicted;
                    }
                }
            }
        }
        for ((seen, blends), &region) in seen.iter_mut().zip(blends).zip(&regions.of_triangles) {
            seen.blends += blends / of_regions[usize::from(region)].max(1e-9);
        }
    }
    seen
}

/// Where something is in several poses, and where it looks.
type Place = Vec<f32>;

/// Of each triangle.
fn places(problem: &Problem<'_>, kind: FrameKind) -> Vec<Place> {
    let step = problem.stages.len().div_ceil(MOST_POSES).max(1);
    let poses: Vec<(&Stage, f32)> = problem.stages.iter().step_by(step).map(with_extent).collect();
    let triangles = problem.stages.first().map_or(0, |stage| stage.frames.len());
    let place = |triangle: usize| {
        let in_pose = |&(stage, extent): &(&Stage, f32)| {
            let Some(frame) = &stage.frames[triangle] else { return [0.0; 6] };
            let normal = frame.normal(kind);
            let length = normal.iter().map(|x| x * x).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
            let [u, v, w] = normal.map(|x| TURNED * extent * x / length);
            let [x, y, z] = frame.origin;
            [x, y, z, u, v, w]
        };
        poses.iter().flat_map(in_pose).collect()
    };
    (0..triangles).into_par_iter().map(place).collect()
}

/// A pose and its greatest extent, metres.
fn with_extent(stage: &Stage) -> (&Stage, f32) {
    let extent = |axis: usize| {
        let along = || stage.frames.iter().flatten().map(|frame| frame.origin[axis]);
        along().fold(f32::MIN, f32::max) - along().fold(f32::MAX, f32::min)
    };
    (stage, (0..3).map(extent).fold(0.0, f32::max))
}

/// Triangles that are near each other.
struct Cluster {
    members: Vec<usize>,
    /// The one nearest to their mean, of those that cover at least half as much as they do on average.
    stands_for_all: usize,
}

/// About `count` clusters of some triangles, each weighted by what is seen of it (Lloyd 1982).
fn clusters(places: &[Place], seen: &[Seen], of: &[usize], count: usize) -> Vec<Cluster> {
    let mut centers = seeds(places, seen, of, count);
    let mut members = vec![Vec::new(); centers.len()];
    for _ in 0..ROUNDS {
        let nearest: Vec<usize> =
            of.par_iter().map(|&triangle| nearest(&places[triangle], &centers)).collect();
        members.iter_mut().for_each(Vec::clear);
        of.iter().zip(nearest).for_each(|(&triangle, center)| members[center].push(triangle));
        for (center, members) in centers.iter_mut().zip(&members) {
            move_to_mean(center, members, places, seen);
        }
    }
    let cluster = |(members, center): (Vec<usize>, &Place)| {
        let mean = Seen::sum(members.iter().map(|&t| &seen[t])).footprint / members.len() as f64;
        let large = members.iter().copied().filter(|&t| seen[t].footprint >= 0.5 * mean);
        let distance = |triangle: &usize| square_distance(&places[*triangle], center);
        let stands_for_all = large.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some(Cluster { members, stands_for_all })
    };
    members.into_iter().zip(&centers).filter_map(cluster).collect()
}

/// Places of `count` triangles, or of all of fewer, with as much to be seen from each to the next.
fn seeds(places: &[Place], seen: &[Seen], of: &[usize], count: usize) -> Vec<Place> {
    let all = Seen::sum(of.iter().map(|&triangle| &seen[triangle])).footprint;
    let (mut before, mut seeds) = (0.0, Vec::new());
    for &triangle in of {
        let after = before + seen[triangle].footprint;
        let passed = |sum: f64| (sum / all * count as f64).floor();
        if of.len() <= count || passed(after) > passed(before) {
            seeds.push(places[triangle].clone());
        }
        before = after;
    }
    seeds
}

fn move_to_mean(center: &mut Place, members: &[usize], places: &[Place], seen: &[Seen]) {
    let (mut sums, mut all) = (vec![0.0; center.len()], 0.0);
    for &triangle in members {
        let weight = seen[triangle].footprint;
        for (sum, &x) in sums.iter_mut().zip(&places[triangle]) {
            *sum += weight * f64::from(x);
        }
        all += weight;
    }
    if all > 0.0 {
        center.iter_mut().zip(sums).for_each(|(center, sum)| *center = (sum / all) as f32);
    }
}

fn nearest(place: &Place, centers: &[Place]) -> usize {
    let distance = |at: &usize| square_distance(place, &centers[*at]);
    let nearest = (0..centers.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.unwrap_or(0)
}

fn square_distance(a: &Place, b: &Place) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}
