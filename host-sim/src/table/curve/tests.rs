//! Whatever a cable is at a pose and a coordinate is in what is said of boxes of both.

use cdpr_core::chart::ChartPoint;
use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt as _, SeedableRng as _};

use super::super::place::{Point, PoseBox};
use super::super::proof::Prover;
use super::*;
use crate::robot_file::RobotDescription;

fn marionet_crane() -> Prover {
    let description = RobotDescription::marionet_crane();
    let load = description.load;
    let request = crate::enumerate::Request {
        robot: description,
        position_m: [2.0, 7.0, 2.5],
        rotation_vector_rad: [0.0; 3],
        model: crate::enumerate::ModelKind::Irvine,
    };
    Prover::new(&request.problem::<Model>().expect("a problem").robot, &load)
}

/// A cable, a box of poses and a range of its coordinate.
struct Sample<'a> {
    prover: &'a Prover,
    cable: usize,
    poses: PoseBox,
    chart: Interval,
    sight: Sight,
    /// That of the tangent in the middle of both.
    direction: Vector2<f64>,
}

impl<'a> Sample<'a> {
    fn new(prover: &'a Prover, random: &mut impl Rng) -> Self {
        let low: Point = [
            random.random_range(0.0..4.0),
            random.random_range(4.0..12.0),
            random.random_range(1.0..4.0),
            random.random_range(-0.1..0.1),
            random.random_range(-0.1..0.1),
            random.random_range(-0.1..0.1),
        ];
        let high = low.map(|low| low + random.random_range(0.0..0.1));
        let (poses, cable) = (PoseBox { low, high }, random.random_range(0..CABLES));
        let from: f64 = random.random_range(-8.0..8.0);
        let from = from * from.abs();
        let chart = Interval::new(from, from + random.random_range(0.0..0.5) * (1.0 + from.abs()));
        let (sights, _) = prover.likeness.look(&poses).expect("no cable is vertical");
        let direction = Vector2::zeros();
        let mut sample = Self { prover, cable, poses, chart, sight: sights[cable], direction };
        let middle = sample.hang(&poses.middle(), chart.middle());
        sample.direction = middle.force_by_chart_n.normalize();
        sample
    }

    fn pose(&self, random: &mut impl Rng) -> Point {
        self.poses.at(&std::array::from_fn(|_| random.random()))
    }

    fn coordinate(&self, random: &mut impl Rng) -> f64 {
        random.random_range(self.chart.low()..=self.chart.high())
    }

    /// How far the cable spans, and rises, m.
    fn end(&self, at: &Point) -> [f64; 2] {
        let plane = self.prover.balance(at).expect("a balance").planes()[self.cable];
        [plane.x_m, plane.z_m]
    }

    fn hang(&self, at: &Point, chart: f64) -> ChartPoint<f64> {
        let [x_m, z_m] = self.end(at);
        self.prover.robot().cables()[self.cable].model.hang(x_m, z_m, chart)
    }

    fn slant(&self, at: &Point, chart: f64) -> f64 {
        let tangent_n = self.hang(at, chart).force_by_chart_n;
        across(&self.direction).dot(&tangent_n) / self.direction.dot(&tangent_n)
    }
}

/// Whether a number of some size is in an interval, but for its rounding.
fn near(of: Interval, value: f64, size: f64) -> bool {
    (Interval::symmetric(1e-9 * size) + of).contains(value)
}

/// Whatever a cable is at a pose of a box and a coordinate of a range is in what is said of both, and how tightly a
/// taut cable is known to go straight on does not depend on how large they are.
#[test]
fn courses_hold_every_cable() {
    let prover = marionet_crane();
    let (mut all, mut straight) = (0, 0);
    for seed in 0..300 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sample = Sample::new(&prover, &mut random);
        let Sample { cable, chart, sight, direction, .. } = sample;
        let Some((reach, heading)) = prover.curves.course(cable, &sight, chart, &direction) else {
            continue;
        };
        let turn = prover.curves.turn(cable, &sight, chart, &heading).expect("known");
        all += 1;
        for _ in 0..20 {
            let [at, other] = [0, 1].map(|_| sample.pose(&mut random));
            let [p, u] = [0, 1].map(|_| sample.coordinate(&mut random));
            let here = sample.hang(&at, p);
            for k in 0..2 {
                assert!(near(reach.force_n[k], here.state.force_n[k], 1e3), "{seed}");
                assert!(near(reach.by_chart_n[k], here.force_by_chart_n[k], 1e3), "{seed}");
            }
            let slant = sample.slant(&at, p);
            assert!(near(heading.slant, slant, 1.0), "{seed}");
            // How it turns, as the mean of a way.
            let turned = sample.slant(&at, u) - slant;
            let bound = heading.bend * Interval::point(u - p);
            assert!(near(bound, turned, 1.0), "{seed}: {turned} {bound:?}");
            let moved = sample.slant(&other, p) - slant;
            let [a, b] = [sample.end(&other), sample.end(&at)];
            let bound = (0..2).fold(Interval::zero(), |sum, k| {
                sum + seen(&turn[k], &direction).1 * Interval::point(a[k] - b[k])
            });
            assert!(near(bound, moved, 1.0), "{seed}: {moved} {bound:?}");
            // What a tangent misses across.
            let missed_n = sample.hang(&at, u).state.force_n - here.state.force_n;
            let missed_n = across(&direction).dot(&missed_n) - slant * direction.dot(&missed_n);
            let half_square = Interval::point(0.5 * (u - p) * (u - p));
            let bound = heading.rate_n * heading.bend * half_square;
            assert!(near(bound, missed_n, 1e3), "{seed}: {missed_n} {bound:?}");
        }
        if chart.high() < -25.0 {
            // The mean tension rises by hundreds of newtons, and the direction by a part of that.
            straight += 1;
            let turns = heading.bend.magnitude() * (chart.high() - chart.low());
            assert!(turns < 5e-3, "{seed}: {turns} over {chart:?}");
        }
    }
    assert!(all > 200 && straight > 20, "{all} {straight}");
}

/// Chords have the slant that is said of them, which is less than that of tangents where these bend sharply.
#[test]
fn chords_slant_as_far_as_the_mean_of_tangents() {
    let prover = marionet_crane();
    let (mut all, mut sharper) = (0, 0);
    for seed in 0..300 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sample = Sample::new(&prover, &mut random);
        let Sample { cable, chart, sight, direction, .. } = sample;
        let from = sample.coordinate(&mut random);
        let Some(chord) = prover.curves.chord(cable, &sight, from, chart, &direction) else {
            continue;
        };
        all += 1;
        for _ in 0..20 {
            let (at, to) = (sample.pose(&mut random), sample.coordinate(&mut random));
            let [a, b] = [from, to].map(|chart| sample.hang(&at, chart).state.force_n);
            let along_n = direction.dot(&(b - a));
            // Not where little is left of their difference.
            if along_n.abs() > 1e-3 * (1.0 + a.norm()) {
                let turned = across(&direction).dot(&(b - a)) / along_n - sample.slant(&at, from);
                assert!(near(chord, turned, 1.0), "{seed}: {turned} {chord:?}");
            }
        }
        let tangents = prover.curves.course(cable, &sight, chart, &direction);
        let slant = tangents.map_or(f64::INFINITY, |(_, heading)| heading.slant.radius());
        sharper += usize::from(2.0 * chord.radius() < slant);
    }
    assert!(all > 200 && sharper > 50, "{all} {sharper}");
}

/// A short piece of a curve is as said along its own direction, over a box and at the middle of it.
#[test]
fn short_pieces_hold_every_cable() {
    let prover = marionet_crane();
    let mut all = 0;
    for seed in 0..300 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut sample = Sample::new(&prover, &mut random);
        let Sample { cable, chart, sight, poses, .. } = sample;
        let level = PoseBox { low: poses.middle(), high: poses.middle() };
        let (here, _) = prover.likeness.look(&level).expect("no cable is vertical");
        let Some(fine) = prover.curves.fine(cable, &sight, &here[cable], chart) else {
            continue;
        };
        let Fine { run: Run { heading, turn, .. }, rate_here_n, slant_here } = fine;
        all += 1;
        sample.direction = heading.direction;
        let rate_n = |at: &Point, chart: f64| {
            heading.direction.dot(&sample.hang(at, chart).force_by_chart_n)
        };
        for _ in 0..20 {
            let (at, chart) = (sample.pose(&mut random), sample.coordinate(&mut random));
            let slant = sample.slant(&at, chart);
            assert!(near(heading.rate_n, rate_n(&at, chart), 1e3), "{seed}");
            assert!(near(heading.slant, slant, 1.0), "{seed}");
            let at_middle = sample.slant(&poses.middle(), chart);
            assert!(near(rate_here_n, rate_n(&poses.middle(), chart), 1e3), "{seed}");
            assert!(near(slant_here, at_middle, 1.0), "{seed}");
            let [a, b] = [sample.end(&at), sample.end(&poses.middle())];
            let bound = (0..2).fold(Interval::point(at_middle), |sum, k| {
                sum + seen(&turn[k], &heading.direction).1 * Interval::point(a[k] - b[k])
            });
            assert!(near(bound, slant, 1.0), "{seed}: {slant} {bound:?}");
        }
    }
    assert!(all > 200, "{all}");
}
