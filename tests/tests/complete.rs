//! The complete search against 40-digit solutions, continuation, random starts, and the degree of the
//! pose; at folds, limits and vertical cables, and with questions that make no sense.

use cdpr_core::{CABLES, IrvineCatenary, LinearElastic, Parabola, Robot};
use cdpr_host_sim::complete::{Complete, Place, Proof, Provable, complete};
use cdpr_host_sim::continuation::{BranchEnd, Steps};
use cdpr_host_sim::enumerate::{Difference, Method, ModelKind, Options, Request};
use cdpr_host_sim::interval::Interval;
use cdpr_host_sim::problem::FromMaterial;
use cdpr_host_sim::robot_file::{CableLimits, CableMaterial, RobotDescription};
use cdpr_tests::{
    RefinedSolution, multistart, paper_cases, random, random_tests, refined_cases, tolerance,
};
use nalgebra::Vector3;
use rand::RngExt;

/// Both methods; the steps of continuation are proven by other tests.
const TESTED_STEPS: Options =
    Options { method: Method::Both, steps: Steps::Tested, retrace: false, kantorovich: false };

/// Radius of an enclosed rest length or force, relative to it. A solution is proven within 1e-5 of its
/// forces, and curves leave their chords by the square of that, times bend and condition; largest
/// found 1.4e-9.
const ENCLOSURE: f64 = 3e-9;
/// Random starts at each of many poses: enough to notice a systematic loss. One solution in a hundred
/// is found by fewer than 2 % of all starts.
const STARTS: u32 = 60;
/// Limits that solutions hardly ever leave, m and N, for what holds only without limits.
const WIDE: CableLimits = CableLimits { max_length_m: 1e6, max_tension_n: 1e7 };

/// Whether the enclosure holds a decimal number of any length. Strictly about the nearest float: what
/// stands behind its last digit cannot matter then.
fn holds(enclosure: Interval, digits: &str) -> bool {
    let near: f64 = digits.parse().expect("a decimal number");
    enclosure.low() < near && near < enclosure.high()
}

fn encloses(proof: &Proof, solution: &RefinedSolution) -> bool {
    proof.enclosure().iter().enumerate().all(|(k, state)| {
        holds(state.rest_length_m, &solution.lengths_m[k])
            && holds(state.force_n.x, &solution.fx_n[k])
            && holds(state.force_n.y, &solution.fz_n[k])
    })
}

/// Whether two enclosures have no point in common. Two that have might be one solution, counted twice.
fn are_apart(a: &Proof, b: &Proof) -> bool {
    let apart = |a: Interval, b: Interval| a.intersection(b).is_none();
    a.enclosure().iter().zip(&b.enclosure()).any(|(a, b)| {
        apart(a.rest_length_m, b.rest_length_m)
            || apart(a.force_n.x, b.force_n.x)
            || apart(a.force_n.y, b.force_n.y)
    })
}

fn assert_all_apart(proofs: &[Proof], what: &str) {
    for (n, a) in proofs.iter().enumerate() {
        assert!(proofs[..n].iter().all(|b| are_apart(a, b)), "{what}: {:?} twice", a.states());
    }
}

fn searched<M: FromMaterial + Provable>(request: &Request) -> Complete {
    complete(&request.problem::<M>().expect("a valid pose")).expect("a search")
}

fn with_limits(request: &Request, limits: CableLimits) -> Request {
    let mut request = request.clone();
    request.robot.limits = [limits; CABLES];
    request
}

#[test]
fn enclosures_hold_the_40_digit_solutions() {
    let mut count = 0;
    for case in refined_cases() {
        let found = searched::<IrvineCatenary<f64>>(&case.pose.request());
        assert!(found.undecided.is_empty(), "{}: undecided", case.origin);
        assert!(found.outside.is_empty(), "{}: beyond a limit", case.origin);
        assert_eq!(found.solutions.len(), case.pose.solutions.len(), "{}", case.origin);
        for solution in &case.pose.solutions {
            let holding = found.solutions.iter().filter(|proof| encloses(proof, solution)).count();
            assert_eq!(holding, 1, "{}: {:?}", case.origin, solution.lengths_m);
        }
        for state in found.solutions.iter().flat_map(Proof::enclosure) {
            let length = state.rest_length_m;
            let force_n = state.force_n.map(Interval::middle).norm();
            let radius_n = state.force_n.map(Interval::radius).max();
            assert!(length.radius() < ENCLOSURE * length.middle(), "{}: {length:?}", case.origin);
            assert!(radius_n < ENCLOSURE * force_n, "{}: {:?}", case.origin, state.force_n);
        }
        count += found.solutions.len();
    }
    assert_eq!(count, 38);
}

/// What was seen at many poses.
#[derive(Debug, Default)]
struct Seen {
    solutions: usize,
    /// Solutions that no random start led to.
    missed_by_starts: usize,
    without_rigid_origin: usize,
    only_inverse: usize,
    degrees: usize,
}

/// Both methods agree, random starts find nothing else, and with wide limits the solutions add up to
/// the degree, which only the directions of the curves far out decide.
fn check<M: FromMaterial + Provable>(request: &Request, case: u64, seen: &mut Seen) {
    let answer = request.enumerate(TESTED_STEPS).expect("a valid pose");
    assert!(answer.is_complete(), "case {case}: {:?}", answer.search);
    for difference in &answer.differences {
        match difference {
            Difference::NoRigidOrigin { .. } => seen.without_rigid_origin += 1,
            Difference::OnlyInverse { .. } => seen.only_inverse += 1,
            Difference::Unconfirmed { .. } => panic!("case {case}: {difference}"),
        }
    }

    let found = searched::<M>(request);
    assert_eq!(found.solutions.len(), answer.solutions.len(), "case {case}");
    assert_all_apart(&found.solutions, &format!("case {case}"));
    seen.solutions += found.solutions.len();

    let problem = request.problem::<M>().expect("a valid pose");
    let started = multistart::solutions(&problem, STARTS, &mut random::numbers(case));
    for solution in &started {
        let proofs = found.solutions.iter().filter(|proof| proof.holds(&solution.states)).count();
        assert_eq!(proofs, 1, "case {case}: {:?}", solution.states);
    }
    seen.missed_by_starts += found.solutions.len() - started.len();

    let wide = with_limits(request, WIDE);
    let unlimited = wide.enumerate(TESTED_STEPS).expect("a valid pose");
    assert!(unlimited.is_complete(), "case {case}: {:?}", unlimited.search);
    let everywhere = searched::<M>(&wide);
    assert_all_apart(&everywhere.solutions, &format!("case {case}, wide limits"));
    let within = everywhere.solutions.iter().filter(|proof| {
        proof.states().iter().enumerate().all(|(k, state)| {
            let limits = &request.robot.limits[k];
            let at_anchor_n = state.tension_at_anchor_n(problem.model(k).weight_n_m());
            state.rest_length_m <= limits.max_length_m
                && state.tension_at_attachment_n().max(at_anchor_n) <= limits.max_tension_n
        })
    });
    assert_eq!(within.count(), found.solutions.len(), "case {case}: limits");
    let beyond = |end: &BranchEnd| matches!(end, BranchEnd::BeyondLimit { .. });
    if everywhere.outside.is_empty() && !unlimited.branches.iter().any(|b| beyond(&b.end)) {
        assert_eq!(unlimited.degree(), unlimited.rigid.degree(), "case {case}");
        seen.degrees += 1;
    }
}

/// `ordinary` random poses, and a summary of them.
fn check_many<M: FromMaterial + Provable>(
    request: impl Fn(u64) -> Request,
    model: ModelKind,
    ordinary: u32,
) -> Seen {
    let mut seen = Seen::default();
    let cases = random_tests(ordinary).cases;
    for case in 0..cases.into() {
        check::<M>(&Request { model, ..request(case) }, case, &mut seen);
    }
    let (cases, solved) = (cases as usize, seen.solutions);
    assert!(solved > cases / 32, "{seen:?}"); // fewer would test nothing
    assert!(seen.degrees >= cases - cases / 50, "{seen:?}");
    // More of them would mean starts that are no good.
    assert!(seen.missed_by_starts <= solved / 10, "{seen:?}");
    println!("{cases} poses: {seen:?}");
    seen
}

#[test]
fn random_poses_with_catenaries() {
    let request = |case| random::request(&mut random::numbers(case));
    let seen = check_many::<IrvineCatenary<f64>>(request, ModelKind::Irvine, 1000);
    // Solutions that continuation cannot reach are what the search is for: 3 % of them.
    assert!(seen.without_rigid_origin > 0, "{seen:?}");
}

#[test]
fn random_poses_with_parabolas() {
    let request = |case| random::request(&mut random::numbers(case));
    check_many::<Parabola<f64>>(request, ModelKind::Parabolic, 1000);
}

#[test]
fn random_robots_with_catenaries() {
    let request = |case| random::request_of_random_robot(&mut random::numbers(case));
    check_many::<IrvineCatenary<f64>>(request, ModelKind::Irvine, 400);
}

#[test]
fn random_robots_with_parabolas() {
    let request = |case| random::request_of_random_robot(&mut random::numbers(case));
    check_many::<Parabola<f64>>(request, ModelKind::Parabolic, 200);
}

/// The paper's pose with five solutions, 10 kg, at another linear density of its cables.
fn paper_pose(linear_density_kg_m: f64) -> Request {
    let mut case = paper_cases().remove(2);
    case.linear_density_kg_m = linear_density_kg_m;
    case.request()
}

/// Rest lengths of cable 3, by which the two solutions that meet are told from the others.
fn lengths_3(found: &Complete) -> Vec<f64> {
    let length = |proof: &Proof| proof.states()[2].rest_length_m;
    found.solutions.iter().map(length).collect()
}

/// The two that meet at 58.132 m; the others are 43 m away and more.
fn meeting(found: &Complete) -> Option<[f64; 2]> {
    let mut near: Vec<f64> =
        lengths_3(found).into_iter().filter(|length| (length - 58.132).abs() < 40.0).collect();
    near.sort_by(f64::total_cmp);
    near.try_into().ok()
}

/// Whether all lengths and forces are known to a part of `1e-4`. Pieces are cut down to 1e-7, and a
/// place is the hull of all that cannot be decided around it.
fn is_small(place: &Place) -> bool {
    place.states.iter().all(|state| {
        let force_n = state.force_n.map(Interval::middle).norm();
        state.rest_length_m.radius() < 1e-4 * state.rest_length_m.middle()
            && state.force_n.map(Interval::radius).max() < 1e-4 * force_n
    })
}

#[test]
fn two_solutions_that_meet_are_undecided_and_never_one() {
    // Five solutions below the fold, three above.
    let (mut low, mut high) = (4.1e-3, 4.3e-3);
    let mut pairs = Vec::new();
    let mut undecided = None;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let found = searched::<IrvineCatenary<f64>>(&paper_pose(middle));
        if !found.undecided.is_empty() {
            undecided = Some((middle, found));
            break;
        }
        match found.solutions.len() {
            5 => {
                pairs.push((middle, meeting(&found).expect("two near the fold")));
                low = middle;
            }
            3 => high = middle,
            other => panic!("{other} solutions at {middle:e} kg/m"),
        }
    }
    let (density, found) = undecided.expect("a fold cannot be decided");
    assert_eq!(format!("{density:.8}"), "0.00419299");
    let assert_undecided = |found: &Complete| {
        // The three others, and neither one nor two of those that meet.
        assert_eq!(found.solutions.len(), 3, "{:?}", lengths_3(found));
        assert!(meeting(found).is_none());
        // One place, or one for each of the two.
        assert!((1..=2).contains(&found.undecided.len()), "{:?}", found.undecided);
        for place in &found.undecided {
            let length = place.states[2].rest_length_m;
            assert!(is_small(place) && (length.middle() - 58.132).abs() < 0.01, "{place:?}");
        }
    };
    assert_undecided(&found);

    // Where exactly: the square of the distance of the two falls linearly with the density, and so
    // moves their middle. Two pairs well below the fold know it better than any next to it.
    let gap_sq = |pair: &[f64; 2]| (pair[1] - pair[0]).powi(2);
    let usable: Vec<_> = pairs.iter().filter(|(_, pair)| gap_sq(pair) < 0.3).collect();
    let [(density_1, pair_1), (density_2, pair_2), ..] = usable[..] else { panic!("{pairs:?}") };
    let share = gap_sq(pair_2) / (gap_sq(pair_1) - gap_sq(pair_2));
    let density = density_2 + (density_2 - density_1) * share;
    let middle = |pair: &[f64; 2]| 0.5 * (pair[0] + pair[1]);
    let double_m = middle(pair_2) + (middle(pair_2) - middle(pair_1)) * share;
    let found = searched::<IrvineCatenary<f64>>(&paper_pose(density));
    assert_undecided(&found);
    let held = |place: &Place| place.states[2].rest_length_m.contains(double_m);
    assert!(found.undecided.iter().any(held), "{double_m}: {:?}", found.undecided);
    let answer = paper_pose(density).enumerate(TESTED_STEPS).expect("a valid pose");
    assert!(!answer.is_complete());
}

/// One cable with a limit of its own, all other limits as wide as in the reference cases.
fn with_limit(request: &Request, cable: usize, limit: CableLimits) -> Request {
    let mut request = request.clone();
    request.robot.limits[cable] = limit;
    request
}

/// The reference solution that a limit is about, looked for among all that the search reports.
fn reported(found: &Complete, solution: &RefinedSolution) -> (usize, usize, usize) {
    let inside = found.solutions.iter().filter(|proof| encloses(proof, solution));
    let outside = found.outside.iter().filter(|outside| encloses(&outside.proof, solution));
    let undecided = found.undecided.iter().filter(|place| {
        place.states.iter().zip(&solution.lengths_m).all(|(state, m)| holds(state.rest_length_m, m))
    });
    (inside.count(), undecided.count(), outside.count())
}

/// Distance from a limit, relative to it, that is certainly more than the radius of an enclosure, and
/// less than the part of `1e-6` by which the search looks beyond limits.
const BESIDE_LIMIT: f64 = 20.0 * ENCLOSURE;

#[test]
fn a_solution_at_a_limit_is_undecided() {
    for case in refined_cases() {
        let request = case.pose.request();
        let problem = request.problem::<IrvineCatenary<f64>>().expect("a pose");
        for solution in &case.pose.solutions {
            let number = |digits: &String| digits.parse::<f64>().expect("a decimal number");
            for cable in 0..CABLES {
                let length_m = number(&solution.lengths_m[cable]);
                let (fx_n, fz_n) = (number(&solution.fx_n[cable]), number(&solution.fz_n[cable]));
                let weight_n = problem.model(cable).weight_n_m * length_m;
                let tension_n = fx_n.hypot(fz_n).max(fx_n.hypot(fz_n - weight_n));
                let limits = request.robot.limits[cable];
                for (change, expected) in
                    [(BESIDE_LIMIT, (1, 0, 0)), (0.0, (0, 1, 0)), (-BESIDE_LIMIT, (0, 0, 1))]
                {
                    let max_length_m = length_m * (1.0 + change);
                    let limit = CableLimits { max_length_m, ..limits };
                    let found =
                        searched::<IrvineCatenary<f64>>(&with_limit(&request, cable, limit));
                    assert_eq!(reported(&found, solution), expected, "{max_length_m} m, {found:?}");

                    let max_tension_n = tension_n * (1.0 + change);
                    let limit = CableLimits { max_tension_n, ..limits };
                    let found =
                        searched::<IrvineCatenary<f64>>(&with_limit(&request, cable, limit));
                    assert_eq!(
                        reported(&found, solution),
                        expected,
                        "{max_tension_n} N, {found:?}"
                    );
                }
            }
        }
    }
}

/// MARIONET-CRANE at `position_m` with the anchor of one cable straight above its attachment there.
fn hanging_straight(cable: usize, position_m: [f64; 3]) -> Request {
    let crane = RobotDescription::marionet_crane();
    let mut cables = *crane.robot.cables();
    let attachment_m = Vector3::from(position_m) + cables[cable].attachment_m;
    cables[cable].anchor_m.x = attachment_m.x;
    cables[cable].anchor_m.y = attachment_m.y;
    Request {
        robot: RobotDescription { robot: Robot::new(cables).expect("a robot"), ..crane },
        position_m,
        rotation_vector_rad: [0.0; 3],
        model: ModelKind::Irvine,
    }
}

/// How fast the lengths move with the platform. A slack one moves by some hundred metres per metre (as
/// its tension times the distance of others from theirs), a taut one by at most about one.
const LENGTH_PER_OFFSET: f64 = 300.0;

#[test]
fn vertical_cables_are_searched() {
    // Cable 4 slack at the paper's pose; at the other one, where all six are taut, each of them.
    let mut requests = vec![hanging_straight(3, [4.0, 7.0, 2.0])];
    requests.extend((0..CABLES).map(|cable| hanging_straight(cable, [2.0, 7.0, 2.5])));
    let mut solutions = 0;
    for request in requests {
        let answer = |offset_m: f64| {
            let mut request = request.clone();
            request.position_m[1] += offset_m;
            let answer = request.enumerate(TESTED_STEPS).expect("a valid pose");
            assert!(answer.is_complete(), "{offset_m:e}: {:?}", answer.search);
            assert_eq!(answer.differences, [], "{offset_m:e}");
            assert!(answer.solutions.iter().all(|found| found.proof.is_some()), "{offset_m:e}");
            answer
        };
        let exact = answer(0.0);
        solutions += exact.solutions.len();
        for exponent in 3..16 {
            for offset_m in [0.1_f64.powi(exponent), -0.1_f64.powi(exponent)] {
                let near = answer(offset_m);
                assert_eq!(near.solutions.len(), exact.solutions.len(), "{offset_m:e}");
                for (a, b) in near.solutions.iter().zip(&exact.solutions) {
                    assert_eq!(a.origin, b.origin);
                    for (a, b) in a.solution.states.iter().zip(&b.solution.states) {
                        let change = (a.rest_length_m - b.rest_length_m).abs();
                        let bound = LENGTH_PER_OFFSET * offset_m.abs()
                            + tolerance::SOLUTION_LENGTH * b.rest_length_m;
                        assert!(change < bound, "{offset_m:e}: {change:e}");
                    }
                }
            }
        }
    }
    assert!(solutions >= 4, "{solutions}");
}

/// MARIONET-CRANE with two of its anchors below the platform, which then help to pull it down.
fn with_low_anchors(case: u64) -> Request {
    let mut numbers = random::numbers(case);
    let mut request = random::request(&mut numbers);
    let mut cables = *request.robot.robot.cables();
    let first = numbers.random_range(0..CABLES);
    let second = (first + numbers.random_range(1..CABLES)) % CABLES;
    for cable in [first, second] {
        cables[cable].anchor_m.z = -3.0;
    }
    request.robot.robot = Robot::new(cables).expect("a robot");
    // A push down and sideways tightens them.
    request.robot.load.force_n = Vector3::from_fn(|_, _| numbers.random_range(-0.5..0.5))
        * request.robot.load.mass_kg
        * 9.81;
    request
}

#[test]
fn attachments_above_anchors_with_catenaries() {
    check_many::<IrvineCatenary<f64>>(with_low_anchors, ModelKind::Irvine, 300);
}

#[test]
fn attachments_above_anchors_with_parabolas() {
    check_many::<Parabola<f64>>(with_low_anchors, ModelKind::Parabolic, 300);
}

/// MARIONET-CRANE with the anchor of one cable exactly as high as its attachment, or next to it.
fn with_a_level_cable(case: u64) -> Request {
    let mut numbers = random::numbers(case);
    let mut request = random::request(&mut numbers);
    request.rotation_vector_rad = [0.0; 3];
    let mut cables = *request.robot.robot.cables();
    let cable = &mut cables[numbers.random_range(0..CABLES)];
    let level_m = request.position_m[2] + cable.attachment_m.z;
    cable.anchor_m.z = match case % 3 {
        0 => level_m,
        1 => level_m.next_up(),
        _ => level_m - 1e-9,
    };
    request.robot.robot = Robot::new(cables).expect("a robot");
    request
}

#[test]
fn level_cables_with_catenaries() {
    check_many::<IrvineCatenary<f64>>(with_a_level_cable, ModelKind::Irvine, 300);
}

#[test]
fn level_cables_with_parabolas() {
    check_many::<Parabola<f64>>(with_a_level_cable, ModelKind::Parabolic, 300);
}

#[test]
fn without_a_tension_limit_the_search_refuses() {
    let mut request = paper_cases().remove(0).request();
    request.robot.limits[4].max_tension_n = f64::INFINITY;
    let answer = request.enumerate(TESTED_STEPS).expect("a valid pose");
    assert!(!answer.is_complete());
    assert_eq!(answer.solutions.len(), 1, "continuation needs no limit");
    let refusal = answer.search.and_then(|search| search.refusal).expect("a refusal");
    assert!(refusal.contains("cable 5: no tension limit"), "{refusal}");
    // The weight of the cable limits its length.
    let mut request = paper_cases().remove(0).request();
    request.robot.limits[3].max_length_m = f64::INFINITY;
    let answer = request.enumerate(TESTED_STEPS).expect("a valid pose");
    assert!(answer.is_complete() && answer.solutions.len() == 1);
}

/// Masses, cables and limits that nobody has.
fn absurd(case: u64) -> Request {
    let mut numbers = random::numbers(case);
    let mut request = random::request(&mut numbers);
    let mut any = |choices: &[f64]| choices[numbers.random_range(0..choices.len())];
    let linear_density_kg_m = any(&[1e-9, 1e-5, 0.079, 10.0, 1e3]);
    let axial_stiffness_n = any(&[1e2, 1e4, 1e6, 1e12, f64::INFINITY]);
    request.robot.load.mass_kg = any(&[1e-6, 1e-2, 10.0, 1e3, 1e6]);
    let limits = CableLimits {
        max_length_m: any(&[0.0, 1.0, 20.0, 1e4, 1e12, f64::INFINITY]),
        max_tension_n: any(&[0.0, 1e-3, 1e3, 1e7, 1e15, 1e200]),
    };
    let material = CableMaterial { linear_density_kg_m, axial_stiffness_n };
    request.robot.robot = request.robot.robot.map_models(|_, _| material);
    with_limits(&request, limits)
}

/// Whether the search says that its answer is complete; when it does, random starts and continuation
/// must not know better.
fn holds_out<M: FromMaterial + Provable>(request: &Request, case: u64) -> bool {
    let answer = request.enumerate(TESTED_STEPS).expect("a valid pose");
    let contradicted =
        |d: &Difference| matches!(d, Difference::Unconfirmed { contradicted: true, .. });
    assert!(!answer.differences.iter().any(contradicted), "case {case}: {:?}", answer.differences);
    let problem = request.problem::<M>().expect("a valid pose");
    let found = complete(&problem);
    let complete = found.as_ref().is_ok_and(|found| found.undecided.is_empty());
    assert_eq!(answer.is_complete(), complete, "case {case}");
    let Ok(found) = found else { return false };
    assert_all_apart(&found.solutions, &format!("case {case}"));
    if complete {
        for solution in multistart::solutions(&problem, STARTS, &mut random::numbers(case)) {
            let proofs = found.solutions.iter().filter(|proof| proof.holds(&solution.states));
            assert_eq!(proofs.count(), 1, "case {case}: {:?}", solution.states);
        }
    }
    complete
}

#[test]
fn absurd_questions_are_answered_truly_or_not_at_all() {
    let (mut complete, cases) = (0, random_tests(300).cases);
    for case in 0..cases.into() {
        let request = absurd(case);
        complete += u32::from(holds_out::<IrvineCatenary<f64>>(&request, case));
        let request = Request { model: ModelKind::Parabolic, ..request };
        complete += u32::from(holds_out::<Parabola<f64>>(&request, case));
        let request = Request { model: ModelKind::Elastic, ..request };
        complete += u32::from(holds_out::<LinearElastic<f64>>(&request, case));
    }
    println!("{complete} of {} complete", 3 * cases);
    assert!(complete > cases, "{complete} of {}", 3 * cases);
}
