//! An image that links only when nothing in the mathematics of `cdpr-core` can panic; for controller and
//! winches see `no_panic_controller`.
//!
//! ```text
//! cargo build --release --package cdpr-firmware-example --bin no_panic --target thumbv7em-none-eabihf
//! ```
//!
//! Every public function is called in f32 and f64 with arguments the compiler cannot see through,
//! and the panic handler calls a function that does not exist. Where the optimizer has removed every
//! panic it removes the handler too; where it has not, the linker names the missing function. The
//! proof is of the release profile: in others overflow checks panic. The image is never run.
//!
//! On any other target this is an empty program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[path = "../hidden.rs"]
mod hidden;

#[cfg(target_os = "none")]
mod image {
    use core::fmt::{self, Display, Write};
    use core::hint::black_box;
    use core::panic::PanicInfo;

    use cdpr_core::line::{nested_force, nested_iteration_bound, root_iteration_bound};
    use cdpr_core::newton::converge;
    use cdpr_core::statics::Balance;
    use cdpr_core::{
        CABLES, Cable, CablePlane, CableState, CurvePoint, Elimination, Fault, IrvineCatenary,
        LinearElastic, Load, NewtonStep, NonDeformable, Parabola, Pose, Real, Robot, SetPoint,
        ShapedCable, Tracker,
    };
    use nalgebra::{Matrix6, Quaternion, UnitQuaternion, Vector2, Vector6};

    use super::hidden::{self, number, vector};

    unsafe extern "C" {
        /// Defined nowhere.
        safe fn cdpr_core_can_panic() -> !;
    }

    #[panic_handler]
    fn panic(_: &PanicInfo<'_>) -> ! {
        cdpr_core_can_panic()
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        surface::<f32>();
        surface::<f64>();
        // Hidden from the compiler, this can be any fault.
        show::<(), _>(Err(Fault::<Unprinted>::NonFiniteSetPoint));
        loop {
            cortex_m::asm::wfi();
        }
    }

    /// Every public function for one number type. Each argument is hidden from the compiler, results
    /// of other functions included: nothing may follow from where they come from.
    fn surface<T: Real>() {
        scalar::<T>();
        let compliance_per_n = number::<T>();
        let weight_n_m = number::<T>();
        model::<T, _>(NonDeformable);
        model::<T, _>(LinearElastic { compliance_per_n });
        model::<T, _>(Parabola { weight_n_m, compliance_per_n });
        model::<T, _>(IrvineCatenary { weight_n_m, compliance_per_n });
        elimination::<T>();
    }

    fn scalar<T: Real>() {
        let (a, b) = (number::<T>(), number::<T>());
        black_box([a.sqrt(), a.abs(), a.ln(), a.rough_ln(), a.rough_cbrt(), a.max(b), a.min(b)]);
        black_box((T::constant(black_box(1.0)), a.is_finite()));
        black_box((T::hypot_with_excess(a, b), T::atanh_tail(a, b)));
        black_box((root_iteration_bound::<T>(), nested_iteration_bound::<T>()));
    }

    /// A model, and all that is generic over models.
    fn model<T: Real, M: ShapedCable<T>>(model: M) {
        let model = black_box(model);
        let (x_m, z_m, rest_length_m) = (number::<T>(), number::<T>(), number::<T>());
        black_box(model.weight_n_m());
        black_box(model.at_deformation(number()));
        let end = black_box(model.end_point(vector2(), rest_length_m));
        show(model.force_at_length(x_m, z_m, rest_length_m));
        show(nested_force(&model, x_m, z_m, rest_length_m));

        let state = state::<T>();
        let curve = CurvePoint::new(&end, x_m, z_m);
        black_box((curve.correction_n(), curve.length_correction_m(), curve.is_finite()));
        black_box((
            curve.normal(),
            curve.force_by_end(&vector2()),
            curve.length_by_end_m(&vector2()),
        ));
        black_box((state.tension_at_attachment_n(), state.tension_at_anchor_n(number())));

        let cables =
            [(); CABLES].map(|()| Cable { anchor_m: vector(), attachment_m: vector(), model });
        let Some(robot) = show(Robot::new(black_box(cables))) else { return };
        black_box(robot.moment_arm_m());
        black_box(robot.map_models(|i, model| (black_box(i), black_box(*model))));
        statics(&robot);
    }

    fn statics<T: Real, M: ShapedCable<T>>(robot: &Robot<T, M>) {
        let robot = black_box(robot);
        let orientation = UnitQuaternion::new_unchecked(black_box(Quaternion::new(
            T::one(),
            T::zero(),
            T::zero(),
            T::zero(),
        )));
        let Some(pose) = show(Pose::new(vector(), orientation)) else { return };
        black_box((pose.position_m(), pose.turn(&vector())));
        let load = black_box(hidden::load());
        black_box(load.wrench(&pose));
        let plane = black_box(CablePlane::new(robot, &robot.cables()[0], &pose, vector2()));
        black_box(plane.distance_m());

        let Some(balance) = show(Balance::at(robot, &load, &pose)) else { return };
        let Some(balance) = show(balance.at_next(robot, &load, &pose)) else { return };
        black_box((balance.planes(), balance.wrench_n()));
        black_box(plane.wrench_n(&vector2()));
        black_box(balance.residual_n(&[(); CABLES].map(|()| vector2())));

        let states = black_box(hidden::states());
        if let Some(step) = show(NewtonStep::new(robot, &balance, &states)) {
            black_box((step.condition(), step.is_positive()));
        }
        let _ = black_box(converge(robot, &balance, &states, number(), black_box(20)));
        tracker(robot, load, pose);
    }

    fn tracker<T: Real, M: ShapedCable<T>>(robot: &Robot<T, M>, load: Load<T>, pose: Pose<T>) {
        let settings = black_box(hidden::tracker_settings());
        let set_point = black_box(SetPoint { pose, twist: hidden::twist() });
        let states = black_box(hidden::states());
        let started = Tracker::start(*black_box(robot), load, settings, &set_point, &states);
        let Some(tracker) = told(started) else { return };
        let mut tracker = black_box(tracker);
        let _ = told(tracker.tick(&black_box(set_point)).copied());
        black_box((tracker.command(), tracker.settings(), tracker.pose(), tracker.robot()));
    }

    fn told<T: Real, R>(outcome: Result<R, Fault<T>>) -> Option<R> {
        black_box(outcome).map_err(|fault| black_box(fault.remedy())).ok()
    }

    /// A number that is not printed: the formatting of floats in Rust's own `core` has assertions, which
    /// the optimizer cannot remove. All else of a fault is formatted.
    struct Unprinted;

    impl Display for Unprinted {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(black_box("number"))
        }
    }

    fn elimination<T: Real>() {
        let matrix = black_box(Matrix6::<T>::zeros());
        if let Some(elimination) = black_box(Elimination::new(&matrix)) {
            black_box(elimination.solve(&black_box(Vector6::zeros())));
            black_box((elimination.inverse(), elimination.is_positive()));
        }
    }

    fn vector2<T: Real>() -> Vector2<T> {
        Vector2::new(number(), number())
    }

    fn state<T: Real>() -> CableState<T> {
        CableState { force_n: vector2(), rest_length_m: number() }
    }

    /// Formats an error; hides a result.
    fn show<R, E: Display>(outcome: Result<R, E>) -> Option<R> {
        black_box(outcome).map_err(|fault| write!(Nowhere, "{fault}")).ok()
    }

    struct Nowhere;

    impl Write for Nowhere {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            black_box(text);
            Ok(())
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
