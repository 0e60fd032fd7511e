//! The picture of the problem: the robot with its sagging cables, one of them in its vertical plane
//! at several rest lengths, and the force curve that it runs along.
//!
//! `cargo run --release --example draw_problem -- host-sim/pictures/problem.svg`
//!
//! Every cable is drawn with its true shape.

use std::error::Error;

use cdpr_core::{CableModel, CablePlane, CableState, IrvineCatenary};
use cdpr_host_sim::continuation::Solution;
use cdpr_host_sim::enumerate::{ModelKind, Options, Request};
use cdpr_host_sim::output::pen::{FINE, GREY, INK, PALE, Pen, fine, font, px};
use cdpr_host_sim::problem::Problem;
use cdpr_host_sim::robot_file::{CableMaterial, RobotDescription};
use cdpr_host_sim::shape::{shape, shapes};
use nalgebra::{Vector2, Vector3};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

type Outcome<T = ()> = Result<T, Box<dyn Error>>;
type Model = IrvineCatenary<f64>;

/// Size of the picture, px.
const SIZE_PX: (u32, u32) = (1200, 470);

const POSITION_M: [f64; 3] = [2.0, 7.0, 2.5];
const MASS_KG: f64 = 10.0;
/// Heavier than the cable of the crane (0.079 kg/m), so that the sag can be seen.
const LINEAR_DENSITY_KG_M: f64 = 0.2;
/// The cable of the two panels on the right.
const CABLE: usize = 4;

const GROUND: RGBColor = RGBColor(240, 242, 245);
/// From taut to slack: the longer the lighter, so that they differ without their hues as well.
const COLORS: [RGBColor; 4] =
    [RGBColor(30, 18, 80), RGBColor(140, 41, 129), RGBColor(205, 55, 95), RGBColor(228, 120, 30)];

fn main() -> Outcome {
    let path = std::env::args().nth(1).ok_or("usage: draw_problem FILE.svg")?;
    let mut robot = RobotDescription::marionet_crane();
    robot.load.mass_kg = MASS_KG;
    robot.robot = robot.robot.map_models(|_, material| CableMaterial {
        linear_density_kg_m: LINEAR_DENSITY_KG_M,
        ..*material
    });
    let request = Request {
        robot,
        position_m: POSITION_M,
        rotation_vector_rad: [0.0; 3],
        model: ModelKind::Irvine,
    };
    let problem = request.problem::<Model>()?;
    let enumeration = request.enumerate(Options::default())?;
    let solution = &enumeration.solutions.first().ok_or("the pose has no solution")?.solution;
    let svg = picture(&problem, solution)?;
    std::fs::write(&path, svg).map_err(|fault| format!("{path}: {fault}"))?;
    Ok(())
}

fn picture(problem: &Problem<Model>, solution: &Solution) -> Outcome<String> {
    Pen::picture(SIZE_PX, |pen| {
        draw_robot(pen, problem, solution)?;
        let hanging = Hanging::of(problem, solution)?;
        draw_plane(pen, &hanging)?;
        draw_force_curve(pen, &hanging)
    })
}

/// The shape of a cable in its plane, from the anchor to the attachment, m.
fn shape_m(model: &Model, state: &CableState<f64>) -> Vec<Vector2<f64>> {
    let end_m = model.end_point(state.force_n, state.rest_length_m).position_m;
    let plane = CablePlane {
        x_m: end_m.x,
        z_m: end_m.y,
        direction: Vector2::x(),
        lever_arm: Vector3::zeros(),
    };
    let points = shape(model, &Vector3::zeros(), &plane, state);
    points.iter().map(|point| point.position_m.xz()).collect()
}

/// (a) The robot in perspective, with its cables at equilibrium.
fn draw_robot(pen: &Pen<'_>, problem: &Problem<Model>, solution: &Solution) -> Outcome {
    let [x, y, z] = POSITION_M;
    pen.heading(20.0, &format!("(a) MARIONET-CRANE at ({x}, {y}, {z}) m"))?;
    pen.note(
        20.0,
        &format!("{MASS_KG} kg, cables of {LINEAR_DENSITY_KG_M} kg/m, true shapes, grid 2 m"),
    )?;
    let camera = Camera::new();
    draw_ground(pen, &camera)?;

    let origin = Vector3::from(POSITION_M);
    let (middle, below) = (camera.see(origin), camera.see(Vector3::new(x, y, 0.0)));
    pen.dashed(&[middle, below], GREY, 1.0, 4.0)?;
    pen.dot(below, 2.5, GREY)?;

    let cables = problem.robot.cables();
    for cable in cables {
        let foot = camera.see(Vector3::new(cable.anchor_m.x, cable.anchor_m.y, 0.0));
        pen.line(&[foot, camera.see(cable.anchor_m)], GREY, 2.0)?;
        pen.dot(foot, 2.5, GREY)?;
    }
    for (i, points) in shapes(problem, solution).iter().enumerate() {
        let path: Vec<_> = points.iter().map(|point| camera.see(point.position_m)).collect();
        let (color, width) = if i == CABLE { (COLORS[1], 2.6) } else { (INK, 1.5) };
        pen.line(&path, color, width)?;
        let anchor = path[0];
        pen.dot(anchor, 3.5, INK)?;
        let (side, outwards) =
            if anchor.x < middle.x { (HPos::Right, -8.0) } else { (HPos::Left, 8.0) };
        pen.text(anchor + px(outwards, 4.0), &format!("A{}", i + 1), side, INK)?;
    }
    let corners = cables.each_ref().map(|cable| camera.see(origin + cable.attachment_m));
    pen.fill(&corners, INK)?;
    // The load.
    pen.arrow(middle, middle + px(0.0, 30.0), INK, 2.0)?;
    pen.text(middle + px(10.0, 24.0), &format!("{MASS_KG} kg"), HPos::Left, INK)?;
    let length = format!("{:.2} m", solution.states[CABLE].rest_length_m);
    Ok(pen.text(middle - px(126.0, -12.0), &length, HPos::Center, COLORS[1])?)
}

/// The ground, with lines 2 m apart.
fn draw_ground(pen: &Pen<'_>, camera: &Camera) -> Outcome {
    let see = |x: i32, y: i32| camera.see(Vector3::new(x.into(), y.into(), 0.0));
    let (x, y) = ([-4, 10], [-4, 22]);
    pen.fill(&[see(x[0], y[0]), see(x[1], y[0]), see(x[1], y[1]), see(x[0], y[1])], GROUND)?;
    for x in (x[0]..=x[1]).step_by(2) {
        pen.line(&[see(x, y[0]), see(x, y[1])], PALE, 0.8)?;
    }
    for y in (y[0]..=y[1]).step_by(2) {
        pen.line(&[see(x[0], y), see(x[1], y)], PALE, 0.8)?;
    }
    Ok(())
}

/// One cable in its plane at several rest lengths.
struct Hanging {
    model: Model,
    plane: CablePlane<f64>,
    /// From taut to slack; the second is that of the solution.
    states: [CableState<f64>; 4],
}

impl Hanging {
    fn of(problem: &Problem<Model>, solution: &Solution) -> Outcome<Self> {
        let model = *problem.model(CABLE);
        let plane = problem.balance.planes()[CABLE];
        let at_length = |rest_length_m| {
            model
                .force_at_length(plane.x_m, plane.z_m, rest_length_m)
                .map(|line| CableState { force_n: line.force_n, rest_length_m })
        };
        let states =
            [at_length(12.05)?, solution.states[CABLE], at_length(15.0)?, at_length(20.0)?];
        Ok(Self { model, plane, states })
    }
}

/// (b) The cable in its plane.
fn draw_plane(pen: &Pen<'_>, hanging: &Hanging) -> Outcome {
    const LEFT: f64 = 516.0;
    const PX_PER_M: f64 = 24.5;
    pen.heading(LEFT, &format!("(b) Cable {} in its plane", CABLE + 1))?;
    pen.note(LEFT, "at four rest lengths L")?;
    let Hanging { model, plane: CablePlane { x_m, z_m, .. }, states } = hanging;
    let at = |x: f64, z: f64| px(LEFT + 20.0, 127.0) + px(x, -z) * PX_PER_M;
    let (a, b, corner) = (at(0.0, 0.0), at(*x_m, *z_m), at(*x_m, 0.0));

    let (above, beside) = (px(0.0, -14.0), px(14.0, 0.0));
    pen.line(&[a + above, a, corner, corner + above], PALE, 1.0)?;
    pen.line(&[corner + beside, corner, b, b + beside], PALE, 1.0)?;
    pen.arrow(a + above, corner + above, GREY, 1.0)?;
    pen.arrow(corner + beside, b + beside, GREY, 1.0)?;
    pen.text(at(x_m / 2.0, 0.0) + 2.0 * above, &format!("x = {x_m:.2} m"), HPos::Center, INK)?;
    let z_place = at(*x_m, -1.6) - px(6.0, 0.0);
    pen.text(z_place, &format!("z = {z_m:.2} m").replace('-', "−"), HPos::Right, INK)?;
    pen.dashed(&[a, b], GREY, 1.0, 4.0)?;

    let places = [at(7.5, -3.15), at(5.0, -5.8), at(4.9, -8.5), at(0.3, -8.2)];
    for ((state, color), place) in states.iter().zip(COLORS).zip(places) {
        let path: Vec<_> = shape_m(model, state).iter().map(|p| at(p.x, p.y)).collect();
        pen.line(&path, color, 2.2)?;
        let length = format!("{:.2} m", state.rest_length_m);
        pen.text(place, &length, HPos::Center, color)?;
    }

    // The weight of the slackest and the force on the tautest.
    let slackest = shape_m(model, &states[3]);
    let lowest =
        slackest.iter().fold(Vector2::zeros(), |low, p| if p.y < low.y { *p } else { low });
    for offset_m in [-0.8, 0.0, 0.8] {
        let from = at(lowest.x + offset_m, lowest.y + 0.05) + px(0.0, 3.0);
        pen.arrow(from, from + px(0.0, 22.0), GREY, 1.2)?;
    }
    let weight = format!("weight w = {:.2} N/m", model.weight_n_m());
    pen.text(at(lowest.x, lowest.y) + px(0.0, 40.0), &weight, HPos::Center, INK)?;
    let tip = b + px(states[0].force_n.x, -states[0].force_n.y);
    pen.arrow(b, tip, COLORS[0], 2.4)?;
    pen.text(b + px(0.0, 38.0), "F = (Fx, Fz)", HPos::Left, COLORS[0])?;
    for (end, name, place) in [(a, "A", px(-12.0, 8.0)), (b, "B", px(-8.0, -13.0))] {
        pen.dot(end, 4.0, INK)?;
        pen.text(end + place, name, HPos::Center, INK)?;
    }
    Ok(())
}

/// (c) The force curve of the cable.
fn draw_force_curve(pen: &Pen<'_>, hanging: &Hanging) -> Outcome {
    const LEFT: f64 = 872.0;
    pen.heading(LEFT, "(c) Its force curve")?;
    pen.note(LEFT, "the force F on the cable at B as L grows")?;
    let mut chart = ChartBuilder::on(&pen.area)
        .margin_left(fine(LEFT))
        .margin_top(fine(96.0))
        .margin_right(fine(14.0))
        .margin_bottom(fine(12.0))
        .x_label_area_size(fine(48.0))
        .y_label_area_size(fine(54.0))
        .build_cartesian_2d(0.0..60.0, -40.0..30.0)?;
    let whole_newtons = |force_n: &f64| format!("{force_n:.0}").replace('-', "−");
    chart
        .configure_mesh()
        .x_labels(7)
        .y_labels(8)
        .x_label_formatter(&whole_newtons)
        .y_label_formatter(&whole_newtons)
        .max_light_lines(0)
        .set_all_tick_mark_size(fine(5.0))
        .bold_line_style(PALE.stroke_width(fine(0.8)))
        .axis_style(GREY.stroke_width(fine(1.0)))
        .label_style(font(15.0, INK))
        .x_desc("Fx (N)")
        .axis_desc_style(font(16.0, INK))
        .draw()?;

    let Hanging { model, plane, states } = hanging;
    let mut curve = Vec::new();
    // From 0.0475 m to 21 m longer than the chord.
    for k in 0..=200 {
        let longer_m = 0.0475 * (21.0_f64 / 0.0475).powf(f64::from(k) / 200.0);
        let line = model.force_at_length(plane.x_m, plane.z_m, plane.distance_m() + longer_m)?;
        curve.push((line.force_n.x, line.force_n.y));
    }
    let (taut, slack) = (curve[0], curve[200]);
    chart.draw_series(LineSeries::new(curve, INK.stroke_width(fine(1.6))))?;

    let at = |fx: f64, fz: f64| {
        let (x, y) = chart.plotting_area().map_coordinate(&(fx, fz));
        px(f64::from(x), f64::from(y)) / f64::from(FINE)
    };
    pen.text(at(-1.5, 34.0), "Fz (N)", HPos::Right, INK)?;
    pen.dashed(&[at(0.0, 0.0), at(58.0, 58.0 * plane.z_m / plane.x_m)], GREY, 1.0, 4.0)?;
    pen.text(at(29.0, -25.5), "along AB", HPos::Center, GREY)?;
    pen.text(at(taut.0, taut.1) + px(4.0, -22.0), "taut", HPos::Center, GREY)?;
    pen.text(at(slack.0, slack.1) + px(10.0, 4.0), "slack", HPos::Left, GREY)?;
    pen.arrow(at(42.0, -8.0), at(31.0, -1.0), INK, 1.4)?;
    pen.text(at(38.0, -2.6), "L grows", HPos::Left, INK)?;
    for (state, color) in states.iter().zip(COLORS) {
        let point = at(state.force_n.x, state.force_n.y);
        pen.dot(point, 5.0, color)?;
        let length = format!("{:.2} m", state.rest_length_m);
        pen.text(point + px(9.0, -9.0), &length, HPos::Left, color)?;
    }
    Ok(())
}

/// A view of the world in perspective, with verticals kept vertical.
struct Camera {
    eye: Vector3<f64>,
    ahead: Vector3<f64>,
    right: Vector3<f64>,
}

impl Camera {
    fn new() -> Self {
        let eye = Vector3::new(-35.7, -7.9, 28.0);
        let ahead = Vector3::new(38.7, 16.4, 0.0).normalize();
        Self { eye, ahead, right: Vector3::new(ahead.y, -ahead.x, 0.0) }
    }

    /// Where a point of the world is in the picture, px.
    fn see(&self, world_m: Vector3<f64>) -> Vector2<f64> {
        let ray = world_m - self.eye;
        px(266.0, -138.0) + px(ray.dot(&self.right), -ray.z) * (660.0 / ray.dot(&self.ahead))
    }
}
