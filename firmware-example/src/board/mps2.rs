//! QEMU's mps2-an386 (Cortex-M4F) and mps2-an500 (Cortex-M7). Code lies in 4 MiB at `0x0000_0000`, data
//! and stack in 4 MiB at `0x2000_0000`.

use core::ptr::{read_volatile, with_exposed_provenance_mut, write_volatile};

use cortex_m_semihosting::debug;

/// Clock of the core, Hz.
pub(super) const CORE_HZ: u32 = 25_000_000;

/// What work costs: under `-icount shift=6` every instruction takes 64 ns, the same in every run.
pub const COST_UNIT: &str = "instructions";

/// `TIMER0` of the CMSDK, which counts the clock of the core down in 32 bits: CTRL, VALUE, RELOAD.
const TIMER0: usize = 0x4000_0000;
const CTRL: usize = 0;
const VALUE: usize = 1;
const RELOAD: usize = 2;
const ENABLE: u32 = 1;

/// Starts [`clock`].
pub(super) fn start_clock() {
    let timer: *mut u32 = with_exposed_provenance_mut(TIMER0);
    // SAFETY: registers of a timer that nothing else uses; it neither interrupts nor touches memory.
    unsafe {
        write_volatile(timer.add(RELOAD), u32::MAX);
        write_volatile(timer.add(VALUE), u32::MAX);
        write_volatile(timer.add(CTRL), ENABLE);
    }
}

/// Time, in periods of the core's clock, counted up.
pub(super) fn clock() -> u32 {
    let timer: *mut u32 = with_exposed_provenance_mut(TIMER0);
    // SAFETY: reading the register has no side effect.
    !unsafe { read_volatile(timer.add(VALUE)) }
}

/// The instructions done in so many periods: 40 ns each, 64 ns an instruction; rounded, as the clock
/// is read between its ticks.
pub(super) fn cost(periods: u32) -> u32 {
    (periods * 5 + 4) / 8
}

/// Ends the run, for the host with success or failure.
pub fn exit(success: bool) -> ! {
    debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    // A debugger may let the core go on.
    loop {
        cortex_m::asm::wfi();
    }
}
