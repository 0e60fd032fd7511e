//! QEMU's mps2-an386 (Cortex-M4F) and mps2-an500 (Cortex-M7). Code lies in 4 MiB at `0x0000_0000`, data
//! and stack in 4 MiB at `0x2000_0000`.

use core::ptr::{read_volatile, with_exposed_provenance_mut, write_volatile};

use cortex_m::interrupt::{self, InterruptNumber};
use cortex_m::peripheral::NVIC;
use cortex_m_semihosting::debug;

/// Clock of the core, Hz.
pub(super) const CORE_HZ: u32 = 25_000_000;

/// What work costs: under `-icount shift=6` every instruction takes 64 ns, the same in every run.
pub const COST_UNIT: &str = "instructions";

/// `TIMER0` of the CMSDK, which counts the clock of the core down in 32 bits: CTRL, VALUE, RELOAD.
const TIMER0: usize = 0x4000_0000;
const TIMER_CTRL: usize = 0;
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
        write_volatile(timer.add(TIMER_CTRL), ENABLE);
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

/// `UART0` of the CMSDK (Arm DDI 0479, APB UART), which holds one byte each way: DATA, STATE, CTRL, INTCLEAR
/// and BAUDDIV.
const UART0: usize = 0x4000_4000;
const DATA: usize = 0;
const STATE: usize = 1;
const UART_CTRL: usize = 2;
const INTCLEAR: usize = 3;
const BAUDDIV: usize = 4;
/// Of STATE.
const IS_SENDING: u32 = 1 << 0;
const HAS_RECEIVED: u32 = 1 << 1;
/// Of CTRL: sends, receives, and interrupts when it has received.
const LINE_ENABLE: u32 = 0b1011;
/// Of INTCLEAR.
const RECEIVED: u32 = 1 << 1;
/// Periods of the core's clock to a bit, the fewest there may be: 1.6 Mbit/s.
const FASTEST: u32 = 16;

/// The interrupt of [`UART0`] when it has received.
#[derive(Clone, Copy)]
struct HasReceived;

// SAFETY: it has this number, the first, on all mps2 boards.
unsafe impl InterruptNumber for HasReceived {
    fn number(self) -> u16 {
        0
    }
}

/// The serial line: 8 bits, no parity, no flow control, 1.6 Mbit/s, for which QEMU does not wait.
#[derive(Debug)]
pub struct Line(());

impl Line {
    /// Opens it; from then on bytes may come. Interrupts are off from here on: they wake the core and do no
    /// more.
    #[must_use]
    pub fn open() -> Self {
        interrupt::disable();
        let uart: *mut u32 = with_exposed_provenance_mut(UART0);
        // SAFETY: registers of a UART that nothing else uses; it touches no memory, and its interrupt has no
        // handler that could run.
        unsafe {
            write_volatile(uart.add(BAUDDIV), FASTEST);
            write_volatile(uart.add(UART_CTRL), LINE_ENABLE);
            // What lay there before; QEMU does not look for more until it is read.
            let _ = read_volatile(uart.add(DATA));
            NVIC::unmask(HasReceived);
        }
        Self(())
    }

    /// The byte that has come. Where none has the core sleeps, and with it QEMU, until one may have.
    pub fn read(&mut self) -> Option<u8> {
        let uart: *mut u32 = with_exposed_provenance_mut(UART0);
        // SAFETY: reading the register has no side effect.
        if unsafe { read_volatile(uart.add(STATE)) } & HAS_RECEIVED == 0 {
            cortex_m::asm::wfi(); // over at once if a byte has come since
            return None;
        }
        // SAFETY: as in `open`. What comes after the interrupt is cleared is found above, before the core sleeps.
        let data = unsafe {
            write_volatile(uart.add(INTCLEAR), RECEIVED);
            read_volatile(uart.add(DATA))
        };
        NVIC::unpend(HasReceived);
        let [byte, ..] = data.to_le_bytes();
        Some(byte)
    }

    /// Sends a byte, once the last is on its way.
    pub fn write(&mut self, byte: u8) {
        let uart: *mut u32 = with_exposed_provenance_mut(UART0);
        // SAFETY: as in `open`.
        unsafe {
            while read_volatile(uart.add(STATE)) & IS_SENDING != 0 {}
            write_volatile(uart.add(DATA), byte.into());
        }
    }
}

/// Ends the run, for the host with success or failure.
pub fn exit(success: bool) -> ! {
    debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    // A debugger may let the core go on.
    loop {
        cortex_m::asm::wfi();
    }
}
