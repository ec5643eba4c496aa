//! A packed avatar, unpacked.

use dermis_format::Error;
use dermis_format::packed::Unpacker;

use crate::avatars::File;

/// [`File::Leveled`], packed.
pub const PACKED: &[u8] = include_bytes!("../data/leveled.packed");

/// Whether [`PACKED`] unpacks to the bytes of [`File::Leveled`] in memory that the caller lends; [`crate::FRAME_WORDS`] are
/// enough.
pub fn unpacks(memory: &mut [u32]) -> Result<bool, Error> {
    let mut unpacker = Unpacker::new(PACKED, bytemuck::cast_slice_mut(memory))?;
    while unpacker.next_section()? {}
    Ok(unpacker.done() == File::Leveled.bytes())
}
