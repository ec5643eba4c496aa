//! "The same bytes everywhere", shown: named cases whose frames have the same CRC32 on every target.
//!
//! No operating system, no heap, no formatting: what runs this may be a bare microcontroller.
//!
//! 1. [`avatars`] are bytes in the tree, so that neither training nor the encoder changes a frame.
//! 2. [`cases`] names what is drawn: avatar, pose ([`poses`]), plan, camera ([`cameras`]), size, background.
//! 3. [`draw`] draws a case into memory that the caller lends and gives the CRC32 of that memory;
//!    [`mod@export`] that of the Gaussians that another renderer would draw.
//! 4. [`how`] is all that a frame may be drawn with: the pixel format, and what must not show;
//!    [`mod@frame`] its memory in each format.
//! 5. [`expected`] is the table that every target must agree with, `crc32.txt`.
//! 6. [`unpacking`] does what a file comes to when it was packed.
//! 7. [`mod@digest`] reads the rest of a file, for those who look for panic paths.
//!
//! [`check`] and [`check_export`] do all of it for one case. Run it on this machine, and renew the table, with
//!
//! ```text
//! cargo test -p dermis-conformance
//! DERMIS_BLESS=1 cargo test -p dermis-conformance --test same_bytes
//! ```
//!
//! and on the targets that this machine can emulate with `.ci/targets`. A device under test never renews the table. There, this is all:
//!
//! ```
//! use dermis_conformance::*;
//!
//! // Of your memory; a small board lends less, and skips what fails for want of it: the greatest case takes 587 KB and a frame
//! // of 625 KB, the least 37 KB with its frame.
//! let (mut scratch, mut frame) = (vec![0; SCRATCH_WORDS], vec![0; FRAME_WORDS]);
//! for case in CASES {
//!     for &format in Format::ALL {
//!         let how = How { format, bands: 1, kernel: Kernel::baseline() };
//!         let outcome = check(case, &how, &mut scratch, &mut frame);
//!         assert!(matches!(outcome, Outcome::Same(_)), "{} {}: {outcome:?}", case.name, format.name());
//!     }
//!     let exported = check_export(case, Kernel::baseline(), &mut scratch, &mut frame);
//!     assert!(matches!(exported, Outcome::Same(_)), "{}: {exported:?}", case.name);
//! }
//! assert_eq!(unpacks(&mut frame), Ok(true)); // 72 KB of stack
//! ```
//!
//! `tests/bare_metal` is such a program for a Cortex-M4F (its `host.rs` and `start.rs` are QEMU's; replace them), `tests/wasm` one
//! for WebAssembly. For an avatar of your own `dermis render --json` tells the frame's CRC32, of its RGBA8 rows without padding.
#![no_std]

pub mod avatars;
pub mod cameras;
pub mod cases;
pub mod digest;
pub mod draw;
pub mod expected;
pub mod export;
pub mod frame;
pub mod how;
pub mod poses;
pub mod unpacking;

pub use avatars::File;
pub use cases::{CASES, Case};
pub use digest::digest;
pub use draw::{Error, FRAME_WORDS, SCRATCH_WORDS, run};
pub use how::{Format, How, Kernel};
pub use unpacking::unpacks;

/// What became of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Its frame has the CRC32 of the table.
    Same(u32),
    /// It has another one.
    Other {
        /// Of the frame.
        found: u32,
        /// Of the table; none where it has no such row or column.
        expected: Option<u32>,
    },
    /// It was not drawn.
    Failed(Error),
}

/// Draws a case and compares it with the table. [`SCRATCH_WORDS`] and [`FRAME_WORDS`] are enough
/// for every case.
pub fn check(case: &Case, how: &How, scratch: &mut [u32], frame: &mut [u32]) -> Outcome {
    outcome(case, how.format.name(), run(case, how, scratch, frame))
}

/// The same of the Gaussians that another renderer would draw.
pub fn check_export(
    case: &Case,
    kernel: Kernel,
    scratch: &mut [u32],
    records: &mut [u32],
) -> Outcome {
    outcome(case, export::COLUMN, export::export(case, kernel, scratch, records))
}

fn outcome(case: &Case, column: &str, found: Result<u32, Error>) -> Outcome {
    match found {
        Err(error) => Outcome::Failed(error),
        Ok(found) => match expected::crc32(case.name, column) {
            Some(expected) if expected == found => Outcome::Same(found),
            expected => Outcome::Other { found, expected },
        },
    }
}
