//! The memory that the runtime is lent: the board's second RAM.

use core::cell::UnsafeCell;

use dermis_conformance::{FRAME_WORDS, SCRATCH_WORDS};

struct Lent<T>(UnsafeCell<T>);

// SAFETY: one core without interrupts runs the program, and `take` is called once.
unsafe impl<T> Sync for Lent<T> {}

static SCRATCH: Lent<[u32; SCRATCH_WORDS]> = Lent(UnsafeCell::new([0; SCRATCH_WORDS]));
static FRAME: Lent<[u32; FRAME_WORDS]> = Lent(UnsafeCell::new([0; FRAME_WORDS]));

/// Scratch and frame.
///
/// # Safety
///
/// To be called once.
pub(crate) unsafe fn take() -> (&'static mut [u32], &'static mut [u32]) {
    // SAFETY: nothing else names the statics, and this is called once.
    unsafe { (&mut *SCRATCH.0.get(), &mut *FRAME.0.get()) }
}
