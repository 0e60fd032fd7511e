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
#[cfg(test)]
mod tests;
pub mod types;

use core::ffi::c_char;
use core::mem::{align_of, size_of};
use core::slice;

use cdpr_core::statics::Balance;
use cdpr_core::{Fault, IrvineCatenary, Real, Table, TableFault};

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

/// Starts a tracker from a warm-start table (`cdpr table build`) of so many bytes: on the sheet of the table, at the
/// solution that it leads to at the pose. The table is only read, may lie in flash at any address, and is checked first,
/// with about ten instructions a byte.
///
/// Where it does not cover the pose and `way_parts` is not 0: at the nearest pose that it covers, and from there in at most
/// so many parts, each proven and as expensive as a tick, straight to the pose. The search for that pose looks at each node
/// of the table once at most. Otherwise as `cdpr_f32_start`.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says. `table`: `table_bytes` bytes.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments)] // what C knows of a slice are two
pub unsafe extern "C" fn cdpr_f32_start_from_table(
    tracker: *mut TrackerF32,
    robot: *const Robot<f32>,
    load: *const Load<f32>,
    settings: *const Settings<f32>,
    set_point: *const SetPoint<f32>,
    table: *const u8,
    table_bytes: usize,
    way_parts: u16,
) -> Status<f32> {
    let start = Start { robot, load, settings, set_point };
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { start.with_table(tracker.cast(), table, table_bytes, way_parts) }
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

/// As `cdpr_f32_start_from_table`, in `double`.
///
/// # Safety
/// A pointer that is neither null nor misaligned must point to what its type says. `table`: `table_bytes` bytes.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments)] // what C knows of a slice are two
pub unsafe extern "C" fn cdpr_f64_start_from_table(
    tracker: *mut TrackerF64,
    robot: *const Robot<f64>,
    load: *const Load<f64>,
    settings: *const Settings<f64>,
    set_point: *const SetPoint<f64>,
    table: *const u8,
    table_bytes: usize,
    way_parts: u16,
) -> Status<f64> {
    let start = Start { robot, load, settings, set_point };
    // SAFETY: as promised by the caller; the memory of a tracker has room for its slot.
    unsafe { start.with_table(tracker.cast(), table, table_bytes, way_parts) }
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

/// What all ways to start are given.
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
    /// As `cdpr_f32_start_from_table`.
    unsafe fn with_table(
        self,
        slot: *mut Slot<T>,
        table: *const u8,
        table_bytes: usize,
        way_parts: u16,
    ) -> Status<T> {
        // SAFETY: as promised by the caller.
        let begin = || unsafe {
            let Question { robot, load, settings, set_point } = self.read()?;
            if !is_sound(table) {
                return Err(Status::refusal(Code::BadPointer));
            }
            // No slice is longer.
            if isize::try_from(table_bytes).is_err() {
                return Err(Fault::Table(TableFault::TooShort).into());
            }
            let table =
                Table::open(slice::from_raw_parts(table, table_bytes)).map_err(Fault::Table)?;
            Ok(Tracker::start_from(robot, load, settings, &set_point, &table, way_parts)?)
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
