//! The conformance set on a bare Cortex-M4F.
//!
//! 1. [`start`] brings the processor from reset to [`dermis_conformance_main`].
//! 2. [`memory`] is what the runtime is lent.
//! 3. [`host`] prints and exits through the debugger's semihosting.
//!
//! It prints each case and the CRC32 of its frame, and of its exported Gaussians, and exits with the number
//! of those that differ from the table.
#![no_std]
#![no_main]

mod host;
mod memory;
mod start;

use core::panic::PanicInfo;

use dermis_conformance::draw::run_at_once;
use dermis_conformance::{
    CASES, Case, File, Format, How, Kernel, Outcome, check, check_export, digest, export, unpacks,
};

/// Exit code of a panic.
const PANICKED: u32 = 101;

/// Draws every case in every format.
// SAFETY: no other symbol of the program has this name.
#[unsafe(no_mangle)]
extern "C" fn dermis_conformance_main() -> ! {
    // SAFETY: this is the program's entry, and calls it once.
    let (scratch, frame) = unsafe { memory::take() };
    let mut others = 0;
    for &file in File::ALL {
        others += u32::from(digest(file).is_err());
    }
    others += u32::from(unpacks(frame) != Ok(true));
    for &format in Format::ALL {
        // Two bands, so that the offsets of a second one are walked here, too.
        let how = How { format, bands: 2, kernel: Kernel::baseline() };
        for case in CASES {
            let outcome = check(case, &how, scratch, frame);
            let at_once = run_at_once(case, &how, scratch, frame);
            let same = matches!(outcome, Outcome::Same(crc) if at_once == Ok(crc));
            others += u32::from(!same);
            print(case, format.name(), outcome, same);
        }
    }
    for case in CASES {
        let outcome = check_export(case, Kernel::baseline(), scratch, frame);
        let same = matches!(outcome, Outcome::Same(_));
        others += u32::from(!same);
        print(case, export::COLUMN, outcome, same);
    }
    #[cfg(feature = "panic_control")]
    host::print_hex(scratch[frame[0] as usize % 256 * 65_536]);
    // Of a process' exit code a byte is left.
    host::exit(if others < 100 { others } else { 100 })
}

fn print(case: &Case, column: &str, outcome: Outcome, same: bool) {
    host::print(case.name);
    host::print(" ");
    host::print(column);
    host::print(if same { " " } else { " OTHER " });
    match outcome {
        Outcome::Same(crc) | Outcome::Other { found: crc, .. } => host::print_hex(crc),
        Outcome::Failed(_) => host::print("FAILED"),
    }
    host::print("\n");
}

/// Never reached: `.ci/no_panic` shows that nothing leads here.
#[panic_handler]
fn panicked(_: &PanicInfo<'_>) -> ! {
    host::exit(PANICKED)
}
