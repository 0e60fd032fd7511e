//! One period of a winch controller as messages.
//!
//! A plant, real or simulated, tells in [`Inputs`] what encoders, switches and operator say; a [`Station`]
//! (the controller of `cdpr-core` with its drums, way-points and monitor) answers with a [`Decision`]. Both
//! sides of a simulation use the same station: the host as a library, the firmware behind a serial line, over
//! which [`frame`] carries the messages and [`serial`] answers them once each, whatever is lost or repeated.
//!
//! ```text
//!          Inputs: motor angles, switches, request, way-point
//! plant -------------------------------------------------------> Station
//!   ^                                                              |
//!   +--------------- Decision: motor angles, speeds, brakes -------+
//! ```
//!
//! Numbers go over the line as the bits they are, so that both sides compute the same.

#![no_std]
#![forbid(unsafe_code)]

pub mod frame;
pub mod identity;
pub mod messages;
pub mod serial;
pub mod station;

use crc::{CRC_32_ISO_HDLC, Crc};
pub use identity::Identity;
pub use messages::{Decision, Inputs, Mode, Motor, Note, Pace, Request, Start, Target};
pub use station::{Station, StationFault};

/// Of frames and identities.
static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
