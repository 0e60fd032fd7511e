//! NUCLEO-F446RE (STM32F446RE, Cortex-M4F), at the 16 MHz of the internal oscillator that the core
//! starts with. The log leaves by RTT through the debugger on the board.

use cortex_m::Peripherals;
use cortex_m::peripheral::{DCB, DWT};
use cortex_m_semihosting::debug;

/// Clock of the core, Hz.
pub(super) const CORE_HZ: u32 = 16_000_000;

/// What work costs.
pub const COST_UNIT: &str = "cycles";

/// Starts [`clock`].
pub(super) fn start_clock() {
    // SAFETY: only the trace unit is touched, which nothing else uses.
    let mut peripherals = unsafe { Peripherals::steal() };
    peripherals.DCB.enable_trace();
    peripherals.DWT.set_cycle_count(0);
    peripherals.DWT.enable_cycle_counter();
}

/// Time, in cycles.
pub(super) fn clock() -> u32 {
    DWT::cycle_count()
}

/// Cycles are what is counted.
pub(super) fn cost(cycles: u32) -> u32 {
    cycles
}

/// Ends the run, for `probe-rs run` with success or failure; without a debugger, the core sleeps.
pub fn exit(success: bool) -> ! {
    if DCB::is_debugger_attached() {
        debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    }
    loop {
        cortex_m::asm::wfi();
    }
}
