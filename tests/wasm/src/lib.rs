//! The conformance set for a host of WebAssembly: `run.mjs` walks cases × columns of the table by index.
//!
//! It needs neither imports nor a heap: a module of these exports and a memory.
#![no_std]

use core::cell::UnsafeCell;
use core::panic::PanicInfo;

use dermis_conformance::{
    CASES, Case, FRAME_WORDS, Format, How, Kernel, Outcome, SCRATCH_WORDS, check, check_export,
};

struct Lent<T>(UnsafeCell<T>);

// SAFETY: a module without shared memory has one thread.
unsafe impl<T> Sync for Lent<T> {}

static SCRATCH: Lent<[u32; SCRATCH_WORDS]> = Lent(UnsafeCell::new([0; SCRATCH_WORDS]));
static FRAME: Lent<[u32; FRAME_WORDS]> = Lent(UnsafeCell::new([0; FRAME_WORDS]));

fn case(index: usize) -> Option<&'static Case> {
    CASES.get(index)
}

/// How many cases there are.
// SAFETY: no other symbol of the module has this name; so below.
#[unsafe(no_mangle)]
pub extern "C" fn cases() -> usize {
    CASES.len()
}

/// How many columns the table has: formats, then exported Gaussians.
// SAFETY: as for `cases`.
#[unsafe(no_mangle)]
pub extern "C" fn columns() -> usize {
    Format::ALL.len() + 1
}

/// Where the name of a case begins.
// SAFETY: as for `cases`.
#[unsafe(no_mangle)]
pub extern "C" fn name(index: usize) -> *const u8 {
    case(index).map_or("", |case| case.name).as_ptr()
}

/// Bytes of the name of a case.
// SAFETY: as for `cases`.
#[unsafe(no_mangle)]
pub extern "C" fn name_len(index: usize) -> usize {
    case(index).map_or("", |case| case.name).len()
}

/// Whether the packed avatar unpacks to the bytes of the file.
// SAFETY: as for `cases`.
#[unsafe(no_mangle)]
pub extern "C" fn unpacks() -> bool {
    // SAFETY: as in `draw`.
    let frame = unsafe { &mut *FRAME.0.get() };
    dermis_conformance::unpacks(frame) == Ok(true)
}

/// Draws a case in the format of a column, or exports it. The upper word is 0 if it comes out as in the
/// table, 1 if it does not, 2 if the runtime refused it, 3 if there is no such case or column; the lower
/// one is the CRC32.
// SAFETY: as for `cases`.
#[unsafe(no_mangle)]
pub extern "C" fn draw(index: usize, column: usize) -> u64 {
    let Some(case) = case(index) else { return 3 << 32 };
    // SAFETY: there is one thread, and nothing that is called here comes back to `draw`.
    let (scratch, frame) = unsafe { (&mut *SCRATCH.0.get(), &mut *FRAME.0.get()) };
    let kernel = Kernel::baseline();
    let outcome = match Format::ALL.get(column) {
        Some(&format) => check(case, &How { format, bands: 1, kernel }, scratch, frame),
        None if column == Format::ALL.len() => check_export(case, kernel, scratch, frame),
        None => return 3 << 32,
    };
    match outcome {
        Outcome::Same(crc) => u64::from(crc),
        Outcome::Other { found, .. } => 1 << 32 | u64::from(found),
        Outcome::Failed(_) => 2 << 32,
    }
}

#[panic_handler]
fn panicked(_: &PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}
