//! Warm-start tables: what is damaged or made for another robot is refused, and what is not leads to the solution
//! that the complete search proves, on the branch that small steps from the start lead to.

use std::cmp::Ordering;
use std::sync::LazyLock;

use cdpr_core::chart::Start;
use cdpr_core::table::{COORDINATES, Gap, Table, TableFault};
use cdpr_core::{
    CABLES, Cable, CableState, IrvineCatenary, Load, Pose, Real, Robot, SetPoint, TrackerSettings,
    Twist,
};
use cdpr_firmware_example::path::TAUT;
use cdpr_firmware_example::robot;
use cdpr_host_sim::choice::Choice;
use cdpr_host_sim::complete::{Proof, complete};
use cdpr_host_sim::enumerate::{ModelKind, Request};
use cdpr_host_sim::journal::Job as _;
use cdpr_host_sim::problem::Problem;
use cdpr_host_sim::robot_file::{CableLimits as HostLimits, RobotDescription};
use cdpr_host_sim::table::{Effort, Order};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

mod damage;
mod leads;
mod ways;

type Model<T> = IrvineCatenary<T>;
type Place = [f64; COORDINATES];

/// Where the table starts: the home of the firmware.
const START: Place = [2.0, 7.0, 2.5, 0.0, 0.0, 0.0];
/// Largest tilt, as a sine: about a degree.
const TILT: f64 = 0.0175;
/// Longest rest length that the table is for, m.
const LONGEST_M: f64 = 50.0;
/// Bytes of the header: where the tree begins.
const TREE: usize = 388;

/// The table of all tests here. Long and flat, and mostly beyond the workspace: built in seconds, for most of it
/// has no solution, and with all that a table can have: splits, cells, and gaps of several kinds.
static TABLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let [_, y, z, ..] = START;
    let low = [-100.0, y - 0.1, z - 0.1, -TILT, -TILT, -TILT];
    let high = [100.0, y + 0.1, z + 0.1, TILT, TILT, TILT];
    built([START[0], y, z], low, high, 8)
});

fn built(position_m: [f64; 3], low: Place, high: Place, depth: u8) -> Vec<u8> {
    let mut robot = RobotDescription::marionet_crane();
    for limits in &mut robot.limits {
        limits.max_length_m = LONGEST_M;
    }
    let model = ModelKind::Irvine;
    let request = Request { robot, position_m, rotation_vector_rad: [0.0; 3], model };
    let effort = Effort { steps: 4, depth, max_bytes: None };
    let order = Order::new(&request, low, high, Choice::Shortest, None, effort).expect("an order");
    let threads = rayon::ThreadPoolBuilder::new().build().expect("threads");
    let tiles: Vec<usize> = (0..order.tiles()).collect();
    let mut plans = Vec::new();
    let keep = |(_, plan)| {
        plans.push(plan);
        Ok::<(), ()>(())
    };
    order.cover(&threads, &tiles, keep).expect("a sheet").expect("kept");
    order.assemble(plans).expect("a table").bytes
}

fn table() -> Table<'static> {
    Table::open(&TABLE).expect("a table")
}

/// The robot and load of the firmware, which rounds its own constants to `T`.
fn crane<T: Real>() -> (Robot<T, Model<T>>, Load<T>) {
    (robot::crane().expect("a robot"), robot::load(&TAUT.payload))
}

/// CRC-32 bit by bit, from its polynomial: another program than that of core and host.
fn crc32(bytes: &[u8]) -> u32 {
    let mut rest = !0_u32;
    for byte in bytes {
        rest ^= u32::from(*byte);
        for _ in 0..8 {
            rest = if rest & 1 == 1 { (rest >> 1) ^ 0xedb8_8320 } else { rest >> 1 };
        }
    }
    !rest
}

/// With the checksum that goes with the bytes before it.
fn repaired(mut bytes: Vec<u8>) -> Vec<u8> {
    let protected = bytes.len() - 4;
    let sum = crc32(&bytes[..protected]);
    bytes[protected..].copy_from_slice(&sum.to_le_bytes());
    bytes
}

/// What a leaf of the tree says.
#[derive(Clone, Copy, Debug)]
enum What {
    Cell(Start<f32>),
    Nothing(u32),
}

/// A leaf and its box, in parts of the region; a cell may be cut off by a plane: normal and offset.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    low: Place,
    high: Place,
    plane: Option<([i32; COORDINATES], i32)>,
    what: What,
}

/// The lowest bits of a word, so many of them, as a number with a sign.
fn signed(word: usize, bits: u32) -> i32 {
    let value = i32::try_from(word & ((1 << bits) - 1)).expect("few bits");
    if value < 1 << (bits - 1) { value } else { value - (1 << bits) }
}

/// A reader of its own, by the offsets in the description of the format.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn word(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.0[at..at + 4].try_into().expect("four bytes"))
    }

    fn floats<const N: usize>(&self, at: usize) -> [f32; N] {
        std::array::from_fn(|k| f32::from_bits(self.word(at + 4 * k)))
    }

    fn low(&self) -> [f32; COORDINATES] {
        self.floats(32)
    }

    fn extent(&self) -> [f32; COORDINATES] {
        self.floats(56)
    }

    /// Parts of the region, of a place.
    fn parts(&self, at: &Place) -> Place {
        let (low, extent) = (self.low(), self.extent());
        std::array::from_fn(|k| (at[k] - f64::from(low[k])) / f64::from(extent[k]))
    }

    fn place(&self, parts: &Place) -> Place {
        let (low, extent) = (self.low(), self.extent());
        std::array::from_fn(|k| f64::from(low[k]) + parts[k] * f64::from(extent[k]))
    }

    fn short(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.0[at..at + 2].try_into().expect("two bytes"))
    }

    fn seed(&self, at: usize) -> Start<f32> {
        let bytes = &self.0[at..at + 8];
        // Sign, exponent and fraction of a coordinate.
        let number = |k: usize| {
            let (sign, exponent, fraction) = (bytes[k] >> 7, bytes[k] >> 3 & 15, bytes[k] & 7);
            let size = 2.0_f32.powi(i32::from(exponent)) * (1.0 + f32::from(fraction) / 8.0);
            (1.0 - 2.0 * f32::from(sign)) * (size - 1.0) / 4.0
        };
        let kind = bytes[0];
        let (eliminated, bracket) = (usize::from(kind & 7), [number(1), number(2)]);
        // The mean of the square roots, with signs, squared.
        let root = |x: f32| x.abs().sqrt().copysign(x);
        let middle = 0.5 * (root(bracket[0]) + root(bracket[1]));
        let charts = std::array::from_fn(|i| match i.cmp(&eliminated) {
            Ordering::Less => number(3 + i),
            Ordering::Equal => middle * middle.abs(),
            Ordering::Greater => number(2 + i),
        });
        let (is_positive, fold_at_slack_end) = (kind & 8 != 0, kind & 16 != 0);
        Start { charts, eliminated, bracket, fold_at_slack_end, is_positive }
    }

    fn leaves(&self) -> Vec<Leaf> {
        let seeds_at = TREE + 2 * self.word(16) as usize;
        let mut leaves = Vec::new();
        let mut stack = vec![(0, [0.0; COORDINATES], [1.0; COORDINATES], None)];
        while let Some((node, low, high, plane)) = stack.pop() {
            let short = self.short(TREE + 2 * node);
            let word = usize::from(short);
            let long = || self.word(TREE + 2 * (node + 1)) as usize;
            match word >> 14 {
                0 | 1 if word >> 12 >= 6 => {
                    let turned = word >> 12 == 7;
                    let normals = |at: usize| usize::from(self.short(TREE + 2 * at));
                    let normal = std::array::from_fn(|k| match (k < 3, turned) {
                        (true, _) => signed(normals(node + 1) >> (5 * k), 5),
                        (false, true) => signed(normals(node + 2) >> (5 * (k - 3)), 5),
                        (false, false) => 0,
                    });
                    assert_eq!(plane, None, "one plane is enough");
                    let next = node + if turned { 3 } else { 2 };
                    stack.push((next, low, high, Some((normal, signed(word, 12)))));
                }
                0 | 1 => {
                    let k = word >> 12;
                    let middle = 0.5 * (low[k] + high[k]);
                    let (mut lower, mut upper) = (high, low);
                    (lower[k], upper[k]) = (middle, middle);
                    let halves = [(low, lower), (upper, high)];
                    if word & 0xff0 == 0xff0 {
                        let which = word >> 3 & 1;
                        let ((from, to), (low, high)) = (halves[which], halves[1 - which]);
                        stack.push((node + 1, from, to, plane));
                        let what = What::Nothing(u32::from(short & 7));
                        leaves.push(Leaf { low, high, plane, what });
                        continue;
                    }
                    let (first, second) = match word & 0xfff {
                        0 => (node + 3, node + long()),
                        skip => (node + 1, node + skip),
                    };
                    for (next, (low, high)) in [first, second].into_iter().zip(halves) {
                        stack.push((next, low, high, plane));
                    }
                }
                2 => {
                    let seed = if word & 0x3fff == 0x3fff { long() } else { word & 0x3fff };
                    let start = self.seed(seeds_at + 8 * seed);
                    leaves.push(Leaf { low, high, plane, what: What::Cell(start) });
                }
                _ => {
                    let what = What::Nothing(u32::from(short & 0xff));
                    leaves.push(Leaf { low, high, plane, what });
                }
            }
        }
        leaves
    }
}

/// By how much a place may be off in f32, in parts of the region: a few roundings of the position, and of a
/// rotation matrix.
fn rounding(reader: &Reader<'_>) -> Place {
    let (low, extent) = (reader.low(), reader.extent());
    std::array::from_fn(|k| {
        let size = if k < 3 { low[k].abs() + extent[k] } else { 1.0 };
        f64::from(4.0 * f32::EPSILON * size / extent[k])
    })
}

/// What the table may answer at a place: one for each leaf that it can be in, but for rounding.
fn answers(
    reader: &Reader<'_>,
    leaves: &[Leaf],
    at: &Place,
) -> Vec<Result<Start<f32>, TableFault>> {
    let (t, margin) = (reader.parts(at), rounding(reader));
    let mut answers = Vec::new();
    for leaf in leaves {
        let is_in = (0..COORDINATES)
            .all(|k| t[k] >= leaf.low[k] - margin[k] && t[k] <= leaf.high[k] + margin[k]);
        if !is_in {
            continue;
        }
        let (is_before, is_beyond) = leaf.sides(&t, &margin);
        if is_before {
            answers.push(match leaf.what {
                What::Nothing(code) => Err(TableFault::Uncovered(Gap::ALL[code as usize])),
                What::Cell(seed) => Ok(seed),
            });
        }
        if is_beyond {
            answers.push(Err(TableFault::Uncovered(Gap::Fold)));
        }
    }
    answers
}

impl Leaf {
    /// Whether a place may be before its plane, and whether it may be beyond it.
    fn sides(&self, t: &Place, margin: &Place) -> (bool, bool) {
        let Some((normal, offset)) = self.plane else { return (true, false) };
        let (mut past, mut unknown) = (-f64::from(offset) / 16.0, 1e-4);
        for k in 0..COORDINATES {
            let side = self.high[k] - self.low[k];
            past += f64::from(normal[k]) * (t[k] - self.low[k]) / side;
            unknown += f64::from(normal[k]).abs() * margin[k] / side;
        }
        (past <= unknown, past >= -unknown)
    }
}

/// The pose with these coordinates in f32, and the very same in f64.
#[allow(clippy::cast_possible_truncation)] // that is what f32 is
fn poses(at: &Place) -> (Pose<f32>, Pose<f64>, Place) {
    let sine = Vector3::new(at[3], at[4], at[5]);
    let turn = if sine.norm() > 0.0 { sine * (sine.norm().asin() / sine.norm()) } else { sine };
    turned(at, &turn)
}

#[allow(clippy::cast_possible_truncation)] // as above
fn turned(at: &Place, turn: &Vector3<f64>) -> (Pose<f32>, Pose<f64>, Place) {
    let position = Vector3::new(at[0] as f32, at[1] as f32, at[2] as f32);
    let q = UnitQuaternion::from_scaled_axis(*turn).coords.map(|c| c as f32);
    let single = UnitQuaternion::new_unchecked(Quaternion::from(q));
    let double = UnitQuaternion::new_normalize(Quaternion::from(q.map(f64::from)));
    let exact = position.map(f64::from);
    let turn = double.scaled_axis();
    let sine = if turn.norm() > 0.0 { turn * (turn.norm().sin() / turn.norm()) } else { turn };
    let place = [exact.x, exact.y, exact.z, sine.x, sine.y, sine.z];
    let single = Pose::new(position, single).expect("a pose");
    (single, Pose::new(exact, double).expect("a pose"), place)
}

fn wide(states: &[CableState<f32>; CABLES]) -> [CableState<f64>; CABLES] {
    states.each_ref().map(|state| CableState {
        force_n: state.force_n.map(f64::from),
        rest_length_m: state.rest_length_m.into(),
    })
}

/// The solutions that the complete search proves, for the robot as f32 has it; `None` when it cannot decide.
fn proven(pose: &Pose<f64>) -> Option<Vec<[CableState<f64>; CABLES]>> {
    let (robot, load) = exact_crane();
    // Far beyond what the table is for: at its edge it may lead on to longer cables.
    let limits = HostLimits { max_length_m: 10.0 * LONGEST_M, max_tension_n: 5e4 };
    let problem = Problem::new(robot, &load, pose, [limits; CABLES]).expect("a problem");
    let answer = complete(&problem).expect("limits of tension");
    answer.undecided.is_empty().then(|| answer.solutions.iter().map(Proof::states).collect())
}

/// The robot of the firmware in f32, in f64 arithmetic.
fn exact_crane() -> (Robot<f64, Model<f64>>, Load<f64>) {
    let (robot, load) = crane::<f32>();
    let cables = robot.cables().map(|cable| Cable {
        anchor_m: cable.anchor_m.map(f64::from),
        attachment_m: cable.attachment_m.map(f64::from),
        model: IrvineCatenary {
            weight_n_m: cable.model.weight_n_m.into(),
            compliance_per_n: cable.model.compliance_per_n.into(),
        },
    });
    let load = Load {
        mass_kg: load.mass_kg.into(),
        center_of_mass_m: load.center_of_mass_m.map(f64::from),
        gravity_m_s2: load.gravity_m_s2.into(),
        force_n: load.force_n.map(f64::from),
        moment_nm: load.moment_nm.map(f64::from),
    };
    (Robot::new(cables).expect("a robot"), load)
}

/// Largest distance of two forces of a cable, as a part of the sum of all forces.
fn apart(a: &[CableState<f64>; CABLES], b: &[CableState<f64>; CABLES]) -> f64 {
    let sum_n: f64 = b.iter().map(|state| state.force_n.norm()).sum();
    let each = (0..CABLES).map(|i| (a[i].force_n - b[i].force_n).norm());
    each.fold(0.0, f64::max) / sum_n
}

/// Nothing but the certificate refuses small moves.
fn unlimited<T: Real>() -> TrackerSettings<T> {
    let largest_move_m = T::constant(4e-3);
    TrackerSettings { largest_move_m, ..TrackerSettings::unlimited(T::constant(1e-3)) }
}

fn still<T: Real>(pose: Pose<T>) -> SetPoint<T> {
    SetPoint { pose, twist: Twist::none() }
}

#[test]
fn the_table_of_these_tests_has_everything() {
    // The check value of this CRC in every catalogue.
    assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    assert_eq!(*TABLE, repaired(TABLE.clone()));
    let leaves = Reader(&TABLE).leaves();
    let count = |wanted: fn(&What) -> bool| leaves.iter().filter(|leaf| wanted(&leaf.what)).count();
    assert!(count(|what| matches!(what, What::Cell(_))) >= 3);
    assert!(count(|what| matches!(what, What::Nothing(0))) >= 1);
    assert!(count(|what| matches!(what, What::Nothing(1..))) >= 1);
}
