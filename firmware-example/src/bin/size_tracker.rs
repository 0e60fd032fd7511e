//! An image that starts a tracker and ticks it, and nothing else: how large is the control library? It
//! is never run.
//!
//! On any other target this is an empty program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[path = "../hidden.rs"]
mod hidden;

#[cfg(target_os = "none")]
mod image {
    use core::hint::black_box;
    use core::panic::PanicInfo;

    use cdpr_core::{IrvineCatenary, Tracker};

    use super::hidden::{self, Float};

    #[panic_handler]
    fn panic(_: &PanicInfo<'_>) -> ! {
        cortex_m::asm::udf()
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        if let Some(mut tracker) = start() {
            while let Some(set_point) = hidden::set_point() {
                black_box(tracker.tick(&set_point).is_ok());
                black_box(tracker.command());
            }
        }
        loop {
            cortex_m::asm::wfi();
        }
    }

    fn start() -> Option<Tracker<Float, IrvineCatenary<Float>>> {
        let (load, settings) = (hidden::load(), hidden::tracker_settings());
        let (set_point, states) = (hidden::set_point()?, hidden::states());
        Tracker::start(hidden::robot().ok()?, load, settings, &set_point, &states).ok()
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
