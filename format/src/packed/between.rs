//! What is known of a block's discs from two blocks that came before and stand on either side of them.
//!
//! Where a layer is dealt to its blocks in turn, disc i of a block stands on the surface between disc i of one block and
//! disc i, or i + 1, of another: mostly on the same triangle, of much the same size and colour.

use core::ops::Range;

use crate::bits::{chunk, mask};
use crate::block::{Block, Records};
use crate::discs::{DiscLayout, Discs};
use crate::header::Header;
use crate::quant::last_code;
use crate::record::DiscWidths;
use crate::section::{Sections, split_header, tag};
use crate::triangles::Triangles;

use super::columns::fields;
use super::earlier::{ANGLE, group_at, range};
use super::predict::BATCH;

/// Blocks of the same region, each by how many blocks before the one that is coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sides {
    pub(super) low: u32,
    pub(super) high: u32,
    /// Whether disc i + 1 of the upper one is the neighbour of disc i.
    pub(super) next: bool,
}

/// Bits of [`Sides`]: each block's.
pub(super) const BACK_BITS: u32 = 8;

/// The blocks on either side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbours<'a> {
    low: (Triangles<'a>, Discs<'a>),
    high: (Triangles<'a>, Discs<'a>),
    /// Discs of the upper one before the first neighbour.
    skipped: usize,
}

impl<'a> Neighbours<'a> {
    /// Blocks of a region in the file `before` a section; `None` if it has no such blocks of discs.
    pub(super) fn find(
        before: &'a [u8],
        header: &Header,
        region: u8,
        sides: Sides,
    ) -> Option<Self> {
        let (_, sections) = split_header(before).ok()?;
        let is_of_region = |payload: &[u8]| payload.first() == Some(&region);
        let blocks = || {
            let payloads = Sections::new(sections).filter(|section| section.tag == tag::BLOCK);
            payloads.map(|section| section.payload).filter(|payload| is_of_region(payload))
        };
        let count = blocks().count();
        let [low, high] = [sides.low, sides.high].map(|back| count.wrapping_sub(back as usize));
        let (mut of_low, mut of_high) = (None, None);
        for (index, payload) in blocks().enumerate() {
            if index == low {
                of_low = Some(payload);
            }
            if index == high {
                of_high = Some(payload);
            }
        }
        let discs = |payload| {
            let block = Block::split(payload, header)?;
            match block.records {
                Records::Disc(discs) => Some((block.triangles, discs)),
                Records::Full(_) => None,
            }
        };
        Some(Self { low: discs(of_low?)?, high: discs(of_high?)?, skipped: sides.next.into() })
    }

    /// Triangles on either side of each disc, as far as both blocks have some.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [u32; 2]> + use<'a> {
        let (low, high) = (self.low.0.iter(), self.high.0.iter().skip(self.skipped));
        low.zip(high).map(|(low, high)| [low, high])
    }

    /// What is known of the discs, whose ranges stand at byte `groups` of their payload, if records are alike.
    pub(super) fn discs(&self, groups: usize, widths: DiscWidths) -> Option<Between<'a>> {
        let (layout, [low, high]) = (DiscLayout::new(widths)?, [self.low.1, self.high.1]);
        let same = low.layout() == layout && high.layout() == layout;
        same.then_some(Between { low, high, skipped: self.skipped, layout, groups })
    }
}

/// Discs on either side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Between<'a> {
    low: Discs<'a>,
    high: Discs<'a>,
    skipped: usize,
    /// Everywhere.
    layout: DiscLayout,
    /// Where the ranges stand in the payload that is coded.
    groups: usize,
}

/// Numbers of a disc that are like those on either side: angle, scales and colours, side by side in a record.
pub(super) const ALIKE: Range<usize> = ANGLE..ANGLE + COUNT;
/// How many they are.
const COUNT: usize = 6;

/// The same numbers of a batch of discs.
pub(super) type Alike = [[u8; BATCH]; COUNT];

impl Between<'_> {
    /// The codes half way between the neighbours of a batch of discs; 0 where there are none.
    pub(super) fn predict(&self, payload: &[u8], batch: usize) -> Alike {
        let first = batch * BATCH;
        let both = self.low.len().min(self.high.len().saturating_sub(self.skipped));
        let both = both.saturating_sub(first).min(BATCH);
        let fields = self.fields();
        let low = take(self.low, &fields, first, both);
        let high = take(self.high, &fields, first + self.skipped, both);
        let mut codes = [[0; BATCH]; COUNT];
        for ((((low, high), codes), number), (_, width)) in
            low.iter().zip(&high).zip(&mut codes).zip(ALIKE).zip(fields)
        {
            if number == ANGLE {
                halve_angles(low, high, width, codes);
            } else {
                // The last neighbour may be of the next group.
                let map = |group| self.map(payload, batch, group, number, width);
                let [map, map_of_last] = [map(batch), map(batch + self.skipped)];
                let ([low @ .., low_of_last], [high @ .., high_of_last], [codes @ .., last]) =
                    (low, high, &mut *codes);
                for ((&low, &high), code) in low.iter().zip(high).zip(codes) {
                    *code = map.apply(low, high);
                }
                *last = map_of_last.apply(*low_of_last, *high_of_last);
            }
            codes.iter_mut().skip(both).for_each(|code| *code = 0);
        }
        codes
    }

    /// First bit and width of each number that is alike.
    fn fields(&self) -> [(u32, u32); COUNT] {
        let [_, _, _, angle, s, t, luma, orange, green, _] = fields(self.layout);
        [angle, s, t, luma, orange, green]
    }

    /// What takes codes of a group of the lower block and one of the upper block to those of the payload's group.
    fn map(&self, payload: &[u8], group: usize, high: usize, number: usize, width: u32) -> Middle {
        let here = group_at(payload, self.groups, group);
        let sides = (self.low.groups().get(group), self.high.groups().get(high));
        let (Some(here), (Some(low), Some(high))) = (here, sides) else {
            return Middle::default();
        };
        Middle::new([here, low, high].map(|group| range(group, number)), last_code(width as u8))
    }
}

/// Codes of `count` discs, from one on; 0 of the others.
#[inline(always)]
fn take(discs: Discs<'_>, fields: &[(u32, u32); COUNT], first: usize, count: usize) -> Alike {
    let [(start, _), ..] = *fields;
    // They stand side by side, in 48 bits at most.
    let fields = fields.map(|(bit, width)| (bit.wrapping_sub(start) & 63, mask(width)));
    let stride = discs.layout().bits() as usize;
    let mut at = first * stride + start as usize;
    let mut all = [[0; BATCH]; COUNT];
    for i in 0..count.min(BATCH) {
        let word = u64::from_le_bytes(chunk(discs.records(), at / 8)) >> (at % 8);
        for (codes, (shift, mask)) in all.iter_mut().zip(fields) {
            codes[i] = ((word >> shift) as u32 & mask) as u8;
        }
        at += stride;
    }
    all
}

/// Half way between angles of a quarter turn, by the way round that is shorter.
#[inline(always)]
fn halve_angles(low: &[u8; BATCH], high: &[u8; BATCH], width: u32, codes: &mut [u8; BATCH]) {
    let spare = 8u32.wrapping_sub(width) & 7;
    for ((low, high), code) in low.iter().zip(high).zip(codes) {
        let way = (high.wrapping_sub(*low) << spare) as i8 >> spare >> 1;
        *code = low.wrapping_add(way as u8);
    }
}

/// The code half way between two, in whole numbers: for machines without many lanes of f32. From 2.5 below what is half way to
/// 0.5 above it, give or take what f32 rounds, where ranges on either side have up to 255 times the step.
#[derive(Clone, Copy, Debug, Default)]
struct Middle {
    /// In 1/256 of a code.
    low: i16,
    high: i16,
    /// And a half, to round.
    offset: i32,
    last: u16,
}

/// What a code is in the arithmetic of [`Middle`].
const UNIT_BITS: u32 = 8;

impl Middle {
    /// Of offsets and steps of the codes wanted, of the lower ones and of the upper ones. What is no number is 0.
    fn new([(to, step), (low, low_step), (high, high_step)]: [(f32, f32); 3], last: u16) -> Self {
        let half = (1 << UNIT_BITS) as f32 * 0.5 / step;
        Self {
            low: (low_step * half) as i16,
            high: (high_step * half) as i16,
            offset: ((low + high - (to + to) + step) * half) as i32,
            last,
        }
    }

    #[inline(always)]
    fn apply(&self, low: u8, high: u8) -> u8 {
        let [low, high] = [(low, self.low), (high, self.high)]
            .map(|(code, scale)| i32::from(code) * i32::from(scale));
        let middle = low.wrapping_add(high).wrapping_add(self.offset) >> UNIT_BITS;
        middle.clamp(0, self.last.into()) as u8
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// The domain and the bounds that [`Middle`] states.
        #[test]
        fn codes_are_half_way(
            [to, low, high] in prop::array::uniform3(-4.0f32..4.0),
            step in 0.01f32..1.0,
            [low_step, high_step] in prop::array::uniform2((-8.0f32..7.99).prop_map(f32::exp2)),
            codes in prop::array::uniform2(any::<u8>()),
            width in 1u8..=8,
        ) {
            let last = last_code(width);
            let ranges = [(to, step), (low, low_step * step), (high, high_step * step)];
            let found = Middle::new(ranges, last).apply(codes[0], codes[1]);
            let value = |(offset, step): (f32, f32), code: u8| {
                f64::from(offset) + f64::from(step) * f64::from(code)
            };
            let half_way = 0.5 * (value(ranges[1], codes[0]) + value(ranges[2], codes[1]));
            let exact = (half_way - f64::from(to)) / f64::from(step);
            let off = f64::from(found) - exact.clamp(0.0, last.into());
            // A half to round, and 2 · 255 / 256 and 1 / 256 cut off.
            prop_assert!((-2.51..=0.51).contains(&off), "{off}");
        }

        #[test]
        fn angles_go_the_shorter_way(low in any::<u8>(), high in any::<u8>(), width in 1u32..=8) {
            let turn = 1i32 << width;
            let [low, high] = [low, high].map(|code| i32::from(code) % turn);
            let mut codes = [0; BATCH];
            halve_angles(&[low as u8; BATCH], &[high as u8; BATCH], width, &mut codes);
            let found = i32::from(codes[0]) % turn;
            let apart = |a: i32, b: i32| (a - b).rem_euclid(turn).min((b - a).rem_euclid(turn));
            let whole = apart(low, high);
            prop_assert!(apart(found, low) <= (whole + 1) / 2 && apart(found, high) <= (whole + 1) / 2);
        }
    }

    #[test]
    fn no_ranges_are_code_0_and_none_overflow() {
        for ranges in
            [[(0.0, 0.0); 3], [(f32::MAX, 1e-30); 3], [(0.0, -0.0), (1.0, 1.0), (-1.0, 1.0)]]
        {
            let middle = Middle::new(ranges, 255);
            for code in 0..=255 {
                let _ = middle.apply(code, 255 - code);
            }
        }
        assert_eq!(Middle::new([(0.0, 0.0); 3], 255).apply(9, 7), 0);
    }
}
