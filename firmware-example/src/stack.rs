//! How much stack is used, found by painting it.

use core::ptr::{read_volatile, with_exposed_provenance_mut, write_volatile};

use cortex_m::register::msp;

const PAINT: u32 = 0xa5a5_a5a5;

/// Room for the frame of [`paint`], which may be taken after it has asked for the stack pointer. It
/// stays unpainted, and the least that can be measured.
const OWN_FRAME_BYTES: usize = 64;

unsafe extern "C" {
    /// The end of the stack, which grows down, by the linker script of `cortex-m-rt`.
    static mut _stack_end: u32;
    /// Where it starts.
    static mut _stack_start: u32;
}

/// Paints all that lies below the caller's frame. No interrupt may be enabled.
#[inline(never)]
pub fn paint() {
    let top = msp::read() as usize - OWN_FRAME_BYTES;
    let mut word = (&raw mut _stack_end).addr();
    while word < top {
        // SAFETY: below the stack pointer, above everything static: nobody's memory.
        unsafe { write_volatile(with_exposed_provenance_mut(word), PAINT) };
        word += size_of::<u32>();
    }
}

/// How deep the stack has been since it was last painted, in bytes from its start.
#[must_use]
pub fn deepest_bytes() -> usize {
    deepest_below((&raw mut _stack_start).addr())
}

/// Does `work` and tells how much stack that takes, in bytes. No interrupt may be enabled.
pub fn used_by<R>(work: impl FnOnce() -> R) -> (R, usize) {
    // A frame of its own: inlined, its locals would lie above the paint.
    #[inline(never)]
    fn call<R>(work: impl FnOnce() -> R) -> R {
        work()
    }
    let top = msp::read() as usize;
    paint();
    let result = call(work);
    (result, deepest_below(top))
}

fn deepest_below(top: usize) -> usize {
    let mut word = (&raw mut _stack_end).addr();
    // SAFETY: the memory of the stack.
    while word < top && unsafe { read_volatile::<u32>(with_exposed_provenance_mut(word)) } == PAINT
    {
        word += size_of::<u32>();
    }
    top - word
}
