//! Warm-start tables: what is damaged or made for another robot is refused, and what is not leads to the solution
//! that the complete search proves, on the branch that small steps from the start lead to.

use std::cmp::Ordering;
use std::sync::LazyLock;

use cdpr_core::chart::{Charted as _, Start};
use cdpr_core::newton::converge;
use cdpr_core::statics::Balance;
use cdpr_core::table::{COORDINATES, Gap, MAX_DEPTH, Node, Plane, TOLERANCE, Table, TableFault};
use cdpr_core::{
    CABLES, Cable, CableLimits, CableState, Fault, IrvineCatenary, Load, Pose, Real, Robot,
    SetPoint, Tracker, TrackerSettings, Twist,
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
use cdpr_tests::{random, random_tests};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rayon::prelude::*;

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
        let number = |word: usize| f32::from_bits(u32::from(self.short(at + 2 * word)) << 16);
        let kind = self.short(at);
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
                    let (first, second) = match word & 0xfff {
                        0 => (node + 3, node + long()),
                        skip => (node + 1, node + skip),
                    };
                    let middle = 0.5 * (low[k] + high[k]);
                    let (mut lower, mut upper) = (high, low);
                    (lower[k], upper[k]) = (middle, middle);
                    stack.extend([(first, low, lower, plane), (second, upper, high, plane)]);
                }
                2 => {
                    let seed = if word & 0x3fff == 0x3fff { long() } else { word & 0x3fff };
                    let start = self.seed(seeds_at + 16 * seed);
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
    let limits = HostLimits { max_length_m: 4.0 * LONGEST_M, max_tension_n: 5e4 };
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

#[test]
fn every_damage_is_refused_by_its_name() {
    let whole = &*TABLE;
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let wanted = match bit / 8 {
            0..8 => TableFault::NotATable,
            8..10 => match u16::from_le_bytes([bytes[8], bytes[9]]) {
                version @ 0..4 => TableFault::OlderVersion(version),
                version => TableFault::NewerVersion(version),
            },
            12..16 => TableFault::WrongLength {
                said: Reader(&bytes).word(12),
                found: u32::try_from(whole.len()).expect("short"),
            },
            _ => TableFault::Corrupt,
        };
        assert_eq!(Table::open(&bytes), Err(wanted), "bit {bit}");
    }
    let said = u32::try_from(whole.len()).expect("short");
    for length in 0..whole.len() {
        let found = u32::try_from(length).expect("short");
        // A header, one word and the checksum.
        let wanted = if length < TREE + 2 + 4 {
            TableFault::TooShort
        } else {
            TableFault::WrongLength { said, found }
        };
        assert_eq!(Table::open(&whole[..length]), Err(wanted), "{length} bytes");
    }
    let longer = [&whole[..], &[0]].concat();
    assert_eq!(Table::open(&longer), Err(TableFault::WrongLength { said, found: said + 1 }));
    // The first in the order of the header when several apply.
    let mut bytes = vec![0xff; whole.len()]; // erased flash
    assert_eq!(Table::open(&bytes), Err(TableFault::NotATable));
    bytes[..8].copy_from_slice(b"CDPRSEED");
    assert_eq!(Table::open(&bytes), Err(TableFault::NewerVersion(0xffff)));
}

/// The header of the table of these tests, with other contents.
fn made(words: &[u16], seeds: &[[u16; 8]]) -> Vec<u8> {
    let mut bytes = TABLE[..TREE].to_vec();
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend(seeds.iter().flatten().flat_map(|word| word.to_le_bytes()));
    bytes.extend([0; 4]);
    let counts = [bytes.len(), words.len(), seeds.len()];
    for (k, count) in counts.into_iter().enumerate() {
        let count = u32::try_from(count).expect("few");
        bytes[12 + 4 * k..16 + 4 * k].copy_from_slice(&count.to_le_bytes());
    }
    repaired(bytes)
}

const CELL: u16 = 0x8000;
const TRIM: u16 = 6 << 12;
const TRIM_TURNED: u16 = 7 << 12;
const NOTHING: u16 = 0xc000;

/// The upper half is so many words on.
fn split(coordinate: u16, skip: u16) -> u16 {
    coordinate << 12 | skip
}

/// A seed: cable 3 between -4 and 1, the others at 0.5, and a positive determinant.
const SEED: [u16; 8] = [8 | 2, 0xc080, 0x3f80, 0x3f00, 0x3f00, 0x3f00, 0x3f00, 0x3f00];

#[test]
fn seeds_that_make_no_sense_are_refused() {
    const NAN: u16 = 0x7fc0;
    const INFINITY: u16 = 0x7f80;
    let (start, _, _) = poses(&START);
    let (robot, load) = crane::<f32>();
    // No such cable, bits that mean nothing, no bracket; and what is one, but leads nowhere.
    let [kind, low, high, ..] = SEED;
    let beginnings = [
        ([6, low, high], false),
        ([15, low, high], false),
        ([kind | 32, low, high], false),
        ([kind | 0x8000, low, high], false),
        ([kind, high, low], false),
        ([kind, low, low], false),
        ([kind, NAN, high], false),
        ([kind, low, NAN], false),
        ([kind, low, INFINITY], true),
        ([kind, 0xff80, high], true),
        ([kind, high, INFINITY], true),
    ];
    let damaged = beginnings.iter().map(|(beginning, opens)| {
        let mut seed = SEED;
        seed[..3].copy_from_slice(beginning);
        (seed, *opens)
    });
    let nowhere = [NAN, INFINITY, 0xff80].map(|chart| {
        let mut seed = SEED;
        seed[3..].fill(chart);
        (seed, true)
    });
    for (seed, opens) in damaged.chain(nowhere) {
        let bytes = made(&[CELL], &[seed]);
        let table = Table::open(&bytes).expect("opens");
        assert_eq!(table.seed(0).is_some(), opens, "{seed:x?}");
        let states = table.states(&robot, &load, &start);
        assert_eq!(states, Err(TableFault::Malformed), "{seed:x?}");
    }
}

#[test]
fn a_right_checksum_does_not_hide_a_wrong_structure() {
    let seed = SEED;
    let wanted = Start {
        charts: [0.5, 0.5, -0.25, 0.5, 0.5, 0.5],
        eliminated: 2,
        bracket: [-4.0, 1.0],
        fold_at_slack_end: false,
        is_positive: true,
    };
    let (start, _, _) = poses(&START);
    let (robot, load) = crane::<f32>();
    let at = |bytes: &[u8]| Table::open(bytes).expect("opens").start_at(&start);
    // At the start, with which half of the region the lower one is.
    let good: [&[u16]; 8] = [
        &[CELL],
        &[CELL | 0x3fff, 0, 0], // the number in two words
        &[split(0, 2), CELL, CELL],
        &[split(0, 0), 4, 0, CELL, CELL],
        &[TRIM | 1, 0, CELL],           // all is before it
        &[TRIM | 0x7ff, 0x1f, CELL],    // a component of -1
        &[TRIM_TURNED | 1, 0, 0, CELL], // with words for turns
        &[split(0, 3), TRIM | 1, 0, CELL, CELL],
    ];
    for words in good {
        assert_eq!(at(&made(words, &[seed])), Ok(wanted), "{words:x?}");
    }
    let malformed: [(&[u16], usize); 20] = [
        (&[CELL | 1], 1), // a seed that is not there
        (&[CELL | 0x3ffe], 1),
        (&[CELL | 0x3fff, 1, 0], 1),
        (&[CELL | 0x3fff, 0, 1], 1),
        (&[CELL | 0x3fff, 0], 1), // torn off
        (&[CELL | 0x3fff], 1),
        (&[CELL], 0),
        (&[split(0, 1), CELL, CELL], 1), // both halves at one place
        (&[split(0, 2), CELL], 1),       // beyond the end
        (&[split(0, 0xfff)], 1),
        (&[split(0, 0), 0, 0], 1),
        (&[split(0, 0), 3, 0, CELL, CELL], 1),
        (&[split(0, 0), 0xffff, 0xffff, CELL, CELL], 1),
        (&[split(0, 0)], 1),
        (&[TRIM], 1), // torn off
        (&[TRIM, 0], 1),
        (&[TRIM_TURNED, 0, 0], 1),
        (&[TRIM_TURNED, 0], 1),
        (&[TRIM, 0, CELL | 1], 1),
        (&[split(0, 2), split(0, 2), split(0, 2)], 1),
    ];
    for (words, seeds) in malformed {
        let bytes = made(words, &vec![seed; seeds]);
        assert_eq!(at(&bytes), Err(TableFault::Malformed), "{words:x?}");
        let table = Table::open(&bytes).expect("opens");
        assert_eq!(table.states(&robot, &load, &start), Err(TableFault::Malformed), "{words:x?}");
    }
    // The deepest tree, and one deeper; the lowest x stays in the lower half.
    let (edge, _, _) = poses(&Reader(&TABLE).place(&[0.0, 0.5, 0.5, 0.5, 0.5, 0.5]));
    for (depth, wanted) in [(MAX_DEPTH, Ok(wanted)), (MAX_DEPTH + 1, Err(TableFault::Malformed))] {
        let depth = u16::try_from(depth).expect("small");
        // Of the words behind a split the upper half is the last one.
        let mut words: Vec<u16> = (0..depth).map(|index| split(0, 2 * (depth - index))).collect();
        words.extend(vec![CELL; usize::from(depth) + 1]);
        let bytes = made(&words, &[seed]);
        assert_eq!(Table::open(&bytes).expect("opens").start_at(&edge), wanted, "{depth}");
    }
    // A lower half too long for one word: host and core agree on what is written then.
    let node = Node::Split { coordinate: 2, lower: 0, upper: 5000 };
    let (words, count) = node.encode();
    let words = [&words[..count], &[CELL; 5001]].concat();
    let bytes = made(&words, &[seed]);
    let table = Table::open(&bytes).expect("opens");
    assert_eq!(table.node(0), Some(Node::Split { coordinate: 2, lower: 3, upper: 5003 }));
    assert_eq!(table.node(5003), Some(Node::Cell { seed: 0 }));
    assert_eq!(table.node(5004), None);
    for seed in [0, 0x3ffe, 0x3fff, 0x12_3456] {
        let (words, count) = Node::Cell { seed }.encode();
        let bytes = made(&words[..count], &[]);
        assert_eq!(Table::open(&bytes).expect("opens").node(0), Some(Node::Cell { seed }));
    }
    // Planes: all that fits is what it was, and it is beyond the one side.
    for case in 0..2000 {
        let mut rng = random::numbers(case);
        let mut normal: [i8; COORDINATES] = std::array::from_fn(|_| rng.random_range(-15..=15));
        if case % 2 == 0 {
            normal[3..].fill(0);
        }
        let plane = Plane { normal, offset: rng.random_range(-2047..=2047) };
        let (words, count) = Node::Trim { plane, inside: 0 }.encode();
        assert_eq!(count, if normal[3..] == [0; 3] { 2 } else { 3 });
        let bytes = made(&[&words[..count], &[CELL]].concat(), &[seed]);
        let table = Table::open(&bytes).expect("opens");
        assert_eq!(table.node(0), Some(Node::Trim { plane, inside: count }));
        let parts: Place = std::array::from_fn(|_| rng.random_range(0.01..0.99));
        let (pose, _, place) = poses(&Reader(&TABLE).place(&parts));
        let reader = Reader(&bytes);
        let possible = answers(&reader, &reader.leaves(), &place);
        assert!(possible.contains(&table.start_at(&pose)), "case {case}");
    }
    // Gaps of today and of tomorrow.
    for (code, gap) in
        (0..).zip(Gap::ALL).chain([(8, Gap::Other), (77, Gap::Other), (255, Gap::Other)])
    {
        let bytes = made(&[NOTHING | code], &[]);
        assert_eq!(at(&bytes), Err(TableFault::Uncovered(gap)), "{code}");
    }
}

#[test]
fn a_wrong_header_is_refused_though_the_checksum_is_right() {
    let with = |at: usize, new: &[u8]| {
        let mut bytes = TABLE.clone();
        bytes[at..at + new.len()].copy_from_slice(new);
        let bytes = repaired(bytes);
        Table::open(&bytes).map(|_| ())
    };
    for version in [0, 1, 2, 3] {
        assert_eq!(with(8, &[version, 0]), Err(TableFault::OlderVersion(u16::from(version))));
    }
    assert_eq!(with(8, &[5, 0]), Err(TableFault::NewerVersion(5)));
    for model in [0, 2, 255] {
        assert_eq!(with(10, &[model]), Err(TableFault::OtherModel(model)));
    }
    let reader = Reader(&TABLE);
    for at in [16, 20] {
        let count = reader.word(at);
        let wrong = [0, count - 1, count + 1, count + 8, 1 << 27, 1 << 30, u32::MAX];
        for wrong in wrong.into_iter().filter(|wrong| *wrong != count) {
            let outcome = with(at, &wrong.to_le_bytes());
            assert_eq!(outcome, Err(TableFault::Malformed), "{wrong} at {at}");
        }
    }
    for k in 0..COORDINATES {
        for low in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(with(32 + 4 * k, &low.to_le_bytes()), Err(TableFault::Malformed), "{low}");
        }
        for extent in [f32::NAN, f32::INFINITY, 0.0, -0.0, -1.0] {
            let outcome = with(56 + 4 * k, &extent.to_le_bytes());
            assert_eq!(outcome, Err(TableFault::Malformed), "{extent}");
        }
    }
}

/// What a step of a start is, by its definition: five tangents and one curve that balance the load.
#[test]
fn a_step_balances_five_tangents_and_one_curve() {
    let (robot, load) = crane::<f64>();
    let mut ended = 0;
    let cases = random_tests(1000).cases;
    for case in 0..u64::from(cases) {
        let mut rng = random::numbers(case);
        let at: Place = std::array::from_fn(|k| {
            START[k]
                + if k < 3 { rng.random_range(-0.4..0.4) } else { rng.random_range(-0.05..0.05) }
        });
        let (_, pose, _) = poses(&at);
        let balance = Balance::at(&robot, &load, &pose).expect("planes");
        let eliminated = rng.random_range(0..CABLES);
        let bracket = [rng.random_range(-300.0..-100.0), rng.random_range(-10.0..3.0)];
        let charts = std::array::from_fn(|_| rng.random_range(-100.0..-10.0));
        let (is_positive, fold_at_slack_end) = (rng.random(), rng.random());
        let start = Start { charts, eliminated, bracket, fold_at_slack_end, is_positive };
        let Ok(next) = start.step(&robot, &balance) else { continue };
        assert_eq!(Start { charts, ..next }, start);
        let point = |i: usize, chart: f64| {
            let plane = &balance.planes()[i];
            robot.cables()[i].model.hang(plane.x_m, plane.z_m, chart)
        };
        let chart = next.charts[eliminated];
        if chart - bracket[0] < 1e-2 * bracket[0].abs() || bracket[1] - chart < 1e-2 {
            continue; // no crossing in the bracket: what is found is one of its ends
        }
        ended += 1;
        let mut forces_n = std::array::from_fn(|i| {
            let here = point(i, charts[i]);
            here.state.force_n + here.force_by_chart_n * (next.charts[i] - charts[i])
        });
        forces_n[eliminated] = point(eliminated, chart).state.force_n;
        let sum_n: f64 = forces_n.iter().map(nalgebra::Vector2::norm).sum();
        // The last step along the curve is below a thousandth, and what it leaves out is its square.
        let left_n = balance.residual_n(&forces_n).norm();
        assert!(left_n <= 1e-5 * sum_n, "case {case}: {left_n:e} of {sum_n}");
    }
    println!("{ended} of {cases}"); // shown by --nocapture
    assert!(ended > cases / 4, "{ended}");
}

/// A pose of the region or beyond it, sometimes far.
fn any_place(reader: &Reader<'_>, rng: &mut impl Rng) -> Place {
    let spread = if rng.random::<bool>() { 0.5 } else { 2.0 };
    reader.place(&std::array::from_fn(|_| 0.5 + rng.random_range(-spread..spread)))
}

#[test]
fn whatever_the_contents_a_look_up_ends_with_a_typed_result() {
    let (robot, load) = crane::<f32>();
    let (mut opened, mut found, mut malformed) = (0, 0, 0);
    let cases = random_tests(3000).cases;
    for case in 0..u64::from(cases) {
        let mut rng = random::numbers(case);
        let mut bytes = TABLE.clone();
        let protected = bytes.len() - 4;
        // Mostly in the tree and what it leads to; else anywhere behind the length, steps included.
        let from = if case % 4 == 0 { 10 } else { TREE };
        // Often little, or no way leads to a cell any more.
        let edits = [1, 2, 12][rng.random_range(0..3)];
        for _ in 0..edits {
            let at = rng.random_range(from..protected);
            if !(12..24).contains(&at) {
                bytes[at] = rng.random();
            }
        }
        let bytes = repaired(bytes);
        let table = match Table::open(&bytes) {
            Ok(table) => table,
            Err(TableFault::OtherModel(_) | TableFault::Malformed) => continue,
            Err(fault) => panic!("case {case}: {fault}"),
        };
        opened += 1;
        // The robot may be another one now: that is for `check`, which must end as well.
        let checked = table.check(&robot, &load);
        assert!(matches!(
            checked,
            Ok(()) | Err(TableFault::OtherCable(0..CABLES) | TableFault::OtherLoad)
        ));
        for _ in 0..6 {
            let mut at = any_place(&Reader(&TABLE), &mut rng);
            if rng.random::<bool>() {
                at[0] = rng.random_range(-3.0..9.0); // where the cells are
            }
            let turn = Vector3::new(at[3], at[4], at[5]);
            let (pose, _, _) = turned(&at, &turn);
            match table.states(&robot, &load, &pose) {
                Ok(states) => {
                    found += 1;
                    for state in &states {
                        assert!(state.force_n.iter().all(|f| f.is_finite()), "case {case}");
                        assert!(state.rest_length_m.is_finite(), "case {case}");
                    }
                }
                Err(TableFault::Malformed) => malformed += 1,
                Err(TableFault::OutsideRegion | TableFault::Uncovered(_)) => {}
                Err(fault) => panic!("case {case}: {fault}"),
            }
        }
    }
    println!("{opened} opened, {found} found, {malformed} malformed"); // shown by --nocapture
    // Three in four leave the header alone, and one pose in four is among the cells.
    assert!(opened >= 3 * cases / 4 && found >= cases / 10 && malformed >= cases / 100);
}

/// Eight parameters of a cable, changed one at a time.
fn altered<T: Real>(
    robot: &Robot<T, Model<T>>,
    cable: usize,
    parameter: usize,
    change: impl Fn(T) -> T,
) -> Robot<T, Model<T>> {
    let mut cables = *robot.cables();
    let Cable { anchor_m: a, attachment_m: b, model } = &mut cables[cable];
    let value = match parameter {
        0..3 => &mut a[parameter],
        3..6 => &mut b[parameter - 3],
        6 => &mut model.weight_n_m,
        _ => &mut model.compliance_per_n,
    };
    *value = change(*value);
    Robot::new(cables).expect("still a robot")
}

/// Eleven parameters of the load, changed one at a time.
fn loaded<T: Real>(load: &Load<T>, parameter: usize, change: impl Fn(T) -> T) -> Load<T> {
    let mut load = *load;
    let value = match parameter {
        0 => &mut load.mass_kg,
        1..4 => &mut load.center_of_mass_m[parameter - 1],
        4 => &mut load.gravity_m_s2,
        5..8 => &mut load.force_n[parameter - 5],
        _ => &mut load.moment_nm[parameter - 8],
    };
    *value = change(*value);
    load
}

#[test]
fn a_table_is_for_its_robot_and_no_other() {
    let table = table();
    // In both types, each of which rounds on its own way.
    let (robot, load) = crane::<f64>();
    assert_eq!(table.check(&robot, &load), Ok(()));
    let (robot, load) = crane::<f32>();
    assert_eq!(table.check(&robot, &load), Ok(()));

    for cable in 0..CABLES {
        let refused = Err(TableFault::OtherCable(cable));
        let checked = |parameter, change: &dyn Fn(f32) -> f32| {
            table.check(&altered(&robot, cable, parameter, change), &load)
        };
        for parameter in 0..8 {
            // One rounding away it is the same robot; five are at least 5/2^24 of the value, and the
            // table is for 4/2^24.
            for neighbour in [f32::next_up, f32::next_down] {
                let five = |x| (0..5).fold(x, |x, _| neighbour(x));
                assert_eq!(checked(parameter, &neighbour), Ok(()), "{cable} {parameter}");
                assert_eq!(checked(parameter, &five), refused, "{cable} {parameter}");
            }
            if parameter < 6 {
                assert_eq!(checked(parameter, &|x| x + 1e-3), refused, "{cable} {parameter}");
                assert_eq!(checked(parameter, &|x| x - 1e-3), refused, "{cable} {parameter}");
            } else {
                assert_eq!(checked(parameter, &|x| x * 1.001), refused, "{cable} {parameter}");
                assert_eq!(checked(parameter, &|x| x * 0.999), refused, "{cable} {parameter}");
            }
        }
        // Inextensible.
        assert_eq!(checked(7, &|_| 0.0), refused);
    }
    let checked = |parameter, change: &dyn Fn(f32) -> f32| {
        table.check(&robot, &loaded(&load, parameter, change))
    };
    for parameter in 0..11 {
        assert_eq!(checked(parameter, &|x| x + 1e-3), Err(TableFault::OtherLoad), "{parameter}");
        assert_eq!(checked(parameter, &|x| x - 1e-3), Err(TableFault::OtherLoad), "{parameter}");
        assert_eq!(checked(parameter, &|_| f32::NAN), Err(TableFault::OtherLoad), "{parameter}");
        assert_eq!(checked(parameter, &|x| -0.0 + x), Ok(()), "{parameter}");
    }
    for parameter in [0, 4] {
        assert_eq!(checked(parameter, &f32::next_up), Ok(()), "{parameter}");
        assert_eq!(checked(parameter, &f32::next_down), Ok(()), "{parameter}");
    }
    // The first that differs is named.
    let both = altered(&altered(&robot, 4, 0, |x| x + 0.1), 2, 6, |x| 2.0 * x);
    assert_eq!(table.check(&both, &load), Err(TableFault::OtherCable(2)));
    // And a start asks.
    let (pose, _, _) = poses(&START);
    let start = |robot, load| {
        Tracker::start_from(robot, load, unlimited(), &still(pose), &table).map(|_| ())
    };
    assert_eq!(start(robot, load), Ok(()));
    assert_eq!(start(both, load), Err(Fault::Table(TableFault::OtherCable(2))));
    let heavier = loaded(&load, 0, |mass| mass + 1.0);
    assert_eq!(start(robot, heavier), Err(Fault::Table(TableFault::OtherLoad)));
}

#[test]
fn bytes_lie_anywhere() {
    let (robot, load) = crane::<f32>();
    let reader = Reader(&TABLE);
    let cells: Vec<Leaf> =
        reader.leaves().into_iter().filter(|leaf| matches!(leaf.what, What::Cell(_))).collect();
    let middles: Vec<Pose<f32>> = cells
        .iter()
        .map(|cell| {
            poses(&reader.place(&std::array::from_fn(|k| 0.5 * (cell.low[k] + cell.high[k])))).0
        })
        .collect();
    let all = |table: &Table<'_>| -> Vec<_> {
        middles.iter().map(|pose| table.states(&robot, &load, pose)).collect()
    };
    let wanted = all(&table());
    assert!(wanted.iter().filter(|states| states.is_ok()).count() >= 2);
    // More than 16 bytes, the widest alignment there is, have every remainder.
    let mut buffer = vec![0xa5; TABLE.len() + 16];
    for offset in 0..16 {
        let place = offset..offset + TABLE.len();
        buffer[place.clone()].copy_from_slice(&TABLE);
        let table = Table::open(&buffer[place.clone()]).expect("a table");
        assert_eq!(all(&table), wanted, "offset {offset}");
        buffer[place].fill(0xa5);
    }
}

/// Nothing but the certificate refuses.
fn unlimited() -> TrackerSettings<f32> {
    TrackerSettings {
        period_s: 1e-3,
        largest_move_m: 4e-3,
        least_distance: 0.0,
        fold_horizon_s: 0.0,
        largest_error_n: 1e6,
        cables: [CableLimits {
            shortest_m: 0.0,
            longest_m: 1e9,
            fastest_m_s: 1e9,
            lowest_tension_n: 0.0,
            highest_tension_n: 1e9,
        }; CABLES],
    }
}

fn still(pose: Pose<f32>) -> SetPoint<f32> {
    SetPoint {
        pose,
        twist: Twist { linear_m_s: Vector3::zeros(), angular_rad_s: Vector3::zeros() },
    }
}

/// The solution at a place that small steps from the start of the table lead to. `None` where it ends.
fn followed(start: &[CableState<f64>; CABLES], to: &Place) -> Option<[CableState<f64>; CABLES]> {
    const LONGEST_STEP_M: f64 = 0.02;
    let (robot, load) = exact_crane();
    let way: Place = std::array::from_fn(|k| to[k] - START[k]);
    let steps = (way.iter().map(|w| w.abs()).fold(0.0, f64::max) / LONGEST_STEP_M).ceil().max(1.0);
    let mut states = *start;
    let mut share = 0.0_f64;
    while share < 1.0 {
        share = (share + 1.0 / steps).min(1.0);
        let (_, pose, _) = poses(&std::array::from_fn(|k| START[k] + share * way[k]));
        let balance = Balance::at(&robot, &load, &pose).expect("planes");
        states = converge(&robot, &balance, &states, 1e-11, 8).ok()?.step.states;
    }
    Some(states)
}

/// Largest error of a rest length that a tracker started from the table commands, m: the ends of a cable are
/// rounded to 1e-6 m (of up to 20 m) twice, its length once more, and the cell next to a fold answers with a tenfold
/// of that. Largest found 5e-6.
const LENGTH_M: f64 = 2e-5;

/// What has come of many random poses.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    poses: usize,
    covered: usize,
    undecided: usize,
    lost: usize,
    uncertified: usize,
    /// Largest distance from the proven solution, as a part of the sum of forces.
    apart: f64,
    /// Largest error of a rest length that is commanded, m.
    length_m: f64,
}

impl Count {
    fn add(self, other: Self) -> Self {
        Self {
            poses: self.poses + other.poses,
            covered: self.covered + other.covered,
            undecided: self.undecided + other.undecided,
            lost: self.lost + other.lost,
            uncertified: self.uncertified + other.uncertified,
            apart: self.apart.max(other.apart),
            length_m: self.length_m.max(other.length_m),
        }
    }
}

/// Holds what the table says at a place against a reader of its own, the complete search and the branch from the
/// start, and starts there.
fn examine(leaves: &[Leaf], start: &[CableState<f64>; CABLES], at: &Place) -> Count {
    let table = table();
    let (robot, load) = crane::<f32>();
    let (pose, exact, place) = poses(at);
    let mut count = Count { poses: 1, ..Count::default() };
    let allowed = answers(&Reader(&TABLE), leaves, &place);
    let found = table.start_at(&pose);
    assert!(allowed.contains(&found), "{at:?}: {found:?}, not one of {allowed:?}");
    let states = table.states(&robot, &load, &pose);
    let started = Tracker::start_from(robot, load, unlimited(), &still(pose), &table);
    if let Err(fault) = found {
        assert_eq!(states, Err(fault));
        assert_eq!(started.map(|_| ()), Err(Fault::Table(fault)));
        return count;
    }
    count.covered = 1;
    let states = wide(&states.expect("a solution from a proven cell"));
    let Some(solutions) = proven(&exact) else {
        count.undecided = 1;
        return count;
    };
    let near: Vec<_> = solutions.iter().filter(|s| apart(&states, s) <= TOLERANCE).collect();
    let [solution] = near[..] else { panic!("{at:?}: {states:?} is none of {solutions:?}") };
    count.apart = apart(&states, solution);
    match followed(start, &place) {
        None => count.lost = 1,
        // Both to rounding.
        Some(branch) => assert!(apart(&branch, solution) < 1e-6, "{at:?}: another branch"),
    }
    match started {
        Err(Fault::NotCertified { .. }) => count.uncertified = 1,
        Err(fault) => panic!("{at:?}: {fault}"),
        Ok(tracker) => {
            for (cable, state) in tracker.command().cables.iter().zip(solution) {
                let error_m = (f64::from(cable.rest_length_m) - state.rest_length_m).abs();
                assert!(error_m <= LENGTH_M, "{at:?}: {error_m:e} m");
                count.length_m = count.length_m.max(error_m);
            }
        }
    }
    count
}

/// The one solution at the start within the limits of the table.
fn start_states() -> [CableState<f64>; CABLES] {
    let all = proven(&poses(&START).1).expect("decided");
    let short: Vec<_> = all
        .iter()
        .filter(|states| states.iter().all(|state| state.rest_length_m <= LONGEST_M))
        .collect();
    let [only] = short[..] else { panic!("{} solutions at the start", short.len()) };
    *only
}

#[test]
fn everywhere_it_leads_to_the_proven_solution_of_its_sheet() {
    let reader = Reader(&TABLE);
    let leaves = reader.leaves();
    let cells: Vec<&Leaf> =
        leaves.iter().filter(|leaf| matches!(leaf.what, What::Cell(_))).collect();
    let start = start_states();
    let cases = random_tests(2000).cases;
    let count = (0..u64::from(cases))
        .into_par_iter()
        .map(|case| {
            let mut rng = random::numbers(case);
            // One in eight anywhere, the others where there are cells.
            let parts: Place = if case % 8 == 0 {
                std::array::from_fn(|_| rng.random())
            } else {
                let cell = cells[rng.random_range(0..cells.len())];
                std::array::from_fn(|k| {
                    let t: f64 = rng.random();
                    cell.low[k] + t * (cell.high[k] - cell.low[k])
                })
            };
            examine(&leaves, &start, &reader.place(&parts))
        })
        .reduce(Count::default, Count::add);
    println!("{count:?}"); // shown by --nocapture
    let cases = cases as usize;
    assert!(count.poses == cases && count.covered > cases / 2, "{count:?}");
    assert!(count.covered < cases - cases / 16, "{count:?}"); // the others are mostly beyond
    // Next to a fold the straight way from the start may leave the sheet, and the search or the certificate be
    // at its end. None of 200 000 was.
    let at_most = cases / 1000;
    assert!(count.undecided <= at_most && count.lost <= at_most, "{count:?}");
    assert!(count.uncertified <= at_most, "{count:?}");
}

/// Half a metre across a fold: cells go up to planes close before it.
#[test]
fn trimmed_cells_lead_to_a_proven_solution_up_to_their_planes() {
    let level = 1e-6;
    let low = [2.0, 9.0, 1.0, -level, -level, -level];
    let high = [2.5, 9.5, 1.5, level, level, level];
    let bytes = built([2.1, 9.1, 1.2], low, high, 6);
    let (reader, table) = (Reader(&bytes), Table::open(&bytes).expect("a table"));
    let leaves = reader.leaves();
    let trimmed: Vec<&Leaf> = leaves.iter().filter(|leaf| leaf.plane.is_some()).collect();
    assert!(trimmed.len() >= 3, "{} of {} cells are trimmed", trimmed.len(), leaves.len());
    let (robot, load) = crane::<f32>();
    let cases = random_tests(1500).cases;
    let [before, beyond, without] = (0..u64::from(cases))
        .into_par_iter()
        .map(|case| {
            let mut rng = random::numbers(case);
            let leaf = trimmed[rng.random_range(0..trimmed.len())];
            let t: Place = std::array::from_fn(|_| rng.random_range(0.05..0.95));
            let (normal, offset) = leaf.plane.expect("trimmed");
            // Straight to the plane, and at random a little before it or beyond.
            let dot =
                |t: &Place| (0..COORDINATES).map(|k| f64::from(normal[k]) * t[k]).sum::<f64>();
            let square: f64 = normal.iter().map(|n| f64::from(n * n)).sum();
            let aside = rng.random_range(-0.1..0.1);
            let way = (f64::from(offset) / 16.0 - dot(&t)) / square + aside / square.sqrt();
            let t: Place = std::array::from_fn(|k| t[k] + way * f64::from(normal[k]));
            if !t.iter().all(|t| (0.0..1.0).contains(t)) {
                return [0; 3];
            }
            let parts = std::array::from_fn(|k| leaf.low[k] + t[k] * (leaf.high[k] - leaf.low[k]));
            let (single, exact, place) = poses(&reader.place(&parts));
            let states = table.states(&robot, &load, &single);
            let possible = answers(&reader, &leaves, &place);
            assert!(possible.contains(&table.start_at(&single)), "case {case}");
            let solutions = proven(&exact);
            match states {
                Ok(states) => {
                    let solutions = solutions.unwrap_or_else(|| panic!("case {case}: undecided"));
                    let near =
                        |one: &&[CableState<f64>; CABLES]| apart(&wide(&states), one) <= TOLERANCE;
                    assert_eq!(solutions.iter().filter(near).count(), 1, "case {case}");
                    [1, 0, 0]
                }
                Err(TableFault::Uncovered(Gap::Fold)) => {
                    [0, 1, usize::from(solutions.is_some_and(|all| all.is_empty()))]
                }
                Err(fault) => panic!("case {case}: {fault}"),
            }
        })
        .reduce(|| [0; 3], |a, b| std::array::from_fn(|k| a[k] + b[k]));
    println!("{before} before the planes, {beyond} beyond, {without} of these without a solution");
    let cases = cases as usize;
    assert!(before > cases / 6 && beyond > cases / 6 && without > cases / 50);
}

#[test]
fn borders_of_cells_belong_to_one_of_them() {
    let reader = Reader(&TABLE);
    let leaves = reader.leaves();
    let start = start_states();
    let mut places = Vec::new();
    for leaf in leaves.iter().filter(|leaf| matches!(leaf.what, What::Cell(_))) {
        for corner in 0..8 {
            for within in [0.0, 0.5, 1.0] {
                // Corners and edges in position; in turn as well where that is a split.
                places.push(std::array::from_fn(|k| {
                    let side = if k < 3 { f64::from(corner >> k & 1) } else { within };
                    leaf.low[k] + side * (leaf.high[k] - leaf.low[k])
                }));
            }
        }
        for k in 0..3 {
            for side in [0.0, 1.0] {
                let mut t = [0.5; COORDINATES];
                t[k] = side;
                places.push(std::array::from_fn(|k| {
                    leaf.low[k] + t[k] * (leaf.high[k] - leaf.low[k])
                }));
            }
        }
    }
    // Not up to the very end of a turn: its sine is rounded.
    let inside = |parts: &Place| -> Place {
        std::array::from_fn(|k| if k < 3 { parts[k] } else { parts[k].clamp(1e-3, 1.0 - 1e-3) })
    };
    let count = places
        .par_iter()
        .map(|parts| examine(&leaves, &start, &reader.place(&inside(parts))))
        .reduce(Count::default, Count::add);
    println!("{count:?}");
    assert!(count.covered > places.len() / 3, "{count:?}");
    assert!(count.lost <= places.len() / 10 && count.undecided == 0, "{count:?}");
}

#[test]
fn beyond_the_region_there_is_nothing() {
    let table = table();
    let reader = Reader(&TABLE);
    let outside = Err(TableFault::OutsideRegion);
    let seed = |at: &Place| table.start_at(&poses(at).0);
    let rounding = rounding(&reader);
    for corner in 0..8_u32 {
        let side = |k: usize| f64::from(corner >> k & 1);
        let parts: Place = std::array::from_fn(|k| if k < 3 { side(k) } else { 0.5 });
        // All of the region, its corners included, and nothing more.
        assert_ne!(seed(&reader.place(&parts)), outside, "corner {corner}");
        for k in 0..3 {
            let mut beyond = parts;
            beyond[k] += (2.0 * side(k) - 1.0) * 2.0 * rounding[k];
            assert_eq!(seed(&reader.place(&beyond)), outside, "corner {corner}, {k}");
        }
    }
    for k in 3..COORDINATES {
        for sine in [-1.01 * TILT, 1.01 * TILT] {
            let mut at = START;
            at[k] = sine;
            assert_eq!(seed(&at), outside);
            at[k] = 0.99 / 1.01 * sine;
            assert_ne!(seed(&at), outside);
        }
    }
    // Turns whose sines are small again, and those about any axis.
    for case in 0..u64::from(random_tests(500).cases) {
        let mut rng = random::numbers(case);
        let axis = match case {
            0..3 => Vector3::ith(usize::try_from(case).expect("small"), 1.0),
            _ => Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize(),
        };
        for degrees in [2.0, 89.0, 90.0, 91.0, 135.0, 179.0, 179.9, 180.0, 181.0, 270.0] {
            let turn = axis * f64::to_radians(degrees);
            let (single, double, _) = turned(&START, &turn);
            assert_eq!(table.start_at(&single), outside, "{degrees} about {axis:?}");
            assert_eq!(table.start_at(&double).err(), outside.err(), "{degrees} about {axis:?}");
        }
        let mut parts: Place = std::array::from_fn(|_| rng.random());
        let k = rng.random_range(0..COORDINATES);
        parts[k] =
            if rng.random() { 1.001 + rng.random::<f64>() } else { -0.001 - rng.random::<f64>() };
        assert_eq!(seed(&reader.place(&parts)), outside, "{parts:?}");
    }
    for far in [1e3, -1e3, 1e10, f64::from(f32::MAX), f64::from(f32::MIN)] {
        for k in 0..3 {
            let mut at = START;
            at[k] = far;
            assert_eq!(seed(&at), outside);
        }
    }
}
