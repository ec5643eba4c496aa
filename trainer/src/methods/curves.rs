//! How near the picture of each level is to the mesh, region by region and from one distance to the next: what a plan
//! weighs when it shares a budget out.

use anyhow::Result;
use dermis_format::curves::{count_at, stops};
use dermis_format::source::MeasuredCurves;
use dermis_format::{CurvePoint, FrameKind};
use dermis_runtime::Camera;
use dermis_runtime::footprint::{Covered, covered};
use dermis_runtime::project::View;

use crate::embed::regions::Regions;
use crate::optimize::cloud::{Cloud, Prefix};
use crate::optimize::descend::Problem;
use crate::optimize::forward::{Forward, Stage, draw};
use crate::optimize::price;
use crate::optimize::residual::by_drawn;
use crate::picture::Picture;
use crate::truth::{Scratch, TrainingView, scaled};

/// Training pictures that are looked at, at most.
const MOST_VIEWS: usize = 6;
/// Of these, those that are drawn twice as large for their blends.
const NEAR_VIEWS: usize = 2;
/// Sizes at which they are compared with the mesh, each half of the one before.
const OCTAVES: u32 = 5;
const BLACK: [f32; 3] = [0.0; 3];
const WHITE: [f32; 3] = [1.0; 3];

/// Measures clouds that are as the file will hold them, on frames of a kind. Each of six views is drawn at every count
/// and size over black and over white. The first octave, twice as near as training, has the error of training's own, as there
/// is no truth beyond it, and blends that were counted.
pub(super) fn measure(
    clouds: &[Cloud],
    problem: &Problem<'_>,
    kind: FrameKind,
    regions: &Regions,
) -> Result<MeasuredCurves> {
    let layers = clouds.iter().map(|cloud| cloud.layers.len()).max().unwrap_or(0);
    let mut octaves =
        vec![vec![vec![Sums::default(); stops(layers)]; clouds.len()]; OCTAVES as usize];
    let mut near = vec![vec![Sums::default(); stops(layers)]; clouds.len()];
    let mut densities = Vec::new();
    for (index, view) in problem.some_views(MOST_VIEWS).enumerate() {
        let (footprints, density) = footprints(view, &problem.stages[view.stage], kind, regions);
        densities.push(libm::log2f(density));
        for (octave, sums) in (0..).zip(&mut octaves) {
            add_view(clouds, problem, view, octave, &footprints, sums)?;
        }
        if index % MOST_VIEWS.div_ceil(NEAR_VIEWS) == 0 {
            add_near_view(clouds, problem, view, &footprints, &mut near);
        }
    }
    let points = octaves[0].iter().zip(&near).enumerate().flat_map(|(region, (own, near))| {
        let near = own.iter().zip(near).map(|(own, near)| near.point_with_error_of(own));
        near.chain(octaves.iter().flat_map(move |octave| octave[region].iter().map(Sums::point)))
    });
    Ok(MeasuredCurves {
        density: 2.0 * libm::exp2f(densities.iter().sum::<f32>() / densities.len().max(1) as f32),
        octaves: 1 + OCTAVES as u8,
        points: points.collect(),
    })
}

/// Sums over pictures of one region, count and size.
#[derive(Clone, Copy, Default)]
struct Sums {
    footprint: f64,
    squares: f64,
    blends: f64,
}

impl Sums {
    fn point(&self) -> CurvePoint {
        let pixels = self.footprint.max(1.0);
        CurvePoint {
            error: (self.squares / (3.0 * pixels)) as f32,
            blends: (self.blends / pixels) as f32,
        }
    }

    fn point_with_error_of(&self, other: &Self) -> CurvePoint {
        CurvePoint { error: other.point().error, ..self.point() }
    }
}

/// What each triangle of the surface, `surface` of them, covers that shows something: its index, px², and its depth, m.
pub(super) fn footprint_of_each(
    view: &TrainingView,
    stage: &Stage,
    kind: FrameKind,
    surface: usize,
) -> impl Iterator<Item = (usize, f64, f32)> {
    let camera = View::<f32>::new(&view.camera);
    let triangles = stage.frames.iter().zip(&stage.two_sided).enumerate().take(surface);
    triangles.filter_map(move |(triangle, (frame, &two_sided))| {
        let Covered { area, center: [.., z] } = covered(frame.as_ref()?, kind, &camera);
        (area > 0.0 || two_sided).then_some((triangle, f64::from(area.abs()), z))
    })
}

/// Pixels that the triangles of each region cover that show something, and how many there are to a metre: the root of
/// their mean square.
fn footprints(
    view: &TrainingView,
    stage: &Stage,
    kind: FrameKind,
    regions: &Regions,
) -> (Vec<f64>, f32) {
    let mut areas = vec![0.0; regions.len()];
    let mut squares = 0.0;
    for (triangle, area, z) in footprint_of_each(view, stage, kind, regions.of_triangles.len()) {
        areas[usize::from(regions.of_triangles[triangle])] += area;
        squares += area * f64::from(view.camera.fx * view.camera.fy / (z * z)).abs();
    }
    let all = areas.iter().sum::<f64>().max(1e-9);
    (areas, (squares / all).sqrt().max(1e-9) as f32)
}

/// Adds a view, its sides halved `octave` times, to the sums of each region and count.
fn add_view(
    clouds: &[Cloud],
    problem: &Problem<'_>,
    view: &TrainingView,
    octave: u32,
    footprints: &[f64],
    sums: &mut [Vec<Sums>],
) -> Result<()> {
    let (mut reading, mut squares) = (Scratch::default(), Vec::new());
    let camera = scaled(&view.camera, octave);
    let stage = &problem.stages[view.stage];
    let all = footprints.iter().sum::<f64>().max(1e-9);
    let shares: Vec<f64> = footprints.iter().map(|footprint| footprint / all).collect();
    for (region, footprint) in sums.iter_mut().zip(footprints) {
        // Two pictures, a quarter of the pixels for each octave.
        let pixels = 2.0 * footprint / f64::from(1 << (2 * octave));
        region.iter_mut().for_each(|sums| sums.footprint += pixels);
    }
    for background in [BLACK, WHITE] {
        let mut truth = Picture::default();
        view.truth.draw(background, octave, &mut reading, &mut truth)?;
        let pixels = truth.rgb.iter().flat_map(|rgb| rgb.iter().zip(background));
        let nothing: f64 = pixels.map(|(a, b)| f64::from((a - b) * (a - b))).sum();
        for (region, share) in sums.iter_mut().zip(&shares) {
            region[0].squares += nothing * share;
        }
        for stop in 1..sums.first().map_or(0, Vec::len) {
            let prefixes = prefixes(clouds, stop);
            let forward = draw(clouds, &prefixes, stage, &camera, problem.low_pass, background);
            let by_splats = by_drawn(&forward, &truth, &mut squares);
            let whole: f64 = squares.iter().map(|square| f64::from(square[0])).sum();
            add_picture(
                &forward,
                &by_splats,
                whole,
                &shares,
                sums.iter_mut().map(|r| &mut r[stop]),
            );
        }
    }
    Ok(())
}

/// Adds the blends of a view, its sides doubled, to the sums of each region and count.
fn add_near_view(
    clouds: &[Cloud],
    problem: &Problem<'_>,
    view: &TrainingView,
    footprints: &[f64],
    sums: &mut [Vec<Sums>],
) {
    let Camera { width, height, fx, fy, cx, cy, world_to_camera } = view.camera;
    let (width, height) = (2 * width, 2 * height);
    let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(|px| 2.0 * px);
    let camera = Camera { width, height, fx, fy, cx, cy, world_to_camera };
    for (region, footprint) in sums.iter_mut().zip(footprints) {
        region.iter_mut().for_each(|sums| sums.footprint += 4.0 * footprint);
    }
    for stop in 1..sums.first().map_or(0, Vec::len) {
        let (prefixes, stage) = (prefixes(clouds, stop), &problem.stages[view.stage]);
        let forward = draw(clouds, &prefixes, stage, &camera, problem.low_pass, BLACK);
        add_blends(&forward, sums.iter_mut().map(|region| &mut region[stop]));
    }
}

/// What each cloud has at a stop.
pub(super) fn prefixes(clouds: &[Cloud], stop: usize) -> Vec<Prefix> {
    let prefix = |cloud: &Cloud| {
        let (layers, len) = (&cloud.layers, cloud.layers.len());
        Prefix::of(count_at(stop, |layer| layers[layer], len), cloud)
    };
    clouds.iter().map(prefix).collect()
}

/// Adds a picture, whose splats have these shares of its `whole` squares.
fn add_picture<'s>(
    forward: &Forward,
    by_splats: &[f32],
    whole: f64,
    shares: &[f64],
    sums: impl Iterator<Item = &'s mut Sums>,
) {
    let sum = |squares: &[f32]| squares.iter().map(|&square| f64::from(square)).sum::<f64>();
    let mut sums: Vec<&mut Sums> = sums.collect();
    add_blends(forward, sums.iter_mut().map(|sums| &mut **sums));
    // What shows through, of holes and of the rim, is everybody's.
    let rest = (whole - sum(by_splats)).max(0.0);
    for ((sums, drawn), share) in sums.into_iter().zip(&forward.regions).zip(shares) {
        sums.squares += sum(&by_splats[drawn.clone()]) + rest * share;
    }
}

/// Adds the blends of a picture.
fn add_blends<'s>(forward: &Forward, sums: impl Iterator<Item = &'s mut Sums>) {
    let predicted = |splats: &[_]| splats.iter().map(|s| f64::from(price::blends(s))).sum::<f64>();
    // Pixels that are finished early take less than footprints of splats say.
    let taken = forward.blends() as f64 / predicted(&forward.splats).max(1.0);
    for (sums, drawn) in sums.zip(&forward.regions) {
        sums.blends += taken * predicted(&forward.splats[drawn.clone()]);
    }
}
