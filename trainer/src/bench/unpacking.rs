//! The time that unpacking takes.

use anyhow::Result;
use dermis_format::packed::{Unpacker, pack};
use dermis_format::section::holds_gaussians;
use dermis_runtime::Avatar;
use serde::Serialize;

use super::clock::{Clock, median};

/// Times of one thread, medians.
#[derive(Clone, Debug, Serialize)]
pub struct Unpacking {
    /// Of the file.
    pub bytes: usize,
    /// Of its packed form.
    pub packed_bytes: usize,
    /// In the file.
    pub gaussians: u32,
    /// All of it, checksums included, ms.
    pub ms: f64,
    /// Blocks and levels alone, ms.
    pub gaussians_ms: f64,
    /// Gaussians by the time of blocks and levels.
    pub gaussians_per_second: f64,
}

/// Packs an avatar and unpacks it `runs` times, after once that does not count.
///
/// # Errors
///
/// Where the clock fails.
pub fn measure(avatar: &Avatar<'_>, runs: u32) -> Result<Unpacking> {
    let packed = pack(avatar.bytes())?;
    let mut file = vec![0; avatar.bytes().len()];
    let (mut all, mut of_gaussians) = (Vec::new(), Vec::new());
    for run in 0..=runs {
        let (mut unpacker, start) = Clock::ONE_THREAD.time(|| Unpacker::new(&packed, &mut file))?;
        let (mut total, mut gaussians) = (start, 0.0);
        loop {
            let done = unpacker.done().len();
            let (more, ms) = Clock::ONE_THREAD.time(|| unpacker.next_section())?;
            total += ms;
            let written = unpacker.done().get(done..).and_then(<[u8]>::first_chunk);
            if written.copied().is_some_and(holds_gaussians) {
                gaussians += ms;
            }
            if !more {
                break;
            }
        }
        if run > 0 {
            all.push(total);
            of_gaussians.push(gaussians);
        }
    }
    let (ms, gaussians_ms) = (median(all), median(of_gaussians));
    let gaussians = avatar.header().gaussians;
    Ok(Unpacking {
        bytes: avatar.bytes().len(),
        packed_bytes: packed.len(),
        gaussians,
        ms,
        gaussians_ms,
        gaussians_per_second: f64::from(gaussians) / gaussians_ms * 1e3,
    })
}
