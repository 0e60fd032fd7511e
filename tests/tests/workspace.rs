//! Maps of the workspace: the statistics of design and paper, and why poses are lost and gained.

use cdpr_core::CABLES;
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::choice::Choice;
use cdpr_host_sim::continuation::{BranchEnd, Steps};
use cdpr_host_sim::enumerate::{Method, ModelKind, Options, Request};
use cdpr_host_sim::in_order;
use cdpr_host_sim::journal::Job as _;
use cdpr_host_sim::rigid::RigidSolutions;
use cdpr_host_sim::robot_file::RobotDescription;
use cdpr_host_sim::workspace::{Change, Findings, Grid, Order, Status, Summary};
use nalgebra::{Matrix6, Vector3, Vector6};

/// MARIONET-CRANE with 10 kg, and with cables of so many metres.
fn crane(max_length_m: f64) -> RobotDescription {
    let overrides =
        Overrides { mass_kg: Some(10.0), max_length_m: Some(max_length_m), ..Overrides::default() };
    overrides.apply(&RobotDescription::marionet_crane())
}

fn map(robot: &RobotDescription, model: ModelKind, grid: Grid) -> Vec<Findings> {
    let order = Order::new(robot, model, grid, [0.0; 3], Choice::Shortest).expect("an order");
    let tiles: Vec<usize> = (0..order.tiles()).collect();
    let mut all = Vec::new();
    let keep = |(_, findings): (usize, Vec<Findings>)| {
        all.extend(findings);
        Ok::<(), ()>(())
    };
    order.examine(&in_order::threads(None).expect("threads"), &tiles, keep).expect("kept");
    all
}

/// The grid of the design: around the workspace, wide enough that nothing is cut off.
fn around(counts: [usize; 3]) -> Grid {
    Grid::new(counts, [-3.0, -0.5, 0.0], [9.5, 20.4, 8.0]).expect("a grid")
}

/// The figures were found by a prototype in another language (design, section 8).
#[test]
fn rigid_statistics_are_those_of_the_design() {
    let summary = Summary::of(&map(&crane(5000.0), ModelKind::Rigid, around([50, 80, 40])));
    assert_eq!(summary.poses, 160_000);
    assert_eq!(summary.rigid_undecided, 0);
    let reached: usize = summary.rigid.values().sum();
    assert_eq!(reached, 30_764);
    let shares: Vec<String> = summary
        .rigid
        .iter()
        .map(|(number, poses)| format!("{number}: {:.3}", 100.0 * *poses as f64 / reached as f64))
        .collect();
    assert_eq!(shares, ["1: 71.629", "2: 24.789", "3: 3.325", "4: 0.059", "5: 0.198"]);
}

/// The count of rigid solutions by a way of its own: tensions and pulls from a general LU decomposition of wrenches
/// that are put together from the positions.
#[test]
fn rigid_counts_are_those_of_plain_statics() {
    let (robot, grid) = (crane(5000.0), around([9, 15, 7]));
    let weight = Vector6::new(0.0, 0.0, -10.0 * robot.load.gravity_m_s2, 0.0, 0.0, 0.0);
    assert_eq!(robot.load.center_of_mass_m, Vector3::zeros());
    let mut reached = 0;
    for (number, findings) in map(&robot, ModelKind::Rigid, grid).iter().enumerate() {
        let position = Vector3::from(grid.position_m(number));
        let mut expected = 0;
        for slack in 0_u32..64 {
            let mut matrix = Matrix6::zeros();
            for (i, cable) in robot.robot.cables().iter().enumerate() {
                let up_the_cable = cable.anchor_m - (position + cable.attachment_m);
                let pull =
                    if slack >> i & 1 == 1 { -Vector3::z() } else { up_the_cable.normalize() };
                let moment = cable.attachment_m.cross(&pull);
                matrix.fixed_view_mut::<3, 1>(0, i).copy_from(&pull);
                matrix.fixed_view_mut::<3, 1>(3, i).copy_from(&moment);
            }
            let Some(forces) = matrix.full_piv_lu().solve(&-weight) else { continue };
            // A singular system gives forces without end.
            expected += u8::from(forces.min() > 0.0 && forces.max() < 1e9);
        }
        assert_eq!(findings.rigid, expected, "{position}");
        reached += usize::from(expected > 0);
    }
    assert!(reached > 100, "{reached}");
}

/// Continuation, which has no part in the map, must agree on what became of each rigid solution.
#[test]
fn poses_are_lost_and_gained_as_continuation_says() {
    let robot = crane(300.0);
    let grid = Grid::new([11, 20, 8], [-1.0, -0.5, 0.0], [8.5, 20.4, 4.5]).expect("a grid");
    let [mut merged, mut limited, mut gained] = [0; 3];
    for (number, findings) in map(&robot, ModelKind::Irvine, grid).iter().enumerate() {
        assert_eq!(findings.status, Status::Proven);
        let Some(change) = findings.change else { continue };
        let request = Request {
            robot: robot.clone(),
            position_m: grid.position_m(number),
            rotation_vector_rad: [0.0; 3],
            model: ModelKind::Irvine,
        };
        let options =
            Options { method: Method::Continuation, steps: Steps::Certified, ..Options::default() };
        let answer = request.enumerate(options).expect("a pose");
        assert!(answer.solutions.is_empty());
        let ends =
            |is: fn(&BranchEnd) -> bool| answer.branches.iter().filter(|b| is(&b.end)).count();
        let met = ends(|end| matches!(end, BranchEnd::MetBranch(_)));
        let beyond = ends(|end| matches!(end, BranchEnd::BeyondLimit { .. }));
        match change {
            Change::LostByMerging => {
                merged += 1;
                assert_eq!(met, answer.branches.len(), "{:?}", request.position_m);
            }
            Change::LostToLimits => {
                limited += 1;
                assert!(beyond > 0, "{:?}", request.position_m);
            }
            Change::Gained => {
                gained += 1;
                assert!(answer.branches.is_empty() && findings.solutions > 0);
            }
            Change::Lost | Change::LostWithoutWeight => {
                panic!("{change:?} at {:?}", request.position_m)
            }
        }
    }
    assert!(merged > 5 && limited > 5 && gained > 5, "{merged} {limited} {gained}");
}

/// The pose that disproves the paper's conjecture (design, section 8; solved there with 18 unknowns).
#[test]
fn a_pose_without_rigid_solution_is_gained() {
    let position_m = [3.764_711_568_660_600_5, 16.856_870_148_365_69, 3.958_746_955_731_745];
    let grid = Grid::new([1; 3], position_m, position_m).expect("one pose");
    let findings = map(&crane(5000.0), ModelKind::Irvine, grid).remove(0);
    assert_eq!((findings.rigid, findings.solutions, findings.degree), (0, 2, 0));
    assert_eq!(findings.change, Some(Change::Gained));
    let expected = [18.470, 21.670, 633.080, 5.905, 7.680, 20.361]; // m, of the one with shorter cables
    let best = findings.best.expect("the best");
    for i in 0..CABLES {
        assert!((best.lengths_m[i] - expected[i]).abs() < 6e-4, "{:?}", best.lengths_m);
    }
    let problem = Request {
        robot: crane(5000.0),
        position_m,
        rotation_vector_rad: [0.0; 3],
        model: ModelKind::Rigid,
    };
    let problem = problem.problem::<cdpr_core::NonDeformable>().expect("a problem");
    assert!(RigidSolutions::of(&problem.balance).solutions.is_empty());
}
