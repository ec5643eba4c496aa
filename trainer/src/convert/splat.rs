//! `.splat`: 32 bytes for each Gaussian, and nothing else.
//!
//! | bytes | type | what |
//! |---|---|---|
//! | 0..12 | 3 f32 | centre |
//! | 12..24 | 3 f32 | standard deviations |
//! | 24..28 | 4 u8 | r, g, b, opacity in 1/255 |
//! | 28..32 | 4 u8 | quaternion w, x, y, z: (code − 128) / 128 |
//!
//! Axes are those of the PLY that it was made of: where that was a capture, x right, y down, z forward.

use std::io::BufRead;

use anyhow::{Context, Result, ensure};

use super::splats::{LeftOut, Splat, Splats};

/// Bytes of a Gaussian.
const RECORD: usize = 32;

/// Reads a file of `len` bytes.
pub(super) fn read(mut file: impl BufRead, len: u64) -> Result<(Splats, LeftOut)> {
    let count = len / RECORD as u64;
    ensure!(
        count > 0 && len.is_multiple_of(RECORD as u64),
        "its {len} bytes are no whole number of Gaussians, of {RECORD} bytes each; copy or export it \
         again, or say what it is with --from"
    );
    let (mut splats, mut left_out) = (Splats::default(), LeftOut::default());
    let mut record = [0; RECORD];
    for index in 0..count {
        file.read_exact(&mut record)
            .with_context(|| format!("ends in its Gaussian {index} of {count}; copy it again"))?;
        splats.push(&gaussian(&record), &mut left_out);
    }
    Ok((splats, left_out))
}

fn gaussian(record: &[u8; RECORD]) -> Splat<'static> {
    let (words, bytes) = record.split_at(24);
    let words = words.as_chunks::<4>().0;
    let float = |i: usize| f64::from(f32::from_le_bytes(words[i]));
    let share = |i: usize| f64::from(bytes[i]) / 255.0;
    let turn = |i: usize| (f64::from(bytes[4 + i]) - 128.0) / 128.0;
    Splat {
        position: [0, 1, 2].map(float),
        rotation: [0, 1, 2, 3].map(turn),
        log2_scale: [3, 4, 5].map(|i| libm::log2(float(i))),
        color: [0, 1, 2].map(share),
        opacity: share(3),
        harmonics: &[],
    }
}
