//! Batches of Gaussians as the file has them: codes of one group's ranges.

use dermis_format::order::GROUP_LEN;
use dermis_format::quant::{COMPONENT_MIDDLE, HALF_ROOT};
use dermis_format::record::{DiscGroup, FullGroup};
use dermis_format::{Block, Disc, Discs, Full, Fulls};

use crate::batch::{BATCH, Batch, FrameRows, OnScreen, seen};
use crate::frame::Frame;
use crate::gaussian::{disc_on, full_on};
use crate::harmonics;
use crate::lanes::{Lanes, MAX_LANES, Row, lanes_at, load};
use crate::math::each;
use crate::mix::mixed;
use crate::screen::SplatCamera;
use crate::select::{Harmonics, Place};

/// Gaussians of a block as the file has them: codes of each, and what they mean.
pub trait Coding<'a>: Copy {
    /// One Gaussian, or several side by side.
    type Decoded<V: Lanes>;

    /// The Gaussians of a block at the level below, if they are of this kind.
    fn below(discs: Discs<'a>) -> Option<Self>;

    /// All codes of Gaussian `index`.
    fn words(&self, index: usize) -> [u32; 4];

    /// The Gaussians of the words of several in group `group`, without their opacities, which are given.
    fn decode<V: Lanes>(
        &self,
        token: V::Token,
        words: [V::Words; 4],
        opacity: V,
        group: usize,
    ) -> Self::Decoded<V>;

    /// Gaussians on their way from `upper` to `lower`, of which `share` is gone; the opacity is that of `upper`.
    fn mixed<V: Lanes>(
        upper: Self::Decoded<V>,
        lower: &Self::Decoded<V>,
        share: V,
    ) -> Self::Decoded<V>;

    /// Projects Gaussians whose scales grow by 2^`log2_factor` for each camera; gives their centres in the world, too,
    /// and what is drawn of them without harmonics.
    fn project<V: Lanes, const EYES: usize>(
        decoded: Self::Decoded<V>,
        log2_factor: V,
        frame: &Frame<V>,
        cameras: &[SplatCamera<V>; EYES],
    ) -> ([V; 3], [OnScreen<V>; EYES]);
}

impl<'a> Coding<'a> for Discs<'a> {
    type Decoded<V: Lanes> = Disc<V>;

    #[inline(always)]
    fn below(discs: Discs<'a>) -> Option<Self> {
        Some(discs)
    }

    #[inline(always)]
    fn words(&self, index: usize) -> [u32; 4] {
        Discs::words(self, index)
    }

    #[inline(always)]
    fn decode<V: Lanes>(
        &self,
        token: V::Token,
        words: [V::Words; 4],
        opacity: V,
        group: usize,
    ) -> Disc<V> {
        let layout = self.layout();
        let none = DiscGroup::default();
        let codes = layout.codes(
            #[inline(always)]
            |word, shift, mask| V::field(words[word], shift, mask),
        );
        let ranges = self.groups().get(group).unwrap_or(&none);
        let mut disc = ranges.disc_of_codes(
            &codes,
            layout.widths().angle,
            #[inline(always)]
            |x| V::splat(token, x),
        );
        if let Some(shape) = self.shape() {
            disc.log2_scale = shape.log2_scale(
                group,
                #[inline(always)]
                |shift, mask| V::field(words[3], shift, mask),
                #[inline(always)]
                |x| V::splat(token, x),
            );
        }
        Disc { opacity, ..disc }
    }

    #[inline(always)]
    fn mixed<V: Lanes>(upper: Disc<V>, lower: &Disc<V>, share: V) -> Disc<V> {
        mixed(&upper, lower, share)
    }

    #[inline(always)]
    fn project<V: Lanes, const EYES: usize>(
        disc: Disc<V>,
        log2_factor: V,
        frame: &Frame<V>,
        cameras: &[SplatCamera<V>; EYES],
    ) -> ([V; 3], [OnScreen<V>; EYES]) {
        let [s, t] = disc.log2_scale;
        let scales = [s + log2_factor, t + log2_factor];
        let ellipsoid = disc_on(frame, disc.position, disc.angle, scales);
        (ellipsoid.center, seen(&ellipsoid, disc.opacity, disc.color, cameras))
    }
}

impl<'a> Coding<'a> for Fulls<'a> {
    type Decoded<V: Lanes> = Full<V>;

    /// Only discs have levels.
    #[inline(always)]
    fn below(_: Discs<'a>) -> Option<Self> {
        None
    }

    #[inline(always)]
    fn words(&self, index: usize) -> [u32; 4] {
        let Some(record) = self.records.get(index) else { return [0; 4] };
        let ([x, y, z], [s, t, u]) =
            (record.position.map(|code| u32::from(code.get())), record.scale);
        let [luma, orange, green] = record.color;
        let third = z | u32::from(s) << 16 | u32::from(t) << 24;
        [x | y << 16, record.rotation.get(), third, u32::from_le_bytes([u, luma, orange, green])]
    }

    #[inline(always)]
    fn decode<V: Lanes>(
        &self,
        token: V::Token,
        [first, rotation, third, fourth]: [V::Words; 4],
        opacity: V,
        group: usize,
    ) -> Full<V> {
        let component = |shift: u32| V::field(rotation, shift, 0x3ff);
        let codes = Full {
            position: [
                V::field(first, 0, 0xffff),
                V::field(first, 16, 0xffff),
                V::field(third, 0, 0xffff),
            ],
            rotation: quaternion(
                V::field(rotation, 30, 3),
                [component(20), component(10), component(0)],
            ),
            log2_scale: [
                V::field(third, 16, 0xff),
                V::field(third, 24, 0xff),
                V::field(fourth, 0, 0xff),
            ],
            color: [
                V::field(fourth, 8, 0xff),
                V::field(fourth, 16, 0xff),
                V::field(fourth, 24, 0xff),
            ],
            opacity,
        };
        let none = FullGroup::default();
        self.groups.get(group).unwrap_or(&none).full_of_codes(
            &codes,
            #[inline(always)]
            |x| V::splat(token, x),
        )
    }

    /// Only discs have levels.
    #[inline(always)]
    fn mixed<V: Lanes>(upper: Full<V>, _: &Full<V>, _: V) -> Full<V> {
        upper
    }

    #[inline(always)]
    fn project<V: Lanes, const EYES: usize>(
        full: Full<V>,
        log2_factor: V,
        frame: &Frame<V>,
        cameras: &[SplatCamera<V>; EYES],
    ) -> ([V; 3], [OnScreen<V>; EYES]) {
        let scales = each(
            full.log2_scale,
            #[inline(always)]
            |scale| scale + log2_factor,
        );
        let ellipsoid = full_on(frame, full.position, full.rotation, scales);
        (ellipsoid.center, seen(&ellipsoid, full.opacity, full.color, cameras))
    }
}

/// The lanes' form of `dermis_format::quant::quaternion_value`, which says what the codes mean. `which`:
/// index of the component left out.
#[inline(always)]
fn quaternion<V: Lanes>(which: V, others: [V; 3]) -> [V; 4] {
    let constant = |x: f32| which.like(x);
    let step = constant(HALF_ROOT / COMPONENT_MIDDLE);
    let [a, b, c] = each(
        others,
        #[inline(always)]
        |code| (code - constant(COMPONENT_MIDDLE)) * step,
    );
    let rest = constant(1.0) - (a * a + b * b + c * c);
    let root = rest.at_least(constant(0.0)).sqrt();
    let before = |i: f32| which.below(constant(i));
    [
        V::select(before(1.0), root, a),
        V::select(before(1.0), a, V::select(before(2.0), root, b)),
        V::select(before(2.0), b, V::select(before(3.0), root, c)),
        V::select(before(3.0), c, root),
    ]
}

/// Gaussians of one group, on their way from the file to the screen.
pub struct Coded<'a, R> {
    len: usize,
    frames: FrameRows,
    words: [[u32; 4]; BATCH],
    /// At the level below, if there is one that they are on their way to.
    lower_words: [[u32; 4]; BATCH],
    opacity: [f32; BATCH],
    /// Whether `harmonics` are theirs: all of a group have some, or none has.
    has_harmonics: bool,
    harmonics: [Harmonics<'a>; BATCH],
    /// All of their block.
    records: R,
    /// The same at the level below.
    below: Option<R>,
    /// How far they have gone there, in [0, 1].
    share: f32,
    /// Index of their group.
    group: usize,
    /// Added to log₂ of the scales.
    log2_factor: f32,
}

impl<'a, R: Coding<'a>> Coded<'a, R> {
    /// None of a block's Gaussians, which are `records`.
    pub fn new(block: &Block<'a>, records: R) -> Self {
        Self {
            len: 0,
            frames: FrameRows::new(),
            words: [[0; 4]; BATCH],
            lower_words: [[0; 4]; BATCH],
            opacity: [0.0; BATCH],
            has_harmonics: !block.harmonics.is_empty(),
            harmonics: [Harmonics::default(); BATCH],
            records,
            below: block.below.and_then(R::below),
            share: 0.0,
            group: 0,
            log2_factor: 0.0,
        }
    }

    /// Whether there is room, and the place has the ranges of those that are here.
    #[inline(always)]
    pub fn takes(&self, place: &Place<'a, '_>) -> bool {
        self.len == 0 || self.len < BATCH && self.group == place.index / GROUP_LEN
    }

    /// Adds a Gaussian that [`Self::takes`], on the frame of these rows. Either all Gaussians of a
    /// `Coded` have a frame or none has; without, they stand in the world's.
    #[inline(always)]
    pub fn push(&mut self, place: &Place<'a, '_>, frame: Option<[&Row; 3]>) {
        let lane = self.len;
        if lane >= BATCH {
            return;
        }
        if lane == 0 {
            // All of a group have these alike.
            self.group = place.index / GROUP_LEN;
            self.log2_factor = place.log2_factor;
            self.share = place.share;
        }
        if let Some(frame) = frame {
            self.frames.set(lane, frame);
        }
        self.words[lane] = self.records.words(place.index);
        self.opacity[lane] = place.opacity;
        if self.has_harmonics {
            self.harmonics[lane] = place.harmonics();
        }
        if let Some(below) = &self.below {
            self.lower_words[lane] = below.words(place.index);
        }
        self.len = lane + 1;
    }

    /// Removes all.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Gaussians `at..at + V::LEN`, decoded.
    #[inline(always)]
    pub fn decode<V: Lanes>(&self, token: V::Token, at: usize) -> R::Decoded<V> {
        let opacity = load(token, &self.opacity, at);
        let words = words_at::<V>(token, &self.words, at);
        let decoded = self.records.decode(token, words, opacity, self.group);
        match &self.below {
            Some(below) => {
                let words = words_at::<V>(token, &self.lower_words, at);
                let lower = below.decode(token, words, opacity, self.group);
                R::mixed(decoded, &lower, V::splat(token, self.share))
            }
            None => decoded,
        }
    }
}

#[inline(always)]
fn words_at<V: Lanes>(token: V::Token, of: &[[u32; 4]], at: usize) -> [V::Words; 4] {
    V::load_word_rows(token, lanes_at::<_, V>(of, at))
}

impl<'a, R: Coding<'a>> Batch for Coded<'a, R> {
    fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn project<V: Lanes, const EYES: usize>(
        &self,
        token: V::Token,
        at: usize,
        cameras: &[SplatCamera<V>; EYES],
    ) -> [OnScreen<V>; EYES] {
        let decoded = self.decode(token, at);
        let frame = self.frames.load(token, at);
        let factor = V::splat(token, self.log2_factor);
        let (center, mut seen) = R::project(decoded, factor, &frame, cameras);
        for (seen, camera) in seen.iter_mut().zip(cameras) {
            seen.color = if self.has_harmonics {
                let harmonics = self.harmonics.get(at..self.len).unwrap_or(&[]);
                let direction = harmonics::direction(center, camera.view.eye);
                harmonics::color(seen.color, coefficients(token, harmonics), direction)
            } else {
                harmonics::not_below_zero(seen.color)
            };
        }
        seen
    }
}

/// Coefficient after coefficient of several Gaussians.
#[inline(always)]
fn coefficients<'a, V: Lanes + 'a>(
    token: V::Token,
    lanes: &'a [Harmonics<'_>],
) -> impl Iterator<Item = [V; 3]> + 'a
where
    V::Token: 'a,
{
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
