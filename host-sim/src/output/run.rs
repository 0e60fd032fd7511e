//! What came of a simulated run, for people.

use std::io::{self, Write};

use cdpr_core::CABLES;
use cdpr_link::Mode;
use nalgebra::Vector2;
use plotters::style::RGBColor;
use plotters::style::text_anchor::HPos;

use super::axis::Axis;
use super::pen::{GREY, INK, PALE, Pen, PenFault, px};
use crate::simulate::summary::Spread;
use crate::simulate::{PoseError, Sample, Summary};

/// Size of the picture, px.
const SIZE_PX: (u32, u32) = (1000, 1030);
/// Left and right end of all panels, px.
const ENDS_X: (f64, f64) = (96.0, 860.0);
/// Top of the first panel, height of each, and room between two, px.
const PANEL_PX: (f64, f64, f64) = (104.0, 174.0, 56.0);
/// Points of a line in the picture: more would not be seen.
const POINTS: usize = 1500;
/// Errors below this are drawn there, mm.
const LEAST_MM: f64 = 1e-3;

/// Cables 1 to 6: light and dark take turns, so that they differ without their hues as well.
const CABLE_COLORS: [RGBColor; CABLES] = [
    RGBColor(30, 18, 80),
    RGBColor(219, 84, 60),
    RGBColor(112, 31, 129),
    RGBColor(236, 150, 40),
    RGBColor(20, 110, 120),
    RGBColor(120, 170, 60),
];
const TOTAL: RGBColor = RGBColor(30, 18, 80);
const STATIC: RGBColor = RGBColor(219, 84, 60);
const DYNAMIC: RGBColor = RGBColor(20, 110, 120);

/// What is kept of a period for the picture.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    time_s: f64,
    mode: Mode,
    error: Option<PoseError>,
    tensions_n: [f64; CABLES],
    lengths_m: [f64; CABLES],
    contraction: f64,
}

impl Kept {
    /// Of a period.
    #[must_use]
    pub fn of(sample: &Sample, error: Option<&PoseError>) -> Self {
        Self {
            time_s: sample.time_s,
            mode: sample.decision.mode,
            error: error.copied(),
            tensions_n: sample.tensions_n,
            lengths_m: sample.lengths_m,
            contraction: sample.decision.contraction,
        }
    }
}

/// Writes the summary; `wall_s` is how long the run took.
///
/// # Errors
/// Those of `out`.
pub fn text(out: &mut impl Write, summary: &Summary, wall_s: f64) -> io::Result<()> {
    for (time_s, note) in &summary.events {
        writeln!(out, "{time_s:9.3} s  {note}")?;
    }
    let Summary { outcome, simulated_s, ticks, ticks_in, .. } = summary;
    writeln!(out, "\nOutcome: {outcome}")?;
    let [disarmed, aligning, holding, tracking, fault] = ticks_in;
    writeln!(
        out,
        "{ticks} ticks: {disarmed} disarmed, {aligning} aligning, {holding} holding, {tracking} tracking, {fault} in \
         fault; {} with a certified command",
        summary.certified
    )?;
    let Summary { stops, warnings, refusals, largest_contraction, .. } = summary;
    writeln!(
        out,
        "{stops} stops on the way, {warnings} warnings, {refusals} way-points refused or lost"
    )?;
    if *largest_contraction > 0.0 {
        let least = summary.least_distance;
        writeln!(
            out,
            "certificates: contraction up to {largest_contraction:.3} (0.44 is allowed), distance to a singularity {least:.4} and more"
        )?;
    }
    writeln!(out, "\nPose error, mm             largest        rms")?;
    let rows = [
        ("all together", &summary.total_m),
        ("static part", &summary.static_m),
        ("  cables and load", &summary.model_m),
        ("  winches", &summary.winches_m),
        ("dynamic part", &summary.dynamic_m),
    ];
    for (name, Spread { largest, rms, .. }) in rows {
        writeln!(out, "  {name:20} {:12.4} {:10.4}", 1e3 * largest, 1e3 * rms)?;
    }
    let turn = &summary.total_rad;
    writeln!(out, "  {:20} {:12.4} {:10.4}", "turn, mrad", 1e3 * turn.largest, 1e3 * turn.rms)?;
    if summary.restless > 0 {
        writeln!(out, "  {} looks without a stable place to rest nearby", summary.restless)?;
    }
    if *tracking > 0 {
        writeln!(out, "\nCable    tension at A [N]        rest length [m]")?;
        for i in 0..CABLES {
            let ([low_n, high_n], [short_m, long_m]) =
                (summary.tensions_n[i], summary.lengths_m[i]);
            writeln!(
                out,
                "  {}   {low_n:9.2} to {high_n:8.2}   {short_m:9.4} to {long_m:8.4}",
                i + 1
            )?;
        }
    }
    let faster = simulated_s / wall_s;
    writeln!(
        out,
        "\n{simulated_s:.1} s simulated in {wall_s:.2} s: {faster:.0} times as fast as real time"
    )
}

/// The run as an SVG: pose errors, tensions, rest lengths, certificates over time.
///
/// # Errors
/// [`PenFault`], which an SVG in memory never meets.
pub fn svg(robot: &str, kept: &[Kept]) -> Result<String, PenFault> {
    let last_s = kept.last().map_or(1.0, |kept| kept.time_s).max(1e-3);
    let time = Axis::scaled(0.0..=last_s, ENDS_X, 0.0, false);
    Pen::picture(SIZE_PX, |pen| {
        pen.heading(20.0, &format!("{robot}: a simulated run"))?;
        pen.note(
            20.0,
            "Shaded: not tracking. Pose error: true less commanded position of the platform.",
        )?;
        let mm = |part: fn(&PoseError) -> f64| {
            move |kept: &Kept| kept.error.as_ref().map(|error| (1e3 * part(error)).max(LEAST_MM))
        };
        let error_lines: Vec<Line<'_>> = vec![
            Line { name: "total".into(), color: TOTAL, value: Box::new(mm(|e| e.total_m)) },
            Line { name: "dynamic".into(), color: DYNAMIC, value: Box::new(mm(|e| e.dynamic_m)) },
            Line { name: "static".into(), color: STATIC, value: Box::new(mm(|e| e.static_m)) },
        ];
        let cables = |value: fn(&Kept, usize) -> f64| {
            (0..CABLES)
                .map(|i| Line {
                    name: format!("cable {}", i + 1),
                    color: CABLE_COLORS[i],
                    value: Box::new(move |kept: &Kept| Some(value(kept, i))),
                })
                .collect::<Vec<_>>()
        };
        let margin = vec![Line {
            name: "contraction".into(),
            color: TOTAL,
            value: Box::new(|kept: &Kept| {
                (kept.mode == Mode::Tracking).then_some(kept.contraction)
            }),
        }];
        let panels = [
            ("pose error, mm", error_lines, Scale::Log),
            ("tension at the anchor, N", cables(|kept, i| kept.tensions_n[i]), Scale::FromZero),
            ("rest length, m", cables(|kept, i| kept.lengths_m[i]), Scale::Linear),
            ("contraction of the certificate (allowed: below 0.44)", margin, Scale::FromZero),
        ];
        let (mut top, height, room) = PANEL_PX;
        for (title, lines, scale) in panels {
            Panel { title, time: &time, top, bottom: top + height, lines: &lines, scale }
                .draw(pen, kept)?;
            top += height + room;
        }
        pen.text(px(ENDS_X.1, top - room + 38.0), "time since power-up, s", HPos::Right, INK)
    })
}

/// What a line shows of a period, if anything.
type Value<'a> = Box<dyn Fn(&Kept) -> Option<f64> + 'a>;

struct Line<'a> {
    name: String,
    color: RGBColor,
    value: Value<'a>,
}

/// How values are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scale {
    Linear,
    /// Linear, with zero in the picture.
    FromZero,
    Log,
}

struct Panel<'a> {
    title: &'static str,
    time: &'a Axis,
    top: f64,
    bottom: f64,
    lines: &'a [Line<'a>],
    scale: Scale,
}

impl Panel<'_> {
    fn draw(&self, pen: &Pen<'_>, kept: &[Kept]) -> Result<(), PenFault> {
        let (left, right) = ENDS_X;
        let values =
            self.lines.iter().flat_map(|line| kept.iter().filter_map(|kept| (line.value)(kept)));
        let (low, high) = values
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = match self.scale {
            Scale::Log if low < high => (10_f64.powf(low.log10().floor()), high),
            Scale::Log => (LEAST_MM, 1.0),
            Scale::Linear if low < high => (low, high),
            Scale::FromZero if high > 0.0 => (0.0, high),
            Scale::Linear | Scale::FromZero => (0.0, 1.0),
        };
        let is_log = self.scale == Scale::Log;
        let headroom = if is_log { 0.0 } else { 0.04 };
        let axis = Axis::scaled(low..=high, (self.bottom, self.top), headroom, is_log);
        self.shade(pen, kept)?;
        for tick in axis.ticks() {
            let y = axis.place(tick.value);
            pen.line(
                &[px(left, y), px(right, y)],
                PALE,
                if tick.label.is_some() { 0.9 } else { 0.4 },
            )?;
            if let Some(label) = tick.label {
                pen.text(px(left - 8.0, y), &label, HPos::Right, INK)?;
            }
        }
        for tick in self.time.ticks() {
            let x = self.time.place(tick.value);
            pen.line(&[px(x, self.bottom), px(x, self.bottom + 5.0)], GREY, 1.0)?;
            if let Some(label) = tick.label {
                pen.text(px(x, self.bottom + 16.0), &label, HPos::Center, INK)?;
            }
        }
        pen.text(px(left, self.top - 12.0), self.title, HPos::Left, INK)?;
        let every = kept.len().div_ceil(POINTS).max(1);
        for (index, line) in self.lines.iter().enumerate() {
            // The largest of each group, so that no peak is lost; a gap ends the path.
            let mut path: Vec<Vector2<f64>> = Vec::new();
            for group in kept.chunks(every) {
                let largest = group.iter().filter_map(|kept| (line.value)(kept)).reduce(f64::max);
                if let (Some(value), Some(first)) = (largest, group.first()) {
                    path.push(px(self.time.place(first.time_s), axis.place(value)));
                } else if !path.is_empty() {
                    pen.line(&std::mem::take(&mut path), line.color, 1.4)?;
                }
            }
            if !path.is_empty() {
                pen.line(&path, line.color, 1.4)?;
            }
            let y = self.top + 12.0 + 22.0 * index as f64;
            pen.line(&[px(right + 12.0, y), px(right + 32.0, y)], line.color, 2.4)?;
            pen.text(px(right + 38.0, y), &line.name, HPos::Left, INK)?;
        }
        pen.line(&[px(left, self.top), px(left, self.bottom), px(right, self.bottom)], GREY, 1.0)
    }

    /// Shades the times in which the platform does not follow the trajectory.
    fn shade(&self, pen: &Pen<'_>, kept: &[Kept]) -> Result<(), PenFault> {
        const SHADE: RGBColor = RGBColor(240, 241, 244);
        for part in kept.chunk_by(|a, b| (a.mode == Mode::Tracking) == (b.mode == Mode::Tracking)) {
            let (Some(first), Some(last)) = (part.first(), part.last()) else { continue };
            if first.mode != Mode::Tracking {
                let (from, to) = (self.time.place(first.time_s), self.time.place(last.time_s));
                let corners = [
                    px(from, self.top),
                    px(to, self.top),
                    px(to, self.bottom),
                    px(from, self.bottom),
                ];
                pen.fill(&corners, SHADE)?;
            }
        }
        Ok(())
    }
}
