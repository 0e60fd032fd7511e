//! A firmware image around `cdpr-core`: the warm step of a controller, on a Cortex-M4F in QEMU.
//!
//! ```text
//! cargo firmware
//! ```
//!
//! On any other target this is an empty program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod robot;
#[cfg(target_os = "none")]
mod warm_step;

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    let outcome = warm_step::run(&board::Counter::start());
    if let Err(fault) = &outcome {
        board::print_line!("failed: {fault}");
    }
    board::exit(outcome.is_ok())
}

#[cfg(not(target_os = "none"))]
fn main() {}
