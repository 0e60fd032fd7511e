//! Boots.
#![no_std]
#![no_main]
use core as _;
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! { loop {} }
