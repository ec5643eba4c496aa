//! From reset to Rust.

use core::arch::global_asm;

// The vector table, and what its first entry but one points at: the floating-point unit is switched
// on before any Rust runs, since that may hold floats in its registers from the first instruction on;
// then all statics are zeroed, and Rust takes over and never returns. Any fault ends the program with
// exit code 102 (semihosting's SYS_EXIT_EXTENDED, 0x20).
global_asm!(
    r#"
    .section .vectors, "a"
    .word __stack_top
    .word reset
    .rept 14
    .word fault
    .endr

    .section .text.reset, "ax"
    .global reset
    .type reset, %function
    .thumb_func
reset:
    ldr r0, =0xE000ED88
    ldr r1, [r0]
    orr r1, r1, #0x00F00000
    str r1, [r0]
    dsb
    isb
    ldr r0, =__bss_start
    ldr r1, =__bss_end
    movs r2, #0
1:  cmp r0, r1
    bhs 2f
    str r2, [r0], #4
    b 1b
2:  bl dermis_conformance_main

    .type fault, %function
    .thumb_func
fault:
    movs r0, #0x20
    ldr r1, =faulted
    bkpt 0xAB
    b fault

    .section .rodata.faulted, "a"
    .balign 4
faulted:
    .word 0x20026, 102
    "#
);
