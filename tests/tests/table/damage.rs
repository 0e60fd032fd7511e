//! What is damaged, makes no sense or is made for another robot is refused by name.

use cdpr_core::chart::Start;
use cdpr_core::table::{
    COORDINATES, Gap, MAX_DEPTH, Node, Plane, Table, TableFault, decoded, encoded,
};
use cdpr_core::{CABLES, Cable, Fault, Load, Pose, Real, Robot, Tracker};
use cdpr_tests::{random, random_tests};
use nalgebra::Vector3;
use rand::{Rng, RngExt};

use super::{
    Leaf, Model, Place, Reader, START, TABLE, TREE, What, answers, crane, poses, repaired, still,
    table, turned, unlimited,
};

#[test]
fn every_damage_is_refused_by_its_name() {
    let whole = &*TABLE;
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let wanted = match bit / 8 {
            0..8 => TableFault::NotATable,
            8..10 => match u16::from_le_bytes([bytes[8], bytes[9]]) {
                version @ 0..5 => TableFault::OlderVersion(version),
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
fn made(words: &[u16], seeds: &[[u8; 8]]) -> Vec<u8> {
    let mut bytes = TABLE[..TREE].to_vec();
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend(seeds.iter().flatten());
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

/// One half is not covered, and why.
fn half(coordinate: u16, is_upper: bool, gap: u16) -> u16 {
    coordinate << 12 | 0xff0 | u16::from(is_upper) << 3 | gap
}

/// A seed: cable 3 between -2.25 and 1, the others at 0.5, and a positive determinant. A size is one less than
/// `2^exponent (1 + fraction/8)`, in quarters.
const SEED: [u8; 8] = [8 | 2, 0x80 | 3 << 3 | 2, 2 << 3 | 2, HALF, HALF, HALF, HALF, HALF];
const HALF: u8 = 1 << 3 | 4;

#[test]
fn seeds_that_make_no_sense_are_refused() {
    let (start, _, _) = poses(&START);
    let (robot, load) = crane::<f32>();
    // No such cable, bits that mean nothing, no bracket.
    let [kind, low, high, ..] = SEED;
    let beginnings = [
        [6, low, high],
        [15, low, high],
        [kind | 32, low, high],
        [kind | 64, low, high],
        [kind | 128, low, high],
        [kind, high, low],
        [kind, low, low],
        [kind, 0, 0x80],
    ];
    for beginning in beginnings {
        let mut seed = SEED;
        seed[..3].copy_from_slice(&beginning);
        let bytes = made(&[CELL], &[seed]);
        let table = Table::open(&bytes).expect("opens");
        assert_eq!(table.seed(0), None, "{seed:x?}");
        let states = table.states(&robot, &load, &start);
        assert_eq!(states, Err(TableFault::Malformed), "{seed:x?}");
    }
}

/// Every coordinate that can be written, and what is made of all others.
#[test]
fn seeds_are_rounded_to_the_nearest_and_brackets_outwards() {
    let of = |byte: u8| {
        let size = 2.0_f32.powi(i32::from(byte >> 3 & 15)) * (1.0 + f32::from(byte & 7) / 8.0);
        if byte >> 7 == 0 { (size - 1.0) / 4.0 } else { (1.0 - size) / 4.0 }
    };
    let start = |charts: [f32; CABLES], bracket: [f32; 2]| Start {
        charts,
        eliminated: 5,
        bracket,
        fold_at_slack_end: true,
        is_positive: false,
    };
    for byte in (0..128).chain(129..=255) {
        let seed = start([of(byte); CABLES], [-1e9, 1e9]);
        assert_eq!(encoded(&seed), [5 | 16, 255, 127, byte, byte, byte, byte, byte]);
    }
    let mut chart = -20_000.0_f32;
    while chart < 20_000.0 {
        let seed = start([chart; CABLES], [chart - 1e-3, chart + 1e-3]);
        let read = decoded(encoded(&seed));
        let largest = of(127);
        if chart.abs() < largest - 1.0 {
            let read = read.expect("a bracket");
            // Half of a step: an eighth of the size and a quarter.
            let room = (chart.abs() + 0.25) / 16.0 * 1.000_01;
            assert!((read.charts[0] - chart).abs() <= room, "{chart}: {read:?}");
            assert!(read.bracket[0] <= chart - 1e-3 && read.bracket[1] >= chart + 1e-3, "{chart}");
            assert!(read.bracket[1] - read.bracket[0] <= 4.0 * room + 2e-3, "{chart}: {read:?}");
        } else if let Some(read) = read {
            assert!(read.charts.iter().all(|c| c.abs() <= largest), "{chart}: {read:?}");
        }
        chart += 0.013 + chart.abs() * 0.003;
    }
}

#[test]
fn a_right_checksum_does_not_hide_a_wrong_structure() {
    let seed = SEED;
    let wanted = Start {
        charts: [0.5, 0.5, -0.0625, 0.5, 0.5, 0.5],
        eliminated: 2,
        bracket: [-2.25, 1.0],
        fold_at_slack_end: false,
        is_positive: true,
    };
    let (start, _, _) = poses(&START);
    let (robot, load) = crane::<f32>();
    let at = |bytes: &[u8]| Table::open(bytes).expect("opens").start_at(&start);
    // At the start, with which half of the region the lower one is.
    let good: [&[u16]; 10] = [
        &[CELL],
        &[CELL | 0x3fff, 0, 0], // the number in two words
        &[split(0, 2), CELL, CELL],
        &[split(0, 0), 4, 0, CELL, CELL],
        &[TRIM | 1, 0, CELL],           // all is before it
        &[TRIM | 0x7ff, 0x1f, CELL],    // a component of -1
        &[TRIM_TURNED | 1, 0, 0, CELL], // with words for turns
        &[split(0, 3), TRIM | 1, 0, CELL, CELL],
        &[half(0, true, 1), CELL], // the start is in the upper half of x, and in the lower half of that
        &[half(0, true, 3), half(0, false, 0), CELL],
    ];
    for words in good {
        assert_eq!(at(&made(words, &[seed])), Ok(wanted), "{words:x?}");
    }
    let malformed: [(&[u16], usize); 21] = [
        (&[CELL | 1], 1), // a seed that is not there
        (&[CELL | 0x3ffe], 1),
        (&[CELL | 0x3fff, 1, 0], 1),
        (&[CELL | 0x3fff, 0, 1], 1),
        (&[CELL | 0x3fff, 0], 1), // torn off
        (&[CELL | 0x3fff], 1),
        (&[CELL], 0),
        (&[split(0, 1), CELL, CELL], 1), // both halves at one place
        (&[split(0, 2), CELL], 1),       // beyond the end
        (&[half(0, false, 0)], 1),
        (&[split(0, 0xfef), CELL], 1),
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
}

/// Host and core agree on what is written.
#[test]
fn every_node_is_read_as_it_was_written() {
    let seed = SEED;
    let (start, _, _) = poses(&START);
    let at = |bytes: &[u8]| Table::open(bytes).expect("opens").start_at(&start);
    // A lower half too long for one word.
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
    // The half in which the start is not covered, and why.
    for (code, gap) in (0..).zip(Gap::ALL) {
        let words = [half(0, true, 7 - code), half(0, true, code), CELL];
        let bytes = made(&words, &[seed]);
        assert_eq!(at(&bytes), Err(TableFault::Uncovered(gap)), "{code}");
        let table = Table::open(&bytes).expect("opens");
        for (place, word) in words[..2].iter().enumerate() {
            assert_eq!(table.node(place).expect("a node").encode(), ([*word, 0, 0], 1));
        }
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
    for version in 0..5 {
        assert_eq!(with(8, &[version, 0]), Err(TableFault::OlderVersion(u16::from(version))));
    }
    assert_eq!(with(8, &[6, 0]), Err(TableFault::NewerVersion(6)));
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
        Tracker::start_from(robot, load, unlimited(), &still(pose), &table, 0).map(|_| ())
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
