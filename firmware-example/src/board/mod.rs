//! Everything that depends on the board. The file of a board tells the clock of the core, counts what
//! work costs, has a serial line, brings the log out and ends the run; a real board replaces it, together
//! with its memory map in `memory/`. What is common to all Cortex-M stands here.

#[cfg(not(feature = "board-nucleo-f446re"))]
mod mps2;
#[cfg(feature = "board-nucleo-f446re")]
mod nucleo_f446re;

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{ExceptionFrame, exception};
// The log of every board goes the one way or the other.
#[cfg(feature = "rtt")]
use defmt_rtt as _;
#[cfg(not(feature = "rtt"))]
use defmt_semihosting as _;
#[cfg(not(feature = "board-nucleo-f446re"))]
use mps2 as chosen;
#[cfg(feature = "board-nucleo-f446re")]
use nucleo_f446re as chosen;

pub use chosen::{COST_UNIT, Line, exit};

/// Interrupts per second.
const TICK_HZ: u32 = 1_000;

/// Lets `SysTick` interrupt 1000 times a second.
pub fn start_ticking(systick: &mut SYST) {
    systick.set_clock_source(SystClkSource::Core);
    systick.set_reload(chosen::CORE_HZ / TICK_HZ - 1);
    systick.clear_current();
    systick.enable_interrupt();
    systick.enable_counter();
}

/// Counts what work costs, in units of [`COST_UNIT`].
#[derive(Clone, Copy, Debug)]
pub struct Counter {
    /// What counting nothing counts.
    overhead_ticks: u32,
}

impl Counter {
    /// Starts the clock that is counted with.
    #[must_use]
    pub fn start() -> Self {
        chosen::start_clock();
        let ((), overhead_ticks) = ticks(|| ());
        Self { overhead_ticks }
    }

    /// Does `work` and counts its cost, up to 2^27.
    pub fn count<R>(&self, work: impl FnOnce() -> R) -> (R, u32) {
        let (result, ticks) = ticks(work);
        (result, chosen::cost(ticks.saturating_sub(self.overhead_ticks)))
    }
}

/// Does `work` between two readings of the clock.
fn ticks<R>(work: impl FnOnce() -> R) -> (R, u32) {
    // The black boxes keep the compiler from moving work past the readings.
    let work = black_box(work);
    let start = chosen::clock();
    let result = black_box(work());
    let stop = chosen::clock();
    (result, stop.wrapping_sub(start))
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    exit(false)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("hard fault at {=u32:#010x}", frame.pc());
    exit(false)
}
