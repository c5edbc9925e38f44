//! Copies of whole words, eight at a time: what the compiler moves structs by.

use core::arch::naked_asm;

/// Copies `bytes` from `from` to `to`, which do not overlap; both begin at a word.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __aeabi_memcpy4(to: *mut u8, from: *const u8, bytes: usize) {
    naked_asm!(
        "subs r2, r2, #32",
        "blo 3f",
        "push {{r4, r5, r6, r7, r8, r9}}",
        "2:",
        "ldm r1!, {{r3, r4, r5, r6, r7, r8, r9, r12}}",
        "subs r2, r2, #32",
        "stm r0!, {{r3, r4, r5, r6, r7, r8, r9, r12}}",
        "bhs 2b",
        "pop {{r4, r5, r6, r7, r8, r9}}",
        // What is left, less 32: five bits.
        "3:",
        "lsls r12, r2, #28",
        "bcc 4f",
        "ldr r3, [r1], #4",
        "str r3, [r0], #4",
        "ldr r3, [r1], #4",
        "str r3, [r0], #4",
        "ldr r3, [r1], #4",
        "str r3, [r0], #4",
        "ldr r3, [r1], #4",
        "str r3, [r0], #4",
        "4:",
        "bpl 5f",
        "ldr r3, [r1], #4",
        "str r3, [r0], #4",
        "ldr r3, [r1], #4",
        "str r3, [r0], #4",
        "5:",
        "lsls r12, r2, #30",
        "bcc 6f",
        "ldr r3, [r1], #4",
        "str r3, [r0], #4",
        "6:",
        "bpl 7f",
        "ldrh r3, [r1], #2",
        "strh r3, [r0], #2",
        "7:",
        "lsls r12, r2, #31",
        "it eq",
        "bxeq lr",
        "ldrb r3, [r1]",
        "strb r3, [r0]",
        "bx lr",
    )
}

/// The same; both begin at two words.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __aeabi_memcpy8(to: *mut u8, from: *const u8, bytes: usize) {
    naked_asm!("b {copy}", copy = sym __aeabi_memcpy4)
}
