//! A winch as the plant has it: the sensor and the amplifier at the pins of core's drivers, and the mechanics of
//! drum and motor.

use std::cell::Cell;
use std::convert::Infallible;
use std::rc::Rc;

use cdpr_core::winch::{
    As5047p, Drive as _, Drum, DrumFault, Encoder as _, MotorAngle, MotorEncoder, Sense,
    VelocityDrive, VelocitySettings,
};
use cdpr_link::Motor;
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use embedded_hal::spi::{self, Operation, SpiDevice};

use crate::robot_file::WinchDesign;

/// Counts of the sensor in a turn.
const COUNTS: f64 = 16384.0;
/// Duty at full scale.
const MOST: u16 = u16::MAX;

/// What an AS5047P shows, and what is wrong with it.
#[derive(Debug, Default)]
struct Sensor {
    counts: Cell<u16>,
    is_corrupt: Cell<bool>,
    /// The register that the next frame answers.
    asked: Cell<u16>,
}

/// The sensor's end of the SPI: commands in, answers with parity out, one frame late.
#[derive(Debug)]
struct SensorBus(Rc<Sensor>);

impl spi::ErrorType for SensorBus {
    type Error = Infallible;
}

impl SpiDevice for SensorBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        const DIAAGC: u16 = 0x3FFC;
        const ANGLECOM: u16 = 0x3FFF;
        /// Offset loops settled, gain in the middle.
        const WELL: u16 = 0x0180;
        for operation in operations {
            if let Operation::Transfer(read, write) = operation
                && let (&mut [ref mut high, ref mut low], &[command_high, command_low]) =
                    (&mut **read, *write)
            {
                let data = match self.0.asked.get() {
                    ANGLECOM => self.0.counts.get(),
                    DIAAGC => WELL,
                    _ => 0,
                };
                let parity =
                    u16::from(data.count_ones() % 2 == 1) ^ u16::from(self.0.is_corrupt.get());
                [*high, *low] = (data | parity << 15).to_be_bytes();
                self.0.asked.set(u16::from_be_bytes([command_high, command_low]) & 0x3FFF);
            }
        }
        Ok(())
    }
}

/// What the amplifier reads at its inputs.
#[derive(Debug, Default)]
struct Amplifier {
    duty: Cell<u16>,
    is_forward: Cell<bool>,
}

#[derive(Debug)]
struct DutyPin(Rc<Amplifier>);

impl pwm::ErrorType for DutyPin {
    type Error = Infallible;
}

impl SetDutyCycle for DutyPin {
    fn max_duty_cycle(&self) -> u16 {
        MOST
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.0.duty.set(duty);
        Ok(())
    }
}

#[derive(Debug)]
struct DirectionPin(Rc<Amplifier>);

impl digital::ErrorType for DirectionPin {
    type Error = Infallible;
}

impl OutputPin for DirectionPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.is_forward.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.is_forward.set(true);
        Ok(())
    }
}

/// What happened to a winch. Any of it, alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ailments {
    /// It does not turn.
    pub is_stuck: bool,
    /// It turns no faster, m/s of rest length.
    pub fastest_m_s: Option<f64>,
    /// The sensor shows the same angle for ever.
    pub is_sensor_stuck: bool,
    /// The sensor's answers have the wrong parity.
    pub is_sensor_corrupt: bool,
}

impl Ailments {
    /// None.
    pub const NONE: Self = Self {
        is_stuck: false,
        fastest_m_s: None,
        is_sensor_stuck: false,
        is_sensor_corrupt: false,
    };
}

/// One winch.
#[derive(Debug)]
pub(super) struct Winch {
    design: WinchDesign,
    period_s: f64,
    drum: Drum<f64>,
    rad_per_m: f64,
    encoder: MotorEncoder<SensorBus>,
    sensor: Rc<Sensor>,
    /// Whole turns at which the sensor began to count.
    turns_at_start: i64,
    last_angle: MotorAngle,
    drive: VelocityDrive<f64, DutyPin, DirectionPin>,
    amplifier: Rc<Amplifier>,
    /// Speeds on their way to the amplifier, m/s, the oldest first.
    delayed_m_s: std::collections::VecDeque<f64>,
    brake: Brake,
    pub(super) ailments: Ailments,
    /// The driver refused a command.
    is_refused: bool,
}

#[derive(Clone, Copy, Debug)]
struct Brake {
    is_locked: bool,
    /// For how long it has been told otherwise, s.
    changing_s: f64,
}

/// What the mechanics of a winch are subject to during a period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    /// Wanted rate of the rest length, m/s.
    pub(super) wanted_m_s: f64,
    /// The brake holds, or nothing turns.
    pub(super) is_locked: bool,
}

impl Winch {
    /// A winch with `length_m` paid out; its motor stands as `drum` says.
    pub(super) fn new(
        design: &WinchDesign,
        period_s: f64,
        drum: Drum<f64>,
        length_m: f64,
    ) -> Result<Self, DrumFault> {
        let rad_per_m = drum.motor_speed_rad_s(1.0);
        let (sensor, amplifier) = (Rc::new(Sensor::default()), Rc::new(Amplifier::default()));
        let angle = drum.motor_angle(length_m)?;
        sensor.counts.set(counts(angle, 0));
        let full_scale_rad_s = design.max_speed_m_s * rad_per_m.abs();
        // As far as the motor turns in a period, and half as much for noise and overshoot.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let furthest = (1.5 * full_scale_rad_s * period_s / std::f64::consts::TAU * COUNTS) as u16;
        let encoder = MotorEncoder::start(
            As5047p::new(SensorBus(Rc::clone(&sensor))),
            furthest.max(64),
            Sense::Forward,
        )
        .unwrap_or_else(|_| unreachable!("a sensor that is well answers"));
        let settings = VelocitySettings {
            full_scale_rad_s,
            dead_band_rad_s: full_scale_rad_s / f64::from(MOST),
            lowest_duty: 0.0,
            highest_duty: 1.0,
            gain_per_s: design.position_gain_per_s,
        };
        let pins = (DutyPin(Rc::clone(&amplifier)), DirectionPin(Rc::clone(&amplifier)));
        let drive = VelocityDrive::new(pins.0, pins.1, settings)
            .unwrap_or_else(|_| unreachable!("a positive speed and gain"));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let delay = (design.command_delay_s / period_s).round() as usize;
        Ok(Self {
            design: *design,
            period_s,
            drum,
            rad_per_m,
            encoder,
            sensor,
            turns_at_start: angle.units() >> 32,
            last_angle: angle,
            drive,
            amplifier,
            delayed_m_s: std::iter::repeat_n(0.0, delay).collect(),
            brake: Brake { is_locked: true, changing_s: 0.0 },
            ailments: Ailments::NONE,
            is_refused: false,
        })
    }

    /// The motor angle that the encoder gives, the last one where it gives none; and whether all is well.
    pub(super) fn measure(&mut self, length_m: f64, noise_counts: i32) -> (MotorAngle, bool) {
        self.sensor.is_corrupt.set(self.ailments.is_sensor_corrupt);
        if let Ok(angle) = self.drum.motor_angle(length_m)
            && !self.ailments.is_sensor_stuck
        {
            self.sensor.counts.set(counts(angle, noise_counts));
        }
        let whole = MotorAngle::from_units(self.turns_at_start << 32);
        match self.encoder.angle().map(|angle| angle.checked_add(whole)) {
            Ok(Some(angle)) => {
                self.last_angle = angle;
                (angle, !self.is_refused)
            }
            _ => (self.last_angle, false),
        }
    }

    /// Gives a command to the drive (`None`: stand still), and time to the brake; what the mechanics then get.
    pub(super) fn command(&mut self, motor: Option<&Motor<f64>>, is_brake_released: bool) -> Drive {
        let done = match motor {
            Some(motor) if is_brake_released => self.drive.command(
                MotorAngle::from_units(motor.angle),
                motor.speed_rad_s,
                self.last_angle,
            ),
            _ => self.drive.stop(),
        };
        self.is_refused |= done.is_err();
        let sign = if self.amplifier.is_forward.get() { 1.0 } else { -1.0 };
        let share = f64::from(self.amplifier.duty.get()) / f64::from(MOST);
        let full_scale_m_s = self.design.max_speed_m_s * self.rad_per_m.signum();
        self.delayed_m_s.push_back(sign * share * full_scale_m_s);
        let wanted_m_s = self.delayed_m_s.pop_front().unwrap_or_default();
        let fastest_m_s = self.ailments.fastest_m_s.unwrap_or(f64::INFINITY);

        if self.brake.is_locked == is_brake_released {
            self.brake.changing_s += self.period_s;
            let takes_s = if is_brake_released {
                self.design.brake_opens_s
            } else {
                self.design.brake_grips_s
            };
            if self.brake.changing_s >= takes_s {
                self.brake = Brake { is_locked: !is_brake_released, changing_s: 0.0 };
            }
        } else {
            self.brake.changing_s = 0.0;
        }
        Drive {
            wanted_m_s: wanted_m_s.clamp(-fastest_m_s, fastest_m_s),
            is_locked: self.brake.is_locked || self.ailments.is_stuck,
        }
    }
}

/// What the sensor shows at an angle.
fn counts(angle: MotorAngle, noise_counts: i32) -> u16 {
    let counts = (angle.units() >> 18) + i64::from(noise_counts);
    u16::try_from(counts.rem_euclid(1 << 14)).unwrap_or_default() // 14 bits fit
}

/// The mechanics of a winch, in terms of the rest length: an inertia, a speed loop with a limited force, friction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mechanics {
    mass_kg: f64,
    largest_force_n: f64,
    dry_friction_n: f64,
    viscous_n_s_m: f64,
    bandwidth_rad_s: f64,
}

/// Rates of rest length, its rate, and the integral of the speed loop.
pub(super) type WinchRates = [f64; 3];

impl Mechanics {
    pub(super) fn new(design: &WinchDesign, rad_per_m: f64) -> Self {
        Self {
            mass_kg: design.motor_inertia_kg_m2 * rad_per_m * rad_per_m,
            largest_force_n: design.max_torque_nm * rad_per_m.abs(),
            dry_friction_n: design.dry_friction_n,
            viscous_n_s_m: design.viscous_friction_n_s_m,
            bandwidth_rad_s: design.speed_bandwidth_rad_s,
        }
    }

    /// Gain of the integral: a quarter of the bandwidth squared, where the loop just does not oscillate, 1/s^2.
    fn integral_gain(&self) -> f64 {
        0.25 * self.bandwidth_rad_s * self.bandwidth_rad_s
    }

    /// The integral with which the motor bears `tension_n` at rest: what an amplifier is given before the brake
    /// opens, m.
    pub(super) fn bearing_m(&self, tension_n: f64) -> f64 {
        -tension_n.min(self.largest_force_n) / (self.mass_kg * self.integral_gain())
    }

    /// Rates under a cable with `tension_n` at the drum. Dry friction rises over 2 mm/s, so that it has a rate.
    pub(super) fn rates(
        &self,
        drive: &Drive,
        rate_m_s: f64,
        integral_m: f64,
        tension_n: f64,
    ) -> WinchRates {
        const STICKING_M_S: f64 = 2e-3;
        const BRAKING_PER_S: f64 = 200.0;
        if drive.is_locked {
            return [rate_m_s, -rate_m_s * BRAKING_PER_S, 0.0];
        }
        let error_m_s = drive.wanted_m_s - rate_m_s;
        let wanted_n =
            self.mass_kg * (self.bandwidth_rad_s * error_m_s + self.integral_gain() * integral_m);
        let force_n = wanted_n.clamp(-self.largest_force_n, self.largest_force_n);
        let friction_n =
            self.dry_friction_n * (rate_m_s / STICKING_M_S).tanh() + self.viscous_n_s_m * rate_m_s;
        // Beyond the limit of the force the integral stands still, unless it leads back.
        let is_winding_up = force_n.to_bits() != wanted_n.to_bits() && wanted_n * error_m_s > 0.0;
        [
            rate_m_s,
            (force_n + tension_n - friction_n) / self.mass_kg,
            if is_winding_up { 0.0 } else { error_m_s },
        ]
    }
}
