//! The controller at the other end of a serial line decides what it decides here, bit for bit: in this process
//! over a line that garbles, loses and repeats bytes, and as the image `in_the_loop` in QEMU.

use std::collections::VecDeque;
use std::fmt::{Debug, Display};
use std::io::{self, BufReader, ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use cdpr_core::CABLES;
use cdpr_core::winch::{Drum, MotorAngle};
use cdpr_firmware_example::Number;
use cdpr_firmware_example::path::{Path, TAUT, WAY_POINT_S};
use cdpr_firmware_example::robot::{self, Model};
use cdpr_firmware_example::station::station;
use cdpr_host_sim::simulate::firmware::{Firmware, FirmwareError};
use cdpr_link::frame::{Frame, Receiver};
use cdpr_link::messages::{Answer, Question};
use cdpr_link::serial::Responder;
use cdpr_link::{Identity, Inputs, Mode, Pace, Request, Start, Target};
use cdpr_qemu::Serving;
use cdpr_tests::images::{Images, M4F_F32, M7_F64};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Periods over a line in this process: twice around the path, nearly.
const PERIODS: usize = 15_000;

/// Periods in QEMU: up to the emergency stop and, recovered, on the way again.
const PERIODS_IN_QEMU: usize = 1_500;

/// Periods in QEMU over a line that is bad as well, where a byte that is lost may cost [`PATIENCE`].
const PERIODS_DAMAGED: usize = 400;

/// One byte in so many is garbled, lost or repeated: one question or answer in ten or so.
const DAMAGED_IN: u32 = 2_000;

/// What is silence on a line to QEMU.
const PATIENCE: Duration = Duration::from_millis(200);

#[test]
fn a_bad_line_changes_no_decision() {
    over_a_bad_line::<f32>();
    over_a_bad_line::<f64>();
}

fn over_a_bad_line<T: OnTheLine>() {
    let script = script::<T>(PERIODS);
    let mut firmware = Firmware::over(Bad::new(Here::<T>::new()));
    replay(&mut firmware, &script);
    assert!(firmware.repeats() > PERIODS as u64 / 10, "asked again {} times", firmware.repeats());
}

#[test]
fn cortex_m4f_decides_the_bits_of_the_host_in_f32() {
    in_qemu::<f32>(M4F_F32);
}

#[test]
fn cortex_m7_decides_the_bits_of_the_host_in_f64() {
    in_qemu::<f64>(M7_F64);
}

fn in_qemu<T: OnTheLine>(images: Images) {
    let script = script::<T>(PERIODS_IN_QEMU);
    let image = images.build("in_the_loop");
    let mut firmware = Firmware::launch(images.machine, &image).unwrap();
    let began = Instant::now();
    replay(&mut firmware, &script);
    let per_second = PERIODS_IN_QEMU as f64 / began.elapsed().as_secs_f64();
    println!("{}: {per_second:.0} periods a second", images.machine); // shown by --nocapture
    let log: Vec<String> = firmware.log().collect();
    assert!(!log.is_empty() && log.iter().all(|line| line == "INFO started"), "{log:?}");

    let line = Serving::launch(images.machine, &image, PATIENCE).unwrap();
    let mut firmware = Firmware::over(Bad::new(line));
    replay(&mut firmware, &script[..PERIODS_DAMAGED]);
    assert!(firmware.repeats() > PERIODS_DAMAGED as u64 / 20, "{}", firmware.repeats());
}

/// The firmware says what it is built for, and the host finds what is different.
#[test]
fn a_firmware_for_another_robot_is_told_apart() {
    let mut firmware = Firmware::over(Here::<f32>::new());
    let theirs = firmware.start(&start()).unwrap();
    let ours = robot::blueprint::<f32>().unwrap();
    assert_eq!(Identity::of(&ours).differs_in(&theirs), None);
    let mut other = ours;
    other.load = robot::load(&robot::EMPTY);
    assert_eq!(Identity::of(&other).differs_in(&theirs), Some("load"));
    let mut other = ours;
    other.monitor.swing_n += 1.0;
    assert_eq!(Identity::of(&other).differs_in(&theirs), Some("drums"));
    let other = Identity::of(&robot::blueprint::<f64>().unwrap());
    assert_eq!(other.differs_in(&theirs), Some("number type"));
}

#[test]
fn it_starts_anew_and_refuses_what_does_not_follow() {
    starts_and_refusals::<f64, _>(Here::<f64>::new());
    let line = Serving::launch(M4F_F32.machine, &M4F_F32.build("in_the_loop"), PATIENCE).unwrap();
    starts_and_refusals::<f32, _>(line);
}

fn starts_and_refusals<T: OnTheLine, L: Read + Write>(line: L) {
    let mut firmware = Firmware::over(line);
    let refused = |outcome| match outcome {
        Err(FirmwareError::Refused(why)) => why,
        other => panic!("{other:?}"),
    };
    let nothing = Inputs::default();
    assert_eq!(refused(firmware.tick(&nothing).map(|_| ())), "not started");
    let nowhere = Start { position_m: [f64::NAN; 3], ..start() };
    assert!(!refused(firmware.start(&nowhere).map(|_| ())).is_empty());
    // Above the anchors, where no way leads.
    let outside = Start { position_m: [3.0, 7.0, 20.0], ..start() };
    let why = refused(firmware.start(&outside).map(|_| ()));
    assert!(why.contains("outside"), "{why}");
    assert_eq!(refused(firmware.tick(&nothing).map(|_| ())), "not started");

    // Where the table leads only by way.
    firmware.start(&Start { position_m: [2.5, 7.3, 2.5], ..start() }).unwrap();
    firmware.tick(&nothing).unwrap();

    // The second time it knows nothing of the first.
    let script = script::<T>(400);
    replay(&mut firmware, &script);
    replay(&mut firmware, &script);
    // A start that fails ends what ran.
    refused(firmware.start(&outside).map(|_| ()));
    assert_eq!(refused(firmware.tick(&nothing).map(|_| ())), "not started");

    let mut line = firmware.into_line();
    let Answer::Started(_) = ask::<T>(&mut line, 0x8000_0000, Question::Start(start())) else {
        panic!("no start")
    };
    let mut tick = |sequence| ask::<T>(&mut line, sequence, Question::Tick(Inputs::default()));
    let first = tick(0x8000_0001);
    assert!(matches!(first, Answer::Ticked(_)), "{first:?}");
    assert_eq!(tick(0x8000_0001), first);
    for out_of_order in [0x8000_0000, 0x8000_0003, 0] {
        let Answer::Refused(why) = tick(out_of_order) else { panic!("{out_of_order}") };
        assert_eq!(why, "this period does not follow the last");
    }
    assert!(matches!(tick(0x8000_0002), Answer::Ticked(_)));
}

/// A question in so many words, and its answer.
fn ask<T: OnTheLine>(
    line: &mut (impl Read + Write),
    sequence: u32,
    message: Question,
) -> Answer<T> {
    line.write_all(&Frame { sequence, message }.encode().unwrap()).unwrap();
    let mut receiver = Receiver::new();
    for byte in BufReader::new(line).bytes() {
        if let Some(frame) = receiver.receive(byte.unwrap()).unwrap() {
            assert_eq!(frame.sequence, sequence);
            return frame.message;
        }
    }
    panic!("it has ended")
}

#[test]
fn a_dead_line_is_no_answer_and_an_end_is_an_end() {
    let mut asked = 0;
    let outcome = Firmware::over(Dead(&mut asked)).start(&start());
    assert!(matches!(outcome, Err(FirmwareError::NoAnswer)), "{outcome:?}");
    assert_eq!(asked, 9);
    let ended = io::Cursor::new(Vec::new());
    let outcome = Firmware::over(ended).start(&start());
    assert!(matches!(outcome, Err(FirmwareError::Ended)), "{outcome:?}");
}

/// A number that goes over the line.
trait OnTheLine: Number + Display + Debug + Serialize + DeserializeOwned + Into<f64> {}

impl<T: Number + Display + Debug + Serialize + DeserializeOwned + Into<f64>> OnTheLine for T {}

/// Where the platform of the firmware starts.
fn start() -> Start {
    let stance = Path::<f64>::new(TAUT).target().stance;
    Start {
        position_m: stance.position_m.into(),
        quaternion: [1.0, 0.0, 0.0, 0.0],
        home_lengths_m: robot::start_lengths_m(&TAUT.payload),
    }
}

/// Inputs, and what a station here decides, as text: its numbers in as many digits as they have.
type Period = (Inputs, String);

fn replay<L: Read + Write>(firmware: &mut Firmware<L>, script: &[Period]) {
    firmware.start(&start()).unwrap();
    for (period, (inputs, expected)) in script.iter().enumerate() {
        let decision = firmware.tick(inputs).unwrap_or_else(|error| panic!("{period}: {error}"));
        assert_eq!(format!("{decision:?}"), *expected, "period {period}");
    }
}

/// Arming, way-points around the path, one of them no pose, an emergency stop, recovery by the table, and on;
/// from the second half on with measured tensions of a load that bounces.
fn script<T: OnTheLine>(periods: usize) -> Vec<Period> {
    /// The operator acts once in so many periods.
    const LOOK: usize = 20;
    /// The emergency stop is pressed after so many periods on the way, while the table covers the pose.
    const STOP_AFTER: usize = 400;
    /// For so many.
    const STOP: usize = 50;
    /// Way-points that the controller has in its queue, at least.
    const AHEAD: u8 = 2;
    /// Which way-point is none.
    const SPOILT: usize = 7;

    let (mut station, _) = station::<T>(&start()).unwrap();
    let mut path = Path::<f64>::coarse(TAUT);
    let mut angles: [i64; CABLES] = std::array::from_fn(|i| {
        let length_m = start().home_lengths_m[i];
        let drum = Drum::new(&robot::DRUM, length_m, MotorAngle::ZERO).unwrap();
        drum.motor_angle(length_m + robot::OFF_AT_START_M).unwrap().units()
    });
    let (mut mode, mut waiting, mut tensions_n) = (Mode::Disarmed, 0, [0.0; CABLES]);
    let (mut moving, mut stopped, mut sent) = (0, 0, 0);
    let (mut place, mut must_recover) = (Place::AtRest, false);
    let (mut modes, mut notes, mut warnings) = (vec![mode], String::new(), 0);
    let mut script = Vec::new();
    for period in 0..periods {
        moving += usize::from(mode == Mode::Tracking);
        let emergency_stop = moving >= STOP_AFTER && stopped < STOP;
        stopped += usize::from(emergency_stop);
        let request = match mode {
            Mode::Disarmed if must_recover => Some(Request::Recover),
            Mode::Disarmed => Some(Request::Arm),
            Mode::Fault if !emergency_stop => Some(Request::Acknowledge),
            _ => None,
        }
        .filter(|_| period % LOOK == 0);
        if mode == Mode::Fault {
            (place, must_recover) = (Place::Away, true);
        } else if request == Some(Request::Recover) {
            must_recover = false;
        }
        let wants_more = matches!(mode, Mode::Holding | Mode::Tracking) && waiting < AHEAD;
        let way_point = wants_more.then(|| {
            sent += 1;
            let is_spoilt = sent == SPOILT;
            if place != Place::Away && !is_spoilt {
                path.advance();
            }
            let mut target = target(&path);
            match place {
                Place::OnTheWay => {}
                // At half the speed on average, to set out.
                Place::AtRest => target.pace = Pace::Duration(2.0 * WAY_POINT_S),
                Place::Away => {
                    (target.linear_m_s, target.angular_rad_s) = ([0.0; 3], [0.0; 3]);
                    target.pace = Pace::Share(0.5);
                }
            }
            place = if place == Place::Away { Place::AtRest } else { Place::OnTheWay };
            if is_spoilt {
                target.position_m[1] = f64::NAN;
            }
            target
        });
        let bounce_n = if period % 64 < 32 { 100.0 } else { -100.0 };
        let inputs = Inputs {
            angles,
            failed_winch: None,
            emergency_stop,
            tensions_n: (period > periods / 2)
                .then(|| tensions_n.map(|tension_n| tension_n + bounce_n)),
            request,
            way_point,
        };
        let decision = station.tick(&inputs);
        if let Some(motors) = &decision.motors {
            angles = motors.map(|motor| motor.angle);
        }
        (mode, waiting) = (decision.mode, decision.waiting);
        tensions_n = decision.tensions_n.map(|tension_n| tension_n.to_f32().unwrap());
        if modes.last() != Some(&mode) {
            modes.push(mode);
        }
        if !decision.note.is_empty() {
            notes.extend([decision.note.as_str(), "\n"]);
        }
        warnings += usize::from(decision.is_warning);
        script.push((inputs, format!("{:?}", decision.map(T::into))));
    }
    let expected = [
        Mode::Disarmed,
        Mode::Aligning,
        Mode::Holding,
        Mode::Tracking,
        Mode::Fault,
        Mode::Disarmed,
        Mode::Aligning,
        Mode::Holding,
        Mode::Tracking,
    ];
    assert!(modes.iter().eq(expected.iter().take(modes.len())), "{modes:?}");
    if periods >= PERIODS_IN_QEMU {
        assert_eq!(modes.len(), expected.len(), "{modes:?} {notes}");
        assert!(periods < PERIODS || notes.contains("way-point refused"), "{notes}");
        assert!(notes.contains("the load swings") && warnings > 0, "{notes}");
    }
    script
}

/// Where the last way-point sent leaves the platform.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    /// Anywhere.
    Away,
    /// On the path, at rest.
    AtRest,
    /// On the path, moving.
    OnTheWay,
}

/// Where a path is.
fn target(path: &Path<f64>) -> Target {
    let target = path.target();
    let q = target.stance.orientation.as_ref().coords;
    Target {
        position_m: target.stance.position_m.into(),
        quaternion: [q.w, q.x, q.y, q.z],
        linear_m_s: target.twist.linear_m_s.into(),
        angular_rad_s: target.twist.angular_rad_s.into(),
        pace: Pace::Duration(WAY_POINT_S),
    }
}

/// The firmware's end of a line, in this process.
struct Here<T: OnTheLine> {
    responder: Responder<'static, T, Model<T>>,
    sent: VecDeque<u8>,
}

impl<T: OnTheLine> Here<T> {
    fn new() -> Self {
        Self { responder: Responder::new(), sent: VecDeque::new() }
    }
}

impl<T: OnTheLine> Write for Here<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for &byte in bytes {
            self.sent.extend(self.responder.receive(byte, station::<T>).iter().flatten());
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<T: OnTheLine> Read for Here<T> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.sent.is_empty() { Err(ErrorKind::WouldBlock.into()) } else { self.sent.read(bytes) }
    }
}

/// A line that garbles, loses and repeats bytes, the same ones in every run.
struct Bad<L> {
    line: L,
    chance: ChaCha8Rng,
}

impl<L> Bad<L> {
    fn new(line: L) -> Self {
        Self { line, chance: ChaCha8Rng::seed_from_u64(7) }
    }

    fn damaged(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut damaged = Vec::new();
        for &byte in bytes {
            match self.chance.random_range(0..3 * DAMAGED_IN) {
                0 => damaged.push(byte ^ (1 << self.chance.random_range(0..8))),
                1 => {}
                2 => damaged.extend([byte; 2]),
                _ => damaged.push(byte),
            }
        }
        damaged
    }
}

impl<L: Write> Write for Bad<L> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let damaged = self.damaged(bytes);
        self.line.write_all(&damaged)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.line.flush()
    }
}

impl<L: Read> Read for Bad<L> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let half = bytes.len() / 2; // each may come twice
        let count = self.line.read(&mut bytes[..half])?;
        let damaged = self.damaged(&bytes[..count]);
        if damaged.is_empty() && count > 0 {
            return Err(ErrorKind::Interrupted.into());
        }
        bytes[..damaged.len()].copy_from_slice(&damaged);
        Ok(damaged.len())
    }
}

/// Nobody is at the other end; counts the questions.
struct Dead<'a>(&'a mut u32);

impl Write for Dead<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        *self.0 += 1;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Read for Dead<'_> {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        Err(ErrorKind::TimedOut.into())
    }
}
