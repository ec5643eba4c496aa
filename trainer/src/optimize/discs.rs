//! From the gradient by splats to the gradient by the discs that were drawn, many at once.

use core::ops::Range;

use dermis_format::{Disc, LowPass};
use dermis_runtime::Kernel;
use dermis_runtime::frame::Frame;
use dermis_runtime::kernel::Work;
use dermis_runtime::lanes::{Lanes, Row};
use dermis_runtime::math::each;
use dermis_runtime::project::View;

use super::backward::SplatGradient;
use super::forward::{Forward, Stage};
use super::projection::{ByScreen, by_disc};

/// Gaussians whose gradients are taken through the projection together.
pub const BATCH: usize = 64;

/// A picture's discs and the gradient by their splats.
#[derive(Clone, Copy, Debug)]
pub struct ByDiscs<'a> {
    /// Who looked.
    pub view: View<f32>,
    /// How the low-pass acted.
    pub low_pass: LowPass,
    /// The pose.
    pub stage: &'a Stage,
    /// Triangle of each Gaussian of the cloud.
    pub triangles: &'a [u32],
    /// The picture.
    pub forward: &'a Forward,
    /// By each of its splats.
    pub gradients: &'a [SplatGradient],
}

impl ByDiscs<'_> {
    /// The gradient by the discs `drawn` of the picture, at most [`BATCH`] of them; each number of a disc is
    /// the derivative by that number.
    pub fn of(&self, drawn: Range<usize>) -> [Disc; BATCH] {
        let Self { forward, gradients, .. } = self;
        let mut batch = Batch::new();
        for (lane, drawn) in drawn.clone().enumerate() {
            let triangle = self.triangles[forward.sources[drawn] as usize];
            // What was drawn has a frame.
            if let Some(frame) = &self.stage.frames[triangle as usize] {
                batch.set(lane, frame, &forward.discs[drawn], &gradients[drawn]);
            }
        }
        let work = ByBatch { view: &self.view, low_pass: self.low_pass, batch: &mut batch };
        Kernel::detect().run(work);
        let mut discs = [Disc::default(); BATCH];
        for (lane, drawn) in drawn.enumerate() {
            let ([x, y, z, angle], [s, t, ..]) = (batch.places[lane], batch.scales[lane]);
            let SplatGradient { color, log2_opacity, .. } = gradients[drawn];
            discs[lane] = Disc {
                position: [x, y, z],
                angle,
                log2_scale: [s, t],
                color,
                opacity: log2_opacity * core::f32::consts::LOG2_E / forward.discs[drawn].opacity,
            };
        }
        discs
    }
}

/// Discs with the gradient by their splats, which becomes the gradient by the discs.
struct Batch {
    frames: [[Row; BATCH]; 3],
    /// Position, then angle.
    places: [Row; BATCH],
    /// log₂ of the scales, then mean.
    scales: [Row; BATCH],
    /// Falloff, then log₂ of the opacity.
    shapes: [Row; BATCH],
}

impl Batch {
    fn new() -> Self {
        let rows = [[0.0; 4]; BATCH];
        Self { frames: [rows; 3], places: rows, scales: rows, shapes: rows }
    }

    #[inline]
    fn set(&mut self, lane: usize, frame: &Frame<f32>, disc: &Disc, gradient: &SplatGradient) {
        for (rows, row) in self.frames.iter_mut().zip(frame.rows()) {
            rows[lane] = row;
        }
        let ([x, y, z], [s, t]) = (disc.position, disc.log2_scale);
        let ([u, v], [a, b, c]) = (gradient.mean, gradient.falloff);
        self.places[lane] = [x, y, z, disc.angle];
        self.scales[lane] = [s, t, u, v];
        self.shapes[lane] = [a, b, c, gradient.log2_opacity];
    }
}

struct ByBatch<'a> {
    view: &'a View<f32>,
    low_pass: LowPass,
    batch: &'a mut Batch,
}

impl Work for ByBatch<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { view, low_pass, batch: Batch { frames, places, scales, shapes } } = self;
        let view = view.map(
            #[inline(always)]
            |x| V::splat(token, x),
        );
        for at in (0..BATCH).step_by(V::LEN) {
            let lanes = at..at + V::LEN;
            let frame = Frame::of_rows(each(
                [0, 1, 2],
                #[inline(always)]
                |i: usize| V::load_rows(token, &frames[i][lanes.clone()]),
            ));
            let [x, y, z, angle] = V::load_rows(token, &places[lanes.clone()]);
            let [s, t, u, v] = V::load_rows(token, &scales[lanes.clone()]);
            let [a, b, c, log2_opacity] = V::load_rows(token, &shapes[lanes.clone()]);
            let by = ByScreen { mean: [u, v], falloff: [a, b, c], log2_opacity };
            let by = by_disc(&view, low_pass, &frame, ([x, y, z], angle, [s, t]), &by);
            let ([x, y, z], [s, t]) = (by.position, by.log2_scale);
            V::store_rows([x, y, z, by.angle], &mut places[lanes.clone()]);
            V::store_rows([s, t, s, t], &mut scales[lanes]);
        }
    }
}
