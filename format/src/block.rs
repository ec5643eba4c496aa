//! A block: a band of one region's nested order, self-contained.

use crate::discs::Discs;
use crate::error::{Error, malformed};
use crate::header::{FrameKind, Header, PerLevel, RecordKind};
use crate::order::{BLOCK_LEN, GROUP_LEN};
use crate::quant::{Full, Linear, last_code};
use crate::record::{BlockRecord, FullGroup, FullRecord, ShortRange, plane, take_plane};
use crate::triangles::Triangles;

/// Positions and log₂ scales beyond this are refused, so that no arithmetic of a reader overflows:
/// 2⁴¹ frame sizes.
const GREATEST_POSITION: f32 = 2.0e12;
/// Of x, y and ∛z of a disc.
const GREATEST_ROOTED: [f32; 3] = [GREATEST_POSITION, GREATEST_POSITION, 1.2e4];
const GREATEST_LOG2_SCALE: f32 = 41.0;
const GREATEST_COLOR: f32 = 2.0e3;
/// Ranges reach a little beyond what they hold, which is 1 at most.
const GREATEST_OPACITY: f32 = 2.0;

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
    /// Triangle of each Gaussian; empty without a mesh.
    pub triangles: Triangles<'a>,
    /// Each Gaussian.
    pub records: Records<'a>,
    /// Opacities of each Gaussian at the levels after its own layer, `later_levels` each.
    pub opacities: &'a [u8],
    /// Levels after the block's layer that have opacities of their own.
    pub later_levels: usize,
    /// Spherical harmonics of each Gaussian: i8 codes, coefficient by coefficient, (r, g, b) each.
    pub harmonics: &'a [i8],
    /// Where the block is seen between two levels ([`crate::walk`]), its Gaussians at the lower one.
    pub below: Option<Discs<'a>>,
}

/// Records of a block.
#[derive(Clone, Copy, Debug)]
pub enum Records<'a> {
    /// Discs.
    Disc(Discs<'a>),
    /// Gaussians with rotation and three scales.
    Full(Fulls<'a>),
}

/// Gaussians with rotation and three scales.
#[derive(Clone, Copy, Debug)]
pub struct Fulls<'a> {
    /// Ranges of 256 Gaussians each, in a row.
    pub groups: &'a [FullGroup],
    /// Each Gaussian.
    pub records: &'a [FullRecord],
}

impl<'a> Fulls<'a> {
    fn split(bytes: &'a [u8], len: usize) -> Option<(Self, &'a [u8])> {
        let (groups, rest) = take_plane(bytes, len.div_ceil(GROUP_LEN))?;
        let (records, rest) = take_plane(rest, len)?;
        Some((Self { groups, records }, rest))
    }

    /// Gaussian `index`, decoded.
    #[inline]
    pub fn get(&self, index: usize) -> Option<Full> {
        Some(self.groups.get(index / GROUP_LEN)?.full(self.records.get(index)?))
    }

    /// All of them, decoded.
    pub fn iter(&self) -> impl Iterator<Item = Full> + '_ {
        (0..self.records.len()).filter_map(|index| self.get(index))
    }
}

impl<'a> Block<'a> {
    /// Splits a block's payload into planes. Lengths are checked, numbers are not.
    pub(crate) fn split(payload: &'a [u8], header: &Header) -> Option<Self> {
        let (head, rest) = split_head(payload)?;
        let count = u32::from(head.count.get());
        let n = count as usize;
        let (triangles, rest) = match header.frame {
            FrameKind::World => (Triangles::default(), rest),
            _ => Triangles::split(rest, count)?,
        };
        let (records, rest) = match header.record {
            RecordKind::Disc => {
                Discs::split(rest, n).map(|(discs, rest)| (Records::Disc(discs), rest))?
            }
            RecordKind::Full => {
                Fulls::split(rest, n).map(|(fulls, rest)| (Records::Full(fulls), rest))?
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
        let valid = match &self.records {
            Records::Disc(discs) => have_valid_ranges(discs),
            Records::Full(fulls) => fulls.groups.iter().all(is_valid_full_group),
        };
        if !valid {
            return malformed("block", "a range is not finite, descends or is too large");
        }
        if header.frame != FrameKind::World && !self.triangles.are_valid(header.triangles) {
            return malformed(
                "block",
                "its triangles are not as many as its Gaussians, one does not exist, or they descend",
            );
        }
        Ok(())
    }
}

/// The head of a block or a level, of 1 to 4,096 Gaussians, and what follows.
pub(crate) fn split_head(payload: &[u8]) -> Option<(&BlockRecord, &[u8])> {
    let (head, rest) = take_plane::<BlockRecord>(payload, 1)?;
    let head = head.first()?;
    (1..=BLOCK_LEN).contains(&head.count.get().into()).then_some((head, rest))
}

/// Whether every number of every group is finite and small enough.
pub(crate) fn have_valid_ranges(discs: &Discs<'_>) -> bool {
    let widths = discs.layout().widths();
    let all = |ranges: &[ShortRange; 3], widths: [u8; 3], limits: [f32; 3]| {
        let pairs = ranges.iter().zip(widths).zip(limits);
        pairs.into_iter().all(|((range, width), limit)| range.is_within(last_code(width), limit))
    };
    discs.groups().iter().all(|group| {
        all(&group.position, widths.position, GREATEST_ROOTED)
            && all(&group.color, widths.color, [GREATEST_COLOR; 3])
            && group.log2_scale.is_within(last_code(widths.scale), GREATEST_LOG2_SCALE)
            && group.opacity.is_within(last_code(widths.opacity), GREATEST_OPACITY)
    })
}

fn is_valid_full_group(group: &FullGroup) -> bool {
    group.position.iter().all(|range| range.is_within(u16::MAX, GREATEST_POSITION))
        && group.log2_scale.is_within(255, GREATEST_LOG2_SCALE)
        && group.color.iter().all(|range| range.is_within(255, GREATEST_COLOR))
        && group.harmonics_step.get().abs() <= GREATEST_COLOR
}
