//! Gaussians on the frames of their triangles become splats: one by one, which is the specification,
//! or a batch at once.

use dermis_format::LowPass;

use crate::batch::{Batch, Shape};
use crate::frame::Frame;
use crate::gaussian::{Ellipsoid, disc_on, full_on};
use crate::harmonics;
use crate::kernel::{Kernel, Work};
use crate::lanes::{Column, Lanes, MAX_LANES, load, store};
use crate::math::each;
use crate::project::{Splat, View, footprint, project};
use crate::select::{Harmonics, Local, Selected};

/// What turns Gaussians on frames into splats.
#[derive(Clone, Copy, Debug)]
pub struct SplatCamera {
    /// The camera.
    pub view: View<f32>,
    /// How its low-pass acts.
    pub low_pass: LowPass,
}

impl SplatCamera {
    /// The splat of a Gaussian on its frame; `None` if it touches no pixel.
    pub fn splat(&self, selected: &Selected<'_>, frame: &Frame<f32>) -> Option<Splat> {
        match &selected.gaussian {
            Local::Disc(disc) => {
                let ellipsoid = disc_on(frame, disc.position, disc.angle, disc.log2_scale);
                self.pack(&ellipsoid, disc.opacity, disc.color, &selected.harmonics)
            }
            Local::Full(full) => {
                let ellipsoid = full_on(frame, full.position, full.rotation, full.log2_scale);
                self.pack(&ellipsoid, full.opacity, full.color, &selected.harmonics)
            }
        }
    }

    fn pack<const N: usize>(
        &self,
        ellipsoid: &Ellipsoid<f32, N>,
        opacity: f32,
        color: [f32; 3],
        harmonics: &Harmonics<'_>,
    ) -> Option<Splat> {
        let (projected, drawable) = project(&self.view, self.low_pass, ellipsoid);
        let color = harmonics.seen(color, ellipsoid.center, self.view.eye);
        Splat::pack(&self.view, &projected, opacity, color).filter(|_| drawable)
    }

    /// Projects a batch. Calls `visit` with the lane and the splat of each Gaussian that touches a
    /// pixel, in their order. `harmonics` may be empty.
    #[inline]
    pub fn splats<G: Shape>(
        &self,
        kernel: Kernel,
        batch: &Batch<G>,
        harmonics: &[Harmonics<'_>],
        mut visit: impl FnMut(usize, Splat),
    ) {
        let mut out = Columns::default();
        let touches = kernel.run(Project { camera: self, batch, harmonics, out: &mut out });
        let mut left = touches & ((1u64 << batch.len.min(MAX_LANES)) - 1) as u32;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            visit(lane, out.splat(lane));
        }
    }
}

/// Fills `out`; gives the lanes that touch a pixel.
struct Project<'b, 'h, G> {
    camera: &'b SplatCamera,
    batch: &'b Batch<G>,
    harmonics: &'b [Harmonics<'h>],
    out: &'b mut Columns,
}

impl<G: Shape> Work for Project<'_, '_, G> {
    type Output = u32;

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) -> u32 {
        let Self { camera, batch, harmonics, out } = self;
        let view = camera.view.map(
            #[inline(always)]
            |x| V::splat(token, x),
        );
        let mut touches = 0;
        let mut at = 0;
        while at < batch.len.min(MAX_LANES) {
            let frame = batch.frame::<V>(token, at);
            let (center, projected, drawable) =
                batch.shape.project(token, at, &frame, &view, camera.low_pass);
            let opacity = load(token, &batch.opacity, at);
            let (footprint, visible) = footprint(&view, &projected, opacity);
            let [r, g, b] = &batch.color;
            let color = [load(token, r, at), load(token, g, at), load(token, b, at)];
            let color = if harmonics.is_empty() {
                harmonics::not_below_zero(color)
            } else {
                let direction = harmonics::direction(center, view.eye);
                harmonics::color(color, coefficients(token, at, harmonics), direction)
            };
            touches |= V::bits(drawable & visible) << at;
            let [x, y] = projected.mean;
            let [a, b, c] = projected.falloff;
            let [red, green, blue] = color;
            let splat = [x, y, a, b, c, footprint.log2_opacity, red, green, blue, projected.depth];
            for (column, value) in out.splats.iter_mut().zip(splat) {
                store(value, column, at);
            }
            let [x0, y0, x1, y1] = footprint.bounds;
            let [first, end] = &mut out.bounds;
            V::store_fields([x0, y0], [0, 16], first.get_mut(at..).unwrap_or(&mut []));
            V::store_fields([x1, y1], [0, 16], end.get_mut(at..).unwrap_or(&mut []));
            at += V::LEN;
        }
        touches
    }
}

/// Coefficient after coefficient of lanes `at..`.
#[inline(always)]
fn coefficients<'a, V: Lanes + 'a>(
    token: V::Token,
    at: usize,
    harmonics: &'a [Harmonics<'_>],
) -> impl Iterator<Item = [V; 3]> + 'a
where
    V::Token: 'a,
{
    let lanes = harmonics.get(at..).unwrap_or(&[]);
    let degree_codes = lanes.first().map_or(0, |first| first.codes.len());
    let mut steps = [0.0; MAX_LANES];
    steps.iter_mut().zip(lanes).for_each(|(step, lane)| *step = lane.step);
    let step = V::load(token, &steps);
    (0..degree_codes / 3).map(
        #[inline(always)]
        move |coefficient| {
            each(
                [0, 1, 2],
                #[inline(always)]
                |channel: usize| {
                    let mut codes = [0; MAX_LANES];
                    for (code, lane) in codes.iter_mut().zip(lanes) {
                        *code =
                            lane.codes.get(coefficient * 3 + channel).map_or(0, |&c| i32::from(c));
                    }
                    V::load_integers(token, &codes) * step
                },
            )
        },
    )
}

/// Projected Gaussians before they are records.
#[derive(Default)]
struct Columns {
    /// In the order of [`Splat`]'s fields.
    splats: [Column; 10],
    /// First column and row, then one past the last ones, 16 bits each.
    bounds: [[u32; MAX_LANES]; 2],
}

impl Columns {
    #[inline(always)]
    fn splat(&self, lane: usize) -> Splat {
        let lane = lane % MAX_LANES;
        let [x, y, a, b, c, log2_opacity, red, green, blue, depth] =
            self.splats.each_ref().map(|column| column[lane]);
        let [first, end] = self.bounds.each_ref().map(|column| column[lane]);
        Splat {
            mean: [x, y],
            falloff: [a, b, c],
            log2_opacity,
            color: [red, green, blue],
            depth,
            bounds: [first as u16, (first >> 16) as u16, end as u16, (end >> 16) as u16],
        }
    }
}
