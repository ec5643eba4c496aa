//! Batches of Gaussians as the file has them: codes of one group's ranges.

use core::marker::PhantomData;

use dermis_format::quant::{COMPONENT_MIDDLE, HALF_ROOT};
use dermis_format::record::{DiscRecord, FullRecord, GroupRecord};
use dermis_format::{Disc, Full, Records};

use crate::batch::{BATCH, Batch, FrameRows, OnScreen};
use crate::frame::Frame;
use crate::gaussian::{disc_on, full_on};
use crate::harmonics;
use crate::lanes::{Lanes, MAX_LANES, Row, lanes_at, load};
use crate::math::each;
use crate::mix::mixed;
use crate::project::project;
use crate::screen::SplatCamera;
use crate::select::{Below, Harmonics, Place};

/// Codes of a Gaussian, and what they mean.
pub trait Record: Sized {
    /// One Gaussian, or several side by side.
    type Decoded<V: Lanes>;

    /// The records of a block, if they are of this kind.
    fn all<'a>(records: &Records<'a>) -> &'a [Self];

    /// All codes but the opacity's.
    fn words(&self) -> [u32; 4];

    /// The Gaussians of the words of several records.
    fn decode<V: Lanes>(
        token: V::Token,
        words: [V::Words; 4],
        opacity: V,
        group: &GroupRecord,
    ) -> Self::Decoded<V>;

    /// Gaussians on their way from `upper` to `lower`, of which `share` is gone; the opacity is that of `upper`.
    fn mixed<V: Lanes>(
        upper: Self::Decoded<V>,
        lower: &Self::Decoded<V>,
        share: V,
    ) -> Self::Decoded<V>;

    /// Projects Gaussians whose scales grow by 2^`log2_factor`; gives their centres in the world, too,
    /// and what is drawn of them without harmonics.
    fn project<V: Lanes>(
        decoded: Self::Decoded<V>,
        log2_factor: V,
        frame: &Frame<V>,
        camera: &SplatCamera<V>,
    ) -> ([V; 3], OnScreen<V>);
}

impl Record for DiscRecord {
    type Decoded<V: Lanes> = Disc<V>;

    #[inline(always)]
    fn all<'a>(records: &Records<'a>) -> &'a [Self] {
        match records {
            Records::Disc(discs) => discs,
            Records::Full(_) => &[],
        }
    }

    #[inline(always)]
    fn words(&self) -> [u32; 4] {
        let ([x, y, z], [s, t], [luma, orange, green]) = (self.position, self.scale, self.color);
        let first = u32::from_le_bytes([x, y, z, self.angle]);
        [first, u32::from_le_bytes([s, t, luma, orange]), green.into(), 0]
    }

    #[inline(always)]
    fn decode<V: Lanes>(
        token: V::Token,
        [first, second, third, _]: [V::Words; 4],
        opacity: V,
        group: &GroupRecord,
    ) -> Disc<V> {
        let byte = |words: V::Words, at: u32| V::field(words, 8 * at, 0xff);
        let codes = Disc {
            position: [byte(first, 0), byte(first, 1), byte(first, 2)],
            angle: byte(first, 3),
            log2_scale: [byte(second, 0), byte(second, 1)],
            color: [byte(second, 2), byte(second, 3), byte(third, 0)],
            opacity,
        };
        group.disc_of_codes(
            &codes,
            #[inline(always)]
            |x| V::splat(token, x),
        )
    }

    #[inline(always)]
    fn mixed<V: Lanes>(upper: Disc<V>, lower: &Disc<V>, share: V) -> Disc<V> {
        mixed(&upper, lower, share)
    }

    #[inline(always)]
    fn project<V: Lanes>(
        disc: Disc<V>,
        log2_factor: V,
        frame: &Frame<V>,
        camera: &SplatCamera<V>,
    ) -> ([V; 3], OnScreen<V>) {
        let [s, t] = disc.log2_scale;
        let scales = [s + log2_factor, t + log2_factor];
        let ellipsoid = disc_on(frame, disc.position, disc.angle, scales);
        let (projected, drawable) = project(&camera.view, camera.low_pass, &ellipsoid);
        let (opacity, color) = (disc.opacity, disc.color);
        (ellipsoid.center, OnScreen { projected, drawable, opacity, color })
    }
}

impl Record for FullRecord {
    type Decoded<V: Lanes> = Full<V>;

    #[inline(always)]
    fn all<'a>(records: &Records<'a>) -> &'a [Self] {
        match records {
            Records::Disc(_) => &[],
            Records::Full(fulls) => fulls,
        }
    }

    #[inline(always)]
    fn words(&self) -> [u32; 4] {
        let ([x, y, z], [s, t, u]) = (self.position.map(|code| u32::from(code.get())), self.scale);
        let [luma, orange, green] = self.color;
        let third = z | u32::from(s) << 16 | u32::from(t) << 24;
        [x | y << 16, self.rotation.get(), third, u32::from_le_bytes([u, luma, orange, green])]
    }

    #[inline(always)]
    fn decode<V: Lanes>(
        token: V::Token,
        [first, rotation, third, fourth]: [V::Words; 4],
        opacity: V,
        group: &GroupRecord,
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
        group.full_of_codes(
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
    fn project<V: Lanes>(
        full: Full<V>,
        log2_factor: V,
        frame: &Frame<V>,
        camera: &SplatCamera<V>,
    ) -> ([V; 3], OnScreen<V>) {
        let scales = each(
            full.log2_scale,
            #[inline(always)]
            |scale| scale + log2_factor,
        );
        let ellipsoid = full_on(frame, full.position, full.rotation, scales);
        let (projected, drawable) = project(&camera.view, camera.low_pass, &ellipsoid);
        let (opacity, color) = (full.opacity, full.color);
        (ellipsoid.center, OnScreen { projected, drawable, opacity, color })
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
    /// At the level below, if `below` says that they are on their way there.
    lower_words: [[u32; 4]; BATCH],
    below: Option<Below<'a>>,
    opacity: [f32; BATCH],
    /// Whether `harmonics` are theirs: all of a group have some, or none has.
    has_harmonics: bool,
    harmonics: [Harmonics<'a>; BATCH],
    /// Ranges of the codes; none if there are no Gaussians.
    group: Option<&'a GroupRecord>,
    /// Added to log₂ of the scales.
    log2_factor: f32,
    records: PhantomData<R>,
}

impl<'a, R: Record> Coded<'a, R> {
    /// None.
    pub fn new() -> Self {
        Self {
            len: 0,
            frames: FrameRows::new(),
            words: [[0; 4]; BATCH],
            lower_words: [[0; 4]; BATCH],
            below: None,
            opacity: [0.0; BATCH],
            has_harmonics: false,
            harmonics: [Harmonics::default(); BATCH],
            group: None,
            log2_factor: 0.0,
            records: PhantomData,
        }
    }

    /// Whether there is room, and the place has the ranges of those that are here.
    #[inline(always)]
    pub fn takes(&self, place: &Place<'a, '_>) -> bool {
        let same = self.group.is_none_or(|group| core::ptr::eq(group, place.group));
        self.len < BATCH && same
    }

    /// Adds a Gaussian that [`Self::takes`], on the frame of these rows. Either all Gaussians of a
    /// `Coded` have a frame or none has; without, they stand in the world's.
    #[inline(always)]
    pub fn push(&mut self, place: &Place<'a, '_>, frame: Option<[&Row; 3]>) {
        let Some(record) = R::all(&place.block.records).get(place.index) else { return };
        let lane = self.len;
        if lane >= BATCH {
            return;
        }
        if lane == 0 {
            // All of a group have these alike.
            self.group = Some(place.group);
            self.log2_factor = place.log2_factor;
            self.below = place.below;
            self.has_harmonics = !place.block.harmonics.is_empty();
        }
        if let Some(frame) = frame {
            self.frames.set(lane, frame);
        }
        self.words[lane] = record.words();
        self.opacity[lane] = place.opacity;
        if self.has_harmonics {
            self.harmonics[lane] = place.harmonics();
        } else if let Some(below) = &place.block.below
            && let Some(record) = R::all(&below.records).get(place.index)
        {
            // Only discs have levels, and they have no harmonics.
            self.lower_words[lane] = record.words();
        }
        self.len = lane + 1;
    }

    /// Removes all.
    pub fn clear(&mut self) {
        self.len = 0;
        self.group = None;
        self.below = None;
    }

    /// Gaussians `at..at + V::LEN`, decoded.
    #[inline(always)]
    pub fn decode<V: Lanes>(&self, token: V::Token, at: usize) -> R::Decoded<V> {
        let opacity = load(token, &self.opacity, at);
        let none = GroupRecord::default();
        let decoded = R::decode(
            token,
            words_at::<V>(token, &self.words, at),
            opacity,
            self.group.unwrap_or(&none),
        );
        match &self.below {
            Some(below) => {
                let lower = R::decode(
                    token,
                    words_at::<V>(token, &self.lower_words, at),
                    opacity,
                    below.group,
                );
                R::mixed(decoded, &lower, V::splat(token, below.share))
            }
            None => decoded,
        }
    }
}

#[inline(always)]
fn words_at<V: Lanes>(token: V::Token, of: &[[u32; 4]], at: usize) -> [V::Words; 4] {
    V::load_word_rows(token, lanes_at::<_, V>(of, at))
}

impl<R: Record> Default for Coded<'_, R> {
    fn default() -> Self {
        Self::new()
    }
}

impl<R: Record> Batch for Coded<'_, R> {
    fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn project<V: Lanes>(
        &self,
        token: V::Token,
        at: usize,
        camera: &SplatCamera<V>,
    ) -> OnScreen<V> {
        let decoded = self.decode(token, at);
        let frame = self.frames.load(token, at);
        let (center, seen) = R::project(decoded, V::splat(token, self.log2_factor), &frame, camera);
        let color = if self.has_harmonics {
            let harmonics = self.harmonics.get(at..self.len).unwrap_or(&[]);
            let direction = harmonics::direction(center, camera.view.eye);
            harmonics::color(seen.color, coefficients(token, harmonics), direction)
        } else {
            harmonics::not_below_zero(seen.color)
        };
        OnScreen { color, ..seen }
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
