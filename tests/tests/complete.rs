//! The complete search against 40-digit solutions, continuation, random starts, and the degree of the
//! pose; at folds, limits and vertical cables, and with questions that make no sense.

use cdpr_core::{CABLES, IrvineCatenary, Parabola};
use cdpr_host_sim::complete::{Complete, Place, Proof, Provable, complete};
use cdpr_host_sim::continuation::BranchEnd;
use cdpr_host_sim::enumerate::{Difference, ModelKind, Options, Request};
use cdpr_host_sim::interval::Interval;
use cdpr_host_sim::problem::FromMaterial;
use cdpr_host_sim::robot_file::CableLimits;
use cdpr_tests::{RefinedSolution, multistart, paper_cases, random, random_tests, refined_cases};

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
    let answer = request.enumerate(Options::default()).expect("a valid pose");
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
    let unlimited = wide.enumerate(Options::default()).expect("a valid pose");
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
        assert_eq!(found.solutions.len(), 3);
        assert!(meeting(found).is_none() && !found.undecided.is_empty());
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
    let answer = paper_pose(density).enumerate(Options::default()).expect("a valid pose");
    assert!(!answer.is_complete());
}
