//! What the compiler calls on ARMv7-M (Cortex-M3, M4, M7): arithmetic of f64, for which most of them have no instructions, and
//! copies.
//!
//! `a + b` of two f64 is a call of `__aeabi_dadd` there, and a struct is moved by `__aeabi_memcpy8`. The compiler brings such
//! routines, written once for all processors. These are in assembly, and take half to three quarters of their instructions. The
//! compiler's are weak symbols, so a firmware has these as soon as it has
//!
//! ```
//! use armv7m_runtime as _;
//! ```
//!
//! Results are the same to the last bit, except for the bits of a NaN: IEEE 754, to nearest, ties to even. Names and calls are those
//! of the [run-time ABI](https://github.com/ARM-software/abi-aa/blob/main/rtabi32/rtabi32.rst), tables 2, 3 and 9: operands in r0
//! to r3, whatever the ABI for floats is. Conversions, remainders and copies by bytes stay the compiler's.
//!
//! - `double`: sums, products and quotients of normal numbers, and comparisons, in assembly;
//! - `any`: the same for all other numbers;
//! - `copies`: whole words, eight at a time;
//! - [`operands`]: what arithmetic is tested with.
//!
//! For other targets only `any` and `operands` are compiled.
#![no_std]

#[cfg_attr(not(armv7m), allow(dead_code))]
mod any;
#[cfg(armv7m)]
mod copies;
#[cfg(armv7m)]
mod double;
pub mod operands;

#[cfg(test)]
mod tests;
