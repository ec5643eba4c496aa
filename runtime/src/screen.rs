//! Gaussians on the frames of their triangles become splats: one by one, which is the specification,
//! or a batch at once.

use dermis_format::LowPass;

use crate::batch::{Batch, OnScreen};
use crate::frame::Frame;
use crate::gaussian::{Ellipsoid, disc_on, full_on};
use crate::kernel::{Kernel, Work};
use crate::lanes::{Lanes, MAX_LANES, Row};
use crate::lists::ListKey;
use crate::math::{Real, each};
use crate::project::{Splat, View, footprint, project};
use crate::select::{Harmonics, Local, Selected};
use crate::tiles::TileGrid;

/// What turns Gaussians on frames into splats.
#[derive(Clone, Copy, Debug)]
pub struct SplatCamera<R = f32> {
    /// The camera.
    pub view: View<R>,
    /// How its low-pass acts.
    pub low_pass: LowPass,
}

impl<R: Real + 'static> SplatCamera<R> {
    /// A Gaussian on its frame, on the screen.
    pub fn on_screen(&self, selected: &Selected<'_>, frame: &Frame<R>) -> OnScreen<R> {
        let number = |x: f32| self.view.eye[0].like(x);
        match &selected.gaussian {
            Local::Disc(disc) => {
                let (position, scales) = (disc.position.map(number), disc.log2_scale.map(number));
                let ellipsoid = disc_on(frame, position, number(disc.angle), scales);
                self.seen(&ellipsoid, disc.opacity, disc.color, &selected.harmonics)
            }
            Local::Full(full) => {
                let (position, scales) = (full.position.map(number), full.log2_scale.map(number));
                let ellipsoid = full_on(frame, position, full.rotation.map(number), scales);
                self.seen(&ellipsoid, full.opacity, full.color, &selected.harmonics)
            }
        }
    }

    fn seen<const N: usize>(
        &self,
        ellipsoid: &Ellipsoid<R, N>,
        opacity: f32,
        color: [f32; 3],
        harmonics: &Harmonics<'_>,
    ) -> OnScreen<R> {
        let number = |x: f32| self.view.eye[0].like(x);
        let (projected, drawable) = project(&self.view, self.low_pass, ellipsoid);
        let color = harmonics.seen(color.map(number), ellipsoid.center, self.view.eye);
        OnScreen { projected, drawable, opacity: number(opacity), color }
    }
}

impl SplatCamera {
    /// The splat of a Gaussian on its frame; `None` if it touches no pixel.
    pub fn splat(&self, selected: &Selected<'_>, frame: &Frame<f32>) -> Option<Splat> {
        let OnScreen { projected, drawable, opacity, color } = self.on_screen(selected, frame);
        Splat::pack(&self.view, &projected, opacity, color).filter(|_| drawable)
    }

    /// Projects a batch. Fills the first of `slots` with the splats of those that touch a pixel, in their
    /// order; `grid` are the tiles of the camera's frame. Bit i of what it returns says whether Gaussian i
    /// touches a pixel. `slots` must have room for the whole batch: what is beyond is lost, its bits stay.
    #[inline]
    pub fn splats<G: Batch>(
        &self,
        kernel: Kernel,
        batch: &G,
        grid: &TileGrid,
        slots: Slots<'_>,
    ) -> u64 {
        let eye = Eye { camera: self, grid, slots, sees: u64::MAX };
        let [touching] = splats(kernel, batch, [eye]);
        touching
    }
}

/// A camera that looks at a batch.
#[derive(Debug)]
pub struct Eye<'s> {
    /// The camera.
    pub camera: &'s SplatCamera,
    /// The tiles of its frame.
    pub grid: &'s TileGrid,
    /// Room for its splats.
    pub slots: Slots<'s>,
    /// Bit i: whether it looks at Gaussian i.
    pub sees: u64,
}

/// [`SplatCamera::splats`] for several cameras, which decode the Gaussians and put them in the world once.
#[inline]
pub fn splats<G: Batch, const EYES: usize>(
    kernel: Kernel,
    batch: &G,
    eyes: [Eye<'_>; EYES],
) -> [u64; EYES] {
    kernel.run(Project { batch, eyes })
}

/// Room for splats, and for what lists need of each.
#[derive(Debug, Default)]
pub struct Slots<'s> {
    /// Splats.
    pub splats: &'s mut [Splat],
    /// As many.
    pub keys: &'s mut [ListKey],
}

impl<'s> Slots<'s> {
    /// Those from index `first` on.
    pub fn behind(&mut self, first: usize) -> Slots<'_> {
        Slots {
            splats: self.splats.get_mut(first..).unwrap_or(&mut []),
            keys: self.keys.get_mut(first..).unwrap_or(&mut []),
        }
    }

    /// Takes the first `count` out. With fewer nothing is taken, and nothing is left.
    pub fn take(&mut self, count: usize) -> Slots<'s> {
        let Self { splats, keys } = core::mem::take(self);
        let (splats, more_splats) = splats.split_at_mut_checked(count).unwrap_or_default();
        let (keys, more_keys) = keys.split_at_mut_checked(count).unwrap_or_default();
        *self = Self { splats: more_splats, keys: more_keys };
        Self { splats, keys }
    }
}

const _: () = assert!(size_of::<Splat>() == size_of::<[Row; 3]>());

/// Where two u16 that stand one after the other lie in a word.
const TWO_SHORTS: [u32; 2] = if cfg!(target_endian = "little") { [0, 16] } else { [16, 0] };

struct Project<'b, G, const EYES: usize> {
    batch: &'b G,
    eyes: [Eye<'b>; EYES],
}

impl<G: Batch, const EYES: usize> Work for Project<'_, G, EYES> {
    type Output = [u64; EYES];

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) -> [u64; EYES] {
        let Self { batch, eyes } = self;
        let cameras = each(
            eyes.each_ref(),
            #[inline(always)]
            |eye: &Eye<'_>| {
                let view = eye.camera.view.map(
                    #[inline(always)]
                    |x| V::splat(token, x),
                );
                SplatCamera { view, low_pass: eye.camera.low_pass }
            },
        );
        let mut writers = eyes.map(
            #[inline(always)]
            |eye| Writer::new(eye.slots, *eye.grid, eye.sees),
        );
        let mut at = 0;
        while at < batch.len() {
            let valid = (1u64 << (batch.len() - at).min(V::LEN)) - 1;
            let seen = batch.project(token, at, &cameras);
            for ((writer, seen), camera) in writers.iter_mut().zip(&seen).zip(&cameras) {
                writer.write(token, at, valid, &camera.view, seen);
            }
            at += V::LEN;
        }
        writers.map(
            #[inline(always)]
            |writer| writer.touching,
        )
    }
}

/// Packs the splats of one camera.
struct Writer<'b> {
    slots: core::iter::Zip<core::slice::IterMut<'b, [Row; 3]>, core::slice::IterMut<'b, ListKey>>,
    grid: TileGrid,
    sees: u64,
    /// Bit i: whether Gaussian i touches a pixel.
    touching: u64,
    /// In the order of the splat's fields.
    rows: [[Row; MAX_LANES]; 3],
    tiles: [u32; MAX_LANES],
}

impl<'b> Writer<'b> {
    #[inline(always)]
    fn new(Slots { splats, keys }: Slots<'b>, grid: TileGrid, sees: u64) -> Self {
        // Copied row by row, as vectors write it: a load of another width waits for those stores. They are as
        // long, so this cannot fail.
        let splats: &mut [[Row; 3]] = bytemuck::try_cast_slice_mut(splats).unwrap_or(&mut []);
        let (rows, tiles) = ([[[0.0; 4]; MAX_LANES]; 3], [0; MAX_LANES]);
        Self { slots: splats.iter_mut().zip(keys), grid, sees, touching: 0, rows, tiles }
    }

    /// Those of Gaussians `at..` that are `valid`, are looked at and touch a pixel.
    #[inline(always)]
    fn write<V: Lanes>(
        &mut self,
        token: V::Token,
        at: usize,
        valid: u64,
        view: &View<V>,
        &OnScreen { projected, drawable, opacity, color }: &OnScreen<V>,
    ) {
        let Self { slots, grid, sees, touching, rows, tiles } = self;
        let (footprint, touches) = footprint(view, &projected, opacity);
        let [x, y] = projected.mean;
        let [a, b, c] = projected.falloff;
        let [red, green, blue] = color;
        let [x0, y0, x1, y1] = footprint.bounds;
        let start = V::of_bits(V::pack(token, [x0, y0], TWO_SHORTS));
        let end = V::of_bits(V::pack(token, [x1, y1], TWO_SHORTS));
        V::store_rows([x, y, a, b], &mut rows[0]);
        V::store_rows([c, footprint.log2_opacity, red, green], &mut rows[1]);
        V::store_rows([blue, projected.depth, start, end], &mut rows[2]);
        V::store_words(ListKey::tiles_of(token, footprint.bounds, grid), tiles);
        let touch = u64::from(V::bits(drawable & touches)) & valid & (*sees >> at);
        let mut left = touch;
        while left != 0 {
            let lane = left.trailing_zeros() as usize % MAX_LANES;
            left &= left - 1;
            if let Some(([first, second, third], key)) = slots.next() {
                *key = ListKey::new(tiles[lane], rows[2][lane][1]);
                *first = rows[0][lane];
                *second = rows[1][lane];
                *third = rows[2][lane];
            }
        }
        *touching |= touch << at;
    }
}
