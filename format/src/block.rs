//! A block: a band of one region's nested order, self-contained.

use crate::error::{Error, malformed};
use crate::header::{FrameKind, Header, PerLevel, RecordKind};
use crate::level::split_groups;
use crate::order::BLOCK_LEN;
use crate::record::{DiscRecord, FullRecord, GroupRecord, U16, plane, take_plane};

/// Positions and log₂ scales beyond this are refused, so that no arithmetic of a reader overflows:
/// 2⁴⁰ frame sizes.
const GREATEST_POSITION: f32 = 1.0e12;
const GREATEST_LOG2_SCALE: f32 = 40.0;
const GREATEST_COLOR: f32 = 1.0e3;

/// A checked block.
#[derive(Clone, Copy, Debug)]
pub struct Block<'a> {
    /// Index of its region.
    pub region: u8,
    /// Index of its layer.
    pub layer: u8,
    /// Rank in the region's order of its first Gaussian.
    pub first: u32,
    /// Gaussians in it.
    pub count: u32,
    /// Ranges; their counts add up to `count`.
    pub groups: &'a [GroupRecord],
    /// Triangle of each Gaussian relative to its group; empty without a mesh.
    pub triangles: &'a [U16],
    /// Each Gaussian.
    pub records: Records<'a>,
    /// Opacities of each Gaussian at the levels after its own layer, `later_levels` each.
    pub opacities: &'a [u8],
    /// Levels after the block's layer that have opacities of their own.
    pub later_levels: usize,
    /// Spherical harmonics of each Gaussian: i8 codes, coefficient by coefficient, (r, g, b) each.
    pub harmonics: &'a [i8],
    /// Where the block is seen between two levels ([`crate::walk`]), its Gaussians at the lower one.
    pub below: Option<Below<'a>>,
}

/// The Gaussians of a block at another level: their triangles are the block's.
#[derive(Clone, Copy, Debug)]
pub struct Below<'a> {
    /// As many as the block's, of the same counts and base triangles.
    pub groups: &'a [GroupRecord],
    /// Each Gaussian.
    pub records: Records<'a>,
}

/// Records of a block.
#[derive(Clone, Copy, Debug)]
pub enum Records<'a> {
    /// Discs.
    Disc(&'a [DiscRecord]),
    /// Gaussians with rotation and three scales.
    Full(&'a [FullRecord]),
}

impl Records<'_> {
    /// The greatest code of a position.
    pub fn last_position_code(&self) -> u16 {
        match self {
            Self::Disc(_) => 255,
            Self::Full(_) => u16::MAX,
        }
    }
}

impl<'a> Block<'a> {
    /// Splits a block's payload into planes. Lengths are checked, numbers are not.
    pub(crate) fn split(payload: &'a [u8], header: &Header) -> Option<Self> {
        let (head, groups, rest) = split_groups(payload)?;
        let count = head.count.get();
        if count == 0 || count > BLOCK_LEN {
            return None;
        }
        let n = count as usize;
        let (triangles, rest) =
            take_plane(rest, if header.frame == FrameKind::World { 0 } else { n })?;
        let (records, rest) = match header.record {
            RecordKind::Disc => {
                take_plane(rest, n).map(|(plane, rest)| (Records::Disc(plane), rest))?
            }
            RecordKind::Full => {
                take_plane(rest, n).map(|(plane, rest)| (Records::Full(plane), rest))?
            }
        };
        let later_levels = if header.per_level == PerLevel::Opacity {
            usize::from(header.layers).checked_sub(usize::from(head.layer) + 1)?
        } else {
            0
        };
        let (opacities, rest) = take_plane(rest, n * later_levels)?;
        let harmonics = plane(rest)?;
        let block = Self {
            region: head.region,
            layer: head.layer,
            first: head.first.get(),
            count,
            groups,
            triangles,
            records,
            opacities,
            later_levels,
            harmonics,
            below: None,
        };
        (harmonics.len() == n * header.harmonics() * 3).then_some(block)
    }

    /// Checks every number.
    pub(crate) fn check(&self, header: &Header) -> Result<(), Error> {
        if self.region >= header.regions || self.layer >= header.layers {
            return malformed("block", "its region or layer does not exist");
        }
        let mut place = 0;
        for group in self.groups {
            let count = usize::from(group.count_less_one) + 1;
            if !has_valid_ranges(group, self.records.last_position_code()) {
                return malformed("block", "a range is not finite, descends or is too large");
            }
            if header.frame != FrameKind::World {
                let Some(triangles) = self.triangles.get(place..place + count) else {
                    return malformed("block", "its groups hold more Gaussians than the block");
                };
                let base = group.base_triangle.get();
                let furthest = triangles.iter().map(|t| t.get()).max().unwrap_or(0);
                if u64::from(base) + u64::from(furthest) >= u64::from(header.triangles) {
                    return malformed("block", "a Gaussian's triangle does not exist");
                }
            }
            place += count;
        }
        if place != self.count as usize {
            return malformed("block", "its groups do not add up to its Gaussians");
        }
        Ok(())
    }
}

/// Whether every number of a group is finite and small enough; positions have codes up to `last`.
pub(crate) fn has_valid_ranges(group: &GroupRecord, last: u16) -> bool {
    group.position.iter().all(|range| range.is_within(last, GREATEST_POSITION))
        && group.log2_scale.is_within(255, GREATEST_LOG2_SCALE)
        && group.color.iter().all(|range| range.is_within(255, GREATEST_COLOR))
        && group.harmonics_step.get().abs() <= GREATEST_COLOR
}
