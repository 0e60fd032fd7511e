//! [`cdpr_core`] from C: a static library, `libcdpr_core_c.a`, and its header, `include/cdpr.h`.
//!
//! Every function comes for `float` (`cdpr_f32_`) and `double` (`cdpr_f64_`). The caller owns all
//! memory; nothing is allocated, nothing is global, no call blocks or panics. This is the one crate
//! with `unsafe`: it reads and writes what the pointers of the caller point to, and does nothing else.

#![no_std]
#![deny(unsafe_op_in_unsafe_fn, clippy::undocumented_unsafe_blocks)]

// On a host the panic handler is that of std; a panic could not cross the border: it ends the program.
#[cfg(not(target_os = "none"))]
extern crate std;

mod start;
pub mod status;
pub mod types;

use core::ffi::c_char;
use core::mem::{align_of, size_of};

use cdpr_core::statics::Balance;
use cdpr_core::{IrvineCatenary, Real};

use crate::status::{Code, Status};
use crate::types::{CDPR_CABLES, CableState, Command, Load, Robot, SetPoint, Settings};

/// Version of this header: major << 16 | minor << 8 | patch.
pub const CDPR_VERSION: u32 = 0x0000_0100;

/// Size of a `float` tracker in 64-bit words.
pub const CDPR_F32_TRACKER_WORDS: usize = 192;

/// Size of a `double` tracker in 64-bit words.
pub const CDPR_F64_TRACKER_WORDS: usize = 384;

/// A tracker in `float`: follows one branch, six rest lengths at each tick, each proven.
///
/// Its memory is the caller's and its contents are not: set it to zero (a `static` is) and start it. It
/// holds no pointers and may be copied. Two threads may not use the same one at the same time.
#[repr(C)]
pub struct TrackerF32 {
    words: [u64; CDPR_F32_TRACKER_WORDS],
}

/// A tracker in `double`: see the one in `float`.
#[repr(C)]
pub struct TrackerF64 {
    words: [u64; CDPR_F64_TRACKER_WORDS],
}

/// What a tracker's memory holds.
#[repr(C)]
struct Slot<T: Real> {
    /// [`STARTED`] when there is a tracker.
    mark: u64,
    tracker: cdpr_core::Tracker<T, IrvineCatenary<T>>,
}

/// Unlikely in memory that has not been started, whatever it holds.
const STARTED: u64 = 0x9e37_79b9_7f4a_7c15;

const fn fits<T: Real, Memory>() -> bool {
    size_of::<Slot<T>>() <= size_of::<Memory>() && align_of::<Slot<T>>() <= align_of::<Memory>()
}
const _: () = assert!(fits::<f32, TrackerF32>(), "make CDPR_F32_TRACKER_WORDS larger");
const _: () = assert!(fits::<f64, TrackerF64>(), "make CDPR_F64_TRACKER_WORDS larger");

#[cfg(target_os = "none")]
mod no_panic {
    use core::panic::PanicInfo;

    unsafe extern "C" {
        /// Defined nowhere.
        safe fn cdpr_core_c_can_panic() -> !;
    }

    /// Where the optimizer has removed every panic the linker removes this too; where it has not, it
    /// names the missing function.
    #[panic_handler]
    fn panic(_: &PanicInfo<'_>) -> ! {
        cdpr_core_c_can_panic()
    }
}

/// Version of the library: compare with `CDPR_VERSION` of the header before anything else.
#[unsafe(no_mangle)]
pub extern "C" fn cdpr_version() -> u32 {
    CDPR_VERSION
}

/// A code in a few words of ASCII, for a display or a log. Never null.
#[unsafe(no_mangle)]
pub extern "C" fn cdpr_text(code: i32) -> *const c_char {
    let known = Code::ALL.iter().find(|known| **known as i32 == code);
    known.map_or(c"not a code", |known| known.text()).as_ptr()
}

/// Starts a tracker at the equilibrium that Newton's method finds from six forces and rest lengths,
/// those of the last command before the power was cut, say.
///
/// The first command is then to be had by `cdpr_f32_last_command`. After a failure there is no tracker.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says. `states`: six.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cdpr_f32_start(
    tracker: *mut TrackerF32,
    robot: *const Robot<f32>,
    load: *const Load<f32>,
    settings: *const Settings<f32>,
    set_point: *const SetPoint<f32>,
    states: *const CableState<f32>,
) -> Status<f32> {
    let start = Start { robot, load, settings, set_point };
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { start.with_states(tracker.cast(), states.cast()) }
}

/// Starts a tracker without knowing any force: at the equilibrium whose rest lengths are those that the
/// encoders measure, within a tolerance (m, all errors together: encoder, drum, pose).
///
/// The lengths tell which of the equilibria of the pose this one is: which cables are taut and which
/// hang slack. With a larger tolerance than the lengths of two equilibria differ by, either may be taken.
/// Otherwise as `cdpr_f32_start`. At most five attempts of twenty Newton steps, usually one of three to seven.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says. `lengths_m`: six.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cdpr_f32_start_from_lengths(
    tracker: *mut TrackerF32,
    robot: *const Robot<f32>,
    load: *const Load<f32>,
    settings: *const Settings<f32>,
    set_point: *const SetPoint<f32>,
    lengths_m: *const f32,
    tolerance_m: f32,
) -> Status<f32> {
    let start = Start { robot, load, settings, set_point };
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { start.with_lengths(tracker.cast(), lengths_m.cast(), tolerance_m) }
}

/// The next command. After a failure `command` is untouched and the last command stands; see the remedy.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cdpr_f32_tick(
    tracker: *mut TrackerF32,
    set_point: *const SetPoint<f32>,
    command: *mut Command<f32>,
) -> Status<f32> {
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { tick(tracker.cast(), set_point, command) }
}

/// The last command, the first one after a start.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cdpr_f32_last_command(
    tracker: *const TrackerF32,
    command: *mut Command<f32>,
) -> Status<f32> {
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { last_command(tracker.cast(), command) }
}

/// As `cdpr_f32_start`, in `double`.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says. `states`: six.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cdpr_f64_start(
    tracker: *mut TrackerF64,
    robot: *const Robot<f64>,
    load: *const Load<f64>,
    settings: *const Settings<f64>,
    set_point: *const SetPoint<f64>,
    states: *const CableState<f64>,
) -> Status<f64> {
    let start = Start { robot, load, settings, set_point };
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { start.with_states(tracker.cast(), states.cast()) }
}

/// As `cdpr_f32_start_from_lengths`, in `double`.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says. `lengths_m`: six.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cdpr_f64_start_from_lengths(
    tracker: *mut TrackerF64,
    robot: *const Robot<f64>,
    load: *const Load<f64>,
    settings: *const Settings<f64>,
    set_point: *const SetPoint<f64>,
    lengths_m: *const f64,
    tolerance_m: f64,
) -> Status<f64> {
    let start = Start { robot, load, settings, set_point };
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { start.with_lengths(tracker.cast(), lengths_m.cast(), tolerance_m) }
}

/// As `cdpr_f32_tick`, in `double`.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cdpr_f64_tick(
    tracker: *mut TrackerF64,
    set_point: *const SetPoint<f64>,
    command: *mut Command<f64>,
) -> Status<f64> {
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { tick(tracker.cast(), set_point, command) }
}

/// As `cdpr_f32_last_command`, in `double`.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cdpr_f64_last_command(
    tracker: *const TrackerF64,
    command: *mut Command<f64>,
) -> Status<f64> {
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { last_command(tracker.cast(), command) }
}

type Tracker<T> = cdpr_core::Tracker<T, IrvineCatenary<T>>;

/// What both ways to start are given.
struct Start<T> {
    robot: *const Robot<T>,
    load: *const Load<T>,
    settings: *const Settings<T>,
    set_point: *const SetPoint<T>,
}

impl<T: Real> Start<T> {
    /// # Safety
    /// As `cdpr_f32_start`.
    unsafe fn with_states(
        self,
        slot: *mut Slot<T>,
        states: *const [CableState<T>; CDPR_CABLES],
    ) -> Status<T> {
        // SAFETY: as promised by the caller.
        unsafe { fill(slot, || self.read()?.start(&read(states)?.map(CableState::to_core))) }
    }

    /// # Safety
    /// As `cdpr_f32_start_from_lengths`.
    unsafe fn with_lengths(
        self,
        slot: *mut Slot<T>,
        lengths_m: *const [T; CDPR_CABLES],
        tolerance_m: T,
    ) -> Status<T> {
        // SAFETY: as promised by the caller.
        let begin = || unsafe {
            let question = self.read()?;
            let balance = Balance::at(&question.robot, &question.load, &question.set_point.pose)?;
            let lengths_m = read(lengths_m)?;
            let states = start::from_lengths(&question.robot, &balance, &lengths_m, tolerance_m)?;
            question.start(&states)
        };
        // SAFETY: as promised by the caller.
        unsafe { fill(slot, begin) }
    }

    /// # Safety
    /// As `cdpr_f32_start`.
    unsafe fn read(&self) -> Result<Question<T>, Status<T>> {
        // SAFETY: as promised by the caller.
        unsafe {
            Ok(Question {
                robot: read(self.robot)?.to_core()?,
                load: read(self.load)?.to_core(),
                settings: read(self.settings)?.to_core(),
                set_point: read(self.set_point)?.to_core()?,
            })
        }
    }
}

/// The same in terms of the core.
struct Question<T: Real> {
    robot: cdpr_core::Robot<T, IrvineCatenary<T>>,
    load: cdpr_core::Load<T>,
    settings: cdpr_core::TrackerSettings<T>,
    set_point: cdpr_core::SetPoint<T>,
}

impl<T: Real> Question<T> {
    fn start(
        self,
        states: &[cdpr_core::CableState<T>; CDPR_CABLES],
    ) -> Result<Tracker<T>, Status<T>> {
        Ok(Tracker::start(self.robot, self.load, self.settings, &self.set_point, states)?)
    }
}

/// Puts a tracker where the caller wants it, or marks the place as empty.
///
/// # Safety
/// If `slot` is neither null nor misaligned, it can be written.
unsafe fn fill<T: Real>(
    slot: *mut Slot<T>,
    make: impl FnOnce() -> Result<Tracker<T>, Status<T>>,
) -> Status<T> {
    if !is_sound(slot) {
        return Status::refusal(Code::BadPointer);
    }
    let (mark, status) = match make() {
        Ok(tracker) => {
            // SAFETY: not null, aligned, and to be written as promised by the caller.
            unsafe { (&raw mut (*slot).tracker).write(tracker) };
            (STARTED, Status::ok())
        }
        Err(status) => (0, status),
    };
    // SAFETY: the same.
    unsafe { (&raw mut (*slot).mark).write(mark) };
    status
}

/// # Safety
/// As `cdpr_f32_tick`.
unsafe fn tick<T: Real>(
    slot: *mut Slot<T>,
    set_point: *const SetPoint<T>,
    command: *mut Command<T>,
) -> Status<T> {
    // SAFETY: as promised by the caller.
    let outcome = || unsafe {
        started(slot)?;
        if !is_sound(command) {
            return Err(Status::refusal(Code::BadPointer));
        }
        let set_point = read(set_point)?.to_core()?;
        command.write((*slot).tracker.tick(&set_point)?.into());
        Ok(())
    };
    outcome().err().unwrap_or_else(Status::ok)
}

/// # Safety
/// As `cdpr_f32_last_command`.
unsafe fn last_command<T: Real>(slot: *const Slot<T>, command: *mut Command<T>) -> Status<T> {
    // SAFETY: as promised by the caller.
    let outcome = || unsafe {
        started(slot)?;
        if !is_sound(command) {
            return Err(Status::refusal(Code::BadPointer));
        }
        command.write((*slot).tracker.command().into());
        Ok(())
    };
    outcome().err().unwrap_or_else(Status::ok)
}

/// Whether there is a tracker.
///
/// # Safety
/// If `slot` is neither null nor misaligned, it can be read.
unsafe fn started<T: Real>(slot: *const Slot<T>) -> Result<(), Status<T>> {
    if !is_sound(slot) {
        return Err(Status::refusal(Code::BadPointer));
    }
    // SAFETY: not null, aligned, and to be read as promised by the caller.
    let mark = unsafe { (&raw const (*slot).mark).read() };
    if mark == STARTED { Ok(()) } else { Err(Status::refusal(Code::NotStarted)) }
}

/// What a pointer of the caller points to.
///
/// # Safety
/// If it is neither null nor misaligned, it points to an `S`.
unsafe fn read<S: Copy, T: Real>(pointer: *const S) -> Result<S, Status<T>> {
    if is_sound(pointer) {
        // SAFETY: not null, aligned, and to be read as promised by the caller.
        Ok(unsafe { pointer.read() })
    } else {
        Err(Status::refusal(Code::BadPointer))
    }
}

fn is_sound<S>(pointer: *const S) -> bool {
    !pointer.is_null() && pointer.is_aligned()
}

#[cfg(test)]
mod tests {
    use core::mem::zeroed;
    use core::ptr::{null, null_mut};

    use super::*;
    use crate::status::Remedy;
    use crate::types::{Cable, CableCommand, CableLimits};

    fn robot() -> Robot<f64> {
        let cables = [
            ([-3.259, -0.475, 8.826], [-0.10, -0.93, -0.03]),
            ([9.421, -3.482, 11.555], [0.10, -0.93, -0.03]),
            ([9.538, 3.797, 11.533], [0.27, 0.50, -0.07]),
            ([5.570, 20.414, 8.704], [0.27, 0.50, -0.07]),
            ([-2.505, 16.810, 8.649], [-0.27, 0.50, -0.07]),
            ([-3.342, 9.421, 8.788], [-0.27, 0.50, -0.07]),
        ];
        Robot {
            cables: cables.map(|(anchor_m, attachment_m)| Cable {
                anchor_m,
                attachment_m,
                weight_n_m: 0.079 * 9.81,
                compliance_per_n: 1.0 / 1.256_637_1e6,
            }),
        }
    }

    static LOAD: Load<f64> = Load {
        mass_kg: 69.0,
        center_of_mass_m: [0.0; 3],
        gravity_m_s2: 9.81,
        force_n: [0.0; 3],
        moment_nm: [0.0; 3],
    };

    static SETTINGS: Settings<f64> = Settings {
        period_s: 0.001,
        largest_move_m: 0.01,
        least_distance: 1e-4,
        fold_horizon_s: 0.1,
        largest_error_n: 1.0,
        cables: [CableLimits {
            shortest_m: 1.0,
            longest_m: 50.0,
            fastest_m_s: 2.0,
            lowest_tension_n: 5.0,
            highest_tension_n: 2000.0,
        }; CDPR_CABLES],
    };

    static SET_POINT: SetPoint<f64> = SetPoint {
        position_m: [2.0, 7.0, 2.5],
        orientation: [1.0, 0.0, 0.0, 0.0],
        velocity_m_s: [0.0; 3],
        angular_velocity_rad_s: [0.0; 3],
    };

    /// The solution there: see the firmware's robot.
    const LENGTHS_M: [f64; CDPR_CABLES] =
        [10.479_832, 15.077_343, 12.221_567, 14.731_523, 11.970_178, 8.355_886];

    fn start(
        robot: &Robot<f64>,
        lengths_m: &[f64; 6],
        tolerance_m: f64,
    ) -> (TrackerF64, Status<f64>) {
        let mut tracker = TrackerF64 { words: [0; CDPR_F64_TRACKER_WORDS] };
        // SAFETY: all pointers are of references.
        let status = unsafe {
            cdpr_f64_start_from_lengths(
                &raw mut tracker,
                robot,
                &raw const LOAD,
                &raw const SETTINGS,
                &raw const SET_POINT,
                lengths_m.as_ptr(),
                tolerance_m,
            )
        };
        (tracker, status)
    }

    #[test]
    fn lengths_within_the_tolerance_lead_to_the_solution() {
        let sign = |cables: u32, i: usize| if cables >> i & 1 == 0 { 1.0 } else { -1.0 };
        for error_m in [0.0, 0.001, 0.02, 0.1, 0.3] {
            for cables in 0..64 {
                let lengths_m = core::array::from_fn(|i| LENGTHS_M[i] + error_m * sign(cables, i));
                let (tracker, status) = start(&robot(), &lengths_m, error_m + 1e-5);
                assert_eq!(status, Status::ok(), "{error_m} {cables}");
                // SAFETY: every bit pattern of it is a command, this one included.
                let mut command: Command<f64> = unsafe { zeroed() };
                // SAFETY: both pointers are of references.
                let status = unsafe { cdpr_f64_last_command(&raw const tracker, &raw mut command) };
                assert_eq!(status, Status::ok());
                for (cable, expected_m) in command.cables.iter().zip(LENGTHS_M) {
                    // They are written in f32.
                    let bound_m = f64::from(f32::EPSILON) * expected_m;
                    assert!((cable.rest_length_m - expected_m).abs() <= bound_m);
                }
            }
        }
    }

    #[test]
    fn lengths_of_no_equilibrium_are_refused() {
        let mut lengths_m = LENGTHS_M;
        lengths_m[3] += 0.1;
        let (mut tracker, status) = start(&robot(), &lengths_m, 0.05);
        assert_eq!(status.code, Code::NoSolutionNearLengths);
        assert_eq!(status.remedy, Remedy::MendCall);
        assert_eq!(status.cable, 3);
        assert!((status.value - 0.1).abs() < 1e-5, "{}", status.value);
        // SAFETY: every bit pattern of it is a command, this one included.
        let mut command: Command<f64> = unsafe { zeroed() };
        // SAFETY: all pointers are of references.
        let status =
            unsafe { cdpr_f64_tick(&raw mut tracker, &raw const SET_POINT, &raw mut command) };
        assert_eq!(status, Status::refusal(Code::NotStarted));

        lengths_m[3] = f64::NAN;
        let (_, status) = start(&robot(), &lengths_m, 0.05);
        assert_eq!((status.code, status.cable), (Code::InvalidMeasurement, 3));
        let (_, status) = start(&robot(), &LENGTHS_M, 0.0);
        assert_eq!((status.code, status.cable), (Code::InvalidMeasurement, -1));
    }

    #[test]
    fn unsound_robots_are_refused() {
        let mut unsound = robot();
        unsound.cables[2].weight_n_m = -1.0;
        assert_eq!(
            start(&unsound, &LENGTHS_M, 0.1).1,
            Status::refusal(Code::InvalidCable).of_cable(2)
        );
        let mut unsound = robot();
        unsound.cables[5].anchor_m = unsound.cables[1].anchor_m;
        let status = start(&unsound, &LENGTHS_M, 0.1).1;
        assert_eq!(
            (status.code, status.cable, status.other_cable),
            (Code::CoincidentAnchors, 1, 5)
        );
    }

    #[test]
    fn bad_pointers_are_refused() {
        let bad = Status::refusal(Code::BadPointer);
        let (mut tracker, status) = start(&robot(), &LENGTHS_M, 0.01);
        assert_eq!(status, Status::ok());
        // SAFETY: every bit pattern of it is a command, this one included.
        let mut command: Command<f64> = unsafe { zeroed() };
        // SAFETY: both pointers are of references.
        let _ = unsafe { cdpr_f64_last_command(&raw const tracker, &raw mut command) };
        let states = command.cables.map(|CableCommand { force_n, rest_length_m, .. }| CableState {
            force_n,
            rest_length_m,
        });
        let crane = robot();
        let misaligned = (&raw mut tracker).wrapping_byte_add(1);
        let (tracker, command) = (&raw mut tracker, &raw mut command);
        // SAFETY: all pointers are of references, null or misaligned.
        unsafe {
            assert_eq!(cdpr_f64_tick(null_mut(), &raw const SET_POINT, command), bad);
            assert_eq!(cdpr_f64_tick(misaligned, &raw const SET_POINT, command), bad);
            assert_eq!(cdpr_f64_tick(tracker, null(), command), bad);
            assert_eq!(cdpr_f64_tick(tracker, &raw const SET_POINT, null_mut()), bad);
            assert_eq!(cdpr_f64_last_command(tracker, null_mut()), bad);
            assert_eq!(cdpr_f64_last_command(null(), command), bad);
            // None of which has harmed it.
            assert_eq!(cdpr_f64_tick(tracker, &raw const SET_POINT, command), Status::ok());

            let set_point = &raw const SET_POINT;
            let (robot, load, settings) = (&raw const crane, &raw const LOAD, &raw const SETTINGS);
            let states = states.as_ptr();
            assert_eq!(cdpr_f64_start(null_mut(), robot, load, settings, set_point, states), bad);
            assert_eq!(cdpr_f64_start(tracker, null(), load, settings, set_point, states), bad);
            assert_eq!(cdpr_f64_start(tracker, robot, null(), settings, set_point, states), bad);
            assert_eq!(cdpr_f64_start(tracker, robot, load, null(), set_point, states), bad);
            assert_eq!(cdpr_f64_start(tracker, robot, load, settings, null(), states), bad);
            assert_eq!(cdpr_f64_start(tracker, robot, load, settings, set_point, null()), bad);
            assert_eq!(
                cdpr_f64_start(tracker, robot, load, settings, set_point, states),
                Status::ok()
            );
        }
    }

    #[test]
    fn every_code_has_its_own_text_and_nothing_else_has_one() {
        // SAFETY: the texts are of static C strings.
        let text = |code| unsafe { core::ffi::CStr::from_ptr(cdpr_text(code)) };
        for code in -10..=110 {
            let known = Code::ALL.iter().any(|known| *known as i32 == code);
            assert_eq!(text(code) != c"not a code", known, "{code}");
        }
        for (i, code) in Code::ALL.iter().enumerate() {
            for other in &Code::ALL[..i] {
                assert_ne!(text(*code as i32), text(*other as i32));
            }
        }
    }

    #[test]
    fn version_is_that_of_the_package() {
        let part = |text: &str| text.parse::<u32>().unwrap();
        let version = part(env!("CARGO_PKG_VERSION_MAJOR")) << 16
            | part(env!("CARGO_PKG_VERSION_MINOR")) << 8
            | part(env!("CARGO_PKG_VERSION_PATCH"));
        assert_eq!(cdpr_version(), version);
    }
}
