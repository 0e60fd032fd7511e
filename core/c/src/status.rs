//! The outcome of a call: a code, what is to be done, and the numbers that say where and how much.

use core::ffi::CStr;

use cdpr_core::{Fault, GeometryFault, Real, StepFault, TableFault};

// i32: an enum of C is as short as it can be on ARM, or not, as the flags of the compiler say.
/// Why a call did not do what it was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Code {
    /// All is well.
    Ok = 0,

    /// A pointer is null, or not aligned as its type asks.
    BadPointer = 1,
    /// This tracker has not been started, or its start has failed.
    NotStarted = 2,
    /// Weight or compliance of `cable` is negative or not finite.
    InvalidCable = 3,
    /// A coordinate of `cable` is not finite.
    NonFiniteCable = 4,
    /// `cable` and `other_cable` leave from the same anchor.
    CoincidentAnchors = 5,
    /// All attachments lie on one line, about which no set of cables can balance a moment.
    CollinearAttachments = 6,
    /// The measured length of `cable` is not positive and finite, or (-1) the tolerance is not.
    InvalidMeasurement = 7,
    /// There is no equilibrium near the measured lengths, or none was found. Of the nearest one,
    /// `cable` is the furthest off, by `value`, m. -1: none at all.
    NoSolutionNearLengths = 8,

    /// A number of the set-point is infinite or NaN.
    NonFiniteSetPoint = 10,
    /// The position is not finite, or the quaternion is not of unit length.
    InvalidPose = 11,
    /// No set-point has come for longer than allowed. `value`: ticks since the last one.
    StaleSetPoint = 12,

    /// The set-point lies further from the last pose than a tick may move. `value`: distance of the
    /// platform origin, m; `other_value`: largest move of an attachment by turning, m.
    JumpingSetPoint = 20,
    /// The rest length of `cable` would change too fast. `value`: speed wanted, m/s.
    SpeedBeyondWinch = 21,
    /// The equations are not met to rounding. `value`: largest distance between the end of a cable and
    /// its attachment, m; `other_value`: unbalanced wrench, moments over the moment arm, N.
    ResidualNotMet = 22,
    /// That the solution belongs to the branch could not be proven. `value`: the contraction found;
    /// below one half is needed.
    NotCertified = 23,

    /// At this pose the attachment of `cable` lies on its anchor.
    AttachmentOnAnchor = 30,
    /// The tension of `cable` vanishes somewhere along it.
    SingularCable = 31,
    /// The cables cannot balance every wrench: a fold, or a singular posture.
    SingularStatics = 32,
    /// `cable` would have no positive rest length.
    LengthNotPositive = 33,
    /// The cables hardly hold the platform against some wrench. `value`: how much the matrix of tangent
    /// wrenches may change before it is singular, between 0 and 1.
    NearSingularity = 34,
    /// At the present speed this branch ends in a fold. `value`: time to it, s.
    FoldAhead = 35,
    /// A tension of `cable` is above its limit. `value`: the larger one of its ends, N.
    TensionAbove = 36,
    /// The tension of `cable` at its anchor is below its limit. `value`: that tension, N.
    TensionBelow = 37,
    /// `cable` is longer or shorter than its winch can hold. `value`: rest length wanted, m.
    LengthBeyondWinch = 38,

    /// The bytes are no warm-start table of the version that this library reads, or they have been damaged.
    BadTable = 40,
    /// The table was made for a robot with another `cable`, or (-1) for another load or cable model.
    OtherRobot = 41,
    /// The pose is in no cell of the table, and no way of `way_parts` parts was found that leads there from one.
    NotInTable = 42,

    /// Something this interface has no name for; the remedy holds all the same.
    Other = 99,
}

impl Code {
    /// All of them.
    pub(crate) const ALL: [Self; 29] = [
        Self::Ok,
        Self::BadPointer,
        Self::NotStarted,
        Self::InvalidCable,
        Self::NonFiniteCable,
        Self::CoincidentAnchors,
        Self::CollinearAttachments,
        Self::InvalidMeasurement,
        Self::NoSolutionNearLengths,
        Self::NonFiniteSetPoint,
        Self::InvalidPose,
        Self::StaleSetPoint,
        Self::JumpingSetPoint,
        Self::SpeedBeyondWinch,
        Self::ResidualNotMet,
        Self::NotCertified,
        Self::AttachmentOnAnchor,
        Self::SingularCable,
        Self::SingularStatics,
        Self::LengthNotPositive,
        Self::NearSingularity,
        Self::FoldAhead,
        Self::TensionAbove,
        Self::TensionBelow,
        Self::LengthBeyondWinch,
        Self::BadTable,
        Self::OtherRobot,
        Self::NotInTable,
        Self::Other,
    ];

    /// In a few words.
    pub(crate) fn text(self) -> &'static CStr {
        match self {
            Self::Ok => c"all is well",
            Self::BadPointer => c"a pointer is null or not aligned",
            Self::NotStarted => c"the tracker has not been started",
            Self::InvalidCable => c"weight or compliance of a cable is negative or not finite",
            Self::NonFiniteCable => c"a coordinate of a cable is not finite",
            Self::CoincidentAnchors => c"two cables leave from the same anchor",
            Self::CollinearAttachments => c"all attachments lie on one line",
            Self::InvalidMeasurement => c"a measured length or the tolerance is not positive",
            Self::NoSolutionNearLengths => c"no equilibrium near the measured lengths was found",
            Self::NonFiniteSetPoint => c"a number of the set-point is not finite",
            Self::InvalidPose => c"the pose is not finite or its quaternion not a rotation",
            Self::StaleSetPoint => c"no set-point for too long",
            Self::JumpingSetPoint => c"the set-point jumps",
            Self::SpeedBeyondWinch => c"a cable would have to move faster than its winch can",
            Self::ResidualNotMet => c"the equations are not met to rounding",
            Self::NotCertified => c"the branch is not certified",
            Self::AttachmentOnAnchor => c"an attachment lies on its anchor",
            Self::SingularCable => c"the tension of a cable vanishes along it",
            Self::SingularStatics => c"the cables cannot balance every wrench (singular)",
            Self::LengthNotPositive => c"a cable has no positive rest length",
            Self::NearSingularity => c"near a singularity",
            Self::FoldAhead => c"the branch ends in a fold",
            Self::TensionAbove => c"a tension is too high",
            Self::TensionBelow => c"a tension is too low",
            Self::LengthBeyondWinch => c"a length is beyond the winch",
            Self::BadTable => c"not a warm-start table, or a damaged one",
            Self::OtherRobot => c"the warm-start table is for another robot or load",
            Self::NotInTable => c"the warm-start table does not cover the pose",
            Self::Other => c"another fault",
        }
    }
}

/// What is to be done after a call that failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Remedy {
    /// Nothing: all is well.
    None = 0,
    /// The call was given something wrong: mend the program, the robot or the measurement.
    MendCall = 1,
    /// Stand still; a sound set-point near the last pose is taken as if nothing had been.
    MendSetPoint = 2,
    /// The pose is right but the way there too fast: the same in smaller steps is taken.
    GoSlower = 3,
    /// This pose is not to be had on this branch: go back the way.
    GoBack = 4,
    /// The warm-start table cannot be used: write the right one.
    ReplaceTable = 5,
}

/// The outcome of a call.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
#[repr(C)]
pub struct Status<T> {
    /// What happened.
    pub code: Code,
    /// What is to be done.
    pub remedy: Remedy,
    /// The cable in question, counted from 0; -1 where there is none.
    pub cable: i32,
    /// The other cable, where two are in question; -1 otherwise.
    pub other_cable: i32,
    /// How much: see the code. 0 where it says nothing.
    pub value: T,
    /// How much of something else: see the code. 0 where it says nothing.
    pub other_value: T,
}

impl<T: Real> Status<T> {
    pub(crate) fn ok() -> Self {
        Self::bare(Code::Ok, Remedy::None)
    }

    /// The call was given something wrong.
    pub(crate) fn refusal(code: Code) -> Self {
        Self::bare(code, Remedy::MendCall)
    }

    fn bare(code: Code, remedy: Remedy) -> Self {
        let (value, other_value) = (T::zero(), T::zero());
        Self { code, remedy, cable: -1, other_cable: -1, value, other_value }
    }

    pub(crate) fn of_cable(self, cable: usize) -> Self {
        Self { cable: index(cable), ..self }
    }

    pub(crate) fn of_value(self, value: T) -> Self {
        Self { value, ..self }
    }
}

/// Why a robot has no cables, or a set-point no pose.
impl<T: Real> From<GeometryFault> for Status<T> {
    fn from(fault: GeometryFault) -> Self {
        match fault {
            GeometryFault::NonFiniteCable(i) => Self::refusal(Code::NonFiniteCable).of_cable(i),
            GeometryFault::CoincidentAnchors(i, j) => {
                Self { other_cable: index(j), ..Self::refusal(Code::CoincidentAnchors).of_cable(i) }
            }
            GeometryFault::CollinearAttachments => Self::refusal(Code::CollinearAttachments),
            GeometryFault::InvalidPose => Self::bare(Code::InvalidPose, Remedy::MendSetPoint),
            GeometryFault::AttachmentOnAnchor(i) => {
                Self::bare(Code::AttachmentOnAnchor, Remedy::GoBack).of_cable(i)
            }
            _ => Self::refusal(Code::Other),
        }
    }
}

impl<T: Real> From<Fault<T>> for Status<T> {
    fn from(fault: Fault<T>) -> Self {
        let remedy = match fault.remedy() {
            cdpr_core::Remedy::MendSetPoint => Remedy::MendSetPoint,
            cdpr_core::Remedy::GoSlower => Remedy::GoSlower,
            cdpr_core::Remedy::GoBack => Remedy::GoBack,
            cdpr_core::Remedy::ReplaceTable => Remedy::ReplaceTable,
        };
        let bare = |code| Self::bare(code, remedy);
        match fault {
            Fault::NonFiniteSetPoint => bare(Code::NonFiniteSetPoint),
            Fault::JumpingSetPoint { distance_m, turn_m } => {
                Self { other_value: turn_m, ..bare(Code::JumpingSetPoint).of_value(distance_m) }
            }
            Fault::StaleSetPoint { age_ticks } => {
                bare(Code::StaleSetPoint).of_value(T::constant(age_ticks.into()))
            }
            Fault::Geometry(fault) => fault.into(),
            Fault::Step(StepFault::SingularCable(i)) => bare(Code::SingularCable).of_cable(i),
            Fault::Step(StepFault::SingularStatics) => bare(Code::SingularStatics),
            Fault::Step(StepFault::LengthNotPositive(i)) => {
                bare(Code::LengthNotPositive).of_cable(i)
            }
            Fault::NearSingularity { distance } => bare(Code::NearSingularity).of_value(distance),
            Fault::FoldAhead { time_s } => bare(Code::FoldAhead).of_value(time_s),
            Fault::TensionAbove { cable, tension_n } => {
                bare(Code::TensionAbove).of_cable(cable).of_value(tension_n)
            }
            Fault::TensionBelow { cable, tension_n } => {
                bare(Code::TensionBelow).of_cable(cable).of_value(tension_n)
            }
            Fault::LengthBeyondWinch { cable, rest_length_m } => {
                bare(Code::LengthBeyondWinch).of_cable(cable).of_value(rest_length_m)
            }
            Fault::SpeedBeyondWinch { cable, speed_m_s } => {
                bare(Code::SpeedBeyondWinch).of_cable(cable).of_value(speed_m_s)
            }
            Fault::ResidualNotMet { closure_m, imbalance_n } => {
                Self { other_value: imbalance_n, ..bare(Code::ResidualNotMet).of_value(closure_m) }
            }
            Fault::Table(fault) => match fault {
                TableFault::OtherCable(cable) => bare(Code::OtherRobot).of_cable(cable),
                TableFault::OtherLoad | TableFault::OtherModel(_) => bare(Code::OtherRobot),
                TableFault::OutsideRegion | TableFault::Uncovered(_) => bare(Code::NotInTable),
                _ => bare(Code::BadTable),
            },
            Fault::NotCertified { contraction } => bare(Code::NotCertified).of_value(contraction),
            _ => bare(Code::Other),
        }
    }
}

/// A cable as C counts it.
fn index(cable: usize) -> i32 {
    i32::try_from(cable).unwrap_or(-1)
}
