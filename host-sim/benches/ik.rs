//! How long the three kinds of work take: one line, one warm step of a controller, one enumeration.
//!
//! ```text
//! cargo bench -p cdpr-host-sim --bench ik [-- <filter>]
//! ```
//!
//! Times are per call. On a shared machine only ratios of figures from one run mean anything, and
//! the columns to read are `fastest` and `median`.

mod warm_path;

fn main() {
    divan::main();
}

/// A single elastic catenary, over the 120 lines of `tests/data/cable.json`.
mod line {
    use cdpr_core::{CableModel, IrvineCatenary};
    use divan::{Bencher, black_box};
    use nalgebra::Vector2;
    use serde_json::Value;

    /// Calls in one sample: ten times through all lines, so that every sample is the same mixture.
    const SAMPLE: u32 = 1200;

    struct Line {
        kind: String,
        model: IrvineCatenary<f64>,
        force_n: Vector2<f64>,
        rest_length_m: f64,
        end_m: Vector2<f64>,
    }

    fn lines() -> Vec<Line> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/cable.json");
        let text = std::fs::read_to_string(path).expect(path);
        let cases: Vec<Value> = serde_json::from_str(&text).expect(path);
        cases.iter().map(line).collect()
    }

    fn line(case: &Value) -> Line {
        let number = |key: &str| case[key].as_f64().expect(key);
        // The end point is written with more digits than a JSON number keeps.
        let decimal = |key: &str| case[key].as_str().expect(key).parse().expect(key);
        Line {
            kind: case["kind"].as_str().expect("kind").to_owned(),
            model: IrvineCatenary {
                weight_n_m: number("weight_n_m"),
                compliance_per_n: number("axial_stiffness_n").recip(),
            },
            force_n: Vector2::new(number("fx_n"), number("fz_n")),
            rest_length_m: number("rest_length_m"),
            end_m: Vector2::new(decimal("x_m"), decimal("z_m")),
        }
    }

    /// Calls `work` on one line after the other.
    fn cycle<T>(bencher: Bencher, lines: &[Line], work: impl Fn(&Line) -> T) {
        let mut next = lines.iter().cycle();
        bencher.bench_local(|| next.next().map(|line| work(black_box(line))));
    }

    fn solve(line: &Line) -> Vector2<f64> {
        let found = line.model.force_at_length(line.end_m.x, line.end_m.y, line.rest_length_m);
        found.expect("every line has a force").force_n
    }

    /// Force from length.
    #[divan::bench(sample_size = SAMPLE)]
    fn irvine(bencher: Bencher) {
        cycle(bencher, &lines(), solve);
    }

    /// The same, one kind of line at a time.
    #[divan::bench(
        sample_size = SAMPLE,
        args = ["taut", "near_taut", "slack", "deep_slack", "above", "almost_vertical"]
    )]
    fn irvine_kind(bencher: Bencher, kind: &str) {
        let mut lines = lines();
        lines.retain(|line| line.kind == kind);
        assert!(!lines.is_empty(), "no line is {kind}");
        cycle(bencher, &lines, solve);
    }

    /// End point and derivative from force and length: what a step needs six times.
    #[divan::bench(sample_size = SAMPLE)]
    fn irvine_end_point(bencher: Bencher) {
        cycle(bencher, &lines(), |line| line.model.end_point(line.force_n, line.rest_length_m));
    }
}

/// One tick of a controller on the path of [`warm_path`]: geometry at the new pose and Newton steps.
mod step {
    use cdpr_core::Real;
    use divan::{Bencher, black_box};

    use crate::warm_path::{TICKS, Walker};

    /// Calls in one sample: once around the circle.
    #[allow(clippy::cast_possible_truncation)]
    const SAMPLE: u32 = TICKS as u32;
    /// A step of 1e-5 leaves an error of 1e-10 of each force and length.
    const TOLERANCE: f64 = 1e-5;
    /// What a further step may change.
    const ERROR: f64 = 1e-9;
    /// The largest condition number on the path is 59.5.
    const CONDITION: f32 = 64.0;
    /// Forces are uncertain by the rounding unit times the condition number; the extrapolation
    /// triples that of the two solutions it starts from.
    const TOLERANCE_F32: f32 = 4.0 * CONDITION * f32::EPSILON;
    /// What a further step may change.
    const ERROR_F32: f32 = CONDITION * f32::EPSILON;

    fn walk<T: Real>(bencher: Bencher, walker: Walker<T>, tick: impl Fn(&mut Walker<T>) -> T) {
        let mut walker = black_box(walker);
        bencher.bench_local(|| tick(&mut walker));
    }

    /// One step from the line through the last two solutions.
    #[divan::bench(sample_size = SAMPLE)]
    fn warm_f64(bencher: Bencher) {
        walk(bencher, Walker::on_circle(TOLERANCE, ERROR), Walker::warm_tick);
    }

    /// The same in single precision.
    #[divan::bench(sample_size = SAMPLE)]
    fn warm_f32(bencher: Bencher) {
        walk(bencher, Walker::on_circle(TOLERANCE_F32, ERROR_F32), Walker::warm_tick);
    }

    /// Two steps from the last solution.
    #[divan::bench(sample_size = SAMPLE)]
    fn cold_two_steps(bencher: Bencher) {
        walk(bencher, Walker::on_circle(TOLERANCE, ERROR), Walker::cold_tick);
    }
}

/// All solutions of one pose by continuation.
mod enumerate {
    use cdpr_host_sim::cases::Overrides;
    use cdpr_host_sim::continuation::Steps;
    use cdpr_host_sim::enumerate::{Method, ModelKind, Options, Request};
    use cdpr_host_sim::robot_file::RobotDescription;
    use divan::{Bencher, black_box};

    /// The paper's pose with five solutions, every step proven.
    #[divan::bench]
    fn five_solutions_certified(bencher: Bencher) {
        five_solutions(bencher, Steps::Certified);
    }

    /// The same with sampled tests of the steps.
    #[divan::bench]
    fn five_solutions_tested(bencher: Bencher) {
        five_solutions(bencher, Steps::Tested);
    }

    fn five_solutions(bencher: Bencher, steps: Steps) {
        let changes = Overrides {
            mass_kg: Some(10.0),
            linear_density_kg_m: Some(0.004),
            ..Overrides::default()
        };
        let request = Request {
            robot: changes.apply(&RobotDescription::marionet_crane()),
            position_m: [0.96733, 11.3833, 1.65],
            rotation_vector_rad: [0.0; 3],
            model: ModelKind::Irvine,
        };
        let options = Options { method: Method::Continuation, steps, ..Options::default() };
        let count = || black_box(&request).enumerate(options).map(|found| found.solutions.len());
        assert_eq!(count(), Ok(5));
        bencher.bench_local(count);
    }
}
