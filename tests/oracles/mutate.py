#!/usr/bin/env python3
"""Shows that the tests notice wrong code: makes one small mistake after the other in a copy of the
tree and reports which of them no test sees.

    tests/oracles/mutate.py [WORD]      only mistakes with WORD in file, text or command

Takes a few seconds a mistake; `tests/run` does not call it. The copy and what is compiled from it are
in `target/mutants`, or in `mutants` below CARGO_TARGET_DIR. Exit status 1 when a mistake survives, or
when one that is listed as harmless is noticed.
"""

import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
PLACE = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "mutants"
TIMEOUT_S = 300

INTERVAL = "host-sim/src/interval.rs"
INTERVAL_TEST = ("--package", "cdpr-tests", "--test", "interval_scalar")

# (file, text, which must occur once, replacement, arguments of `cargo test`[, why it is harmless])
MISTAKES = [
    (INTERVAL, old, new, INTERVAL_TEST, *why)
    for old, new, *why in (
        # Rounding.
        ("    value + (value.abs() * STEP + LEAST)", "    value"),
        ("    value + (value.abs() * STEP + LEAST)", "    value - (value.abs() * STEP + LEAST)"),
        ("    value + (value.abs() * STEP + LEAST)", "    value + value.abs() * STEP"),
        ("    value + (value.abs() * STEP + LEAST)", "    value + (value * STEP + LEAST)"),
        ("    value + (value.abs() * STEP + LEAST)", "    value + 8.0 * (value.abs() * STEP + LEAST)"),
        ("f64 = UNIT * (1.0 + f64::EPSILON)", "f64 = UNIT"),
        ("f64 = UNIT * (1.0 + f64::EPSILON)", "f64 = 0.5 * UNIT"),
        ("value + (value.abs() * (units * STEP) + LEAST)", "value"),
        ("value + (value.abs() * (units * STEP) + LEAST)", "value - (value.abs() * (units * STEP) + LEAST)"),
        ("value + (value.abs() * (units * STEP) + LEAST)", "value + (value * (units * STEP) + LEAST)"),
        ("value + (value.abs() * (units * STEP) + LEAST)", "value + value.abs() * (units * STEP)",
         "only distances above 1e-140, tails and logarithms get here, of which only ln 1 = 0 is small"),
        ("checked(up(negated_low), up(high))", "checked(negated_low, up(high))"),
        ("checked(up(negated_low), up(high))", "checked(up(negated_low), high)"),
        ("if (negated_low + high).is_nan() {", "if false {"),
        # Construction and queries.
        ("if low <= high { Self::checked(-low, high) }", "if low <= high { Self { negated_low: -low, high } }"),
        ("if low <= high { Self::checked(-low, high) }", "if true { Self::checked(-low, high) }"),
        ("Self::outwards(radius - center, center + radius)", "Self::checked(radius - center, center + radius)"),
        ("Self::outwards(radius - center, center + radius)", "Self::outwards(center - radius, center + radius)"),
        ("        if radius >= 0.0 {", "        if true {"),
        ("Self::new(-radius, radius)", "Self::new(radius, radius)"),
        ("0.5 * self.high - 0.5 * self.negated_low", "0.5 * self.high + 0.5 * self.negated_low"),
        ("middle.clamp(self.low(), self.high)", "middle"),
        ("up((self.high - middle).max(middle + self.negated_low))", "(self.high - middle).max(middle + self.negated_low)"),
        ("up((self.high - middle).max(middle + self.negated_low))", "up((self.high - middle).min(middle + self.negated_low))"),
        ("up((self.high - middle).max(middle + self.negated_low))", "up(self.high - middle)"),
        ("up((self.high - middle).max(middle + self.negated_low))", "up(middle + self.negated_low)"),
        ("self.high.max(self.negated_low)", "self.high"),
        ("self.high.max(self.negated_low)", "self.negated_low"),
        ("self.low().max(-self.high).max(0.0)", "self.low().max(0.0)"),
        ("self.low().max(-self.high).max(0.0)", "(-self.high).max(0.0)"),
        ("self.low().max(-self.high).max(0.0)", "self.low().max(-self.high)"),
        ("self.negated_low < f64::INFINITY && self.high < f64::INFINITY", "self.high < f64::INFINITY"),
        ("self.negated_low < f64::INFINITY && self.high < f64::INFINITY", "self.negated_low < f64::INFINITY"),
        ("self.low() <= value && value <= self.high", "self.low() < value && value <= self.high"),
        ("self.low() <= value && value <= self.high", "self.low() <= value && value < self.high"),
        ("self.negated_low < other.negated_low && self.high < other.high", "self.negated_low <= other.negated_low && self.high < other.high"),
        ("self.negated_low < other.negated_low && self.high < other.high", "self.negated_low < other.negated_low && self.high <= other.high"),
        # Sets.
        ("self.negated_low.max(other.negated_low)", "self.negated_low.min(other.negated_low)"),
        ("self.high.max(other.high)", "self.high.min(other.high)"),
        ("self.negated_low.min(other.negated_low)", "self.negated_low.max(other.negated_low)"),
        ("self.high.min(other.high)", "self.high.max(other.high)"),
        ("(-negated_low <= high)", "(-negated_low < high)"),
        ("(-negated_low <= high)", "(negated_low <= high)"),
        # Square.
        ("-up(-(small * small))", "small * small"),
        ("-up(-(small * small))", "up(small * small)"),
        ("-low.max(0.0), up(large * large)", "-low.max(0.0), large * large"),
        ("-low.max(0.0), up(large * large)", "-low, up(large * large)"),
        ("-low.max(0.0), up(large * large)", "-low.max(0.0), up(small * small)"),
        ("(self.mignitude(), self.magnitude())", "(self.magnitude(), self.magnitude())"),
        ("(self.mignitude(), self.magnitude())", "(self.low(), self.high)"),
        # Logarithm.
        ("up_by(-low, 3.0), up_by(high, 3.0)", "up_by(-low, 0.0), up_by(high, 3.0)"),
        ("up_by(-low, 3.0), up_by(high, 3.0)", "up_by(-low, -3.0), up_by(high, 3.0)"),
        ("up_by(high, 3.0)", "up_by(high, 0.0)"),
        ("up_by(high, 3.0)", "up_by(high, -3.0)"),
        ("(libm::log(self.low()), libm::log(self.high))", "(libm::log(self.high), libm::log(self.low()))"),
        ("        if self.low() > 0.0 {", "        if self.low() >= 0.0 {"),
        # Sums and products.
        ("Self { negated_low: self.high, high: self.negated_low }", "self"),
        ("outwards(self.negated_low + other.negated_low, self.high + other.high)", "checked(self.negated_low + other.negated_low, self.high + other.high)"),
        ("self.negated_low + other.negated_low, self.high + other.high", "self.negated_low - other.negated_low, self.high + other.high"),
        ("self.negated_low + other.negated_low, self.high + other.high", "self.negated_low + other.negated_low, self.high - other.high"),
        ("outwards(self.negated_low + other.high, self.high + other.negated_low)", "checked(self.negated_low + other.high, self.high + other.negated_low)"),
        ("self.negated_low + other.high, self.high + other.negated_low", "self.negated_low - other.negated_low, self.high + other.negated_low"),
        ("self.negated_low + other.high, self.high + other.negated_low", "self.negated_low + other.high, self.high - other.high"),
        ("a.negated_low <= 0.0 && b.negated_low <= 0.0", "a.negated_low <= 0.0"),
        ("a.negated_low <= 0.0 && b.negated_low <= 0.0", "b.negated_low <= 0.0"),
        ("a.negated_low <= 0.0 && b.negated_low <= 0.0", "false", "the general case covers it, slower"),
        ("outwards(a.negated_low * -b.negated_low, a.high * b.high)", "checked(a.negated_low * -b.negated_low, a.high * b.high)"),
        ("a.negated_low * -b.negated_low, a.high * b.high", "a.negated_low * b.negated_low, a.high * b.high"),
        ("a.negated_low * -b.negated_low, a.high * b.high", "a.negated_low * -b.negated_low, a.high * -b.negated_low"),
        ("a.negated_low * -b.negated_low, a.high * b.high", "a.negated_low * b.high, a.high * b.high"),
        ("[al * bl, al * b.high, a.high * bl, a.high * b.high]", "[al * b.high, al * b.high, a.high * bl, a.high * b.high]"),
        ("[al * bl, al * b.high, a.high * bl, a.high * b.high]", "[al * bl, al * bl, a.high * bl, a.high * b.high]"),
        ("[al * bl, al * b.high, a.high * bl, a.high * b.high]", "[al * bl, al * b.high, al * bl, a.high * b.high]"),
        ("[al * bl, al * b.high, a.high * bl, a.high * b.high]", "[al * bl, al * b.high, a.high * bl, al * bl]"),
        ("products[0].max(products[1]).max(", "products[0].min(products[1]).max("),
        ("products[0].min(products[1]).min(", "products[0].max(products[1]).min("),
        ("Self::outwards(-low, high)", "Self::checked(-low, high)"),
        ("Self::outwards(-low, high)", "Self::checked(up(-low), high)"),
        ("Self::outwards(-low, high)", "Self::checked(-low, up(high))"),
        # Quotient.
        ("        if b.negated_low < 0.0 {", "        if b.negated_low <= 0.0 {"),
        ("if a.negated_low > 0.0 { -b.negated_low } else { b.high }", "if a.negated_low < 0.0 { -b.negated_low } else { b.high }"),
        ("if a.negated_low > 0.0 { -b.negated_low } else { b.high }", "b.high"),
        ("if a.negated_low > 0.0 { -b.negated_low } else { b.high }", "-b.negated_low"),
        ("if a.high > 0.0 { -b.negated_low } else { b.high }", "if a.high < 0.0 { -b.negated_low } else { b.high }"),
        ("if a.high > 0.0 { -b.negated_low } else { b.high }", "b.high"),
        ("if a.high > 0.0 { -b.negated_low } else { b.high }", "-b.negated_low"),
        ("outwards(a.negated_low / low_by, a.high / high_by)", "checked(a.negated_low / low_by, a.high / high_by)"),
        ("outwards(a.negated_low / low_by, a.high / high_by)", "checked(up(a.negated_low / low_by), a.high / high_by)"),
        ("outwards(a.negated_low / low_by, a.high / high_by)", "checked(a.negated_low / low_by, up(a.high / high_by))"),
        ("-(a / -b)", "a / -b"),
        ("} else if b.high < 0.0 {", "} else if b.high <= 0.0 {"),
        # Constants and roots.
        ("Self::outwards(-value, value)", "Self::checked(-value, value)"),
        ("        if self.high < 0.0 {", "        if self.high > 0.0 {"),
        ("-up(-self.low().max(0.0).sqrt())", "self.low().max(0.0).sqrt()"),
        ("-up(-self.low().max(0.0).sqrt())", "up(self.low().max(0.0).sqrt())"),
        ("-low.max(0.0), up(self.high.sqrt())", "-low, up(self.high.sqrt())"),
        ("-low.max(0.0), up(self.high.sqrt())", "-low.max(0.0), self.high.sqrt()"),
        # Distance.
        ("(x.mignitude(), x.magnitude())", "(x.magnitude(), x.mignitude())"),
        ("hypot(near, z.mignitude()).negated_low", "hypot(near, z.magnitude()).negated_low"),
        ("hypot(near, z.mignitude()).negated_low", "-hypot(near, z.mignitude()).high"),
        ("hypot(near, z.mignitude()).negated_low", "hypot(far, z.mignitude()).negated_low"),
        ("hypot(far, z.magnitude()).high", "hypot(far, z.mignitude()).high"),
        ("hypot(far, z.magnitude()).high", "hypot(far, z.magnitude()).low()"),
        ("(x.abs(), z.abs())", "(x, z)"),
        ("x.max(z);", "x.min(z);"),
        ("(1e-140..1e150)", "(1e-200..1e150)"),
        ("(1e-140..1e150)", "(1e-140..1e200)"),
        ("up_by(-t, 4.0)", "up_by(-t, 0.0)"),
        ("up_by(-t, 4.0)", "up_by(-t, -4.0)"),
        ("up_by(t, 4.0)", "up_by(t, 0.0)"),
        ("up_by(t, 4.0)", "up_by(t, -4.0)"),
        ("checked(-largest, up(x + z))", "checked(-largest, x + z)"),
        ("checked(-largest, up(x + z))", "checked(-largest, up(largest))"),
        ("checked(-largest, up(x + z))", "checked(-(x + z), up(x + z))"),
        # Excess.
        ("-excess(near, z.high).low().max(0.0)", "-excess(near, z.low()).low().max(0.0)"),
        ("-excess(near, z.high).low().max(0.0)", "-excess(near, z.high).high.max(0.0)"),
        ("-excess(near, z.high).low().max(0.0)", "-excess(far, z.high).low().max(0.0)"),
        ("-excess(near, z.high).low().max(0.0)", "-excess(near, z.high).low()"),
        ("excess(far, z.low()).high)", "excess(far, z.high).high)"),
        ("excess(far, z.low()).high)", "excess(far, z.low()).low())"),
        ("excess(far, z.low()).high)", "excess(near, z.low()).high)"),
        ("    if z > 0.0 {", "    if z > f64::MAX {"),
        ("    if z > 0.0 {", "    if z < 0.0 {"),
        ("part * (part / (t + Interval::point(z)))", "part * (part / (t - Interval::point(z)))"),
        ("part * (part / (t + Interval::point(z)))", "part * part / (t + Interval::point(z))"),
        ("        t - Interval::point(z)\n", "        t + Interval::point(z)\n"),
        # Tail of atanh: which view, which end.
        ("complement.high < from_q.high", "complement.high > from_q.high"),
        ("complement.high < from_q.high", "true"),
        ("complement.high < from_q.high", "false"),
        ("complement.low() > from_q.low()", "complement.low() < from_q.low()"),
        ("complement.low() > from_q.low()", "true"),
        ("complement.low() > from_q.low()", "false"),
        ("Interval::point(complement.high.min(1.0))", "Interval::point(complement.low().min(1.0))"),
        ("Interval::point(complement.high.min(1.0))", "Interval::point(complement.high)",
         "q below 0 is taken for 0 by the series"),
        ("Interval::point(q.low().max(0.0))", "Interval::point(q.high.max(0.0))"),
        ("Interval::point(complement.low());", "Interval::point(complement.high);"),
        ("Interval::point(q.high);", "Interval::point(q.low());"),
        ("checked(low.negated_low, high.high)", "checked(high.negated_low, high.high)"),
        ("checked(low.negated_low, high.high)", "checked(low.negated_low, low.high)"),
        ("checked(low.negated_low, high.high)", "checked(-low.high, high.high)"),
        ("checked(low.negated_low, high.high)", "checked(low.negated_low, high.low())"),
        # Its two formulas.
        ("q.high < 0.25 {\n        // The float", "q.high < 0.26 {\n        // The float"),
        ("q.high < 0.25 {\n        // The float", "q.high < 0.24 {\n        // The float"),
        ("q.high < 0.25 {\n        // The float", "q.low() < 0.25 {\n        // The float"),
        ("up_by(-low, 48.0)", "up_by(-low, 0.0), up_by(high, 3.0)"),
        ("up_by(-low, 48.0)", "up_by(-low, -48.0)"),
        ("up_by(high, 48.0)", "up_by(high, 0.0)"),
        ("up_by(high, 48.0)", "up_by(high, -48.0)"),
        ("((one + q) / complement)", "((one - q) / complement)"),
        ("((one + q) / complement)", "((one + q) / (one - q))"),
        # A unit lost in here would be covered by the other roundings: the operations are tested singly.
        ("Interval::point(0.5) * logarithm", "logarithm"),
        ("/ q - one)", "- one)"),
        ("/ q.square()", "/ q"),
    )
]
PIECES = ("--package", "cdpr-host-sim", "--lib", "complete::")
SEARCH = ("--package", "cdpr-tests", "--test", "complete", "--", "--skip", "random_")

MISTAKES += [
    (f"host-sim/src/complete/{file}.rs", old, new, command, *why)
    for file, old, new, command, *why in (
        # Points of the curve.
        ("curve", "let x_error_m = plane_error_m.min(1e-3 * plane.x_m);", "let x_error_m = 0.0;", PIECES),
        ("curve", "Interval::around(plane.z_m, plane_error_m),", "Interval::around(plane.z_m, 0.0),", PIECES),
        ("curve", "if image.x.is_inside(around.x) && image.y.is_inside(around.y) {", "if image.x.is_inside(around.x) {", PIECES),
        ("curve", "if image.x.is_inside(around.x) && image.y.is_inside(around.y) {", "if true {", PIECES),
        ("curve", "let image = newton + contraction * around;", "let image = newton;", PIECES),
        ("curve", "force_n: on_tangent + normal.map(|n| n * image.x),", "force_n: near.force_n.map(Interval::point) + normal.map(|n| n * image.x),", PIECES),
        ("curve", "j.m11 * x + j.m12 * z, j.m21 * x + j.m22 * z) * along", "j.m11 * x, j.m21 * x + j.m22 * z) * along", PIECES),
        ("curve", "        if !along.is_zero() {", "        if false {", PIECES),
        # Pieces.
        ("curve", "let mut reach = 1.0 + 2.0 * slack;", "let mut reach = 0.9_f64;", PIECES),
        ("curve", "reach = reach.max(box_along.magnitude());", "", PIECES),
        ("curve", "Interval::symmetric(reach) * offset(&half_chord_n)", "Interval::symmetric(1.0) * offset(&half_chord_n)", SEARCH),
        ("curve", "slope = rise.max(fall);", "slope = 0.5 * rise.max(fall);", PIECES),
        ("curve", "slope = rise.max(fall);", "slope = rise.min(fall);", PIECES),
        ("curve", "slope = rise.max(fall);", "slope = 10.0 * rise.max(fall);", PIECES),
        ("curve", "{ 2.0 * rise * (fall / sum) }", "{ rise * (fall / sum) }", PIECES),
        ("curve", "{ 2.0 * rise * (fall / sum) }", "{ 20.0 * rise * (fall / sum) }", PIECES),
        ("curve", "let thickness = across.radius()", "let thickness = 0.5 * across.radius()", PIECES),
        ("curve", "            if cosine.low() > 0.5 {", "            if cosine.low() > -0.5 {", PIECES,
         "a division by any interval without zero holds, and with zero it says nothing"),
        ("curve", "(-offset_n - chord_ends + line_error)", "(offset_n - chord_ends + line_error)", PIECES),
        ("curve", "let x = shorter.force_n.x.hull(longer.force_n.x);", "let x = shorter.force_n.x;", PIECES),
        ("curve", "            at_anchor\n        } else {", "            at_attachment\n        } else {", PIECES),
        ("curve", "            at_attachment\n        } else if", "            shorter.force_n.y\n        } else if", PIECES),
        ("curve", "let y = if self.target.y.high() <= 0.0 {", "let y = if self.target.y.low() <= 0.0 {", PIECES,
         "with z across zero the two boxes differ by no more than rounding"),
        # The course of the models.
        ("model", "(a.q.hull(b.q), a.sag.hull(b.sag))", "(a.q, a.sag.hull(b.sag))", PIECES),
        ("model", "(a.q.hull(b.q), a.sag.hull(b.sag))", "(a.q.hull(b.q), a.sag)", PIECES),
        ("model", "(a.bend.hull(b.bend), a.room.hull(b.room))", "(a.bend, a.room.hull(b.room))", PIECES),
        ("model", "(a.bend.hull(b.bend), a.room.hull(b.room))", "(a.bend.hull(b.bend), b.room)", PIECES),
        ("model", "a.langevin.hull(b.langevin)", "a.langevin", PIECES),
        ("model", "a.langevin.hull(b.langevin)", "b.langevin", PIECES),
        ("model", "a.strain_per_m.hull(b.strain_per_m)", "b.strain_per_m", PIECES),
        ("model", "q * length * p.square() * share - z,", "q * length * p.square() * share + z,", PIECES),
        ("model", "q * length * p.square() * share - z,", "q * length * p * share - z,", PIECES),
        ("model", "                -(x * bend * x_share * widening),", "                -(x * bend * x_share),", PIECES),
        ("model", "(length + z * lift)", "(length - z * lift)", PIECES),
        ("model", "Vector2::new(-(rate * cx), half_weight - rate * cz)", "Vector2::new(-(rate * cx), half_weight + rate * cz)", PIECES),
        ("model", "Vector2::new(-cx, half_weight / rate - cz)", "Vector2::new(-cx, half_weight / rate + cz)", PIECES),
        # The equations over a box.
        ("statics", "let (mut low, mut high) = (wrench_n[j] - error_n, wrench_n[j] + error_n);", "let (mut low, mut high) = (wrench_n[j], wrench_n[j]);", PIECES),
        ("statics", "let thick = piece.normal_wrench[j].abs() * piece.thickness;", "let thick = 0.5 * piece.normal_wrench[j].abs() * piece.thickness;", PIECES),
        ("statics", "let mut ranges: Ranges = pieces.map(|p| (-p.reach, p.reach));", "let mut ranges: Ranges = pieces.map(|_| (-1.0, 1.0));", PIECES),
        ("statics", "range.0 = a - room;", "range.0 = a;", PIECES, "rounding that the error of the sums covers as well"),
        ("statics", "            if low > 0.0 || high < 0.0 {", "            if low > 0.0 || high < 1e-3 {", PIECES),
        ("statics", "radius[k] = rows[k] * error_n + off;", "radius[k] = off;", PIECES),
        ("statics", "radius[k] = rows[k] * error_n + off;", "radius[k] = rows[k] * error_n;", PIECES,
         "the defect of the inverse is rounding, and so is its bound"),
        ("statics", "slopes[k] += rows[k] * turned_n;", "", PIECES, "rounding"),
        ("statics", "radius += seen * piece.thickness;", "radius += seen * piece.thickness * 0.5;", PIECES),
        ("statics", "slopes += seen * piece.slope;", "slopes += seen * piece.slope * 0.5;", PIECES),
        ("statics", "contraction: contraction * UPWARDS", "contraction: slopes.min() * UPWARDS", PIECES),
        ("statics", "self.contraction < 1.0", "self.contraction < 3.0", PIECES),
        ("statics", "self.center[k].abs() + self.radius[k] < 2.0 - pieces[k].reach", "self.center[k].abs() < 2.0 - pieces[k].reach", PIECES),
        ("statics", "self.center[k].abs() + self.radius[k] < 2.0 - pieces[k].reach", "self.center[k].abs() + self.radius[k] < pieces[k].reach", PIECES),
        ("statics", "range.0.max(self.center[k] - self.radius[k])", "range.0.max(self.center[k] - 0.5 * self.radius[k])", PIECES),
        # The search.
        ("search", "for part in halves {", "for part in halves.into_iter().take(1) {", SEARCH),
        ("search", "for part in halves {", "for part in halves.into_iter().skip(1) {", SEARCH),
        ("search", "let part = if high < u.low() {", "let part = if center < u.low() {", SEARCH),
        ("search", "        } else if low > u.high() {", "        } else if center > u.high() {", SEARCH),
        ("search", ".is_some_and(|v| v.is_unique())", ".is_some()", SEARCH),
        ("search", "            let Some(piece) = curve.piece(shorter, longer) else { return false };", "            let Some(piece) = curve.piece(shorter, longer) else { return true };", SEARCH),
        ("search", "        if !(verdict.is_unique() && verdict.maps_inside(&pieces)) {", "        if !verdict.is_unique() {", SEARCH),
        ("search", "            && verdict.is_unique()\n", "", SEARCH),
        ("search", "let radius_n = verdict.radius[k] * size_n;", "let radius_n = 0.0;", SEARCH),
        ("search", "        self.give_up(&candidate);\n    }", "    }", SEARCH),
        ("search", "            if self.found.boxes >= MAX_BOXES {\n                self.give_up(&candidate);", "            if self.found.boxes >= 100 {", SEARCH),
        # The limits.
        ("mod", "            answer = Within::Undecided;", "", SEARCH),
        ("mod", "if length.low() > limits.max_length_m {", "if length.high() > limits.max_length_m {", SEARCH),
        ("mod", "at_b.low().max(at_a.low()) > limits.max_tension_n", "at_b.low() > limits.max_tension_n", SEARCH),
        ("mod", "&& at_b.high().max(at_a.high()) <= limits.max_tension_n", "&& at_b.high() <= limits.max_tension_n", SEARCH),
        ("mod", "let pull = if curve.plane.z_m <= 0.0 { -force.y } else { force.y - weight };", "let pull = -force.y;", SEARCH),
        ("mod", "let mut target_n = tension_n * (1.0 + BEYOND) + weight_n;", "let mut target_n = 0.5 * tension_n;", SEARCH),
        ("mod", "            if long || pull.low() > tension_n {", "            if true {", SEARCH),
        ("mod", "const BEYOND: f64 = 1e-6;", "const BEYOND: f64 = -1e-6;", SEARCH),
    )
]


def cargo(tree, *arguments):
    """Whether it succeeds; a test that hangs has failed."""
    command = ["cargo", "test", "--locked", "--quiet", *arguments]
    environment = {**os.environ, "CARGO_TARGET_DIR": str(PLACE / "target"), "RUST_BACKTRACE": "0"}
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        return subprocess.run(command, cwd=tree, env=environment, timeout=TIMEOUT_S, **silent).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def copy():
    """A fresh copy of what is in the working tree, without what is ignored."""
    tree = PLACE / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.run(listed, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0"):
        if name and (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            # With the time of now, or cargo would keep what it made of the last mistake.
            shutil.copy(ROOT / name, tree / name)
    return tree


def main():
    word = sys.argv[1] if len(sys.argv) > 1 else ""
    chosen = [m for m in MISTAKES if any(word in text for text in (*m[:3], " ".join(m[3])))]
    for file, old, *_ in chosen:
        if (count := (ROOT / file).read_text().count(old)) != 1:
            sys.exit(f"{file}: {count} times: {old}")
    tree = copy()
    for arguments in dict.fromkeys(m[3] for m in chosen):
        if not cargo(tree, *arguments):
            sys.exit(f"without a mistake already fails: cargo test {' '.join(arguments)}")
    unexpected = 0
    for file, old, new, arguments, *why in chosen:
        source = (tree / file).read_text()
        (tree / file).write_text(source.replace(old, new))
        if not cargo(tree, "--no-run", *arguments):
            sys.exit(f"does not compile: {old}  ->  {new}")
        noticed = not cargo(tree, *arguments)
        (tree / file).write_text(source)
        if noticed == bool(why):
            unexpected += 1
            print(f"{'NOTICED' if noticed else 'SURVIVES'}  {file}: {old.strip()}  ->  {new.strip()}", flush=True)
    harmless = sum(len(m) > 4 for m in chosen)
    print(f"{len(chosen)} mistakes, {harmless} of them harmless; {unexpected} not as expected")
    sys.exit(unexpected > 0)


if __name__ == "__main__":
    main()
