//! Arithmetic of f64 for Cortex-M3 and M4, which have no instructions for it.
//!
//! `a + b` of two f64 is a call of `__aeabi_dadd` there. The routines that the compiler brings are written for all
//! processors at once; these take half of their instructions. The compiler's are weak symbols, so that these are linked
//! where a crate of the image has
//!
//! ```
//! use armv7m_double as _;
//! ```
//!
//! Results are the same to the last bit, except for which bits mark what is not a number: IEEE 754, to nearest, ties to even.
//! Names and calls are those of the [run-time ABI](https://github.com/ARM-software/abi-aa/blob/main/rtabi32/rtabi32.rst), tables 2
//! and 3: operands in r0 to r3, whatever the ABI for floats is. What is not here is the compiler's still.
//!
//! - `routines`: sums, products and quotients of normal numbers, in assembly; comparisons;
//! - `any`: the same of all other numbers;
//! - [`operands`]: what they are tried with.
//!
//! On other processors there is nothing of it but what can be tested there.
#![no_std]

// A Cortex-M0 lacks the instructions. It is told by its atomics.
#[cfg_attr(not(all(target_arch = "arm", target_has_atomic = "8")), allow(dead_code))]
mod any;
pub mod operands;
#[cfg(all(target_arch = "arm", target_has_atomic = "8"))]
mod routines;

#[cfg(test)]
mod tests;
