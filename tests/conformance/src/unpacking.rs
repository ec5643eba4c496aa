//! A packed avatar, unpacked.

use dermis_format::Error;
use dermis_format::packed::Unpacker;

use crate::avatars::File;

/// [`File::Leveled`], packed.
pub const PACKED: &[u8] = include_bytes!("../data/leveled.packed");
/// An avatar whose blocks take turns, packed: what it unpacks to follows from its checksums alone.
pub const TURNS: &[u8] = include_bytes!("../data/turns.packed");

/// Whether [`PACKED`] unpacks to the bytes of [`File::Leveled`], and [`TURNS`] to what its checksums say, in memory that the
/// caller lends; [`crate::FRAME_WORDS`] are enough.
pub fn unpacks(memory: &mut [u32]) -> Result<bool, Error> {
    unpacked(TURNS, memory)?;
    Ok(unpacked(PACKED, memory)? == File::Leveled.bytes())
}

/// What `packed` unpacks to, in front of `memory`.
fn unpacked<'m>(packed: &[u8], memory: &'m mut [u32]) -> Result<&'m [u8], Error> {
    let memory = bytemuck::cast_slice_mut(memory);
    let mut unpacker = Unpacker::new(packed, memory)?;
    while unpacker.next_section()? {}
    let len = unpacker.done().len();
    Ok(memory.get(..len).unwrap_or_default())
}
