//! A block: a band of one region's nested order, self-contained.

use crate::error::{Error, malformed};
use crate::header::{FrameKind, Header, RecordKind};
use crate::order::BLOCK_LEN;
use crate::record::{BlockRecord, DiscRecord, FullRecord, GroupRecord, U16, plane, take_plane};

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
}

/// Records of a block.
#[derive(Clone, Copy, Debug)]
pub enum Records<'a> {
    /// Discs.
    Disc(&'a [DiscRecord]),
    /// Gaussians with rotation and three scales.
    Full(&'a [FullRecord]),
}

impl<'a> Block<'a> {
    /// Splits a block's payload into planes. Lengths are checked, numbers are not.
    pub(crate) fn split(payload: &'a [u8], header: &Header) -> Option<Self> {
        let (head, rest) = take_plane::<BlockRecord>(payload, 1)?;
        let head = head.first()?;
        let count = head.count.get();
        if count == 0 || count > BLOCK_LEN {
            return None;
        }
        let n = count as usize;
        let (groups, rest) = take_plane(rest, usize::from(head.groups.get()))?;
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
        let later_levels = if header.opacity_per_level {
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
            let last = match self.records {
                Records::Disc(_) => 255,
                Records::Full(_) => u16::MAX,
            };
            let in_range =
                group.position.iter().all(|range| range.is_within(last, GREATEST_POSITION))
                    && group.log2_scale.is_within(255, GREATEST_LOG2_SCALE)
                    && group.color.iter().all(|range| range.is_within(255, GREATEST_COLOR))
                    && group.harmonics_step.get().abs() <= GREATEST_COLOR;
            if !in_range {
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
