//! All branches as a picture.

use nalgebra::Vector2;
use plotters::style::RGBColor;
use plotters::style::text_anchor::HPos;

use super::longest;
use crate::branches::{Border, BranchPoint, Diagram, Fold, Parameter, SolutionBranch};
use crate::enumerate::Request;
use crate::output::axis::Axis;
use crate::output::pen::{GREY, INK, PALE, Pen, PenFault, px};
use crate::output::text::decimals;

/// Size of the picture, px.
const SIZE_PX: (u32, u32) = (1000, 600);
/// The frame of the axes, px.
const FRAME_X: (f64, f64) = (84.0, 850.0);
const FRAME_Y: (f64, f64) = (530.0, 124.0);
/// Room left at both ends of the vertical axis, part of its length.
const HEADROOM: f64 = 0.05;
/// Distance of two labels on top of each other, px.
const LABEL_STEP: f64 = 20.0;
/// Significant digits of a fold in the picture.
const FOLD_DIGITS: i32 = 8;

/// From the first branch to the last, in between mixed: the later the lighter, so that they differ
/// without their hues as well.
const COLORS: [RGBColor; 5] = [
    RGBColor(30, 18, 80),
    RGBColor(112, 31, 129),
    RGBColor(176, 46, 104),
    RGBColor(219, 84, 60),
    RGBColor(236, 150, 40),
];

/// The branches of `request` as an SVG: the longest cable over the parameter.
///
/// # Errors
/// [`PenFault`], which an SVG in memory never meets.
pub fn svg(request: &Request, diagram: &Diagram) -> Result<String, PenFault> {
    let lengths = diagram.branches.iter().flat_map(|b| &b.points).map(|point| longest(point).1);
    let (least, most) = lengths.fold((f64::INFINITY, 0.0_f64), |(least, most), length| {
        (least.min(length), most.max(length))
    });
    let (least, most) = if least < most { (least, most) } else { (1.0, 10.0) };
    let range = diagram.range;
    let plot = Plot {
        x: Axis::new(range.from()..=range.to(), FRAME_X, 0.0),
        y: Axis::new(least..=most, FRAME_Y, HEADROOM),
        request,
        diagram,
    };
    Pen::picture(SIZE_PX, |pen| plot.draw(pen))
}

struct Plot<'a> {
    x: Axis,
    y: Axis,
    request: &'a Request,
    diagram: &'a Diagram,
}

impl Plot<'_> {
    fn draw(&self, pen: &Pen<'_>) -> Result<(), PenFault> {
        self.headings(pen)?;
        self.axes(pen)?;
        self.limit(pen)?;
        for (index, branch) in self.diagram.branches.iter().enumerate() {
            self.branch(pen, index, branch)?;
        }
        for (index, branch) in self.diagram.branches.iter().enumerate() {
            self.markers(pen, index, branch)?;
        }
        self.labels(pen)?;
        self.folds(pen)
    }

    /// Where a point of a branch is.
    fn place(&self, point: &BranchPoint) -> Vector2<f64> {
        px(self.x.place(point.value), self.y.place(longest(point).1))
    }

    fn headings(&self, pen: &Pen<'_>) -> Result<(), PenFault> {
        let Request { robot, position_m, rotation_vector_rad, .. } = self.request;
        let vector = |vector: &[f64; 3]| format!("({})", vector.map(short).join(", "));
        let position = vector(position_m);
        pen.heading(20.0, &format!("{} at {position} m: branches of solutions", robot.name))?;
        let mut fixed = Vec::new();
        if rotation_vector_rad.iter().any(|component| *component != 0.0) {
            fixed.push(format!("rotation vector {} rad", vector(rotation_vector_rad)));
        }
        let parameter = self.diagram.parameter;
        if parameter != Parameter::Mass {
            fixed.push(format!("{} kg", short(robot.load.mass_kg)));
        }
        let materials = robot.robot.cables().each_ref().map(|cable| cable.model);
        if materials.iter().all(|material| *material == materials[0]) {
            if parameter != Parameter::LinearDensity {
                fixed.push(format!("{} kg/m", short(materials[0].linear_density_kg_m)));
            }
            if parameter != Parameter::AxialStiffness {
                fixed.push(format!("EA {} N", short(materials[0].axial_stiffness_n)));
            }
        }
        pen.note(20.0, &fixed.join(", "))?;
        let all = || self.diagram.branches.iter().flat_map(|branch| &branch.points);
        let mut key = "Branch: slack cables of the rigid solution, longest cable. \
                       Marks filled: det > 0, open: det < 0."
            .to_owned();
        if all().any(|point| point.is_beyond_limit) {
            key.push_str(" Dashed: beyond a limit.");
        }
        pen.text(px(20.0, 74.0), &key, HPos::Left, GREY)?;
        if all().next().is_none() {
            let (x, y) = (f64::midpoint(FRAME_X.0, FRAME_X.1), f64::midpoint(FRAME_Y.0, FRAME_Y.1));
            pen.text(px(x, y), "no solution found", HPos::Center, GREY)?;
        }
        Ok(())
    }

    fn axes(&self, pen: &Pen<'_>) -> Result<(), PenFault> {
        let ((left, right), (bottom, top)) = (FRAME_X, FRAME_Y);
        for tick in self.x.ticks() {
            let x = self.x.place(tick.value);
            pen.line(
                &[px(x, bottom), px(x, top)],
                PALE,
                if tick.label.is_some() { 0.9 } else { 0.4 },
            )?;
            if let Some(label) = tick.label {
                pen.line(&[px(x, bottom), px(x, bottom + 5.0)], GREY, 1.0)?;
                pen.text(px(x, bottom + 18.0), &label, HPos::Center, INK)?;
            }
        }
        for tick in self.y.ticks() {
            let y = self.y.place(tick.value);
            pen.line(
                &[px(left, y), px(right, y)],
                PALE,
                if tick.label.is_some() { 0.9 } else { 0.4 },
            )?;
            if let Some(label) = tick.label {
                pen.line(&[px(left, y), px(left - 5.0, y)], GREY, 1.0)?;
                pen.text(px(left - 10.0, y), &label, HPos::Right, INK)?;
            }
        }
        pen.line(&[px(left, top), px(left, bottom), px(right, bottom)], GREY, 1.0)?;
        let parameter = self.diagram.parameter;
        let mut name = parameter.name().to_owned();
        name[..1].make_ascii_uppercase();
        let below = px(f64::midpoint(left, right), bottom + 48.0);
        pen.text(below, &format!("{name} ({})", parameter.unit()), HPos::Center, INK)?;
        pen.text(px(20.0, top - 18.0), "Rest length of the longest cable (m)", HPos::Left, INK)
    }

    /// The longest cable that its limit allows, where all cables have the same.
    fn limit(&self, pen: &Pen<'_>) -> Result<(), PenFault> {
        let limits = self.request.robot.limits.map(|limits| limits.max_length_m);
        let y = self.y.place(limits[0]);
        let same = limits.iter().all(|limit| limit.to_bits() == limits[0].to_bits());
        if !same || !(FRAME_Y.1..FRAME_Y.0).contains(&y) {
            return Ok(());
        }
        pen.dashed(&[px(FRAME_X.0, y), px(FRAME_X.1, y)], GREY, 1.0, 2.0)?;
        pen.text(
            px(FRAME_X.1 - 8.0, y - 11.0),
            &format!("limit {} m", short(limits[0])),
            HPos::Right,
            GREY,
        )
    }

    fn color(&self, index: usize) -> RGBColor {
        let last = self.diagram.branches.len().saturating_sub(1).max(1);
        let place = index as f64 / last as f64 * (COLORS.len() - 1) as f64;
        let lower = (0..COLORS.len() - 1).rfind(|&k| k as f64 <= place).unwrap_or(0);
        let share = place - lower as f64;
        let (RGBColor(r, g, b), RGBColor(s, h, c)) = (COLORS[lower], COLORS[lower + 1]);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between two bytes
        let mix =
            |a: u8, b: u8| (f64::from(a) * (1.0 - share) + f64::from(b) * share).round() as u8;
        RGBColor(mix(r, s), mix(g, h), mix(b, c))
    }

    /// The curve of a branch, dashed where it is beyond a limit.
    fn branch(&self, pen: &Pen<'_>, index: usize, branch: &SolutionBranch) -> Result<(), PenFault> {
        let is_dashed = |pair: &[BranchPoint]| pair.iter().any(|point| point.is_beyond_limit);
        let mut points = &branch.points[..];
        while points.len() > 1 {
            let dashed = is_dashed(&points[..2]);
            let pieces = points.windows(2).take_while(|pair| is_dashed(pair) == dashed).count();
            let path: Vec<_> = points[..=pieces].iter().map(|point| self.place(point)).collect();
            if dashed {
                pen.dashed(&path, self.color(index), 2.0, 6.0)?;
            } else {
                pen.line(&path, self.color(index), 2.4)?;
            }
            points = &points[pieces..];
        }
        Ok(())
    }

    /// Marks where a branch passes a start value, or else in its middle.
    fn markers(
        &self,
        pen: &Pen<'_>,
        index: usize,
        branch: &SolutionBranch,
    ) -> Result<(), PenFault> {
        let is_start = |point: &&BranchPoint| {
            self.diagram.checks.iter().any(|check| check.value.to_bits() == point.value.to_bits())
        };
        let mut places: Vec<_> =
            branch.points.iter().filter(is_start).map(|point| self.place(point)).collect();
        if places.is_empty() {
            places
                .extend(branch.points.get(branch.points.len() / 2).map(|point| self.place(point)));
        }
        for place in places {
            let outline =
                |radius: f64| shape(index, radius).map(|corner| place + corner).collect::<Vec<_>>();
            pen.fill(&outline(5.6), self.color(index))?;
            if !branch.is_positive {
                pen.fill(&outline(3.2), RGBColor(255, 255, 255))?;
            }
        }
        Ok(())
    }

    /// What a branch is called at one of its points.
    fn name(index: usize, branch: &SolutionBranch, point: &BranchPoint) -> String {
        let origin = branch.origin.map_or("no origin".to_owned(), |set| set.to_string());
        format!("{}: {origin}, L{}", index + 1, longest(point).0 + 1)
    }

    /// Branches that reach the right edge are named there, the others and the folds in the frame.
    fn labels(&self, pen: &Pen<'_>) -> Result<(), PenFault> {
        let branches = &self.diagram.branches;
        let mut beside: Vec<(usize, String, f64)> = Vec::new();
        let mut inside = Labels::new(self);
        let mut within = Vec::new();
        for (index, branch) in branches.iter().enumerate() {
            match branch.points.last() {
                Some(last) if branch.high == Border::Range => {
                    let name = Self::name(index, branch, last);
                    beside.push((index, name, self.place(last).y));
                }
                Some(_) => within.push(index),
                None => {}
            }
        }
        beside.sort_by(|a, b| a.2.total_cmp(&b.2));
        for place in 1..beside.len() {
            beside[place].2 = beside[place].2.max(beside[place - 1].2 + LABEL_STEP);
        }
        for (index, name, y) in beside {
            pen.text(px(FRAME_X.1 + 14.0, y), &name, HPos::Left, self.color(index))?;
        }
        for fold in &self.diagram.folds {
            let center = self.place_of_fold(fold);
            let digits = decimals(fold.value, FOLD_DIGITS);
            let unit = self.diagram.parameter.unit();
            let name = format!("fold at {:.digits$} {unit}", fold.value);
            inside.put(pen, &[center], &name, INK)?;
        }
        for index in within {
            let branch = &branches[index];
            let middle = &branch.points[branch.points.len() / 2];
            let places: Vec<_> = branch.points.iter().map(|point| self.place(point)).collect();
            let name = Self::name(index, branch, middle);
            inside.put(pen, &places, &name, self.color(index))?;
        }
        Ok(())
    }

    fn place_of_fold(&self, fold: &Fold) -> Vector2<f64> {
        let length_m = fold.states.iter().map(|state| state.rest_length_m).fold(0.0, f64::max);
        px(self.x.place(fold.value), self.y.place(length_m))
    }

    fn folds(&self, pen: &Pen<'_>) -> Result<(), PenFault> {
        for fold in &self.diagram.folds {
            let center = self.place_of_fold(fold);
            pen.dot(center, 6.5, INK)?;
            pen.dot(center, 2.6, RGBColor(255, 255, 255))?;
        }
        Ok(())
    }
}

/// Corners of the mark of a branch about its middle, px.
fn shape(index: usize, radius: f64) -> impl Iterator<Item = Vector2<f64>> {
    // Number of corners, and the direction of the first in turns from the right.
    let (corners, first) = [(24, 0.0), (4, 0.125), (3, 0.75), (4, 0.0), (3, 0.25)][index % 5];
    // Equal areas.
    let scale = if corners == 3 {
        1.3
    } else if corners == 4 {
        1.15
    } else {
        1.0
    };
    (0..corners).map(move |k| {
        let angle = std::f64::consts::TAU * (first + f64::from(k) / f64::from(corners));
        px(angle.cos(), angle.sin()) * (scale * radius)
    })
}

/// Names in the frame, each where it covers least.
struct Labels {
    /// Places on the curves, close together.
    curves: Vec<Vector2<f64>>,
    /// Left upper and right lower corners of the names so far.
    boxes: Vec<(Vector2<f64>, Vector2<f64>)>,
}

impl Labels {
    /// Distance of places on a curve that a label should not cover, px.
    const STEP: f64 = 4.0;
    /// Width of a letter and half the height of a line, px.
    const LETTER: f64 = 8.6;
    const HALF_LINE: f64 = 10.0;

    fn new(plot: &Plot<'_>) -> Self {
        let mut curves = Vec::new();
        for branch in &plot.diagram.branches {
            for pair in branch.points.windows(2) {
                let (from, to) = (plot.place(&pair[0]), plot.place(&pair[1]));
                let mut along = 0.0;
                while along < (to - from).norm() {
                    curves.push(from + (to - from).normalize() * along);
                    along += Self::STEP;
                }
            }
        }
        Self { curves, boxes: Vec::new() }
    }

    /// Writes `text` beside one of `anchors`, rather in their middle than at their ends.
    fn put(
        &mut self,
        pen: &Pen<'_>,
        anchors: &[Vector2<f64>],
        text: &str,
        color: RGBColor,
    ) -> Result<(), PenFault> {
        let width = text.chars().count() as f64 * Self::LETTER;
        let half = px(0.0, Self::HALF_LINE);
        let mut best = (f64::INFINITY, px(0.0, 0.0));
        let middle = anchors[anchors.len() / 2];
        for anchor in anchors {
            for (right, down) in
                [(12.0, 0.0), (8.0, -16.0), (8.0, 16.0), (-12.0, 0.0), (-8.0, -16.0), (-8.0, 16.0)]
            {
                let left = if right > 0.0 { right } else { right - width };
                let place = anchor + px(left, down);
                let (upper, lower) = (place - half, place + half + px(width, 0.0));
                let covered = |p: &&Vector2<f64>| {
                    upper.x - 4.0 < p.x && p.x < lower.x + 4.0 && upper.y < p.y && p.y < lower.y
                };
                let covers = self.curves.iter().filter(covered).count();
                let overlaps = self.boxes.iter().filter(|(u, l)| {
                    u.x < lower.x && upper.x < l.x && u.y < lower.y && upper.y < l.y
                });
                let outside = upper.x < FRAME_X.0 + 6.0
                    || lower.x > FRAME_X.1
                    || upper.y < FRAME_Y.1
                    || lower.y > FRAME_Y.0;
                let cost = covers as f64
                    + 1e-3 * (anchor - middle).norm()
                    + 1e3 * overlaps.count() as f64
                    + if outside { 1e6 } else { 0.0 };
                if cost < best.0 {
                    best = (cost, place);
                }
            }
        }
        let place = best.1;
        self.boxes.push((place - half, place + half + px(width, 0.0)));
        pen.text(place, text, HPos::Left, color)
    }
}

/// At most six significant digits, without zeros at the end.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let text = format!("{value:.*}", decimals(value, 6).min(9));
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.replace('-', "\u{2212}")
}
