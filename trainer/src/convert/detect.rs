//! What a file is, by its first bytes, or by its name where it has no mark.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use anyhow::{Context, Result, bail};

use super::{Kind, spz};

/// Headers of compressed PLYs name [`PACKED`] within so many bytes, or their comments are very long.
const START: u64 = 1 << 14;

/// Properties of compressed PLYs.
const PACKED: &[u8] = b" packed_position";

/// Tells what `file` is, which is then read from its start.
pub(super) fn kind(file: &mut File, path: &Path) -> Result<Kind> {
    let mut start = Vec::new();
    let again = "cannot be read; is it a file?";
    file.by_ref().take(START).read_to_end(&mut start).context(again)?;
    file.rewind().context(again)?;
    if start.starts_with(b"ply") {
        let is_packed = start.windows(PACKED.len()).any(|bytes| bytes == PACKED);
        return Ok(if is_packed { Kind::CompressedPly } else { Kind::Ply });
    }
    if start.starts_with(&spz::MAGIC) || start.starts_with(&spz::GZIP) {
        return Ok(Kind::Spz);
    }
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("splat")) {
        return Ok(Kind::Splat);
    }
    bail!(
        "is no PLY (\"ply\"), no SPZ (\"NGSP\" or gzip), and not called .splat; \
         give one of them, or say what it is with --from"
    )
}
