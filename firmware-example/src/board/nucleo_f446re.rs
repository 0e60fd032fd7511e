//! NUCLEO-F446RE (STM32F446RE, Cortex-M4F), at the 16 MHz of the internal oscillator that the core
//! starts with. The log leaves by RTT through the debugger on the board.

use core::ptr::{read_volatile, with_exposed_provenance_mut, write_volatile};

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

/// Register of the reset and clock control (RM0390, section 6.3), and the bit in it that clocks port A.
const AHB1ENR: usize = 0x4002_3830;
const GPIOA_ENABLE: u32 = 1 << 0;
/// The same for USART2.
const APB1ENR: usize = 0x4002_3840;
const USART2_ENABLE: u32 = 1 << 17;
/// Port A (section 7.4): what its pins are, and which function those of its lower half have.
const GPIOA_MODER: usize = 0x4002_0000;
const GPIOA_AFRL: usize = 0x4002_0020;
/// USART2 (section 25.6).
const USART2_SR: usize = 0x4000_4400;
const USART2_DR: usize = 0x4000_4404;
const USART2_BRR: usize = 0x4000_4408;
const USART2_CR1: usize = 0x4000_440c;
/// Of SR.
const HAS_RECEIVED: u32 = 1 << 5;
const HAS_ROOM: u32 = 1 << 7;
/// Of CR1: the unit, its transmitter and its receiver.
const ENABLE: u32 = 1 << 13 | 1 << 3 | 1 << 2;
/// What the debugger on the board passes on to USB.
const BAUD: u32 = 115_200;

/// The serial line: USART2 at PA2 and PA3, which lead to the debugger on the board and over USB to the
/// host; 8 bits, no parity, 115,200 bit/s. That is slow: a period of the controller, some 250 bytes there
/// and back, takes 20 ms of it.
#[derive(Debug)]
pub struct Line(());

impl Line {
    /// Opens it; from then on bytes may come.
    #[must_use]
    pub fn open() -> Self {
        set(AHB1ENR, 0, GPIOA_ENABLE);
        set(APB1ENR, 0, USART2_ENABLE);
        set(GPIOA_AFRL, 0xff << 8, 0x77 << 8); // pins 2 and 3: function 7
        set(GPIOA_MODER, 0b1111 << 4, 0b1010 << 4); // instead of input
        set(USART2_BRR, u32::MAX, (CORE_HZ + BAUD / 2) / BAUD);
        set(USART2_CR1, u32::MAX, ENABLE);
        Self(())
    }

    /// The byte that has come, if any.
    pub fn read(&mut self) -> Option<u8> {
        if get(USART2_SR) & HAS_RECEIVED == 0 {
            return None;
        }
        let [byte, ..] = get(USART2_DR).to_le_bytes();
        Some(byte)
    }

    /// Sends a byte, once there is room for it.
    pub fn write(&mut self, byte: u8) {
        while get(USART2_SR) & HAS_ROOM == 0 {}
        set(USART2_DR, u32::MAX, byte.into());
    }
}

/// Reads a register of the [`Line`].
fn get(register: usize) -> u32 {
    // SAFETY: only for registers named above; reading them takes out a byte at most.
    unsafe { read_volatile(with_exposed_provenance_mut(register)) }
}

/// Clears and sets bits of a register of the [`Line`].
fn set(register: usize, clear: u32, set: u32) {
    // SAFETY: only for registers named above, which nothing else uses; none touches memory.
    unsafe { write_volatile(with_exposed_provenance_mut(register), get(register) & !clear | set) };
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
