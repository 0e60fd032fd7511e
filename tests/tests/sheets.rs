//! Sheets of solutions over a region, against following a solution in many small steps without any certificate.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use cdpr_core::statics::Balance;
use cdpr_core::{CABLES, CableState, IrvineCatenary, Load, Pose, Robot, newton};
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::enumerate::{Method, ModelKind, Options, Request};
use cdpr_host_sim::in_order;
use cdpr_host_sim::robot_file::RobotDescription;
use cdpr_host_sim::table::{Border, Sheet, Sheets};
use cdpr_host_sim::workspace::Grid;
use nalgebra::{UnitQuaternion, Vector3};

/// Longest rest length, m.
const LONGEST_M: f64 = 60.0;
/// Steps of a way between two poses: 2 mm each.
const STEPS: u32 = 125;

type States = [CableState<f64>; CABLES];

fn crane() -> RobotDescription {
    let overrides = Overrides { max_length_m: Some(LONGEST_M), ..Overrides::default() };
    overrides.apply(&RobotDescription::marionet_crane())
}

fn sheets(grid: &Grid) -> Sheets {
    let pool = in_order::threads(None).expect("threads");
    Sheets::of(&crane(), grid, [0.0; 3], &pool, || {}).expect("sheets")
}

/// A robot, to be led along ways without proof.
struct Naive {
    robot: Robot<f64, IrvineCatenary<f64>>,
    load: Load<f64>,
}

impl Naive {
    fn new() -> Self {
        let crane = crane();
        Self { robot: crane.with_model(), load: crane.load }
    }

    /// The solution at the end of a straight way; `None` where it jumps, is lost, or is beyond the limit of length.
    fn led(&self, start: &States, from: Vector3<f64>, to: Vector3<f64>) -> Option<States> {
        let mut states = *start;
        for step in 1..=STEPS {
            let position_m = from + (to - from) * (f64::from(step) / f64::from(STEPS));
            let pose = Pose::new(position_m, UnitQuaternion::identity()).ok()?;
            let balance = Balance::at(&self.robot, &self.load, &pose).ok()?;
            let found = newton::converge(&self.robot, &balance, &states, 1e-12, 30).ok()?;
            let next = found.step.states;
            for (before, after) in states.iter().zip(&next) {
                // 2 mm further, a cable changes by some times as much, near its bend by more: never by a tenth.
                let jump_m = (after.rest_length_m - before.rest_length_m).abs();
                let is_near = jump_m <= 0.1 * (1.0 + before.rest_length_m);
                if !is_near || after.rest_length_m > LONGEST_M {
                    return None;
                }
            }
            states = next;
        }
        Some(states)
    }
}

fn bits(position_m: [f64; 3]) -> [u64; 3] {
    position_m.map(f64::to_bits)
}

/// What can be reached from a solution without proof: every solution that the certified sheet holds, and few others.
#[test]
fn a_sheet_is_what_small_steps_reach() {
    // A quarter of a metre apart, around the diamond in which all cables are taut.
    let grid = Grid::new([7, 15, 4], [1.25, 5.5, 2.0], [2.75, 9.0, 2.75]).expect("a grid");
    let start_m = [2.0, 7.0, 2.5];
    let all = sheets(&grid);
    let of_start = |sheet: &&Sheet| {
        sheet.members.iter().any(|m| bits(m.position_m) == bits(start_m) && m.solution == 1)
    };
    let sheet = all.sheets.iter().find(of_start).expect("the sheet of the start");

    // All proven solutions by pose, whichever sheet they are on.
    let mut known = BTreeMap::<[u64; 3], Vec<(usize, [f64; CABLES])>>::new();
    for member in all.sheets.iter().flat_map(|sheet| &sheet.members) {
        known.entry(bits(member.position_m)).or_default().push((member.solution, member.lengths_m));
    }
    let request = Request {
        robot: crane(),
        position_m: start_m,
        rotation_vector_rad: [0.0; 3],
        model: ModelKind::Irvine,
    };
    let options = Options { method: Method::Complete, ..Options::default() };
    let first = request.enumerate(options).expect("a pose").solutions[0].solution.states;

    let naive = Naive::new();
    let number = (0..grid.poses())
        .find(|n| bits(grid.position_m(*n)) == bits(start_m))
        .expect("on the grid");
    let mut reached = BTreeSet::from([(number, 1)]);
    let mut queue = VecDeque::from([(number, first)]);
    let [nx, ny, nz] = grid.counts();
    while let Some((number, states)) = queue.pop_front() {
        let [ix, iy, iz] = grid.indices(number);
        let mut neighbours = Vec::new();
        for (index, count, stride) in [(ix, nx, 1), (iy, ny, nx), (iz, nz, nx * ny)] {
            neighbours.extend((index > 0).then(|| number - stride));
            neighbours.extend((index + 1 < count).then(|| number + stride));
        }
        for next in neighbours {
            let ends = [number, next].map(|n| Vector3::from(grid.position_m(n)));
            let Some(found) = naive.led(&states, ends[0], ends[1]) else { continue };
            let solutions = known.get(&bits(grid.position_m(next)));
            let solution = solutions.into_iter().flatten().find(|(_, lengths_m)| {
                (0..CABLES).all(|i| (found[i].rest_length_m - lengths_m[i]).abs() < 1e-6)
            });
            let (solution, _) =
                solution.expect("what is led to a pose is one of its proven solutions");
            if reached.insert((next, *solution)) {
                queue.push_back((next, found));
            }
        }
    }
    let at: BTreeMap<[u64; 3], usize> =
        (0..grid.poses()).map(|n| (bits(grid.position_m(n)), n)).collect();
    let members: BTreeSet<(usize, usize)> =
        sheet.members.iter().map(|m| (at[&bits(m.position_m)], m.solution)).collect();
    assert!(members.len() > 100, "{}", members.len());
    let unreached: Vec<_> = members.difference(&reached).collect();
    assert!(unreached.is_empty(), "on the sheet, but not to be reached: {unreached:?}");
    let missed = reached.difference(&members).count();
    // Where the proof finds a way too close to a fold, and no way around.
    assert!(50 * missed <= members.len(), "{missed} of {} are not on the sheet", reached.len());
}

/// Facts that hold for every sheet.
#[test]
fn sheets_share_no_solution_and_keep_their_sign() {
    let grid = Grid::new([9, 17, 4], [0.0, 4.0, 1.0], [4.0, 12.0, 4.0]).expect("a grid");
    let all = sheets(&grid);
    assert_eq!((all.poses, all.undecided), (9 * 17 * 4, 0));
    assert!(all.sheets.len() >= 2);
    let mut seen = BTreeSet::new();
    let mut poses = BTreeSet::new();
    for sheet in &all.sheets {
        // Along a way on which the solution is unique and isolated the determinant has no zero.
        assert!(sheet.det_sign.is_some());
        let mut here = BTreeSet::new();
        for member in &sheet.members {
            assert!(seen.insert((bits(member.position_m), member.solution)), "twice: {member:?}");
            here.insert(bits(member.position_m));
            let longest_m = member.lengths_m.iter().copied().fold(0.0, f64::max);
            assert!(longest_m <= LONGEST_M * (1.0 + 1e-12));
            assert!(longest_m >= sheet.shortest.value);
        }
        assert_eq!(sheet.poses, here.len());
        assert!(sheet.members.len() - sheet.poses >= sheet.seams.len());
        poses.extend(here);
        assert!(sheet.borders.keys().all(|border| *border != Border::Undecided), "{sheet:?}");
    }
    assert_eq!(all.reached, poses.len());
    assert!(all.sheets.windows(2).all(|pair| pair[0].poses >= pair[1].poses));
}
