//! What is said in one period.

use cdpr_core::controller::{self, Stance, State, WayPoint};
use cdpr_core::winch::{Countable, Drum, DrumDesign, DrumFault, MotorAngle};
use cdpr_core::{CABLES, Real, Twist};
use heapless::String;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::Identity;

/// What happened in a period, for people; cut off where it is longer.
pub type Note = String<160>;

/// What the plant tells the controller.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// Motor angles, all turns counted, units of 2^-32 turn.
    pub angles: [i64; CABLES],
    /// A winch that has failed, counted from 0.
    pub failed_winch: Option<u8>,
    /// The emergency stop is pressed.
    pub emergency_stop: bool,
    /// Measured tensions at the anchors, N, where they are measured.
    pub tensions_n: Option<[f32; CABLES]>,
    /// What the operator wants.
    pub request: Option<Request>,
    /// The next pose on the way, to be queued.
    pub way_point: Option<Target>,
}

/// What an operator may want: the methods of [`controller::Controller`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Request {
    /// Open the brakes and go to the lengths of the last certified command.
    Arm,
    /// Close the brakes.
    Disarm,
    /// Come to rest along the path.
    Stop,
    /// Go on after a halt.
    Resume,
    /// Give up what is left after a halt.
    Cancel,
    /// The cause of a fault is gone.
    Acknowledge,
    /// Start anew from the warm-start table, where the last command held the platform.
    Recover,
}

/// A coarse set-point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// Position of the platform origin, world frame, m.
    pub position_m: [f64; 3],
    /// Orientation (platform to world), unit quaternion `w, x, y, z`.
    pub quaternion: [f64; 4],
    /// Velocity of the platform origin there, m/s.
    pub linear_m_s: [f64; 3],
    /// Angular velocity there, world axes, rad/s.
    pub angular_rad_s: [f64; 3],
    /// How fast it is reached.
    pub pace: Pace,
}

/// [`controller::Pace`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Pace {
    /// In this time, s.
    Duration(f64),
    /// As fast as the limits allow, times this share.
    Share(f64),
}

/// Where a simulation starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Position of the platform origin, world frame, m.
    pub position_m: [f64; 3],
    /// Orientation (platform to world), unit quaternion `w, x, y, z`.
    pub quaternion: [f64; 4],
    /// Rest lengths that are paid out where the motors stand at angle 0, m.
    pub home_lengths_m: [f64; CABLES],
}

/// What a motor is to do until the next period.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motor<T> {
    /// Where it should be now, units of 2^-32 turn.
    pub angle: i64,
    /// How fast it should turn, rad/s.
    pub speed_rad_s: T,
}

/// [`State`] without its cause.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
)]
pub enum Mode {
    /// [`State::Disarmed`].
    #[default]
    Disarmed,
    /// [`State::Aligning`].
    Aligning,
    /// [`State::Holding`].
    Holding,
    /// [`State::Tracking`].
    Tracking,
    /// [`State::Fault`].
    Fault,
}

/// What the controller decides.
#[expect(clippy::struct_excessive_bools, reason = "each is a fact of its own")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision<T> {
    /// What the motors are to do; `None`: stand still.
    pub motors: Option<[Motor<T>; CABLES]>,
    /// Whether the brakes are to be open.
    pub brakes_released: bool,
    /// What the controller does now.
    pub mode: Mode,
    /// It came to rest before its time, and waits.
    pub is_halted: bool,
    /// Way-points still in the queue.
    pub waiting: u8,
    /// A monitor warned in this period.
    pub is_warning: bool,
    /// A way-point was refused in this period, or found the queue full.
    pub is_refusal: bool,
    /// Where the last certified command holds the platform: position of its origin, m.
    pub position_m: [T; 3],
    /// The same: unit quaternion `w, x, y, z`.
    pub quaternion: [T; 4],
    /// Rest lengths of that command, m.
    pub rest_lengths_m: [T; CABLES],
    /// Tensions at the anchors of that command, N.
    pub tensions_n: [T; CABLES],
    /// Contraction of its certificate.
    pub contraction: T,
    /// Distance to a singularity.
    pub distance: T,
    /// What happened, oldest first; empty when nothing did.
    pub note: Note,
}

/// From the host to the controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Question {
    /// Start, anew where one runs already.
    Start(Start),
    /// One period.
    Tick(Inputs),
}

/// From the controller to the host.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Answer<T> {
    /// It has started, and this is what it is built for.
    Started(Identity),
    /// One period.
    Ticked(Decision<T>),
    /// It does not start, or has not.
    Refused(Note),
    /// What came was no message: say it again.
    Garbled,
}

impl Target {
    /// The way-point, each number rounded to `T` once.
    #[must_use]
    pub fn way_point<T: Real>(&self) -> WayPoint<T> {
        let c = T::constant;
        WayPoint {
            stance: stance(&self.position_m, &self.quaternion),
            twist: Twist {
                linear_m_s: Vector3::from(self.linear_m_s.map(c)),
                angular_rad_s: Vector3::from(self.angular_rad_s.map(c)),
            },
            pace: match self.pace {
                Pace::Duration(duration_s) => controller::Pace::Duration(c(duration_s)),
                Pace::Share(share) => controller::Pace::Share(c(share)),
            },
        }
    }
}

impl Start {
    /// Where the platform should stand.
    #[must_use]
    pub fn stance<T: Real>(&self) -> Stance<T> {
        stance(&self.position_m, &self.quaternion)
    }

    /// The drums, with the motors at angle 0 where the platform stands, each length rounded to `T`.
    ///
    /// # Errors
    /// [`DrumFault`].
    pub fn drums<T: Countable>(&self, design: &DrumDesign) -> Result<[Drum<T>; CABLES], DrumFault> {
        let home = |length_m: f64| Drum::new(design, T::constant(length_m), MotorAngle::ZERO);
        let mut drums = [home(self.home_lengths_m[0])?; CABLES];
        for (drum, &length_m) in drums.iter_mut().zip(&self.home_lengths_m) {
            *drum = home(length_m)?;
        }
        Ok(drums)
    }
}

fn stance<T: Real>(position_m: &[f64; 3], &[w, x, y, z]: &[f64; 4]) -> Stance<T> {
    let c = T::constant;
    Stance {
        position_m: Vector3::from(position_m.map(c)),
        orientation: UnitQuaternion::new_unchecked(Quaternion::new(c(w), c(x), c(y), c(z))),
    }
}

impl<T> From<&State<T>> for Mode {
    fn from(state: &State<T>) -> Self {
        match state {
            State::Disarmed => Self::Disarmed,
            State::Aligning => Self::Aligning,
            State::Holding => Self::Holding,
            State::Tracking => Self::Tracking,
            State::Fault(_) => Self::Fault,
        }
    }
}

impl Decision<f64> {
    /// What stands before the first one: disarmed, brakes closed, nothing done.
    #[must_use]
    pub fn disarmed(start: &Start) -> Self {
        Self {
            motors: None,
            brakes_released: false,
            mode: Mode::Disarmed,
            is_halted: false,
            waiting: 0,
            is_warning: false,
            is_refusal: false,
            position_m: start.position_m,
            quaternion: start.quaternion,
            rest_lengths_m: start.home_lengths_m,
            tensions_n: [0.0; CABLES],
            contraction: 0.0,
            distance: 0.0,
            note: Note::new(),
        }
    }
}

impl<T> Decision<T> {
    /// The same with other numbers.
    pub fn map<U>(self, mut number: impl FnMut(T) -> U) -> Decision<U> {
        Decision {
            motors: self.motors.map(|motors| {
                motors.map(|Motor { angle, speed_rad_s }| Motor {
                    angle,
                    speed_rad_s: number(speed_rad_s),
                })
            }),
            brakes_released: self.brakes_released,
            mode: self.mode,
            is_halted: self.is_halted,
            waiting: self.waiting,
            is_warning: self.is_warning,
            is_refusal: self.is_refusal,
            position_m: self.position_m.map(&mut number),
            quaternion: self.quaternion.map(&mut number),
            rest_lengths_m: self.rest_lengths_m.map(&mut number),
            tensions_n: self.tensions_n.map(&mut number),
            contraction: number(self.contraction),
            distance: number(self.distance),
            note: self.note,
        }
    }
}
