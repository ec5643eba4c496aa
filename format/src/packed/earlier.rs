//! What is known of a disc at one level from its record at the level before.

use crate::block::{Block, Records};
use crate::discs::{DiscLayout, Discs, MOST_BITS};
use crate::header::Header;
use crate::level::Level;
use crate::quant::{Linear, last_code};
use crate::record::{BlockRecord, DiscGroup, DiscWidths, take_plane};
use crate::section::{Sections, split_header, tag};

use super::columns::fields;

/// One number of the same discs, as an earlier section has them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Earlier<'a> {
    /// The discs.
    pub(super) discs: Discs<'a>,
    /// Which of the ten.
    pub(super) number: usize,
    /// Where the ranges stand in the payload that is coded.
    pub(super) groups: usize,
    /// Its widths.
    pub(super) widths: DiscWidths,
}

/// The number of the angle among those of a disc.
pub(super) const ANGLE: usize = 3;

impl<'a> Earlier<'a> {
    /// The discs of a level as the last section before it has them; `None` if none does.
    pub(super) fn find(before: &'a [u8], header: &Header, head: &BlockRecord) -> Option<Discs<'a>> {
        let (_, sections) = split_header(before).ok()?;
        let same = |region: u8, first: u32, count: u32| {
            region == head.region
                && first == head.first.get()
                && count == u32::from(head.count.get())
        };
        let discs = |section: crate::section::Section<'a>| match section.tag {
            tag::BLOCK => {
                let block = Block::split(section.payload, header)?;
                match block.records {
                    Records::Disc(discs) => {
                        same(block.region, block.first, block.count).then_some(discs)
                    }
                    Records::Full(_) => None,
                }
            }
            _ => {
                let level = Level::split(section)?;
                same(level.region, level.first, level.count).then_some(level.discs)
            }
        };
        Sections::new(sections).filter_map(discs).last()
    }

    /// What takes codes of group `group` of the earlier record to those of the payload's.
    pub(super) fn map(&self, payload: &[u8], group: usize) -> CodeMap {
        let last = u32::from(last_code(self.width()));
        if self.number == ANGLE {
            // Codes differ by a power of two, and stand for the middles of their steps.
            let from = self.discs.layout().widths().angle;
            let scale = (1u32 << self.widths.angle) as f32 / (1u32 << from) as f32;
            return CodeMap { scale, offset: 0.5 * scale, last };
        }
        let here = group_at(payload, self.groups, group);
        let (Some(here), Some(there)) = (here, self.discs.groups().get(group)) else {
            return CodeMap { scale: 0.0, offset: 0.0, last };
        };
        let (from, step) = range(there, self.number);
        let (to, code) = range(here, self.number);
        CodeMap { scale: step / code, offset: (from - to) / code + 0.5, last }
    }

    /// First bit and width of the number in the earlier record.
    pub(super) fn field(&self) -> (u32, u32) {
        self.field_of(self.discs.layout())
    }

    fn field_of(&self, layout: DiscLayout) -> (u32, u32) {
        fields(layout).get(self.number).copied().unwrap_or_default()
    }

    fn width(&self) -> u8 {
        DiscLayout::new(self.widths).map_or(MOST_BITS, |layout| self.field_of(layout).1 as u8)
    }
}

/// Ranges of a group of a payload whose groups stand from byte `groups` on.
pub(super) fn group_at(payload: &[u8], groups: usize, group: usize) -> Option<&DiscGroup> {
    let at = groups + group * size_of::<DiscGroup>();
    take_plane::<DiscGroup>(payload.get(at..)?, 1)?.0.first()
}

/// Offset and step of a number other than the angle.
pub(super) fn range(group: &DiscGroup, number: usize) -> (f32, f32) {
    let ([x, y, z], [luma, orange, green]) = (group.position, group.color);
    let range = match number {
        0 => x,
        1 => y,
        2 => z,
        4 | 5 => group.log2_scale,
        6 => luma,
        7 => orange,
        8 => green,
        _ => group.opacity,
    };
    range.parts()
}

/// The nearest code of another range.
#[derive(Clone, Copy, Debug)]
pub(super) struct CodeMap {
    scale: f32,
    /// And a half, to round; of angles, half of what a code becomes.
    offset: f32,
    last: u32,
}

impl CodeMap {
    /// Where a code of the earlier range lies. What is no number is code 0.
    #[inline(always)]
    pub(super) fn apply(&self, code: u32) -> u32 {
        ((code as f32 * self.scale + self.offset) as u32).min(self.last)
    }
}
