//! What the firmware images are made of. All but [`board`] and [`stack`] is independent of the
//! target: the tests run the same controller over the same path on the host, and the commands agree
//! bit for bit.
//!
//! [`path`] → [`rehearsal`] (what is asked of the controller, and what goes wrong) → a queue of
//! way-points → [`control`] (what happens at a tick); [`robot`] holds the constants. Asked over a serial line
//! instead, it is a [`station`].

#![no_std]

#[cfg(target_os = "none")]
pub mod board;
pub mod control;
mod number;
pub mod path;
pub mod plain_step;
pub mod rehearsal;
pub mod robot;
#[cfg(target_os = "none")]
pub mod stack;
pub mod station;

pub use number::{Float, Number};
