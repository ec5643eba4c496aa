//! Semihosting: a breakpoint that the debugger, or the emulator, answers.

use core::arch::asm;

/// Prints a character: r1 points at it.
const SYS_WRITEC: u32 = 0x03;
/// Ends the program: r1 points at the reason and the exit code.
const SYS_EXIT_EXTENDED: u32 = 0x20;
/// The reason "the application is done".
const APPLICATION_EXIT: u32 = 0x20026;

fn call<T>(operation: u32, argument: &T) {
    // SAFETY: both operations only read what `argument` points at: a byte, or two words. The
    // answer in r0 is discarded.
    unsafe {
        asm!(
            "bkpt 0xAB",
            inout("r0") operation => _,
            in("r1") argument,
            options(nostack, preserves_flags)
        );
    }
}

/// Prints text.
pub(crate) fn print(text: &str) {
    text.bytes().for_each(|byte| call(SYS_WRITEC, &byte));
}

/// Prints eight hexadecimal digits.
pub(crate) fn print_hex(number: u32) {
    for shift in (0..32).step_by(4).rev() {
        let digit = (number >> shift & 15) as u8;
        call(SYS_WRITEC, &(if digit < 10 { b'0' + digit } else { b'a' - 10 + digit }));
    }
}

/// Ends the program with this exit code.
pub(crate) fn exit(code: u32) -> ! {
    loop {
        call(SYS_EXIT_EXTENDED, &[APPLICATION_EXIT, code]);
    }
}
