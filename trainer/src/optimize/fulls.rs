//! Gaussians with rotation and three scales, drawn and moved.
//!
//! What another program trained has these, and harmonics, which stay as they are: a gradient by the colour that is seen is
//! one by the constant term. The rest is that of the discs: lists, blending and the way back to splats do not know what
//! a splat was.

use core::ops::Range;

use dermis_format::{Full, LowPass};
use dermis_runtime::batch::{self, BATCH, Batch};
use dermis_runtime::frame::Frame;
use dermis_runtime::harmonics::{color, direction};
use dermis_runtime::kernel::Work;
use dermis_runtime::lanes::{Lanes, Row};
use dermis_runtime::lists::ListKey;
use dermis_runtime::math::each;
use dermis_runtime::project::{Splat, View};
use dermis_runtime::screen::{Slots, SplatCamera};
use dermis_runtime::select::LEAST_OPACITY;
use dermis_runtime::tiles::TileGrid;
use dermis_runtime::{Camera, Kernel};
use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::adam::{Rates, descend};
use super::backward::SplatGradient;
use super::forward::{Forward, Stage};
use super::projection::{ByScreen, by_full};
use crate::picture::Picture;

/// Gaussians that one task projects or moves.
const CHUNK: usize = 2048;

/// Numbers of one Gaussian that move: position, turn, log₂ of the scales, logit of the opacity, colour.
const NUMBERS: usize = 13;

/// Opacities that have a logit to descend by.
const OPACITIES: [f32; 2] = [1e-3, 0.999];

/// Gaussians on the triangles of a [`Stage`].
#[derive(Clone, Debug, Default)]
pub struct Fulls {
    /// Each Gaussian.
    pub gaussians: Vec<Full>,
    /// Triangle of each.
    pub triangles: Vec<u32>,
    /// Coefficients of each, (r, g, b) after (r, g, b); no list at degree 0.
    pub harmonics: Vec<Vec<f32>>,
}

impl Fulls {
    /// How many.
    pub fn len(&self) -> usize {
        self.gaussians.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.gaussians.is_empty()
    }

    /// Draws all over `background`, by the runtime's own stages.
    pub fn draw(
        &self,
        stage: &Stage,
        camera: &Camera,
        low_pass: LowPass,
        background: [f32; 3],
    ) -> Forward {
        let screen = SplatCamera { view: View::new(camera), low_pass };
        let grid = TileGrid::new(camera.width, camera.height);
        let chunks = (0..self.len().div_ceil(CHUNK)).into_par_iter().map(|chunk| {
            let places = chunk * CHUNK..self.len().min((chunk + 1) * CHUNK);
            self.project(places, stage, &screen, &grid)
        });
        let chunks: Vec<Seen> = chunks.collect();
        let mut forward = Forward {
            picture: Picture::filled(camera.width, camera.height, background),
            ..Forward::default()
        };
        let mut keys = Vec::new();
        for seen in chunks {
            forward.splats.extend(seen.splats);
            forward.sources.extend(seen.sources);
            keys.extend(seen.keys);
        }
        forward.regions.push(0..forward.splats.len());
        forward.blend(&keys, background);
        forward
    }

    /// The Gaussians at `places` that are seen.
    fn project(
        &self,
        places: Range<usize>,
        stage: &Stage,
        screen: &SplatCamera,
        grid: &TileGrid,
    ) -> Seen {
        let kernel = Kernel::detect();
        let mut seen = Seen::default();
        let mut batch = batch::Fulls::new();
        let mut sources = Vec::with_capacity(BATCH);
        let mut flush = |batch: &mut batch::Fulls, sources: &mut Vec<u32>| {
            let filled = seen.splats.len();
            seen.splats.resize(filled + BATCH, Splat::default());
            seen.keys.resize(filled + BATCH, ListKey::default());
            let slots =
                Slots { splats: &mut seen.splats[filled..], keys: &mut seen.keys[filled..] };
            let touching = screen.splats(kernel, batch, grid, slots);
            let lanes = (0..).zip(sources.drain(..));
            seen.sources.extend(lanes.filter(|(i, _)| touching >> i & 1 == 1).map(|(_, s)| s));
            seen.splats.truncate(seen.sources.len());
            seen.keys.truncate(seen.sources.len());
            batch.clear();
        };
        for i in places {
            let Some(frame) = stage.visible(self.triangles[i], screen.view.eye) else { continue };
            if !(self.gaussians[i].opacity >= LEAST_OPACITY) {
                continue;
            }
            batch.push(&self.seen(i, frame, screen.view.eye), frame);
            sources.push(i as u32);
            if batch.len() == BATCH {
                flush(&mut batch, &mut sources);
            }
        }
        flush(&mut batch, &mut sources);
        seen
    }

    /// A Gaussian in the colour that `eye` sees.
    fn seen(&self, index: usize, frame: &Frame<f32>, eye: [f32; 3]) -> Full {
        let mut full = self.gaussians[index];
        if let Some(harmonics) = self.harmonics.get(index) {
            let towards = direction(frame.point(full.position), eye);
            let coefficients = harmonics.as_chunks::<3>().0.iter().copied();
            full.color = color(full.color, coefficients, towards);
        }
        full
    }
}

/// Gaussians that are seen.
#[derive(Default)]
struct Seen {
    splats: Vec<Splat>,
    keys: Vec<ListKey>,
    sources: Vec<u32>,
}

/// How Gaussians move.
#[derive(Clone, Debug)]
pub struct Motion {
    moments: Vec<Moments>,
    /// Steps of positions stay those of the first size.
    sigmas: Vec<f32>,
}

#[derive(Clone, Copy, Debug)]
struct Moments {
    numbers: [[f32; NUMBERS]; 2],
    decay: [f32; 2],
}

impl Motion {
    /// At rest.
    pub fn new(fulls: &Fulls) -> Self {
        let moments = Moments { numbers: [[0.0; NUMBERS]; 2], decay: [1.0; 2] };
        // Of the two longer axes: the third one may be as thin as a surface.
        let sigma = |full: &Full| {
            let [s, t, u] = full.log2_scale;
            libm::exp2f(0.5 * (s + t + u - s.min(t).min(u)))
        };
        Self {
            moments: vec![moments; fulls.len()],
            sigmas: fulls.gaussians.iter().map(sigma).collect(),
        }
    }
}

/// One step of all Gaussians that were drawn.
#[derive(Clone, Copy, Debug)]
pub struct Mover<'a> {
    /// Who looked.
    pub camera: &'a Camera,
    /// How the low-pass acted.
    pub low_pass: LowPass,
    /// The pose.
    pub stage: &'a Stage,
    /// How far to go.
    pub rates: Rates,
}

impl Mover<'_> {
    /// Moves the Gaussians of `forward`, given the gradients by its splats.
    pub fn advance(
        &self,
        fulls: &mut Fulls,
        motion: &mut Motion,
        forward: &Forward,
        gradients: &[SplatGradient],
    ) {
        let view = View::new(self.camera);
        let triangles = &fulls.triangles;
        let gaussians = fulls.gaussians.par_chunks_mut(CHUNK);
        let moments = motion.moments.par_chunks_mut(CHUNK).zip(motion.sigmas.par_chunks(CHUNK));
        gaussians.zip(moments).enumerate().for_each(|(chunk, (gaussians, (moments, sigmas)))| {
            let first = chunk * CHUNK;
            let place = |index: usize| forward.sources.partition_point(|&s| (s as usize) < index);
            let drawn = place(first)..place(first + gaussians.len());
            for start in drawn.clone().step_by(BATCH) {
                let drawn = start..drawn.end.min(start + BATCH);
                let sources = &forward.sources[drawn.clone()];
                let of_each = sources.iter().zip(&gradients[drawn.clone()]);
                let batch = of_each.clone().filter_map(|(&source, by)| {
                    let source = source as usize;
                    let frame = self.stage.frames[triangles[source] as usize].as_ref()?;
                    Some((&gaussians[source - first], frame, by))
                });
                let by = by_fulls(&view, self.low_pass, batch);
                for ((&source, by_splat), by) in of_each.zip(by) {
                    let at = source as usize - first;
                    self.step(&mut gaussians[at], &mut moments[at], sigmas[at], by, by_splat);
                }
            }
        });
    }

    fn step(
        &self,
        full: &mut Full,
        moments: &mut Moments,
        sigma: f32,
        [places, turns, scales]: [Row; 3],
        by: &SplatGradient,
    ) {
        let opacity = full.opacity.clamp(OPACITIES[0], OPACITIES[1]);
        // d log₂ o / d logit = (1 − o) log₂ e.
        let logit = by.log2_opacity * core::f32::consts::LOG2_E * (1.0 - opacity);
        let ([x, y, z, _], [i, j, k, _], [s, t, u, _]) = (places, turns, scales);
        let [r, g, b] = by.color;
        let gradient = [x, y, z, i, j, k, s, t, u, logit, r, g, b];
        if !gradient.iter().all(|g| g.is_finite()) {
            return;
        }
        let ([x, y, z], [s, t, u], [r, g, b]) = (full.position, full.log2_scale, full.color);
        let mut values = [x, y, z, 0.0, 0.0, 0.0, s, t, u, 0.0, r, g, b];
        values[9] = libm::logf(opacity / (1.0 - opacity));
        let rates = |factor: f32| {
            let r = self.rates.times(factor);
            let (p, a, s, c) = (r.position * sigma, r.angle, r.log2_scale, r.color);
            [p, p, p, a, a, a, s, s, s, r.logit, c, c, c]
        };
        let Moments { numbers: [first, second], decay } = moments;
        descend(&mut values, &gradient, rates, [first, second], decay);
        let [x, y, z, i, j, k, s, t, u, logit, r, g, b] = values;
        full.position = [x, y, z];
        full.rotation = turned(full.rotation, [i, j, k]);
        full.log2_scale = [s, t, u];
        full.color = [r, g, b];
        full.opacity = (1.0 / (1.0 + libm::expf(-logit))).clamp(OPACITIES[0], OPACITIES[1]);
    }
}

/// A rotation, and after it one about `turn`, radians, by as much as that is long.
pub fn turned([w, x, y, z]: [f32; 4], turn: [f32; 3]) -> [f32; 4] {
    let turn = Quat::from_scaled_axis(Vec3::from(turn));
    let [x, y, z, w] = (turn * Quat::from_xyzw(x, y, z, w)).normalize().to_array();
    [w, x, y, z]
}

/// Gradients by the geometry of Gaussians on frames, [`BATCH`] of them at most, given those by their splats: by position,
/// turn and log₂ of the scales, a fourth number beside each.
pub fn by_fulls<'a>(
    view: &View<f32>,
    low_pass: LowPass,
    gaussians: impl Iterator<Item = (&'a Full, &'a Frame<f32>, &'a SplatGradient)>,
) -> Vec<[Row; 3]> {
    let mut lanes = Box::new([[[0.0; 4]; BATCH]; 8]);
    let mut count = 0;
    for (lane, (full, frame, by)) in gaussians.take(BATCH).enumerate() {
        let ([x, y, z], [s, t, u]) = (full.position, full.log2_scale);
        let ([mx, my], [a, b, c]) = (by.mean, by.falloff);
        let [f0, f1, f2] = frame.rows();
        let rows = [
            f0,
            f1,
            f2,
            [x, y, z, 0.0],
            full.rotation,
            [s, t, u, by.log2_opacity],
            [a, b, c, 0.0],
            [mx, my, 0.0, 0.0],
        ];
        lanes.iter_mut().zip(rows).for_each(|(to, row)| to[lane] = row);
        count = lane + 1;
    }
    Kernel::detect().run(ByBatch { view, low_pass, lanes: &mut lanes });
    (0..count).map(|lane| [3, 4, 5].map(|row| lanes[row][lane])).collect()
}

/// Frames in three rows, position, rotation, log₂ of scales and gradient by log₂ opacity, by falloff, by mean. Gradients
/// by position, turn and scales take the place of those.
struct ByBatch<'a> {
    view: &'a View<f32>,
    low_pass: LowPass,
    lanes: &'a mut [[Row; BATCH]; 8],
}

impl Work for ByBatch<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { view, low_pass, lanes } = self;
        let view = view.map(
            #[inline(always)]
            |x| V::splat(token, x),
        );
        for at in (0..BATCH).step_by(V::LEN) {
            let at = at..at + V::LEN;
            let [f0, f1, f2, place, rotation, shape, falloff, mean] = each(
                [0, 1, 2, 3, 4, 5, 6, 7],
                #[inline(always)]
                |row: usize| V::load_rows(token, &lanes[row][at.clone()]),
            );
            let frame = Frame::of_rows([f0, f1, f2]);
            let ([x, y, z, _], [s, t, u, log2_opacity]) = (place, shape);
            let ([a, b, c, _], [mx, my, ..]) = (falloff, mean);
            let by = ByScreen { mean: [mx, my], falloff: [a, b, c], log2_opacity };
            let by = by_full(&view, low_pass, &frame, ([x, y, z], rotation, [s, t, u]), &by);
            for (row, [x, y, z]) in [(3, by.position), (4, by.turn), (5, by.log2_scale)] {
                V::store_rows([x, y, z, x], &mut lanes[row][at.clone()]);
            }
        }
    }
}
