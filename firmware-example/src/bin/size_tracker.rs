//! An image that starts a tracker and ticks it, and nothing else: how large is the control library? It
//! is never run.
//!
//! On any other target this is an empty program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod image {
    use core::hint::black_box;
    use core::panic::PanicInfo;

    use cdpr_core::{
        CABLES, Cable, CableLimits, CableState, IrvineCatenary, Load, Pose, Robot, SetPoint,
        Tracker, TrackerSettings, Twist,
    };
    use nalgebra::{Quaternion, UnitQuaternion, Vector3};

    #[cfg(not(feature = "f64"))]
    type Float = f32;
    #[cfg(feature = "f64")]
    type Float = f64;

    #[panic_handler]
    fn panic(_: &PanicInfo<'_>) -> ! {
        cortex_m::asm::udf()
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        if let Some(mut tracker) = start() {
            while let Some(set_point) = set_point() {
                black_box(tracker.tick(&set_point).is_ok());
                black_box(tracker.command());
            }
        }
        loop {
            cortex_m::asm::wfi();
        }
    }

    /// All numbers come from where the compiler cannot see.
    fn start() -> Option<Tracker<Float, IrvineCatenary<Float>>> {
        let limits = CableLimits {
            shortest_m: number(),
            longest_m: number(),
            fastest_m_s: number(),
            lowest_tension_n: number(),
            highest_tension_n: number(),
        };
        let settings = TrackerSettings {
            period_s: number(),
            largest_move_m: number(),
            least_distance: number(),
            fold_horizon_s: number(),
            largest_error_n: number(),
            cables: [limits; CABLES],
        };
        let model = IrvineCatenary { weight_n_m: number(), compliance_per_n: number() };
        let robot = Robot::new([(); CABLES].map(|()| Cable {
            anchor_m: vector(),
            attachment_m: vector(),
            model,
        }));
        let load = Load {
            mass_kg: number(),
            center_of_mass_m: vector(),
            gravity_m_s2: number(),
            force_n: vector(),
            moment_nm: vector(),
        };
        let state = || CableState { force_n: vector().xy(), rest_length_m: number() };
        let states = [(); CABLES].map(|()| state());
        Tracker::start(robot.ok()?, load, settings, &set_point()?, &states).ok()
    }

    fn set_point() -> Option<SetPoint<Float>> {
        let orientation = UnitQuaternion::new_unchecked(Quaternion::from_parts(number(), vector()));
        let pose = Pose::new(vector(), orientation).ok()?;
        Some(SetPoint { pose, twist: Twist { linear_m_s: vector(), angular_rad_s: vector() } })
    }

    fn number() -> Float {
        black_box(1.0)
    }

    fn vector() -> Vector3<Float> {
        Vector3::new(number(), number(), number())
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
