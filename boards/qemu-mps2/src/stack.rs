//! How deep a call goes: the memory below the stack pointer is painted before it, and searched for what is no
//! longer paint after it.

/// What is painted \[bytes\]: more than a tick may take.
const PAINTED: usize = if super::IS_SMALL { 768 } else { 1280 };
/// Left unpainted for the frame of [`paint`] itself \[bytes\].
const MARGIN: usize = 64;
const PAINT: u32 = 0x5AFE_C0DE;

/// Paints, and says where the stack ends now.
#[inline(always)]
pub fn paint() -> usize {
    let top = crate::processor::stack_pointer();
    let mut word = top - MARGIN - PAINTED;
    while word < top - MARGIN {
        // Sound: below the stack pointer, in memory; interrupts don't come.
        unsafe { (word as *mut u32).write_volatile(PAINT) };
        word += 4;
    }
    top
}

/// Bytes below `top` that have been written since.
#[inline(always)]
pub fn depth(top: usize) -> usize {
    let mut word = top - MARGIN - PAINTED;
    // Sound: as above.
    while word < top - MARGIN && unsafe { (word as *const u32).read_volatile() } == PAINT {
        word += 4;
    }
    top - word
}
