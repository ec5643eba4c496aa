//! Discs in a row to groups and records, and what becomes of them.

use core::iter;

use crate::quant::Disc;
use crate::record::{DiscRecord, GroupRecord};

use super::EncodeError;
use super::blocks::{disc_group, group_ends};

/// The discs of one block at one level; `triangles` are theirs, none without a mesh.
pub(super) fn disc_planes(
    triangles: &[u32],
    discs: &[Disc],
) -> Result<(Vec<GroupRecord>, Vec<DiscRecord>), EncodeError> {
    let (mut groups, mut records) = (Vec::new(), Vec::new());
    let mut start = 0;
    for end in group_ends(triangles, discs.len()) {
        let group = disc_group(&discs[start..end], triangles.get(start).copied().unwrap_or(0))?;
        records.extend(discs[start..end].iter().map(|disc| group.encode_disc(disc)));
        groups.push(group);
        start = end;
    }
    Ok((groups, records))
}

/// What a reader gets of the discs of one block, at one level: each number rounded to a code of the group's range, which
/// follows from all discs of the group. `triangles` are those of the discs, none without a mesh.
///
/// # Errors
///
/// Where a number is not finite.
pub fn stored(triangles: &[u32], discs: &[Disc]) -> Result<Vec<Disc>, EncodeError> {
    let (groups, records) = disc_planes(triangles, discs)?;
    let of_each = groups.iter().flat_map(|group| {
        let count = usize::from(group.count_less_one) + 1;
        iter::repeat_n(group, count)
    });
    Ok(of_each.zip(&records).map(|(group, record)| group.disc(record)).collect())
}
