//! What a controller is built for, in short, so that it is not driven with another robot's numbers.

use cdpr_core::Charted;
use cdpr_core::winch::{Countable, Sense};
use crc::Digest;
use serde::{Deserialize, Serialize};

use crate::CRC;
use crate::station::Blueprint;

/// CRC-32 of all numbers of a [`Blueprint`], each rounded to `f32`, in groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Bits of a number: 32 or 64.
    pub number_bits: u8,
    /// Anchors, attachments and cables.
    pub robot: u32,
    /// Mass, centre of mass, gravity, further force and moment.
    pub load: u32,
    /// Rate and limits of the tracker.
    pub tracker: u32,
    /// Motions, halts, alignment, brakes.
    pub controller: u32,
    /// Drums, and thresholds of the monitor.
    pub winches: u32,
}

impl Identity {
    /// That of a blueprint. The cable model counts with its weight and its compliance.
    pub fn of<T: Countable, M: Charted<T>>(blueprint: &Blueprint<T, M>) -> Self {
        let Blueprint { robot, load, tracker, controller, drum, monitor } = blueprint;
        let mut robot_sum = Sum::new();
        for cable in robot.cables() {
            robot_sum.add(cable.anchor_m.iter().chain(&cable.attachment_m).copied());
            robot_sum.add([cable.model.weight_n_m(), cable.model.compliance_per_n()]);
        }
        let mut load_sum = Sum::new();
        load_sum.add([load.mass_kg, load.gravity_m_s2]);
        load_sum
            .add(load.center_of_mass_m.iter().chain(&load.force_n).chain(&load.moment_nm).copied());
        let mut tracker_sum = Sum::new();
        tracker_sum.add([
            tracker.period_s,
            tracker.largest_move_m,
            tracker.least_distance,
            tracker.fold_horizon_s,
            tracker.largest_error_n,
        ]);
        for cable in &tracker.cables {
            tracker_sum.add([cable.shortest_m, cable.longest_m, cable.fastest_m_s]);
            tracker_sum.add([cable.lowest_tension_n, cable.highest_tension_n]);
        }
        let mut controller_sum = Sum::new();
        let motion = &controller.motion;
        controller_sum.add([
            motion.distance_m,
            motion.speed_m_s,
            motion.acceleration_m_s2,
            motion.jerk_m_s3,
        ]);
        controller_sum.add([
            motion.turn_speed_rad_s,
            motion.turn_acceleration_rad_s2,
            motion.turn_jerk_rad_s3,
        ]);
        controller_sum.add([
            controller.align_speed_m_s,
            controller.align_reach_m,
            controller.align_tolerance_m,
            controller.following_m,
        ]);
        controller_sum.count([Some(controller.halt_ticks), controller.stream_ticks]);
        controller_sum.count([Some(controller.settle_ticks), Some(controller.brake_ticks)]);
        controller_sum.count([controller.brake_after_ticks]);
        let mut winch_sum = Sum::new();
        winch_sum.add([
            drum.radius_m,
            drum.pitch_m,
            drum.gear,
            drum.winding_tension_n,
            drum.compliance_per_n,
        ]);
        winch_sum.count([Some(u32::from(drum.sense == Sense::Reverse))]);
        winch_sum.add([monitor.swing_n, monitor.spread_n]);
        Self {
            number_bits: u8::try_from(8 * size_of::<T>()).unwrap_or(u8::MAX),
            robot: robot_sum.finish(),
            load: load_sum.finish(),
            tracker: tracker_sum.finish(),
            controller: controller_sum.finish(),
            winches: winch_sum.finish(),
        }
    }

    /// What the other is built for and this one is not, in words; `None` when they are the same.
    #[must_use]
    pub fn differs_in(&self, other: &Self) -> Option<&'static str> {
        [
            ("number type", u32::from(self.number_bits), u32::from(other.number_bits)),
            ("robot", self.robot, other.robot),
            ("load", self.load, other.load),
            ("rate and limits of the cables", self.tracker, other.tracker),
            ("settings of the controller", self.controller, other.controller),
            ("drums", self.winches, other.winches),
        ]
        .iter()
        .find(|(_, mine, theirs)| mine != theirs)
        .map(|(name, ..)| *name)
    }
}

struct Sum(Digest<'static, u32>);

impl Sum {
    fn new() -> Self {
        Self(CRC.digest())
    }

    fn add<T: Countable>(&mut self, numbers: impl IntoIterator<Item = T>) {
        for number in numbers {
            self.0.update(&number.to_f32().unwrap_or(f32::NAN).to_le_bytes());
        }
    }

    fn count(&mut self, counts: impl IntoIterator<Item = Option<u32>>) {
        for count in counts {
            self.0.update(&[u8::from(count.is_some())]);
            self.0.update(&count.unwrap_or_default().to_le_bytes());
        }
    }

    fn finish(self) -> u32 {
        self.0.finalize()
    }
}
