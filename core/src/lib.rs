//! Statics and inverse kinematics of cable-driven parallel robots with six deformable cables,
//! for the winch controller itself: `no_std`, no allocation, no panic, every loop bounded.
//!
//! # The problem
//!
//! Cable `i` leaves its winch at the **anchor** `A_i` (world frame, z up) and holds the platform at
//! the **attachment** `B_i`. In the vertical plane through both, with `A` at the origin, `x >= 0` is
//! the horizontal distance to `B` and `z` its height above `A`. The unknowns of a cable are its
//! **rest length** `L` and the force `F = (Fx, Fz)` **on the cable at B**; the platform feels `-F`.
//! Inverse kinematics: given the pose, find six rest lengths (and forces) so that
//!
//! ```text
//! (X, Z)_i (F_i, L_i) = (x_i, z_i)         12 equations: each cable ends where it is attached
//! sum_i G_i F_i + wrench = 0                6 equations: the platform is at rest
//! ```
//!
//! # How it is solved
//!
//! For a fixed pose each cable keeps one degree of freedom: as `L` grows, `F` runs along a plane
//! curve, the [force curve](force_curve). What is left are six curves and six equations of
//! equilibrium, so one Newton step needs one 6x6 elimination, whatever the cable model.
//!
//! The modules follow the flow of data:
//! [`scalar`] → [`geometry`] and [`wrench`] → [`cable`] models → [`mod@line`] (one cable by itself) →
//! [`force_curve`] → [`statics`] → [`elimination`] → [`newton`] → [`certificate`] → [`tracker`] →
//! [`controller`] → [`winch`]. Beside it, [`chart`] → [`table`] give the tracker its start. What goes wrong is a [`Fault`](fault).
//!
//! # Use
//!
//! A [`Tracker`] follows one branch of the solutions from tick to tick and proves at each that it has
//! not left it:
//!
//! ```
//! use cdpr_core::{Command, Fault, IrvineCatenary, Remedy, SetPoint, Tracker};
//!
//! fn tick(
//!     tracker: &mut Tracker<f32, IrvineCatenary<f32>>,
//!     set_point: &SetPoint<f32>, // pose, and its rate of change
//! ) -> Result<(), Remedy> {
//!     let command: &Command<f32> = tracker.tick(set_point).map_err(|fault: Fault<f32>| {
//!         // Nothing has changed: tracker.command() still holds the last certified lengths.
//!         fault.remedy()
//!     })?;
//!     for cable in &command.cables {
//!         let (_length_m, _rate_m_s) = (cable.rest_length_m, cable.rest_length_rate_m_s);
//!     }
//!     Ok(())
//! }
//! ```
//!
//! Around it, a [`Controller`] makes motions between coarse way-points, halts, holds and watches, and a
//! [`Winch`] turns rest lengths into steps and speeds of a drive. For a single solution of a pose, from
//! a guess, there is [`newton::converge`].
//!
//! SI units everywhere: m, N, kg, rad, s. Raw scalars carry their unit in the name.

#![no_std]
#![deny(unsafe_code)] // but for the square root of the target: see scalar.rs
#![warn(clippy::std_instead_of_core, clippy::std_instead_of_alloc, clippy::alloc_instead_of_core)]

pub mod cable;
pub mod certificate;
pub mod chart;
pub mod controller;
pub mod elimination;
pub mod fault;
pub mod force_curve;
pub mod geometry;
pub mod line;
pub mod newton;
mod root;
pub mod scalar;
pub mod statics;
pub mod table;
pub mod tracker;
pub mod winch;
pub mod wrench;

pub use cable::{CableModel, EndPoint, IrvineCatenary, LinearElastic, NonDeformable, Parabola};
pub use certificate::{Certificate, CurveShape, ShapedCable};
pub use chart::Charted;
pub use controller::Controller;
pub use elimination::Elimination;
pub use fault::{Fault, Remedy};
pub use force_curve::{CableState, CurvePoint};
pub use geometry::{Cable, CablePlane, GeometryFault, Pose, Robot};
pub use line::{LineFault, LineSolution};
pub use newton::{NewtonStep, StepFault};
pub use scalar::{Real, Scalar};
pub use table::{Table, TableFault};
pub use tracker::{CableCommand, CableLimits, Command, SetPoint, Tracker, TrackerSettings, Twist};
pub use winch::{Winch, WinchFault};
pub use wrench::{Load, Wrench};

/// Number of cables. Six cables and six equations of equilibrium make the system square.
pub const CABLES: usize = 6;
