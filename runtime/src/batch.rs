//! Up to 16 Gaussians as columns: what the front end projects at once.

use dermis_format::quant::{ANGLE_STEP, COMPONENT_MIDDLE, HALF_ROOT, affine, rgb_of_ycocg};
use dermis_format::record::{GroupRecord, Range};
use dermis_format::{Disc, LowPass, Records};

use crate::frame::Frame;
use crate::gaussian::{disc_on, full_on};
use crate::kernel::Work;
use crate::lanes::{Column, Lanes, MAX_LANES, load, store};
use crate::math::each;
use crate::project::{Projected, View, project};
use crate::select::Place;

/// Up to 16 Gaussians, each on the frame of its triangle.
#[derive(Clone, Debug, Default)]
pub struct Batch<Shape> {
    /// How many.
    pub len: usize,
    /// Axes x, y, z and origin of the frames: three numbers each, world.
    pub frames: [Column; 12],
    /// Where they are and how they extend.
    pub shape: Shape,
    /// Display-referred sRGB (with harmonics: the constant term's colour).
    pub color: [Column; 3],
    /// In [0, 1].
    pub opacity: Column,
}

/// Flat discs.
#[derive(Clone, Debug, Default)]
pub struct Discs {
    /// In the frame.
    pub position: [Column; 3],
    /// From the frame's x to the first axis, radians.
    pub angle: Column,
    /// log₂ of the standard deviations, in units of the frame's size.
    pub log2_scale: [Column; 2],
}

/// Gaussians with rotation and three scales.
#[derive(Clone, Debug, Default)]
pub struct Fulls {
    /// In the frame.
    pub position: [Column; 3],
    /// Unit quaternions w, x, y, z: own axes → frame.
    pub rotation: [Column; 4],
    /// log₂ of the standard deviations, in units of the frame's size.
    pub log2_scale: [Column; 3],
}

/// What a batch is of.
pub trait Shape: Default {
    /// Copies the codes of a place in the file to lane `lane`.
    fn gather(place: &Place<'_, '_>, lane: usize, codes: &mut Codes);

    /// Positions, and log₂ of the scales.
    fn columns(&mut self) -> (&mut [Column; 3], &mut [Column]);

    /// Decodes how lanes `at..at + V::LEN` are turned.
    fn decode_rotation<V: Lanes>(&mut self, token: V::Token, at: usize, codes: &Codes);

    /// Projects lanes `at..at + V::LEN`: the centres in the world, what they project to, and which
    /// can be drawn.
    fn project<V: Lanes>(
        &self,
        token: V::Token,
        at: usize,
        frame: &Frame<V>,
        view: &View<V>,
        low_pass: LowPass,
    ) -> ([V; 3], Projected<V>, V::Mask);
}

/// Codes of the file: colour, position, scales, then a disc's angle, or a rotation's greatest
/// component and the other three.
pub type Codes = [[i32; MAX_LANES]; 13];

const COLOR: usize = 0;
const POSITION: usize = 3;
const SCALE: usize = 6;
const ROTATION: usize = 9;

#[inline(always)]
fn put(codes: &mut Codes, lane: usize, column: usize, code: impl Into<i32>) {
    if let Some(column) = codes.get_mut(column) {
        column[lane % MAX_LANES] = code.into();
    }
}

/// The values of a column of codes.
#[inline(always)]
fn decode_column<V: Lanes>(
    token: V::Token,
    at: usize,
    codes: &Codes,
    column: usize,
    range: Range,
) -> V {
    let codes = codes.get(column).and_then(|column| column.get(at..)).unwrap_or(&[]);
    let offset = V::splat(token, range.offset.get());
    let step = V::splat(token, range.step.get());
    affine(offset, step, V::load_integers(token, codes))
}

impl Shape for Discs {
    #[inline(always)]
    fn gather(place: &Place<'_, '_>, lane: usize, codes: &mut Codes) {
        let Records::Disc(discs) = place.block.records else { return };
        let Some(disc) = discs.get(place.index) else { return };
        for i in 0..3 {
            put(codes, lane, COLOR + i, disc.color[i]);
            put(codes, lane, POSITION + i, disc.position[i]);
        }
        put(codes, lane, SCALE, disc.scale[0]);
        put(codes, lane, SCALE + 1, disc.scale[1]);
        put(codes, lane, ROTATION, disc.angle);
    }

    #[inline(always)]
    fn columns(&mut self) -> (&mut [Column; 3], &mut [Column]) {
        (&mut self.position, &mut self.log2_scale)
    }

    #[inline(always)]
    fn decode_rotation<V: Lanes>(&mut self, token: V::Token, at: usize, codes: &Codes) {
        let turns = codes.get(ROTATION).and_then(|column| column.get(at..)).unwrap_or(&[]);
        let angle = V::load_integers(token, turns) * V::splat(token, ANGLE_STEP);
        store(angle, &mut self.angle, at);
    }

    #[inline(always)]
    fn project<V: Lanes>(
        &self,
        token: V::Token,
        at: usize,
        frame: &Frame<V>,
        view: &View<V>,
        low_pass: LowPass,
    ) -> ([V; 3], Projected<V>, V::Mask) {
        let column = |column: &Column| load::<V>(token, column, at);
        let [p, q, r] = &self.position;
        let [s, t] = &self.log2_scale;
        let position = [column(p), column(q), column(r)];
        let disc = disc_on(frame, position, column(&self.angle), [column(s), column(t)]);
        let (projected, drawable) = project(view, low_pass, &disc);
        (disc.center, projected, drawable)
    }
}

impl Shape for Fulls {
    #[inline(always)]
    fn gather(place: &Place<'_, '_>, lane: usize, codes: &mut Codes) {
        let Records::Full(fulls) = place.block.records else { return };
        let Some(full) = fulls.get(place.index) else { return };
        let rotation = full.rotation.get();
        for i in 0..3 {
            put(codes, lane, COLOR + i, full.color[i]);
            put(codes, lane, POSITION + i, full.position[i].get());
            put(codes, lane, SCALE + i, full.scale[i]);
            put(codes, lane, ROTATION + 1 + i, (rotation >> (20 - 10 * i) & 1023) as i32);
        }
        put(codes, lane, ROTATION, (rotation >> 30) as i32);
    }

    #[inline(always)]
    fn columns(&mut self) -> (&mut [Column; 3], &mut [Column]) {
        (&mut self.position, &mut self.log2_scale)
    }

    #[inline(always)]
    fn decode_rotation<V: Lanes>(&mut self, token: V::Token, at: usize, codes: &Codes) {
        let integers = |column: usize| {
            let codes = codes.get(column).and_then(|column| column.get(at..)).unwrap_or(&[]);
            V::load_integers(token, codes)
        };
        let others = [integers(ROTATION + 1), integers(ROTATION + 2), integers(ROTATION + 3)];
        for (column, value) in self.rotation.iter_mut().zip(quaternion(integers(ROTATION), others))
        {
            store(value, column, at);
        }
    }

    #[inline(always)]
    fn project<V: Lanes>(
        &self,
        token: V::Token,
        at: usize,
        frame: &Frame<V>,
        view: &View<V>,
        low_pass: LowPass,
    ) -> ([V; 3], Projected<V>, V::Mask) {
        let column = |column: &Column| load::<V>(token, column, at);
        let [p, q, r] = &self.position;
        let [s, t, u] = &self.log2_scale;
        let [w, x, y, z] = &self.rotation;
        let full = full_on(
            frame,
            [column(p), column(q), column(r)],
            [column(w), column(x), column(y), column(z)],
            [column(s), column(t), column(u)],
        );
        let (projected, drawable) = project(view, low_pass, &full);
        (full.center, projected, drawable)
    }
}

/// The lanes' form of `dermis_format::quant::quaternion_value`, which says what the codes mean.
#[inline(always)]
fn quaternion<V: Lanes>(greatest: V, others: [V; 3]) -> [V; 4] {
    let constant = |x: f32| greatest.like(x);
    let step = constant(HALF_ROOT / COMPONENT_MIDDLE);
    let [a, b, c] = each(
        others,
        #[inline(always)]
        |code| (code - constant(COMPONENT_MIDDLE)) * step,
    );
    let rest = constant(1.0) - (a * a + b * b + c * c);
    let root = rest.at_least(constant(0.0)).sqrt();
    let before = |i: f32| greatest.below(constant(i));
    [
        V::select(before(1.0), root, a),
        V::select(before(1.0), a, V::select(before(2.0), root, b)),
        V::select(before(2.0), b, V::select(before(3.0), root, c)),
        V::select(before(3.0), c, root),
    ]
}

impl<G> Batch<G> {
    /// Puts the numbers of the frame (x, y, z, origin) of the Gaussian in lane `lane` in its columns.
    #[inline(always)]
    pub fn set_frame(&mut self, lane: usize, numbers: [f32; 12]) {
        for (column, number) in self.frames.iter_mut().zip(numbers) {
            column[lane % MAX_LANES] = number;
        }
    }

    /// Frames of lanes `at..`.
    #[inline(always)]
    pub(crate) fn frame<V: Lanes>(&self, token: V::Token, at: usize) -> Frame<V> {
        let axis = |first: usize| {
            each(
                [0, 1, 2],
                #[inline(always)]
                |i: usize| match self.frames.get(first + i) {
                    Some(column) => load(token, column, at),
                    None => V::splat(token, 0.0),
                },
            )
        };
        Frame { x: axis(0), y: axis(3), z: axis(6), origin: axis(9) }
    }
}

impl Batch<Discs> {
    /// Puts a disc on `frame` behind the others; a full batch stays as it is.
    #[inline]
    pub fn push(&mut self, disc: &Disc, frame: &Frame<f32>) {
        let lane = self.len;
        if lane >= MAX_LANES {
            return;
        }
        self.set_frame(lane, frame.numbers());
        let Discs { position: [x, y, z], angle, log2_scale: [s, t] } = &mut self.shape;
        let [r, g, b] = &mut self.color;
        let columns = [x, y, z, angle, s, t, r, g, b, &mut self.opacity];
        let ([x, y, z], [s, t], [r, g, b]) = (disc.position, disc.log2_scale, disc.color);
        let numbers = [x, y, z, disc.angle, s, t, r, g, b, disc.opacity];
        for (column, number) in columns.into_iter().zip(numbers) {
            column[lane] = number;
        }
        self.len = lane + 1;
    }
}

/// Decodes the codes of Gaussians of one group into their batch.
pub struct Decode<'b, G> {
    /// What to fill; its `len` says how many.
    pub batch: &'b mut Batch<G>,
    /// Codes of the file.
    pub codes: &'b Codes,
    /// Their ranges.
    pub group: &'b GroupRecord,
    /// Added to log₂ of their scales.
    pub log2_factor: f32,
}

impl<G: Shape> Work for Decode<'_, G> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { batch, codes, group, log2_factor } = self;
        let mut at = 0;
        while at < batch.len {
            let ycocg = each(
                [0, 1, 2],
                #[inline(always)]
                |i: usize| decode_column::<V>(token, at, codes, COLOR + i, group.color[i]),
            );
            for (column, value) in batch.color.iter_mut().zip(rgb_of_ycocg(ycocg)) {
                store(value, column, at);
            }
            let (position, log2_scale) = batch.shape.columns();
            for (i, column) in position.iter_mut().enumerate() {
                let value: V = decode_column(token, at, codes, POSITION + i, group.position[i]);
                store(value, column, at);
            }
            for (i, column) in log2_scale.iter_mut().enumerate() {
                let value: V = decode_column(token, at, codes, SCALE + i, group.log2_scale);
                store(value + V::splat(token, log2_factor), column, at);
            }
            batch.shape.decode_rotation::<V>(token, at, codes);
            at += V::LEN;
        }
    }
}
