//! Sums, products, quotients and comparisons of f64: of normal numbers in assembly, of all others by [`any`].
//!
//! A number is two words, sign and exponent with the upper 20 bits of its fraction in the second. They stay in place: where
//! the fraction of a sum carries into the exponent, that is right by itself. What lies below the last place is one word, and
//! rounds by the carry of its comparison with a half. Decision 57 has the reasons.

use core::arch::naked_asm;

use crate::any;

/// The exponents of a and b to r4 and r5; to 90 if a number is not normal.
macro_rules! normal_operands {
    () => {
        concat!(
            "movw r12, #0x7ff\n",
            "ands r4, r12, r1, lsr #20\n",
            "ittt ne\n",
            "andsne.w r5, r12, r3, lsr #20\n",
            "teqne r4, r12\n",
            "teqne r5, r12\n",
            "beq 90f\n"
        )
    };
}

/// b's digits, r5 < 32 places below a's, to a's places in r3 and r2, and to r6 what lies below them.
macro_rules! align {
    () => {
        concat!(
            "bfc r3, #20, #12\n",
            "orr r3, r3, #0x100000\n",
            "rsb lr, r5, #32\n",
            "lsl r6, r2, lr\n",
            "lsr r2, r2, r5\n",
            "lsl r12, r3, lr\n",
            "orr r2, r2, r12\n",
            "lsr r3, r3, r5\n"
        )
    };
}

/// To 9 if a number is infinite or NaN.
macro_rules! unless_exponent_is_greatest {
    () => {
        concat!(
            "lsl r12, r1, #1\n",
            "mvns r12, r12, asr #21\n",
            "it ne\n",
            "lslne r12, r3, #1\n",
            "it ne\n",
            "mvnsne.w r12, r12, asr #21\n",
            "beq 9f\n"
        )
    };
}

/// a − b.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __aeabi_dsub(a: u64, b: u64) -> u64 {
    naked_asm!("eor r3, r3, #0x80000000", "b {sum}", sum = sym __aeabi_dadd)
}

/// a + b.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __aeabi_dadd(a: u64, b: u64) -> u64 {
    naked_asm!(
        "push {{r4, r5, r6, lr}}",
        // The greater one first, by the upper words.
        "lsl r4, r1, #1",
        "lsl r5, r3, #1",
        "cmp r4, r5",
        "bhs 2f",
        "mov r6, r0",
        "mov r0, r2",
        "mov r2, r6",
        "mov r6, r1",
        "mov r1, r3",
        "mov r3, r6",
        "mov r6, r4",
        "mov r4, r5",
        "mov r5, r6",
        "2:",
        // Infinite or NaN.
        "mvns r6, r4, asr #21",
        "beq 90f",
        // Zero or subnormal.
        "lsrs r5, r5, #21",
        "beq 80f",
        // The difference of the exponents.
        "rsb r5, r5, r4, lsr #21",
        "cmp r5, #32",
        "bhs 50f",
        "teq r1, r3",
        "bmi 40f",
        align!(),
        "30:",
        "adds r0, r0, r2",
        "adc r2, r1, r3",
        "eor r12, r1, r2",
        "lsrs r12, r12, #20",
        "bne 35f",
        // To nearest: the carry is whether half a place is reached, and of just a half the last digit.
        "31:",
        "cmp r6, #0x80000000",
        "beq 33f",
        "32:",
        "adcs r0, r0, #0",
        "adc r1, r2, #0",
        "pop {{r4, r5, r6, pc}}",
        "33:",
        "lsrs r12, r0, #1",
        "b 32b",
        // 2 or more: the exponent gets one, and what is above it is halved.
        "35:",
        "lsr r12, r1, #20",
        "add r12, r12, #1",
        "sub lr, r2, r12, lsl #20",
        "and r5, r6, #1",
        "orr r6, r5, r6, lsr #1",
        "orr r6, r6, r0, lsl #31",
        "lsr r0, r0, #1",
        "orr r0, r0, lr, lsl #31",
        "lsr lr, lr, #1",
        "add r2, lr, r12, lsl #20",
        "lsl r12, r12, #21",
        "mvns r12, r12, asr #21",
        "bne 31b",
        // Too great.
        "mov r0, #0",
        "bfc r2, #0, #20",
        "mov r1, r2",
        "pop {{r4, r5, r6, pc}}",
        // Different signs.
        "40:",
        "cmp r5, #0",
        "beq 60f",
        align!(),
        "41:",
        "rsbs r6, r6, #0",
        "sbcs r0, r0, r2",
        "sbc r2, r1, r3",
        "eor r12, r1, r2",
        "lsrs r12, r12, #20",
        "beq 31b",
        // Less than 1: the exponent lacks the one that the leading bit is, which goes to its place.
        "ubfx r3, r2, #0, #20",
        "lsr r12, r2, #20",
        "42:",
        "clz r4, r3",
        "sub r4, r4, #11",
        // As far as the exponent reaches.
        "ubfx r5, r12, #0, #11",
        "cmp r4, r5",
        "it hi",
        "movhi r4, r5",
        "rsb lr, r4, #32",
        "lsl r3, r3, r4",
        "lsr r5, r0, lr",
        "orr r3, r3, r5",
        "lsl r0, r0, r4",
        "lsr r5, r6, lr",
        "orr r0, r0, r5",
        "lsl r6, r6, r4",
        "sub r12, r12, r4",
        // The upper word was empty.
        "cmp r4, #21",
        "beq 42b",
        "add r2, r3, r12, lsl #20",
        "b 31b",
        // Far apart: no more than a rounding, or nothing.
        "50:",
        "cmp r5, #54",
        "bhi 51f",
        "eor r4, r1, r3",
        "bfc r3, #20, #12",
        "orr r3, r3, #0x100000",
        "sub r5, r5, #32",
        "rsb lr, r5, #32",
        "lsl r6, r3, lr",
        "lsr r12, r2, r5",
        "orr r6, r6, r12",
        "lsls r12, r2, lr",
        "it ne",
        "orrne r6, r6, #1",
        "lsr r2, r3, r5",
        "mov r3, #0",
        "cmp r4, #0",
        "bpl 30b",
        "b 41b",
        "51:",
        "pop {{r4, r5, r6, pc}}",
        // Different signs, the same exponent: the leading bits are gone.
        "60:",
        "ubfx r4, r1, #0, #20",
        "ubfx r5, r3, #0, #20",
        "subs r0, r0, r2",
        "sbcs r3, r4, r5",
        "bhs 61f",
        "mov lr, #0",
        "rsbs r0, r0, #0",
        "sbc r3, lr, r3",
        "eor r1, r1, #0x80000000",
        "61:",
        "orrs r5, r0, r3",
        "beq 62f",
        "mov r6, #0",
        "lsr r12, r1, #20",
        "sub r12, r12, #1",
        "b 42b",
        "62:",
        "mov r1, #0",
        "pop {{r4, r5, r6, pc}}",
        // Zero is added: to a number, which remains as it is, or to zero, where both signs make one.
        "80:",
        "orrs r6, r2, r3, lsl #1",
        "bne 90f",
        "orrs r6, r0, r4",
        "it eq",
        "andeq r1, r1, r3",
        "pop {{r4, r5, r6, pc}}",
        "90:",
        "pop {{r4, r5, r6, lr}}",
        "b {any}",
        any = sym any::sum,
    )
}

/// a·b.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __aeabi_dmul(a: u64, b: u64) -> u64 {
    naked_asm!(
        "push {{r4, r5, r6, r7, r8, lr}}",
        // The product is to be normal, too.
        normal_operands!(),
        "add r4, r4, r5",
        "subw r4, r4, #1023",
        "cmp r4, #0x7f0",
        "bhs 90f",
        "eor r8, r1, r3",
        // 64 bits of one and 53 of the other: the upper two words of four are the result's 53 or 52.
        "lsl r1, r1, #11",
        "orr r1, r1, #0x80000000",
        "orr r1, r1, r0, lsr #21",
        "lsl r0, r0, #11",
        "bfc r3, #20, #12",
        "orr r3, r3, #0x100000",
        "umull r12, r5, r0, r2",
        "mov r6, #0",
        "umlal r5, r6, r1, r2",
        "umull r0, r2, r0, r3",
        "mov r7, #0",
        "adds r5, r5, r0",
        "adcs r6, r6, r2",
        "adc r7, r7, #0",
        "umlal r6, r7, r1, r3",
        "tst r7, #0x100000",
        "beq 30f",
        // The leading bit is one of the exponent.
        "20:",
        "and r8, r8, #0x80000000",
        "add r7, r7, r4, lsl #20",
        "orr r1, r7, r8",
        // See the sum.
        "cmp r5, #0x80000000",
        "beq 40f",
        "21:",
        "adcs r0, r6, #0",
        "adc r1, r1, #0",
        "pop {{r4, r5, r6, r7, r8, pc}}",
        // 52 bits; a subnormal number remains as it is.
        "30:",
        "cmp r4, #0",
        "beq 20b",
        "adds r12, r12, r12",
        "adcs r5, r5, r5",
        "adcs r6, r6, r6",
        "adc r7, r7, r7",
        "sub r4, r4, #1",
        "b 20b",
        // Half a place, if the lowest word is 0.
        "40:",
        "cmp r12, #1",
        "it lo",
        "lsrslo.w r12, r6, #1",
        "b 21b",
        "90:",
        "pop {{r4, r5, r6, r7, r8, lr}}",
        "b {any}",
        any = sym any::product,
    )
}

/// a/b.
///
/// With m and n the 53 bits of a and b: a reciprocal of n's upper 32 bits; by it the first digit of 32 bits, what it leaves, and a
/// second digit. What both leave, exactly, says whether the quotient is rounded up: a quotient of two numbers is never half way
/// between two others. So it need not be rounded down rightly before, but has to be off by less than half a place.
///
/// It is. The first reciprocal takes n's upper 16 bits plus one: it is too small by up to 1.25·2⁻¹⁵ of itself, and after one step of
/// Newton's method by up to 2.6·2⁻³⁰. The first digit is then too small by up to 17 of 2³². The second one counts with the upper
/// word of what is left, 128 units of 2⁻⁶⁴ a step, and by that reciprocal: both together are too small by up to 300 units. A place
/// of the quotient is 1024 units or, where m ≥ n, 2048.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __aeabi_ddiv(a: u64, b: u64) -> u64 {
    naked_asm!(
        "push {{r4, r5, r6, r7, r8, lr}}",
        // The quotient is to be normal, too.
        normal_operands!(),
        "sub r4, r4, r5",
        "addw r4, r4, #1021",
        "cmp r4, #0x7f0",
        "bhs 90f",
        "eor r8, r1, r3",
        "bfc r1, #20, #12",
        "orr r1, r1, #0x100000",
        "bfc r3, #20, #12",
        "orr r3, r3, #0x100000",
        // m/n is from 1 to 2, or from 1/2 to 1: r5 is a shift, and the exponent.
        "cmp r1, r3",
        "it eq",
        "cmpeq r0, r2",
        "ite hs",
        "movhs r5, #20",
        "movlo r5, #21",
        "add r4, r4, #21",
        "sub r4, r4, r5",
        // The reciprocal r7 = 2⁶³/r6: 15 bits, then by Newton's method 28.
        "lsl r6, r3, #11",
        "orr r6, r6, r2, lsr #21",
        "lsr r7, r6, #16",
        "add r7, r7, #1",
        "mvn r12, #0",
        "udiv r7, r12, r7",
        "lsl r7, r7, #15",
        "umull r12, lr, r7, r6",
        "rsb lr, lr, #0x80000000",
        "umull r12, lr, r7, lr",
        "add r7, r7, lr, lsl #1",
        // The first digit r12.
        "lsl r12, r1, #10",
        "orr r12, r12, r0, lsr #22",
        "umull lr, r12, r12, r7",
        "lsl r12, r12, #1",
        // What it leaves, 2³⁶·m − r12·2⁵·n, of which r6 is the upper word.
        "lsl r1, r3, #5",
        "orr r1, r1, r2, lsr #27",
        "lsl lr, r2, #5",
        "umull lr, r6, r12, lr",
        "mla r6, r12, r1, r6",
        "lsl r1, r0, #4",
        "rsbs lr, lr, #0",
        "sbc r6, r1, r6",
        // The second digit lr, which may be less than 0 or more than a word.
        "lsr r7, r7, #1",
        "smull lr, r6, r6, r7",
        "lsr lr, lr, #24",
        "orr lr, lr, r6, lsl #8",
        "add r12, r12, r6, asr #24",
        // The 53 bits of both digits.
        "rsb r6, r5, #31",
        "lsr lr, lr, r6",
        "add r7, r5, #1",
        "lsl r7, r12, r7",
        "orr lr, lr, r7",
        "lsr r12, r12, r6",
        // Twice what they leave, against n.
        "umull r6, r7, lr, r2",
        "mla r7, lr, r3, r7",
        "mla r7, r12, r2, r7",
        "lsl r1, r0, r5",
        "rsbs r6, r6, #0",
        "sbc r7, r1, r7",
        "adds r6, r6, r6",
        "adc r7, r7, r7",
        "subs r6, r2, r6",
        "sbcs r7, r3, r7",
        "ite lt",
        "movlt r6, #1",
        "movge r6, #0",
        "and r8, r8, #0x80000000",
        "add r1, r12, r4, lsl #20",
        "orr r1, r1, r8",
        "adds r0, lr, r6",
        "adc r1, r1, #0",
        "pop {{r4, r5, r6, r7, r8, pc}}",
        "90:",
        "pop {{r4, r5, r6, r7, r8, lr}}",
        "b {any}",
        any = sym any::quotient,
    )
}

/// A comparison of a and b as x < y: which is which, and what is returned if so, and if not.
macro_rules! comparison {
    ($(#[$doc:meta])* $name:ident, $any:path, x: $x:literal, $x_high:literal, y: $y:literal, $y_high:literal, $if_so:literal, $if_not:literal) => {
        $(#[$doc])*
        #[unsafe(no_mangle)]
        #[unsafe(naked)]
        extern "C" fn $name(a: u64, b: u64) -> u32 {
            naked_asm!(
                // Positive, and not infinite: ordered as their bits.
                "orr r12, r1, r3",
                "cmp r12, #0x7f000000",
                "bhs 3f",
                concat!("subs r0, ", $x, ", ", $y),
                concat!("sbcs r1, ", $x_high, ", ", $y_high),
                "2:",
                "ite lo",
                concat!("movlo r0, #", $if_so),
                concat!("movhs r0, #", $if_not),
                "bx lr",
                "3:",
                unless_exponent_is_greatest!(),
                "teq r1, r3",
                "bmi 4f",
                "cmp r1, #0",
                "bmi 5f",
                concat!("subs r0, ", $x, ", ", $y),
                concat!("sbcs r1, ", $x_high, ", ", $y_high),
                "b 2b",
                // Both negative.
                "5:",
                concat!("subs r0, ", $y, ", ", $x),
                concat!("sbcs r1, ", $y_high, ", ", $x_high),
                "b 2b",
                // One negative: less, unless both are zero.
                "4:",
                "orr r0, r0, r2",
                "orr r0, r0, r1, lsl #1",
                "orrs r0, r0, r3, lsl #1",
                concat!("mov r0, #", $if_not),
                "it eq",
                "bxeq lr",
                concat!("cmp ", $x_high, ", #0"),
                "it mi",
                concat!("movmi r0, #", $if_so),
                "bx lr",
                "9:",
                "b {any}",
                any = sym $any,
            )
        }
    };
}

comparison!(
    /// Whether a < b.
    __aeabi_dcmplt, any::is_less, x: "r0", "r1", y: "r2", "r3", "1", "0"
);
comparison!(
    /// Whether a > b.
    __aeabi_dcmpgt, any::is_greater, x: "r2", "r3", y: "r0", "r1", "1", "0"
);
comparison!(
    /// Whether a ≤ b: not b < a.
    __aeabi_dcmple, any::is_not_greater, x: "r2", "r3", y: "r0", "r1", "0", "1"
);
comparison!(
    /// Whether a ≥ b: not a < b.
    __aeabi_dcmpge, any::is_not_less, x: "r0", "r1", y: "r2", "r3", "0", "1"
);

/// Whether a = b.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __aeabi_dcmpeq(a: u64, b: u64) -> u32 {
    naked_asm!(
        "cmp r0, r2",
        "it eq",
        "cmpeq r1, r3",
        "bne 2f",
        // The same bits, but NaN equals nothing.
        "lsl r12, r1, #1",
        "mvns r12, r12, asr #21",
        "beq 9f",
        "mov r0, #1",
        "bx lr",
        // Other bits are equal only as zeros.
        "2:",
        "orr r0, r0, r2",
        "orr r0, r0, r1, lsl #1",
        "orrs r0, r0, r3, lsl #1",
        "ite eq",
        "moveq r0, #1",
        "movne r0, #0",
        "bx lr",
        "9:",
        "b {any}",
        any = sym any::is_equal,
    )
}

/// Whether one is NaN.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __aeabi_dcmpun(a: u64, b: u64) -> u32 {
    naked_asm!(
        unless_exponent_is_greatest!(),
        "mov r0, #0",
        "bx lr",
        "9:",
        "b {any}",
        any = sym any::is_unordered,
    )
}
