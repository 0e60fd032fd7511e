//! What a tick costs, in instructions and stack, and what the same step costs when done the plain way.
//!
//! ```text
//! cargo measure          # Cortex-M4F, f32
//! cargo measure-m7       # Cortex-M7, f64
//! ```
//!
//! On any other target this is an empty program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod image {
    use core::hint::black_box;

    use cdpr_core::statics::Balance;
    use cdpr_core::{Fault, NewtonStep, StepFault, Tracker};
    use cdpr_firmware_example::board::{self, COST_UNIT, Counter};
    use cdpr_firmware_example::control::{Control, start_tracker};
    use cdpr_firmware_example::path::{self, Course, Path, TICKS_AROUND};
    use cdpr_firmware_example::plain_step::plain_step;
    use cdpr_firmware_example::robot::{self, Model};
    use cdpr_firmware_example::{Float, stack};
    use defmt::{Display2Format, error, info};

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let counter = Counter::start();
        let outcome = path("taut path", &counter, path::TAUT)
            .and_then(|()| path("slack path", &counter, path::SLACK))
            .and_then(|()| steps(&counter));
        if let Err(fault) = &outcome {
            error!("{}", Display2Format(fault));
        }
        info!("tracker: {=usize} bytes of RAM", size_of::<Tracker<Float, Model<Float>>>());
        info!("controller: {=usize} bytes of RAM", size_of::<Control<Float>>());
        board::exit(outcome.is_ok())
    }

    /// Every tick once around `course`: the tracker alone, from the set-point to the command.
    fn path(name: &str, counter: &Counter, course: Course) -> Result<(), Fault<Float>> {
        let (tracker, stack_bytes) = stack::used_by(|| start_tracker::<Float>(course));
        info!("{=str}: stack of the start: {=usize} bytes", name, stack_bytes);
        let mut tracker = tracker?;
        let mut path = Path::new(course);
        let (mut worst, mut total, mut slack) = (0, 0, 0);
        for _ in 0..TICKS_AROUND {
            path.advance();
            let set_point = path.target().set_point().map_err(Fault::Geometry)?;
            let (outcome, cost) = counter.count(|| tracker.tick(&set_point).map(|_| ()));
            outcome?;
            worst = worst.max(cost);
            total += u64::from(cost);
            slack += u32::from(tracker.command().cables.iter().any(|cable| cable.is_slack));
        }
        let mean = total / u64::from(TICKS_AROUND);
        info!("{=str}: {=u32} ticks, {=u32} with a slack cable", name, TICKS_AROUND, slack);
        info!("{=str}: worst tick: {=u32} {=str}", name, worst, COST_UNIT);
        info!("{=str}: mean tick: {=u64} {=str}", name, mean, COST_UNIT);

        // All over again would take its time: the stack only of the next ticks.
        let mut deepest = 0;
        for _ in 0..STACK_TICKS {
            path.advance();
            let set_point = path.target().set_point().map_err(Fault::Geometry)?;
            let (outcome, bytes) = stack::used_by(|| tracker.tick(&set_point).map(|_| ()));
            outcome?;
            deepest = deepest.max(bytes);
        }
        info!("{=str}: stack of a tick: {=usize} bytes", name, deepest);
        Ok(())
    }

    /// Painting the stack takes longer than a tick.
    const STACK_TICKS: u32 = 20;

    /// One Newton step of the 18 equations, condensed and plain, both with the planes of the cables at
    /// the new pose.
    fn steps(counter: &Counter) -> Result<(), Fault<Float>> {
        let (robot, load) =
            (robot::crane::<Float>().map_err(Fault::Geometry)?, robot::load(&path::TAUT.payload));
        let states = black_box(robot::start_states::<Float>(&path::TAUT.payload));
        let mut path = Path::new(path::TAUT);
        let before = path.target().set_point().map_err(Fault::Geometry)?;
        let before = Balance::at(&robot, &load, &before.pose).map_err(Fault::Geometry)?;
        path.advance();
        let pose = black_box(path.target().set_point().map_err(Fault::Geometry)?.pose);

        let (condensed, condensed_cost) = counter.count(|| {
            let balance = before.at_next(&robot, &load, &pose).map_err(Fault::Geometry)?;
            let step = NewtonStep::new(&robot, &balance, &states).map_err(Fault::Step)?;
            Ok(step.states)
        });
        condensed?;
        let plain = || {
            let balance = before.at_next(&robot, &load, &pose).map_err(Fault::Geometry)?;
            plain_step(&robot, &balance, &states).ok_or(Fault::Step(StepFault::SingularStatics))
        };
        let (outcome, plain_cost) = counter.count(plain);
        outcome?;
        let (outcome, plain_bytes) = stack::used_by(plain);
        outcome?;
        info!("condensed step: {=u32} {=str}", condensed_cost, COST_UNIT);
        info!("plain step: {=u32} {=str}", plain_cost, COST_UNIT);
        info!("plain step: stack: {=usize} bytes", plain_bytes);
        Ok(())
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
