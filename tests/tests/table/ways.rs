//! Starts at poses that a table does not cover: the nearest one that it does, and the way from there.

use cdpr_core::table::{COORDINATES, Table, TableFault, pose};
use cdpr_core::{CABLES, CableState, Fault, SetPoint, Tracker, TrackerSettings};
use cdpr_firmware_example::robot as firmware;
use cdpr_tests::{random, random_tests};
use rand::{RngExt as _, rngs::ChaCha8Rng};
use rayon::prelude::*;

use super::leads::{followed, start_states};
use super::{
    Leaf, Place, Reader, START, TABLE, TREE, What, apart, built, crane, exact_crane, poses, proven,
    repaired, still, table, unlimited, wide,
};

/// Far more parts than any way here takes.
const MANY: u16 = 2000;
/// How far inside of a cell the nearest pose is taken, in parts of its sides.
const INSIDE: f64 = 1.0 / 8.0;
/// What a command may be off from the proven solution, as a part of the sum of forces: a thousand roundings of f32, as the
/// condition of a posture near a bend makes of one; and what Newton's method leaves in f64, squared at each step.
const SINGLE: f64 = 1e-4;
const DOUBLE: f64 = 1e-9;

/// Held against all leaves of the tree, by a reader of its own.
fn check_nearest(reader: &Reader<'_>, at: &Place, arm_m: f64) -> f64 {
    let (extent, place) = (reader.extent().map(f64::from), reader.parts(at));
    let unit_m = |k: usize| extent[k] * if k < 3 { 1.0 } else { arm_m };
    let distance_m = |to: &Place| {
        let square = |k: usize| ((place[k] - to[k]) * unit_m(k)).powi(2);
        (0..COORDINATES).map(square).sum::<f64>().sqrt()
    };
    let inside = |leaf: &Leaf, part: f64| -> Place {
        std::array::from_fn(|k| {
            let room = part * (leaf.high[k] - leaf.low[k]);
            place[k].clamp(leaf.low[k] + room, leaf.high[k] - room)
        })
    };
    let leaves = reader.leaves();
    let cells = leaves.iter().filter(|leaf| matches!(leaf.what, What::Cell(_)));
    // To the nearest of all cells; to an eighth inside of the nearest without a plane, or to the corner there of one with a
    // plane that is the furthest before it.
    let (mut least_m, mut most_m) = (f64::INFINITY, f64::INFINITY);
    for cell in cells {
        least_m = least_m.min(distance_m(&inside(cell, 0.0)));
        let Some((normal, offset)) = cell.plane else {
            most_m = most_m.min(distance_m(&inside(cell, INSIDE)));
            continue;
        };
        let corner: Place = normal.map(|n| if n > 0 { INSIDE } else { 1.0 - INSIDE });
        let along: f64 = (0..COORDINATES).map(|k| f64::from(normal[k]) * corner[k]).sum();
        if along - f64::from(offset) / 16.0 < -INSIDE {
            let side = |k: usize| cell.high[k] - cell.low[k];
            let corner = std::array::from_fn(|k| cell.low[k] + corner[k] * side(k));
            most_m = most_m.min(distance_m(&corner));
        }
    }
    let table = Table::open(reader.0).expect("a table");
    let near = table.nearest(at, arm_m).expect("a cell");
    let found_m = distance_m(&reader.parts(&near));
    // Rounding of coordinates of some hundred metres.
    let rounding_m = 1e-12;
    assert!(found_m >= least_m - rounding_m, "{at:?}: {found_m} m, below {least_m} m");
    assert!(found_m <= most_m + rounding_m, "{at:?}: {found_m} m, above {most_m} m");
    // There is a seed for it, in f32 as well.
    assert!(table.start_at(&pose(&near).expect("a pose")).is_ok(), "{at:?}: {near:?}");
    #[allow(clippy::cast_possible_truncation)] // that is what f32 is
    let near = table.nearest(&at.map(|x| x as f32), 1.0).expect("a cell");
    assert!(table.start_at(&pose(&near).expect("a pose")).is_ok(), "{at:?}: {near:?}");
    found_m
}

fn anywhere(rng: &mut ChaCha8Rng, reader: &Reader<'_>, beyond: f64) -> Place {
    reader.place(&std::array::from_fn(|_| rng.random_range(-beyond..1.0 + beyond)))
}

#[test]
fn the_nearest_cell_is_found_among_all() {
    let level = 1e-6;
    let low = [2.0, 9.0, 1.0, -level, -level, -level];
    let high = [3.0, 10.0, 2.0, level, level, level];
    let trimmed = built([2.1, 9.1, 1.2], low, high, 8);
    for bytes in [&*TABLE, &trimmed] {
        let reader = Reader(bytes);
        let distances = (0..u64::from(random_tests(300).cases)).into_par_iter().map(|case| {
            let mut rng = random::numbers(case);
            let mut at = anywhere(&mut rng, &reader, if case % 2 == 0 { 0.0 } else { 0.5 });
            // Turns far beyond those of the table.
            for turn in at.iter_mut().skip(3).take(usize::from(case % 3 == 0) * 3) {
                *turn = rng.random_range(-0.1..0.1);
            }
            check_nearest(&reader, &at, rng.random_range(0.1..2.0))
        });
        let (near, far) = distances.partition::<Vec<f64>, Vec<f64>, _>(|found_m| *found_m < 0.05);
        println!("{} nearer than 5 cm, {} further", near.len(), far.len());
        assert!(!far.is_empty());
    }
    // No numbers, no cell.
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let mut at = START;
        at[1] = bad;
        assert_eq!(table().nearest(&at, 1.0), None);
    }
}

/// What became of starts by way.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    reached: usize,
    refused: usize,
    undecided: usize,
    lost: usize,
}

impl Count {
    fn add(self, other: Self) -> Self {
        Self {
            reached: self.reached + other.reached,
            refused: self.refused + other.refused,
            undecided: self.undecided + other.undecided,
            lost: self.lost + other.lost,
        }
    }
}

/// Holds a command against the complete search, and against the branch that small steps from the start lead to.
fn examine(found: &[CableState<f64>; CABLES], at: &Place, rounding: f64) -> Count {
    let (_, exact, _) = poses(at);
    let Some(solutions) = proven(&exact) else { return Count { undecided: 1, ..Count::default() } };
    let near: Vec<_> = solutions.iter().filter(|s| apart(found, s) <= rounding).collect();
    let [solution] = near[..] else { panic!("{at:?}: {found:?} is none of {solutions:?}") };
    match followed(&start_states(), at) {
        None => Count { lost: 1, ..Count::default() },
        Some(branch) => {
            assert!(apart(&branch, solution) < 1e-6, "{at:?}: another branch");
            Count { reached: 1, ..Count::default() }
        }
    }
}

/// Up to half a metre and three degrees from a table that ends in centimetres and a degree.
#[test]
fn a_way_leads_to_the_proven_solution_of_the_branch() {
    let table = table();
    let count = (0..u64::from(random_tests(400).cases))
        .into_par_iter()
        .map(|case| {
            let mut rng = random::numbers(case);
            let at: Place = std::array::from_fn(|k| {
                let far = if k < 3 { 0.5 } else { 0.05 };
                START[k] + rng.random_range(-far..far)
            });
            let (single, double, place) = poses(&at);
            let refused = Count { refused: 1, ..Count::default() };
            let mut count = Count::default();
            let (robot, load) = crane::<f32>();
            let none = Tracker::start_from(robot, load, unlimited(), &still(single), &table, 0);
            let by_way =
                Tracker::start_from(robot, load, unlimited(), &still(single), &table, MANY);
            if let Err(fault) = &none {
                assert!(matches!(
                    fault,
                    Fault::Table(TableFault::OutsideRegion | TableFault::Uncovered(_))
                        | Fault::NotCertified { .. }
                ));
            }
            count = count.add(match by_way {
                Ok(tracker) => examine(&wide(&tracker.command().states()), &place, SINGLE),
                Err(Fault::Table(_) | Fault::NotCertified { .. }) => refused,
                Err(fault) => panic!("{at:?}: {fault}"),
            });
            let (robot, load) = exact_crane();
            let by_way =
                Tracker::start_from(robot, load, unlimited(), &still(double), &table, MANY);
            count.add(match by_way {
                Ok(tracker) => examine(&tracker.command().states(), &place, DOUBLE),
                Err(Fault::Table(_)) => refused,
                Err(fault) => panic!("{at:?}: {fault}"),
            })
        })
        .reduce(Count::default, Count::add);
    println!("{count:?}"); // shown by --nocapture
    let all = 2 * random_tests(400).cases as usize;
    assert!(count.reached > all * 3 / 4, "{count:?}");
    assert!(count.undecided <= all / 100 && count.lost <= all / 100, "{count:?}");
}

#[test]
fn a_way_takes_its_parts_and_ends_within_limits() {
    let (table, (robot, load)) = (table(), exact_crane());
    let mut at = START;
    (at[0], at[1], at[3]) = (2.2, 7.4, 0.03);
    let there = still(poses(&at).1);
    let start = |settings: TrackerSettings<f64>, set_point: &SetPoint<f64>, parts| {
        Tracker::start_from(robot, load, settings, set_point, &table, parts)
    };
    assert_eq!(
        start(unlimited(), &there, 0).err(),
        Some(Fault::Table(TableFault::OutsideRegion)),
        "no way is wanted"
    );
    // A way that is too long for so few parts is not cut short.
    let enough = (1..MANY).find(|parts| start(unlimited(), &there, *parts).is_ok());
    let enough = enough.expect("a way");
    assert!(enough > 4, "{enough}");
    assert!(start(unlimited(), &there, enough + 1).is_ok());
    let short = start(unlimited(), &there, 1).err();
    assert_eq!(short, Some(Fault::Table(TableFault::OutsideRegion)));
    // What is commanded is within limits; what is on the way need not be.
    let tracker = start(unlimited(), &there, enough).expect("a way");
    assert_eq!(tracker.pose(), &there.pose);
    let mut narrow = unlimited();
    for (limits, cable) in narrow.cables.iter_mut().zip(&tracker.command().cables) {
        limits.shortest_m = cable.rest_length_m - 1e-3;
        limits.longest_m = cable.rest_length_m + 1e-3;
    }
    assert!(start(narrow, &there, enough).is_ok());
    narrow.cables[2].longest_m = narrow.cables[2].shortest_m;
    let refused = start(narrow, &there, enough).err();
    assert!(matches!(refused, Some(Fault::LengthBeyondWinch { cable: 2, .. })), "{refused:?}");
    // The twist is that of the set-point, not of the way.
    let rates = tracker.command().cables.map(|cable| cable.rest_length_rate_m_s);
    assert!(rates.iter().all(|rate_m_s| *rate_m_s == 0.0), "{rates:?}");
    // As if it had been started there, in motion and with the limits of the firmware.
    let mut moving = there;
    moving.twist.linear_m_s.x = 0.5;
    moving.twist.angular_rad_s.z = 0.1;
    let by_way = start(firmware::settings(), &moving, enough).expect("within all limits");
    let known = by_way.command().states();
    let at_once =
        Tracker::start(robot, load, firmware::settings(), &moving, &known).expect("a start");
    for (a, b) in by_way.command().cables.iter().zip(&at_once.command().cables) {
        assert!((a.rest_length_m - b.rest_length_m).abs() < 1e-9);
        assert!((a.rest_length_rate_m_s - b.rest_length_rate_m_s).abs() < 1e-7);
    }
    // A restart that fails leaves what was.
    let mut tracker = tracker;
    let before = *tracker.command();
    let mut nowhere = at;
    nowhere[2] = 60.0;
    let refused = tracker.restart_from(&still(poses(&nowhere).1), &table, 50);
    assert_eq!(refused, Err(Fault::Table(TableFault::OutsideRegion)));
    assert_eq!(tracker.command(), &before);
    // A set-point that moves too fast is refused before any way is tried.
    let mut fast = there;
    fast.twist.linear_m_s.x = 1e3;
    let refused = start(unlimited(), &fast, enough).err();
    assert!(matches!(refused, Some(Fault::JumpingSetPoint { .. })), "{refused:?}");
}

/// Turned about any axis by 0.15 rad, from a table that ends at a degree.
#[test]
fn a_way_turns_in_parts_and_ends_at_rotations() {
    let (table, (robot, load)) = (table(), exact_crane());
    let mut count = Count::default();
    for case in 0..40 {
        let mut rng = random::numbers(case);
        let axis: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let norm = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        let mut at = START;
        for (turn, x) in at[3..].iter_mut().zip(axis) {
            *turn = 0.15 * x / norm;
        }
        let (_, pose, place) = poses(&at);
        let start =
            |parts| Tracker::start_from(robot, load, unlimited(), &still(pose), &table, parts);
        count = count.add(match start(MANY) {
            Ok(tracker) => {
                assert_eq!(tracker.pose(), &pose);
                examine(&tracker.command().states(), &place, DOUBLE)
            }
            // With a fold on the way.
            Err(fault) => {
                assert_eq!(fault, Fault::Table(TableFault::OutsideRegion), "{at:?}");
                Count { refused: 1, ..Count::default() }
            }
        });
        // No part turns further than a sixteenth of a radian.
        assert!(start(2).is_err(), "{at:?}");
    }
    println!("{count:?}"); // shown by --nocapture
    assert!(count.reached > 30 && count.undecided == 0 && count.lost < 4, "{count:?}");
}

/// Trees that no builder writes, in the bytes of a table that is sound otherwise.
#[test]
fn no_tree_leads_a_search_astray() {
    let words = Reader(&TABLE).word(16) as usize;
    let tree = |word: &dyn Fn(usize) -> u16| {
        let mut bytes = TABLE.clone();
        for k in 0..words {
            bytes[TREE + 2 * k..TREE + 2 * k + 2].copy_from_slice(&word(k).to_le_bytes());
        }
        repaired(bytes)
    };
    let coordinate = |k: usize| u16::try_from(k % COORDINATES).expect("small") << 12;
    let nothing = 0b11 << 14;
    let is_last = |k: usize| k + 2 >= words;
    // Halves that share their nodes, of which there would be as many as Fibonacci's numbers; halves of halves without
    // end; and no cell at all.
    let shared = tree(&|k| if is_last(k) { nothing } else { coordinate(k) | 2 });
    let deep = tree(&|k| if is_last(k) { nothing } else { coordinate(k) | 0xff8 });
    let empty = tree(&|_| nothing);
    let cells = tree(&|k| if is_last(k) { 0b10 << 14 } else { coordinate(k) | 2 });
    for (bytes, has_cell) in [(shared, false), (deep, false), (empty, false), (cells, true)] {
        let table = Table::open(&bytes).expect("sound bytes");
        for far in [0.0, 0.3, 50.0] {
            let near = table.nearest(&START.map(|x| x + far), 1.0);
            assert!(near.is_none_or(|near| has_cell && near.iter().all(|x| x.is_finite())));
        }
        let (robot, load) = exact_crane();
        let there = still(poses(&START).1);
        let started = Tracker::start_from(robot, load, unlimited(), &there, &table, 9);
        assert!(started.is_err() || has_cell);
    }
}
