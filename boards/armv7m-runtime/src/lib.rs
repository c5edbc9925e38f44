//! What the compiler calls on Cortex-M3 and M4: arithmetic of f64, for which they have no instructions, and copies.
//!
//! `a + b` of two f64 is a call of `__aeabi_dadd` there, and a struct is moved by `__aeabi_memcpy8`. The routines that the
//! compiler brings are written for all processors at once; these take half of their instructions, and copies a seventh. The
//! compiler's are weak symbols, so that these are linked where a crate of the image has
//!
//! ```
//! use armv7m_runtime as _;
//! ```
//!
//! Results are the same to the last bit, except for which bits mark what is not a number: IEEE 754, to nearest, ties to even.
//! Names and calls are those of the [run-time ABI](https://github.com/ARM-software/abi-aa/blob/main/rtabi32/rtabi32.rst),
//! sections 5.1.2 and 5.3.2: operands in r0 to r3, whatever the ABI for floats is. What is not here is the compiler's still.
//!
//! - `double`: sums, products and quotients of normal numbers, and comparisons, in assembly;
//! - `any`: the same of all other numbers;
//! - `copies`: whole words, eight at a time;
//! - [`operands`]: what arithmetic is tried with.
//!
//! On other processors there is nothing of it but what can be tested there.
#![no_std]

// A Cortex-M0 lacks the instructions. It is told by its atomics.
#[cfg_attr(not(all(target_arch = "arm", target_has_atomic = "8")), allow(dead_code))]
mod any;
#[cfg(all(target_arch = "arm", target_has_atomic = "8"))]
mod copies;
#[cfg(all(target_arch = "arm", target_has_atomic = "8"))]
mod double;
pub mod operands;

#[cfg(test)]
mod tests;
