//! What a tick costs, in instructions and stack, and what the same step costs when done the plain way.
//!
//! ```text
//! cargo measure          # Cortex-M4F, f32
//! cargo measure-m7       # Cortex-M7, f64
//! CDPR_TABLE="$PWD/t.cdpr" cargo measure      # with another warm-start table than the firmware's
//! ```
//!
//! On any other target this is an empty program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod image {
    use core::hint::black_box;

    use cdpr_core::controller::{
        ControllerSettings, MotionLimits, Pace, Queue, Readings, Stance, State, WayPoint,
    };
    use cdpr_core::statics::Balance;
    use cdpr_core::table;
    use cdpr_core::winch::{Drum, DrumDesign, MotorAngle, Sense};
    use cdpr_core::{
        CABLES, Controller, Fault, NewtonStep, Pose, Real, Scalar, SetPoint, StepFault, Table,
        TableFault, Tracker, Twist,
    };
    use cdpr_firmware_example::board::{self, COST_UNIT, Counter};
    use cdpr_firmware_example::control::start_tracker;
    use cdpr_firmware_example::path::{self, Course, Path, TICKS_AROUND};
    use cdpr_firmware_example::plain_step::plain_step;
    use cdpr_firmware_example::robot::{self, Model};
    use cdpr_firmware_example::{Float, stack};
    use cdpr_link::station::WAY_PARTS;
    use defmt::{Display2Format, error, info};
    use nalgebra::{Quaternion, UnitQuaternion};

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let counter = Counter::start();
        let outcome = path("taut path", &counter, path::TAUT)
            .and_then(|()| path("slack path", &counter, path::SLACK))
            .and_then(|()| steps(&counter))
            .and_then(|()| table(&counter))
            .and_then(|()| winch_commands(&counter));
        if let Err(fault) = &outcome {
            error!("{}", Display2Format(fault));
        }
        info!("tracker: {=usize} bytes of RAM", size_of::<Tracker<Float, Model<Float>>>());
        let controls = controller(&counter);
        if controls.is_none() {
            error!("the controller does not start");
        }
        let controller = size_of::<Controller<Float, Model<Float>, 8>>();
        let queue = size_of::<Queue<Float, 9>>();
        info!("controller and queue: {=usize} bytes of RAM", controller + queue);
        board::exit(outcome.is_ok() && controls.is_some())
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

    /// A start by the warm-start table: opening it, and the dearest look-up, convergence and whole start of
    /// many poses.
    fn table(counter: &Counter) -> Result<(), Fault<Float>> {
        let bytes = black_box::<&[u8]>(include_bytes!(env!("CDPR_TABLE")));
        let (table, cost) = counter.count(|| Table::open(bytes));
        let table = table.map_err(Fault::Table)?;
        info!("table: {=usize} bytes, {=u8} steps", bytes.len(), table.steps());
        info!("table: open: {=u32} {=str}", cost, COST_UNIT);
        let robot = robot::crane::<Float>().map_err(Fault::Geometry)?;
        let load = robot::load(&path::TAUT.payload);
        let still = Twist::none();
        let (mut seeds, mut states, mut starts) = (0, 0, 0);
        let (mut deepest, mut covered, mut started) = (0, 0, 0);
        for number in 1..=TABLE_POSES {
            let pose = spread_pose(&table, number)?;
            let set_point = black_box(SetPoint { pose, twist: still });
            let (seed, cost) = counter.count(|| table.start_at(&set_point.pose));
            match seed {
                Err(TableFault::Uncovered(_)) => continue,
                found => found.map_err(Fault::Table)?,
            };
            seeds = seeds.max(cost);
            let (found, cost) = counter.count(|| table.states(&robot, &load, &set_point.pose));
            found.map_err(Fault::Table)?;
            states = states.max(cost);
            let start =
                || Tracker::start_from(robot, load, robot::settings(), &set_point, &table, 0);
            covered += 1;
            let (tracker, cost) = counter.count(start);
            // Lengths may be beyond the limits of the firmware, and cables too much between taut and slack for f32.
            if tracker.is_err() {
                continue;
            }
            starts = starts.max(cost);
            if started == 0 {
                let (tracker, bytes) = stack::used_by(start);
                tracker?;
                deepest = bytes;
            }
            started += 1;
        }
        info!("table: {=u32} of {=u32} poses have a seed", covered, TABLE_POSES);
        info!("table: {=u32} of them are started at", started);
        info!("table: worst look-up: {=u32} {=str}", seeds, COST_UNIT);
        info!("table: worst look-up and convergence: {=u32} {=str}", states, COST_UNIT);
        info!("table: worst start: {=u32} {=str}", starts, COST_UNIT);
        info!("table: stack of a start: {=usize} bytes", deepest);

        // A third of a metre away from the firmware's, and tilted.
        let pose = table::pose(&FAR_AWAY.map(<Float as Scalar>::constant));
        let set_point = black_box(SetPoint { pose: pose.map_err(Fault::Geometry)?, twist: still });
        let start = |parts: u16| {
            Tracker::start_from(robot, load, robot::settings(), &set_point, &table, parts)
        };
        let Some(parts) = (1..WAY_PARTS).find(|parts| start(*parts).is_ok()) else {
            return Err(Fault::Table(TableFault::OutsideRegion));
        };
        let (tracker, cost) = counter.count(|| start(parts));
        tracker?;
        info!("table: parts of a way: {=u16}", parts);
        info!("table: start by way: {=u32} {=str}", cost, COST_UNIT);
        let (tracker, bytes) = stack::used_by(|| start(parts));
        tracker?;
        info!("table: stack of a start by way: {=usize} bytes", bytes);
        Ok(())
    }

    /// Where the start by way leads: position (m) and turn vector.
    const FAR_AWAY: [f64; 6] = [2.4, 7.5, 2.5, 0.03, 0.0, 0.0];

    /// Poses at which starts by the table are measured.
    const TABLE_POSES: u32 = 1000;

    /// Poses spread over the region of a table: multiples of irrational parts of its extents, wrapped.
    fn spread_pose<T: Real>(table: &Table<'_>, number: u32) -> Result<Pose<T>, Fault<T>> {
        // The roots of 2, 3, 5, 7, 11 and 13, less their whole parts, times 2^32.
        const STEPS: [u32; 6] =
            [0x6a09_e667, 0xbb67_ae85, 0x3c6e_f372, 0xa54f_f53a, 0x510e_527f, 0x9b05_688c];
        let (low, extent) = (table.low(), table.extent());
        let c: [T; 6] = core::array::from_fn(|k| {
            let share = f64::from(number.wrapping_mul(STEPS[k])) / 4_294_967_296.0;
            T::constant(f64::from(low[k]) + f64::from(extent[k]) * share)
        });
        table::pose(&c).map_err(Fault::Geometry)
    }

    /// Rest lengths and their rates as angles and speeds of six motors.
    fn winch_commands(counter: &Counter) -> Result<(), Fault<Float>> {
        let design = DrumDesign {
            radius_m: 0.05,
            pitch_m: 0.005,
            gear: 20.0,
            sense: Sense::Forward,
            winding_tension_n: 100.0,
            compliance_per_n: 8e-7,
        };
        let length_m =
            black_box(robot::start_states::<Float>(&path::TAUT.payload))[0].rest_length_m;
        let Ok(drum) = Drum::<Float>::new(&design, length_m, MotorAngle::ZERO) else {
            return Ok(()); // no line is printed, and the test misses it
        };
        let drums = black_box([drum; CABLES]);
        let tracker = start_tracker::<Float>(path::TAUT)?;
        let command = black_box(*tracker.command());
        let (angles, cost) = counter.count(|| {
            let mut angles = [(MotorAngle::ZERO, 0.0); CABLES];
            for (i, cable) in command.cables.iter().enumerate() {
                if let Ok(angle) = drums[i].motor_angle(cable.rest_length_m) {
                    angles[i] = (angle, drums[i].motor_speed_rad_s(cable.rest_length_rate_m_s));
                }
            }
            angles
        });
        black_box(angles);
        info!("winch commands: {=u32} {=str}", cost, COST_UNIT);
        Ok(())
    }

    /// A whole tick of the controller: a motion to a way-point and its path, the tracker, monitors of
    /// lengths, brakes and events.
    fn controller(counter: &Counter) -> Option<()> {
        let settings = ControllerSettings {
            motion: MotionLimits {
                distance_m: 5.0,
                speed_m_s: 0.8,
                acceleration_m_s2: 2.0,
                jerk_m_s3: 10.0,
                turn_speed_rad_s: 0.5,
                turn_acceleration_rad_s2: 1.0,
                turn_jerk_rad_s3: 5.0,
            },
            halt_ticks: 100,
            stream_ticks: None,
            align_speed_m_s: 0.1,
            align_reach_m: 0.05,
            align_tolerance_m: 1e-3,
            settle_ticks: 20,
            following_m: 0.02,
            brake_ticks: 10,
            brake_after_ticks: None,
        };
        let home = Stance {
            position_m: robot::start_position_m(),
            orientation: UnitQuaternion::new_unchecked(Quaternion::new(1.0, 0.0, 0.0, 0.0)),
        };
        let mut goal = home;
        goal.position_m.x += 0.5;
        let payload = &path::TAUT.payload;
        let mut controller = Controller::<Float, Model<Float>, 8>::start(
            robot::crane().ok()?,
            robot::load(payload),
            robot::settings(),
            settings,
            home,
            &robot::start_states(payload),
        )
        .ok()?;
        let mut lengths = controller.tracker().command().cables.map(|cable| cable.rest_length_m);
        let readings =
            |rest_lengths_m| Readings { rest_lengths_m, failed_winch: None, emergency_stop: false };
        controller.arm(&readings(lengths)).ok()?;
        let (mut worst, mut tracked) = (0, 0);
        for tick in 0..2_000_u32 {
            let now = readings(lengths);
            let way_point = match tick {
                100 => Some(WayPoint::stop(goal, Pace::Share(1.0))),
                101 => Some(WayPoint::stop(home, Pace::Share(1.0))),
                _ => None,
            };
            let (outputs, cost) = counter.count(|| controller.tick(&now, || way_point));
            if let Some(targets) = outputs.targets {
                lengths = targets.map(|target| target.rest_length_m);
            }
            worst = worst.max(cost);
            tracked += u32::from(controller.state() == State::Tracking);
        }
        info!(
            "controller: worst tick: {=u32} {=str}, {=u32} ticks of motion",
            worst, COST_UNIT, tracked
        );
        // On the way there once more.
        let mut deepest = 0;
        for tick in 0..STACK_TICKS {
            let now = readings(lengths);
            let way_point = (tick == 0).then_some(WayPoint::stop(goal, Pace::Share(1.0)));
            let (outputs, bytes) = stack::used_by(|| controller.tick(&now, || way_point));
            if let Some(targets) = outputs.targets {
                lengths = targets.map(|target| target.rest_length_m);
            }
            deepest = deepest.max(bytes);
        }
        info!("controller: stack of a tick: {=usize} bytes", deepest);
        (tracked > 0 && controller.state() == State::Tracking).then_some(())
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
