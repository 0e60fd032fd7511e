//! Branch and prune over boxes of six pieces of force curve.
//!
//! Each cable keeps a binary tree of pieces, cut when a box first needs it and shared by all boxes.
//! A box in which the equations have no solution is dropped; one in which they have at most one is
//! settled by finding it; any other is cut where that helps most.

use cdpr_core::{CABLES, CableState, newton};
use nalgebra::{Vector2, Vector6};

use super::curve::{Curve, Node, Piece};
use super::model::Provable;
use super::statics::{Verdict, examine, narrow};
use super::{Place, Proof};
use crate::interval::Interval;
use crate::problem::{LEAST_FORCE, Problem};

/// Bound on the boxes of one pose. Poses of the reference cases take 50 to 3000.
const MAX_BOXES: usize = 200_000;
/// Bound on the pieces of one cable: a few hundred bytes each.
const MAX_PIECES: usize = 20_000;
/// A box whose pieces are all smaller than this part of their force is not cut any more.
const LEAST_PIECE: f64 = 1e-7;
/// Newton's method from the middle of a box.
const NEWTON_STEPS: u32 = 16;
/// Relative; what rounding leaves of long slack cables is more than in the cables at work.
const CONVERGED: f64 = 1e-8;
/// Radius of the box in which a solution is proven, relative to its forces; smaller ones are tried.
const PROOF_RADIUS: f64 = 1e-5;
const PROOF_SHRINK: f64 = 0.1;
const PROOF_ATTEMPTS: usize = 4;
/// An enclosure of this radius, relative to the forces, is tight enough.
const TIGHT: f64 = 1e-11;
/// How far beyond a solution a box is extended, in radii of the box in which it was proven: enough for
/// its enclosure, which lies inside, and not more than needed.
const BEYOND_SOLUTION: [f64; 4] = [0.03, 0.1, 0.3, 1.0];
/// Distance of a cut from the range that it separates, in half chords, at least.
const CUT_BESIDE: f64 = 1e-6;
/// A range of this radius, in half chords, decides where a stretch is cut.
const NARROW: f64 = 0.1;
/// A range of this radius may lie within one part of a stretch.
const WIDE: f64 = 0.75;
/// A solution further than this from a box, in half chords, is not looked for by extending it.
const NEAR: f64 = 4.0;

/// One cable: its curve and the stretches of it that were cut so far.
struct Tree<'a, M: Provable> {
    curve: Curve<'a, M>,
    stretches: Vec<Stretch<M::End>>,
}

/// A stretch of a force curve in its tree.
struct Stretch<E> {
    shorter: Node<E>,
    longer: Node<E>,
    /// Enclosed when a box first asks for it; `None` as well when that failed.
    piece: Option<Box<Piece<E>>>,
    cut: Cut,
}

impl<E> Stretch<E> {
    fn between(shorter: Node<E>, longer: Node<E>) -> Self {
        Self { shorter, longer, piece: None, cut: Cut::Whole }
    }
}

#[derive(Clone, Copy)]
enum Cut {
    /// Not tried yet.
    Whole,
    /// Into the stretch with this index and the next one.
    Into(usize),
    /// No point between the ends could be proven.
    Refused,
}

impl<'a, M: Provable> Tree<'a, M> {
    fn new(curve: Curve<'a, M>, root: Piece<M::End>) -> Self {
        let mut whole = Stretch::between(root.shorter, root.longer);
        whole.piece = Some(Box::new(root));
        Self { curve, stretches: vec![whole] }
    }

    /// The piece of a stretch of which [`Tree::enclose`] has said that there is one.
    fn piece(&self, index: usize) -> &Piece<M::End> {
        self.stretches[index].piece.as_ref().expect("boxes are made of enclosed stretches")
    }

    /// Encloses a stretch; whether that is possible.
    fn enclose(&mut self, index: usize) -> bool {
        let stretch = &self.stretches[index];
        if stretch.piece.is_none() {
            let piece = self.curve.piece(stretch.shorter, stretch.longer);
            self.stretches[index].piece = piece.map(Box::new);
        }
        self.stretches[index].piece.is_some()
    }

    /// The two parts of a stretch, cut near `u` when it is still whole: index of the first, the second
    /// follows it.
    fn cut(&mut self, index: usize, u: f64) -> Option<usize> {
        match self.stretches[index].cut {
            Cut::Into(first) => Some(first),
            Cut::Refused => None,
            Cut::Whole => {
                let first = self.stretches.len();
                let room = first < MAX_PIECES;
                let node = if room { self.curve.cut(self.piece(index), u) } else { None };
                self.stretches[index].cut =
                    if node.is_some() { Cut::Into(first) } else { Cut::Refused };
                let node = node?;
                let Stretch { shorter, longer, .. } = self.stretches[index];
                self.stretches.push(Stretch::between(shorter, node));
                self.stretches.push(Stretch::between(node, longer));
                Some(first)
            }
        }
    }

    /// Both parts of a stretch, cut at the apex, enclosed.
    fn halves(&mut self, index: usize) -> Option<[usize; 2]> {
        let first = self.cut(index, self.piece(index).apex)?;
        (self.enclose(first) && self.enclose(first + 1)).then_some([first, first + 1])
    }

    /// The part of a stretch that holds all its points with `u` in the range `low..=high`, when it is
    /// only one of the two.
    fn part_around(&mut self, index: usize, (low, high): (f64, f64)) -> Option<usize> {
        let piece = self.piece(index);
        let (center, radius) = (0.5 * (low + high), 0.5 * (high - low));
        if !piece.slope.is_finite() || radius > WIDE {
            return None; // `u` need not rise along the piece, or the range is too wide
        }
        // A stretch that is still whole is cut beside the range, where it leaves less.
        let margin = 2.0 * radius + CUT_BESIDE;
        let beside = if center > 0.0 { center - margin } else { center + margin };
        let inside = center.abs() + margin < 1.0 && radius < NARROW;
        let at = if inside { beside } else { piece.apex };
        let first = self.cut(index, at)?;
        // Where the cut lies along the chord, on either side of its size.
        let u = self.piece(index).coordinate(&self.stretches[first].longer);
        let part = if high < u.low() {
            first
        } else if low > u.high() {
            first + 1
        } else {
            return None;
        };
        self.enclose(part).then_some(part)
    }
}

impl<E> Piece<E> {
    /// Coordinate `u` of a point of its curve, in half chords from the middle.
    fn coordinate(&self, node: &Node<E>) -> Interval {
        let chord = self.half_chord_n.map(Interval::point);
        let offset = node.state.force_n - self.center_n.map(Interval::point);
        (offset.x * chord.x + offset.y * chord.y) / (chord.x.square() + chord.y.square())
    }

    /// Whether the points of the curve with these rest lengths belong to it.
    fn spans(&self, length_m: Interval) -> bool {
        length_m.low() >= self.shorter.state.rest_length_m.high()
            && length_m.high() <= self.longer.state.rest_length_m.low()
    }

    /// How large it is against its own force.
    fn relative_size(&self, least_n: f64) -> f64 {
        self.half_chord_n.norm() / (self.center_n.norm() + least_n)
    }
}

/// A box: the index of a piece of each cable.
type Box6 = [usize; CABLES];

/// What the search found.
pub(super) struct Found {
    pub(super) proofs: Vec<Proof>,
    pub(super) undecided: Vec<Place>,
    pub(super) boxes: usize,
    pub(super) pieces: usize,
}

/// The search at one pose.
pub(super) struct Search<'a, M: Provable> {
    problem: &'a Problem<M>,
    trees: Vec<Tree<'a, M>>,
    least_n: f64,
    found: Found,
}

impl<'a, M: Provable> Search<'a, M> {
    /// A search over the stretches between the given nodes.
    pub(super) fn new(problem: &'a Problem<M>, curves: Vec<(Curve<'a, M>, Piece<M::End>)>) -> Self {
        let trees = curves.into_iter().map(|(curve, root)| Tree::new(curve, root)).collect();
        let least_n = LEAST_FORCE * problem.balance.wrench_n().amax();
        let found = Found { proofs: Vec::new(), undecided: Vec::new(), boxes: 0, pieces: 0 };
        Self { problem, trees, least_n, found }
    }

    pub(super) fn run(mut self) -> Found {
        let mut stack: Vec<Box6> = vec![[0; CABLES]];
        while let Some(candidate) = stack.pop() {
            if self.found.boxes >= MAX_BOXES {
                self.give_up(&candidate);
                continue;
            }
            self.found.boxes += 1;
            self.treat(candidate, &mut stack);
        }
        self.found.pieces = self
            .trees
            .iter()
            .map(|t| t.stretches.iter().filter(|s| s.piece.is_some()).count())
            .sum();
        self.found
    }

    fn pieces(&self, candidate: &Box6) -> [&Piece<M::End>; CABLES] {
        std::array::from_fn(|i| self.trees[i].piece(candidate[i]))
    }

    fn treat(&mut self, candidate: Box6, stack: &mut Vec<Box6>) {
        let wrench_n = self.problem.balance.wrench_n();
        let pieces = self.pieces(&candidate);
        let Some(mut ranges) = narrow(&pieces, wrench_n) else { return };
        let verdict = examine(&pieces, wrench_n);
        if let Some(verdict) = &verdict {
            match verdict.narrow(&ranges) {
                Some(narrowed) => ranges = narrowed,
                None => return,
            }
        }
        if let Some(verdict) = &verdict
            && verdict.is_unique()
            && self.settle(&candidate, verdict)
        {
            return;
        }
        // Parts that hold no solution can be left out at once.
        let mut smaller = candidate;
        for k in 0..CABLES {
            if let Some(part) = self.trees[k].part_around(candidate[k], ranges[k]) {
                smaller[k] = part;
            }
        }
        if smaller != candidate {
            stack.push(smaller);
            return;
        }
        let Some(verdict) = verdict else { return self.cut_largest(candidate, stack) };
        let share =
            if verdict.radius.max() > 0.5 { verdict.thickness_share } else { verdict.slope_share };
        self.cut_by(candidate, &share, stack);
    }

    /// Cuts the piece that is thickest in newtons.
    fn cut_largest(&mut self, candidate: Box6, stack: &mut Vec<Box6>) {
        let pieces = self.pieces(&candidate);
        let thickness =
            Vector6::from_fn(|i, _| pieces[i].thickness * pieces[i].half_chord_n.norm());
        self.cut_by(candidate, &thickness, stack);
    }

    /// Cuts the piece with the largest share that can be cut; gives up when there is none.
    fn cut_by(&mut self, candidate: Box6, share: &Vector6<f64>, stack: &mut Vec<Box6>) {
        let mut order: [usize; CABLES] = std::array::from_fn(|i| i);
        order.sort_by(|&i, &j| share[j].total_cmp(&share[i]));
        for k in order {
            if self.trees[k].piece(candidate[k]).relative_size(self.least_n) < LEAST_PIECE {
                continue;
            }
            if let Some(halves) = self.trees[k].halves(candidate[k]) {
                for part in halves {
                    let mut half = candidate;
                    half[k] = part;
                    stack.push(half);
                }
                return;
            }
        }
        self.give_up(&candidate);
    }

    fn give_up(&mut self, candidate: &Box6) {
        let mut place = Place::of(&self.pieces(candidate));
        // Neighbours are one place, also those that only this one connects.
        let places = &mut self.found.undecided;
        while let Some(known) = places.iter().position(|known| known.touches(&place)) {
            place = place.hull(&places.swap_remove(known));
        }
        self.found.undecided.push(place);
    }

    /// Finds the solution of a box that has at most one and proves it; whether the box is settled.
    fn settle(&mut self, candidate: &Box6, verdict: &Verdict) -> bool {
        let pieces = self.pieces(candidate);
        let start: [CableState<f64>; CABLES] = std::array::from_fn(|k| {
            let piece = pieces[k];
            let u = verdict.center[k].clamp(-1.0, 1.0);
            let (a, b) = (piece.shorter.near.rest_length_m, piece.longer.near.rest_length_m);
            CableState {
                force_n: piece.center_n + piece.half_chord_n * u,
                rest_length_m: a + (b - a) * 0.5 * (1.0 + u),
            }
        });
        let Problem { robot, balance, .. } = self.problem;
        let Ok(converged) = newton::converge(robot, balance, &start, CONVERGED, NEWTON_STEPS)
        else {
            return false;
        };
        let solution = converged.step.states;
        let far = |k: usize| {
            let offset = solution[k].force_n - pieces[k].center_n;
            let u = offset.dot(&pieces[k].half_chord_n) / pieces[k].half_chord_n.norm_squared();
            u.abs() > NEAR
        };
        if (0..CABLES).any(far) {
            return false;
        }
        let known = |states: &_| {
            let known = self.found.proofs.iter().find(|proof| proof.holds(states))?;
            Some(self.covers(candidate, known))
        };
        if let Some(settled) = known(&solution) {
            return settled;
        }
        let Some(proof) = self.prove(&solution) else { return false };
        // Newton's method may have stopped too far from a known solution to see that it is one.
        if let Some(settled) = known(&proof.states()) {
            return settled;
        }
        // What might be a known solution must not count as another.
        let place = |proof: &Proof| Place { states: proof.enclosure() };
        if self.found.proofs.iter().any(|known| place(known).touches(&place(&proof))) {
            return false;
        }
        let settled = self.covers(candidate, &proof);
        if settled {
            self.found.proofs.push(proof);
        }
        settled
    }

    /// Whether a box, extended to the solution of `proof` where that lies outside, has at most one
    /// solution, which is this one then.
    fn covers(&self, candidate: &Box6, proof: &Proof) -> bool {
        let mut extended = self.pieces(candidate).map(|p| *p);
        let mut changed = false;
        for (k, node) in proof.nodes.iter().enumerate() {
            let length = node.state.rest_length_m;
            if extended[k].spans(length) {
                continue;
            }
            changed = true;
            let curve = &self.trees[k].curve;
            let (mut shorter, mut longer) = (extended[k].shorter, extended[k].longer);
            // A point of the curve beyond the solution, as far from it as its enclosure needs, and
            // beyond the end that it takes the place of.
            let beyond = |towards: f64, reaches: &dyn Fn(Interval) -> bool| {
                BEYOND_SOLUTION
                    .iter()
                    .filter_map(|part| {
                        let step_n = towards * part * proof.radii_n[k];
                        curve.beside(&node.near, node.tangent, step_n)
                    })
                    .find(|end| reaches(end.state.rest_length_m))
            };
            let (first, last) = (shorter.state.rest_length_m, longer.state.rest_length_m);
            if first.high() > length.low() {
                let bound = first.low().min(length.low());
                let Some(end) = beyond(-1.0, &|l| l.high() <= bound) else { return false };
                shorter = end;
            }
            if last.low() < length.high() {
                let bound = last.high().max(length.high());
                let Some(end) = beyond(1.0, &|l| l.low() >= bound) else { return false };
                longer = end;
            }
            let Some(piece) = curve.piece(shorter, longer) else { return false };
            extended[k] = piece;
        }
        if !changed {
            return true;
        }
        let pieces = std::array::from_fn(|k| &extended[k]);
        examine(&pieces, self.problem.balance.wrench_n()).is_some_and(|v| v.is_unique())
    }

    /// Proves a solution in a small box of its own and encloses it.
    pub(super) fn prove(&self, solution: &[CableState<f64>; CABLES]) -> Option<Proof> {
        let wrench_n = self.problem.balance.wrench_n();
        let mut relative = PROOF_RADIUS;
        let mut proof = None;
        for _ in 0..PROOF_ATTEMPTS {
            proof = self.prove_within(solution, relative, wrench_n);
            if proof.is_some() {
                break;
            }
            relative *= PROOF_SHRINK;
        }
        let mut proof = proof?;
        // Where the curves bend much, a smaller box encloses the same solution better.
        for _ in 0..PROOF_ATTEMPTS {
            let found = proof.relative_radius();
            relative *= PROOF_SHRINK;
            if found < TIGHT || relative < 8.0 * found {
                break;
            }
            let Some(tighter) = self.prove_within(&proof.states(), relative, wrench_n) else {
                break;
            };
            proof.nodes = tighter.nodes;
        }
        Some(proof)
    }

    fn prove_within(
        &self,
        solution: &[CableState<f64>; CABLES],
        relative: f64,
        wrench_n: &Vector6<f64>,
    ) -> Option<Proof> {
        let mut pieces = Vec::with_capacity(CABLES);
        for (tree, state) in self.trees.iter().zip(solution) {
            let radius_n = relative * (state.force_n.norm() + self.least_n);
            let tangent = tree.curve.tangent(state)?;
            let shorter = tree.curve.beside(state, tangent, -radius_n)?;
            let longer = tree.curve.beside(state, tangent, radius_n)?;
            pieces.push(tree.curve.piece(shorter, longer)?);
        }
        let pieces: [&Piece<M::End>; CABLES] = std::array::from_fn(|k| &pieces[k]);
        let verdict = examine(&pieces, wrench_n)?;
        if !(verdict.is_unique() && verdict.maps_inside(&pieces)) {
            return None;
        }
        // Where on each piece the solution is, and from there its force and length.
        let mut nodes = Vec::with_capacity(CABLES);
        for k in 0..CABLES {
            let (piece, curve) = (pieces[k], &self.trees[k].curve);
            let size_n = piece.half_chord_n.norm();
            let axis = piece.half_chord_n / size_n;
            let u = verdict.center[k];
            let target_n = (piece.center_n + piece.half_chord_n * u).dot(&axis);
            let near = curve.approach(solution[k], axis, target_n)?;
            let left = target_n - near.force_n.dot(&axis);
            let radius_n = verdict.radius[k] * size_n;
            let rounding_n = 16.0 * f64::EPSILON * (near.force_n.amax() + size_n);
            let along = Interval::around(left, radius_n + rounding_n);
            let node = curve.node_along(near, axis, along)?;
            nodes.push(Node { near, tangent: axis, state: node.state, end: () });
        }
        Some(Proof {
            nodes: nodes.try_into().ok()?,
            radii_n: std::array::from_fn(|k| pieces[k].half_chord_n.norm()),
        })
    }
}

impl<M: Provable> Curve<'_, M> {
    /// A proven point of the curve about `step_n` further along it than `state`.
    pub(super) fn beside(
        &self,
        state: &CableState<f64>,
        tangent: Vector2<f64>,
        step_n: f64,
    ) -> Option<Node<M::End>> {
        let guess = CableState { force_n: state.force_n + tangent * step_n, ..*state };
        let target_n = state.force_n.dot(&tangent) + step_n;
        self.node(self.approach(guess, tangent, target_n)?)
    }
}
