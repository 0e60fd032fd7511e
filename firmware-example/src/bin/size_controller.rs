//! An image with what a winch controller needs of `cdpr-core`, and nothing else: the controller, started from a warm-start
//! table, and six drums. How large is it, without table, board and log? It is never run.
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

    use cdpr_core::winch::{Drum, MotorAngle};
    use cdpr_core::{CABLES, Controller, IrvineCatenary, Table};

    use super::hidden::{self, Float, number};

    #[panic_handler]
    fn panic(_: &PanicInfo<'_>) -> ! {
        cortex_m::asm::udf()
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        work();
        loop {
            cortex_m::asm::wfi();
        }
    }

    fn work() -> Option<()> {
        let table = Table::open(black_box::<&[u8]>(&[])).ok()?;
        let mut controller = Controller::<Float, IrvineCatenary<Float>, 8>::start_from(
            hidden::robot().ok()?,
            hidden::load(),
            hidden::tracker_settings(),
            hidden::controller_settings(),
            hidden::stance(),
            &table,
            black_box(8),
        )
        .ok()?;
        let design = hidden::drum_design();
        let mut drums =
            [Drum::<Float>::new(&design, number(), black_box(MotorAngle::ZERO)).ok()?; CABLES];
        for drum in &mut drums {
            drum.set_home(number(), black_box(MotorAngle::ZERO)).ok()?;
        }
        black_box(controller.arm(&hidden::readings()).is_ok());
        while black_box(true) {
            let mut readings = hidden::readings();
            for (length_m, drum) in readings.rest_lengths_m.iter_mut().zip(&drums) {
                *length_m = drum.rest_length_m(black_box(MotorAngle::ZERO)).ok()?;
            }
            match black_box(5) {
                0 => black_box(controller.stop().is_ok()),
                1 => black_box(controller.resume().is_ok()),
                2 => black_box(controller.acknowledge(&readings).is_ok()),
                3 => black_box(controller.disarm().is_ok()),
                4 => black_box(controller.restart_from(hidden::stance(), &table, 8).is_ok()),
                _ => false,
            };
            let outputs = controller.tick(&readings, || black_box(Some(hidden::way_point())));
            for (target, drum) in outputs.targets.iter().flatten().zip(&drums) {
                black_box(drum.motor_angle(target.rest_length_m).ok());
                black_box(drum.motor_speed_rad_s(target.rate_m_s));
            }
            black_box((outputs.targets, controller.events_mut().take()));
        }
        Some(())
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
