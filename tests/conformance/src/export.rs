//! The Gaussians of a case for those who draw them by themselves.

use crc32fast::Hasher;
use dermis_runtime::{Kernel, PosedGaussian, Sides};

use crate::cases::Case;
use crate::draw::{Error, pose};

/// Its column of the table.
pub const COLUMN: &str = "exported";

/// Words of a record.
const RECORD: usize = size_of::<PosedGaussian>() / 4;

/// CRC32 of the Gaussians of a case: those that its camera sees, then those of all sides.
pub fn export(
    case: &Case,
    kernel: Kernel,
    scratch: &mut [u32],
    records: &mut [u32],
) -> Result<u32, Error> {
    // Records are made of words.
    let records: &mut [PosedGaussian] =
        bytemuck::try_cast_slice_mut(records.as_chunks_mut::<RECORD>().0).unwrap_or_default();
    let eye = case.view.camera(case.size).position();
    pose(case, kernel, scratch, |posed, plan, _| {
        let mut hasher = Hasher::new();
        for sides in [Sides::Seen, Sides::All] {
            let written = posed.export(plan, eye, sides, records)?;
            let records = records.get(..written).unwrap_or(&[]);
            hasher.update(bytemuck::try_cast_slice(records).unwrap_or_default());
        }
        Ok(hasher.finalize())
    })
}
