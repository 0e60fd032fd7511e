//! Following a solution along `sigma`, through folds, until it leaves the range or ends.

use cdpr_core::{CABLES, CableModel};

use super::certificate::{Certificate, Joint, Reach, Refusal, Span};
use super::homotopy::Homotopy;
use super::step::{Accuracy, converge, kantorovich};
use super::system::{COORDINATES, Coordinates, Point, SIGMA, System};

/// First step, in scaled coordinates (`sigma` is one of them).
const FIRST_STEP: f64 = 0.1;
/// Longest step: one e-fold of the parameter.
const LONGEST_STEP: f64 = 1.0;
/// A path that needs a shorter step than this has met a singular point.
const SHORTEST_STEP: f64 = 1e-10;
/// The next step is chosen to have this contraction, at most [`GROWTH`] times longer than the last.
const CONTRACTION: f64 = 0.35;
const GROWTH: f64 = 2.0;
/// A step shorter than this is taken without a proof, if the sampled test allows it.
const LEAST_PROVED: f64 = 1e-6;
/// `sigma` leads as long as it has this part of the unit tangent, else the largest force does.
const LEADING: f64 = 0.5;
/// Around a fold, how far the change of `sigma` over a step may be from that of a parabola,
/// relative to its rate at the ends; steps shorter than [`SHORT_ARC`] are not asked.
const MAX_BEND: f64 = 0.1;
const SHORT_ARC: f64 = 1e-3;
/// A guess at the curvature of a path, in scaled coordinates, for a fold exactly in the middle of a step.
const CURVATURE: f64 = 0.01;
/// Bound on the steps of one path. Paths of the reference cases take 8 to 400.
const MAX_STEPS: usize = 20_000;
/// Bound on the folds of one path.
const MAX_FOLDS: usize = 64;
/// Bound on the steps that pin down a place on a path, such as a fold.
const LOCATE_STEPS: usize = 60;
/// Bound on the steps that bracket it, each a quarter longer than the last.
const BRACKET_STEPS: usize = 20;
/// A fold is found when the tangent turns within this part of its unit length: the error of
/// `sigma` there is of its square.
const FOLD_TOLERANCE: f64 = 1e-10;
/// A path has run away when a tension is this many times what there is to carry, the load and the
/// weight of the longest taut cable. No path of the reference cases comes near.
const RUN_AWAY: f64 = 1e6;
/// The simplified model takes over where the horizontal force is this part of the whole.
const NEARLY_VERTICAL: f64 = 1e-7;

/// A point that a path has passed.
#[derive(Clone, Debug)]
pub(crate) struct Waypoint {
    pub(crate) point: Point,
    /// Unit tangent of the path; where it starts, only its direction in `sigma`.
    pub(crate) along: Coordinates,
    /// Cables that the simplified model stands for.
    pub(crate) vertical: [bool; CABLES],
    /// Whether it is a fold: `sigma` turns around.
    pub(crate) is_fold: bool,
}

/// How a path ended.
#[derive(Clone, Debug)]
pub(crate) enum End {
    /// At the upper end of the range.
    Top(Point),
    /// At the lower end of the range.
    Bottom(Point),
    /// The tension of a cable grew without bound.
    RanAway { cable: usize, sigma: f64 },
    /// The steps became too short: a singular point that is no fold.
    Stalled { sigma: f64 },
}

/// A path from one point, in one direction.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    pub(crate) end: End,
    /// The start, every point that a step ended at, and the folds between them.
    pub(crate) waypoints: Vec<Waypoint>,
    /// Cables that the simplified model still stands for at the end.
    pub(crate) vertical: [bool; CABLES],
    pub(super) steps: usize,
    /// Steps, and changes between full and simplified model, without a proof.
    pub(super) unproved_steps: usize,
    /// Largest contraction of a proven step.
    pub(super) largest_contraction: f64,
}

impl Path {
    /// Where `sigma` turned around, in the order met.
    pub(super) fn folds(&self) -> impl Iterator<Item = &Point> {
        self.waypoints.iter().filter(|waypoint| waypoint.is_fold).map(|waypoint| &waypoint.point)
    }

    /// This path as the continuation of `before`.
    pub(super) fn after(mut self, before: Self) -> Self {
        self.waypoints.splice(0..0, before.waypoints);
        self.steps += before.steps;
        self.unproved_steps += before.unproved_steps;
        self.largest_contraction = self.largest_contraction.max(before.largest_contraction);
        self
    }
}

/// Follows the solution `start` until `sigma` leaves `bottom..=top`, first upwards or downwards.
/// `caution` divides the longest step: 1 is the ordinary run.
pub(crate) fn follow<H: Homotopy>(
    mut system: System<'_, H>,
    start: Point,
    (bottom, top): (f64, f64),
    upwards: bool,
    caution: f64,
) -> Path {
    let mut along = [0.0; COORDINATES];
    along[SIGMA] = if upwards { 1.0 } else { -1.0 };
    let mut length = FIRST_STEP / caution;
    let mut path = Path {
        end: End::Stalled { sigma: start.sigma },
        waypoints: Vec::new(),
        vertical: system.vertical,
        steps: 0,
        unproved_steps: 0,
        largest_contraction: 0.0,
    };
    let passed = |system: &System<'_, H>, point: &Point, along: &Coordinates| Waypoint {
        point: point.clone(),
        along: *along,
        vertical: system.vertical,
        is_fold: false,
    };
    path.waypoints.push(passed(&system, &start, &along));
    let mut here = Station::new(&system, start);
    let mut reach = Reach::default();
    let mut folds = 0;
    while path.steps < MAX_STEPS && folds <= MAX_FOLDS {
        path.end = End::Stalled { sigma: here.point.sigma };
        path.vertical = system.vertical;
        if let Some(away) = run_away(&system, &here.point, top) {
            path.end = away;
            return path;
        }
        let step = Step { along, length, range: (bottom, top) };
        match step.proven(&system, &here, &mut reach).or_else(|| step.sampled(&system, &here)) {
            Some(Advance { station, tangent, certificate, landed }) => {
                path.steps += 1;
                if let Some(certificate) = certificate {
                    path.largest_contraction =
                        path.largest_contraction.max(certificate.contraction);
                    let growth = (CONTRACTION / certificate.contraction).min(GROWTH);
                    length = (growth * length).min(LONGEST_STEP / caution);
                } else {
                    path.unproved_steps += 1;
                    reach = Reach::default();
                    length = (GROWTH * length).min(LONGEST_STEP / caution);
                }
                let point = &station.point;
                if landed {
                    path.waypoints.push(passed(&system, point, &tangent));
                    path.end = if point.sigma >= top {
                        End::Top(point.clone())
                    } else {
                        End::Bottom(point.clone())
                    };
                    return path;
                }
                if tangent[SIGMA] * along[SIGMA] < 0.0 {
                    let (before, after) =
                        (passed(&system, &here.point, &along), passed(&system, point, &tangent));
                    path.waypoints.push(locate_fold(&system, &before, &after));
                    folds += 1;
                }
                (here, along) = (station, tangent);
                if restore_full_model(&mut system, &mut here.point) {
                    path.unproved_steps += 1;
                    here = Station::new(&system, here.point);
                }
                path.waypoints.push(passed(&system, &here.point, &along));
            }
            None if length > SHORTEST_STEP => length *= 0.5,
            None if simplify(&mut system, &mut here.point) => {
                path.unproved_steps += 1;
                here = Station::new(&system, here.point);
                length = FIRST_STEP / caution;
            }
            None => return path,
        }
    }
    path
}

/// A point of a path, with what a proof needs of it unless that cannot be had.
struct Station {
    point: Point,
    joint: Option<Joint>,
}

impl Station {
    fn new<H: Homotopy>(system: &System<'_, H>, point: Point) -> Self {
        Self { joint: H::joint(system, &point), point }
    }
}

/// An accepted step.
struct Advance {
    station: Station,
    /// Unit tangent of the path, at the new point unless it landed.
    tangent: Coordinates,
    /// `None`: only the sampled test was passed.
    certificate: Option<Certificate>,
    /// Whether the step ended exactly on a bound of `sigma`.
    landed: bool,
}

/// A step to try: of `length` roughly along `along`, within a range of `sigma`.
struct Step {
    along: Coordinates,
    length: f64,
    range: (f64, f64),
}

/// Where a step is to end.
struct Target {
    tangent: Coordinates,
    /// The coordinate that is held.
    held: usize,
    length: f64,
    /// The predicted point.
    start: Point,
    landed: bool,
}

impl Step {
    fn target<H: Homotopy>(&self, system: &System<'_, H>, here: &Point) -> Option<Target> {
        let linear = system.linearise(here)?;
        let tangent = linear.tangent(leading(&self.along), &self.along)?;
        let mut held = leading(&tangent);
        let rate = tangent[SIGMA];
        let mut length = self.length;
        let bound = if rate > 0.0 { self.range.1 } else { self.range.0 };
        let landed = (here.sigma + rate * length - bound) * rate >= 0.0;
        if landed {
            length = (bound - here.sigma) / rate;
            held = SIGMA;
        }
        let mut start = linear.advance(here, &tangent.map(|t| t * length), false);
        if landed {
            start.sigma = bound; // exactly, not but for rounding
        }
        Some(Target { tangent, held, length, start, landed })
    }

    /// The step if it can be proven.
    fn proven<H: Homotopy>(
        &self,
        system: &System<'_, H>,
        here: &Station,
        reach: &mut Reach,
    ) -> Option<Advance> {
        let from = here.joint.as_ref()?;
        let target = self.target(system, &here.point)?;
        let accuracy = if target.landed { Accuracy::Full } else { Accuracy::Proof };
        let point = converge(system, &target.start, target.held, accuracy)?;
        let after = self.after(system, &here.point, &target, &point)?;
        let rates = (target.tangent[SIGMA], after[SIGMA]);
        let bow =
            target.length * (0.25 * rates.0.abs().max(rates.1.abs()) + CURVATURE * target.length);
        let mut joint = H::joint(system, &point)?;
        let span = Span {
            before: &here.point,
            after: &point,
            held: target.held,
            length: target.length,
            bow,
        };
        let certificate = match H::certify(system, &span, from, &mut joint, reach) {
            Err(Refusal::Short) => H::certify(system, &span, from, &mut joint, reach).ok()?,
            other => other.ok()?,
        };
        Some(Advance {
            station: Station { point, joint: Some(joint) },
            tangent: after,
            certificate: Some(certificate),
            landed: target.landed,
        })
    }

    /// The step by the sampled test, where a proof would need a shorter one than
    /// [`LEAST_PROVED`].
    fn sampled<H: Homotopy>(&self, system: &System<'_, H>, here: &Station) -> Option<Advance> {
        if system.homotopy.is_proven() && self.length > LEAST_PROVED {
            return None;
        }
        let target = self.target(system, &here.point)?;
        let there = system.linearise(&target.start)?;
        let test = kantorovich(system, &there, &target.start, &here.point, target.held)?;
        if !test.holds() {
            return None;
        }
        let point = converge(system, &target.start, target.held, Accuracy::Full)?;
        if !test.reaches(&there, &target.start, &point) {
            return None;
        }
        let tangent = self.after(system, &here.point, &target, &point)?;
        let station = Station::new(system, point);
        Some(Advance { station, tangent, certificate: None, landed: target.landed })
    }

    /// The tangent at `point`; `None` when the step overshot or bent too much.
    fn after<H: Homotopy>(
        &self,
        system: &System<'_, H>,
        here: &Point,
        target: &Target,
        point: &Point,
    ) -> Option<Coordinates> {
        let Target { tangent, held, length, landed, .. } = target;
        if !landed && (point.sigma > self.range.1 || point.sigma < self.range.0) {
            return None; // overshot along the arc: a shorter step will land
        }
        // The held coordinate goes on in its direction: the step is one arc over it.
        let mut onwards = [0.0; COORDINATES];
        onwards[*held] = tangent[*held];
        let after = system.linearise(point)?.tangent(*held, &onwards);
        if let Some(after) = &after
            && *held != SIGMA
            && *length > SHORT_ARC
        {
            // A pair of folds within the step would leave the signs at its ends as they are.
            let rates = (tangent[SIGMA], after[SIGMA]);
            let off = (point.sigma - here.sigma - 0.5 * (rates.0 + rates.1) * length).abs();
            if off > MAX_BEND * length * rates.0.abs().max(rates.1.abs()) {
                return None;
            }
        }
        after.or_else(|| landed.then_some(*tangent))
    }
}

/// The coordinate to hold: `sigma` unless the path has nearly turned around.
fn leading(tangent: &Coordinates) -> usize {
    if tangent[SIGMA].abs() >= LEADING {
        return SIGMA;
    }
    largest_force(tangent)
}

/// The cable whose force turns fastest along `tangent`.
fn largest_force(tangent: &Coordinates) -> usize {
    (1..CABLES).fold(0, |best, i| if tangent[i].abs() >= tangent[best].abs() { i } else { best })
}

/// The fold between two points of a path whose tangents point to either side of it: along the
/// leading force the parameter has a maximum or minimum there, so the `sigma` component of the tangent
/// changes its sign.
fn locate_fold<H: Homotopy>(
    system: &System<'_, H>,
    before: &Waypoint,
    after: &Waypoint,
) -> Waypoint {
    let rate = |_: &Point, along: &Coordinates| along[SIGMA];
    let held = largest_force(&after.along);
    let fold = locate(system, before, after, held, FOLD_TOLERANCE, rate);
    Waypoint { is_fold: true, ..fold }
}

/// Where a `quantity` with a limit of zero crosses it between two points of a path, at which its
/// signs differ.
pub(crate) fn locate_crossing<H: Homotopy>(
    homotopy: &H,
    before: &Waypoint,
    after: &Waypoint,
    tolerance: f64,
    quantity: impl Fn(&Point) -> f64,
) -> Point {
    let system = System { homotopy, vertical: before.vertical };
    // Next to a fold sigma cannot lead.
    let flatter = if before.along[SIGMA].abs() < after.along[SIGMA].abs() { before } else { after };
    let held = leading(&flatter.along);
    locate(&system, before, after, held, tolerance, |point, _| quantity(point)).point
}

/// Where `value`, a function of the points of a path and the tangents there, vanishes between two of
/// them, within `tolerance`.
///
/// The secant through the ends, kept in the bracket by the Illinois rule, finds where along coordinate
/// `held`. If Newton fails on the way the best point so far is the answer.
fn locate<H: Homotopy>(
    system: &System<'_, H>,
    before: &Waypoint,
    after: &Waypoint,
    held: usize,
    tolerance: f64,
    value: impl Fn(&Point, &Coordinates) -> f64,
) -> Waypoint {
    let size = |waypoint: &Waypoint| value(&waypoint.point, &waypoint.along).abs();
    let mut best = if size(before) < size(after) { before.clone() } else { after.clone() };
    let mut find = || -> Option<()> {
        let linear = system.linearise(&before.point)?;
        let tangent = linear.tangent(leading(&before.along), &before.along)?;
        // How far along the held coordinate the second point lies from the first.
        let moved = if held == SIGMA {
            after.point.sigma - before.point.sigma
        } else {
            let (from, to) = (&before.point.states[held], &after.point.states[held]);
            (to.force_n - from.force_n).dot(&linear.curves[held].curve.tangent)
                / linear.scales[held]
        };
        let whole = moved / tangent[held];
        let mut low = (0.0, value(&before.point, &tangent));
        let at = |length: f64| -> Option<(f64, Point, Coordinates)> {
            let start = linear.advance(&before.point, &tangent.map(|t| t * length), false);
            let point = converge(system, &start, held, Accuracy::Full)?;
            let along = system.linearise(&point)?.tangent(held, &tangent)?;
            Some((value(&point, &along), point, along))
        };
        // Curves bend: `whole` along the tangent need not reach `after`.
        let mut high = (whole, at(whole)?.0);
        for _ in 0..BRACKET_STEPS {
            if (high.1 > 0.0) != (low.1 > 0.0) {
                break;
            }
            high.0 *= 1.25;
            high.1 = at(high.0)?.0;
        }
        for _ in 0..LOCATE_STEPS {
            let length = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let (found, point, along) = at(length)?;
            if found.abs() < size(&best) {
                best = Waypoint { point, along, ..before.clone() };
            }
            if found.abs() < tolerance {
                break;
            }
            if (found > 0.0) == (high.1 > 0.0) {
                high = (length, found);
                low.1 *= 0.5;
            } else {
                low = high;
                high = (length, found);
            }
        }
        Some(())
    };
    find();
    best
}

/// Whether a tension has grown so far beyond all weights, as they are at the `top` of the range, that
/// it will not come back.
fn run_away<H: Homotopy>(system: &System<'_, H>, here: &Point, top: f64) -> Option<End> {
    let homotopy = system.homotopy;
    let cable_n =
        |i: usize| homotopy.model(i, top).weight_n_m() * homotopy.planes()[i].distance_m();
    let load_n = (0..CABLES).map(cable_n).fold(homotopy.wrench_n(top).amax(), f64::max);
    let bound_n = RUN_AWAY * load_n;
    let cable = here.states.iter().position(|state| state.force_n.norm() > bound_n)?;
    Some(End::RanAway { cable, sigma: here.sigma })
}

/// Puts the full model back where the simplified one stands, one cable at a time, whenever the
/// sampled test says that Newton takes the state over; whether it did.
pub(super) fn restore_full_model<H: Homotopy>(
    system: &mut System<'_, H>,
    here: &mut Point,
) -> bool {
    let mut any = false;
    for cable in 0..CABLES {
        let plane = &system.homotopy.planes()[cable];
        if !system.vertical[cable] || plane.x_m <= 0.0 {
            continue;
        }
        let model = system.homotopy.model(cable, here.sigma);
        let Ok(line) =
            model.force_at_length(plane.x_m, plane.z_m, here.states[cable].rest_length_m)
        else {
            continue;
        };
        let mut full = system.clone();
        full.vertical[cable] = false;
        let mut start = here.clone();
        start.states[cable].force_n = line.force_n;
        let restored = full.linearise(&start).and_then(|linear| {
            let accepted = kantorovich(&full, &linear, &start, &start, SIGMA)?.holds();
            if accepted { converge(&full, &start, SIGMA, Accuracy::Full) } else { None }
        });
        if let Some(point) = restored {
            *system = full;
            *here = point;
            any = true;
        }
    }
    any
}

/// Replaces the model of slack cables next to `Fx = 0` by the simplified one; whether any was.
fn simplify<H: Homotopy>(system: &mut System<'_, H>, here: &mut Point) -> bool {
    let mut simple = system.clone();
    let mut start = here.clone();
    for (cable, state) in start.states.iter_mut().enumerate() {
        if state.force_n.x.abs() <= NEARLY_VERTICAL * state.force_n.norm()
            && !simple.vertical[cable]
        {
            simple.vertical[cable] = true;
            state.force_n.x = 0.0;
        }
    }
    if simple.vertical == system.vertical {
        return false;
    }
    let Some(point) = converge(&simple, &start, SIGMA, Accuracy::Full) else { return false };
    *system = simple;
    *here = point;
    true
}
