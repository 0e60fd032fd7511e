//! Everything that depends on the board, here QEMU's mps2-an386 (Cortex-M4F): the only file a real
//! board replaces, together with its memory map in `memory.x`.
//!
//! Code lies in 4 MiB at `0x0000_0000`, data and stack in 4 MiB at `0x2000_0000`; the stack starts
//! at the end and grows down. Text and the end of the run go over semihosting.

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{ExceptionFrame, exception};
use cortex_m_semihosting::debug;
pub(crate) use cortex_m_semihosting::hprintln as print_line;

/// Counts instructions.
///
/// Under `-icount shift=7` every instruction takes 128 ns, and `SysTick` counts the 25 MHz of the
/// core: 3.2 ticks an instruction, the same in every run. These are not cycles; a real board would
/// read its cycle counter instead.
pub(crate) struct Counter {
    /// What counting nothing counts.
    overhead_ticks: u32,
}

impl Counter {
    /// Starts the clock, unless it runs already.
    pub(crate) fn start() -> Self {
        if let Some(Peripherals { SYST: mut systick, .. }) = Peripherals::take() {
            systick.set_clock_source(SystClkSource::Core);
            systick.set_reload(RELOAD);
            systick.clear_current();
            systick.enable_counter();
        }
        let ((), overhead_ticks) = ticks(|| ());
        Self { overhead_ticks }
    }

    /// Does `work` and counts its instructions, up to 5 million.
    pub(crate) fn count<R>(&self, work: impl FnOnce() -> R) -> (R, u32) {
        let (result, ticks) = ticks(work);
        // 40 ns a tick, 128 ns an instruction; rounded, as the clock is read between ticks.
        (result, (ticks.saturating_sub(self.overhead_ticks) * 5 + 8) / 16)
    }
}

/// `SysTick` is 24 bits wide.
const RELOAD: u32 = 0x00ff_ffff;

/// Does `work` between two readings of the clock, which counts down.
fn ticks<R>(work: impl FnOnce() -> R) -> (R, u32) {
    // The black boxes keep the compiler from moving work past the readings.
    let work = black_box(work);
    let start = SYST::get_current();
    let result = black_box(work());
    let stop = SYST::get_current();
    (result, start.wrapping_sub(stop) & RELOAD)
}

/// Ends the run, for the host with success or failure.
pub(crate) fn exit(success: bool) -> ! {
    debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    // A debugger may let the core go on.
    loop {
        cortex_m::asm::wfi();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    print_line!("{info}");
    exit(false)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    print_line!("hard fault at {:#010x}", frame.pc());
    exit(false)
}
