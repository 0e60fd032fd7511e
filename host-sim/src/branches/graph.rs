//! Paths from start values to the next ones, and how they join to branches.
//!
//! The start values cut the range into cells. Each solution at a start value is followed through the
//! cell below and the cell above, over folds, until it lands on a start value again, where it must be
//! one of the solutions there. So every solution lies on one path below and one above, no path is
//! followed twice, and a closed curve ends where it began.

use cdpr_core::{CABLES, CableState};

use super::Doubt;
use crate::continuation::{
    Accuracy, End, Homotopy, Path, Point, SIGMA, System, Waypoint, converge, follow, same_states,
};

/// The longest step is divided by this, so that a drawing of the points looks smooth.
const CAUTION: f64 = 16.0;
/// By how much more when two paths have arrived at one solution.
const MORE_CAUTION: f64 = 8.0;
/// Bound on the paths, should solutions appear without end that the start values do not know.
const MAX_PATHS: usize = 2000;
/// The tangent at a fold turns within this part of its unit length, else the fold is in doubt.
const FOLD_TURN: f64 = 1e-6;

/// A solution and the cables that hang exactly vertically in it.
pub(super) type Start = ([CableState<f64>; CABLES], [bool; CABLES]);

/// The two sides of a start value.
const BELOW: usize = 0;
const ABOVE: usize = 1;

/// A solution at a start value.
struct Node {
    point: Point,
    vertical: [bool; CABLES],
    /// Whether it was among the solutions there, or was found by following another one.
    is_start: bool,
    /// The pieces that lead to it from either side.
    pieces: [Option<usize>; 2],
}

/// Where a piece ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tip {
    /// At a solution of a start value: which value, which solution.
    Node(usize, usize),
    /// At a fold.
    Fold(usize),
    /// The tension of this cable grew without bound.
    RanAway(usize),
    /// At a singular point that is no fold.
    Stalled,
    /// At a solution where another piece has ended already.
    Doubtful,
}

/// A path, or the part of it between two folds, with `sigma` rising.
struct Piece {
    waypoints: Vec<Waypoint>,
    low: Tip,
    high: Tip,
}

/// Pieces joined at the start values: a smooth stretch of solutions, with `sigma` rising.
pub(super) struct Chain {
    pub(super) waypoints: Vec<Waypoint>,
    /// A [`Tip::Node`] is an end of the range.
    pub(super) low: Tip,
    /// The same above.
    pub(super) high: Tip,
}

/// Solutions at the start values and the paths between them.
pub(super) struct Graph<'a, H> {
    homotopy: &'a H,
    /// Logarithms of the start values, rising.
    sigmas: &'a [f64],
    nodes: Vec<Vec<Node>>,
    pieces: Vec<Piece>,
    /// Where pieces meet.
    pub(super) folds: Vec<Point>,
    /// What went wrong.
    pub(super) doubts: Vec<Doubt>,
}

impl<'a, H: Homotopy> Graph<'a, H> {
    /// Follows the solutions `starts` of each of `sigmas`.
    pub(super) fn trace(homotopy: &'a H, sigmas: &'a [f64], starts: &[Vec<Start>]) -> Self {
        let nodes = sigmas.iter().map(|_| Vec::new()).collect();
        let (pieces, folds, doubts) = (Vec::new(), Vec::new(), Vec::new());
        let mut graph = Self { homotopy, sigmas, nodes, pieces, folds, doubts };
        for (value, starts) in starts.iter().enumerate() {
            for start in starts {
                graph.add_start(value, start);
            }
        }
        let mut paths = 0;
        while let Some((value, node, side)) = graph.next_open() {
            if paths == MAX_PATHS {
                graph.doubts.push(Doubt::TooManyPaths);
                break;
            }
            paths += 1;
            graph.follow_from(value, node, side);
        }
        graph
    }

    /// Numbers of solutions at a start value: known there, and followed through it.
    pub(super) fn counts(&self, value: usize) -> (usize, usize) {
        let nodes = &self.nodes[value];
        (nodes.iter().filter(|node| node.is_start).count(), nodes.len())
    }

    /// Sum of the signs of the solutions followed through a start value.
    pub(super) fn degree(&self, value: usize) -> i32 {
        let sign = |node: &Node| {
            let system = System { homotopy: self.homotopy, vertical: node.vertical };
            system
                .eliminate_tangents(&node.point)
                .map_or(0, |elimination| if elimination.is_positive() { 1 } else { -1 })
        };
        self.nodes[value].iter().map(sign).sum()
    }

    fn add_start(&mut self, value: usize, (states, vertical): &Start) {
        let system = System { homotopy: self.homotopy, vertical: *vertical };
        let start = Point { states: *states, sigma: self.sigmas[value] };
        match converge(&system, &start, SIGMA, Accuracy::Full) {
            Some(point) if same_states(&point.states, states) => {
                let (vertical, pieces) = (*vertical, [None; 2]);
                self.nodes[value].push(Node { point, vertical, is_start: true, pieces });
            }
            _ => self.doubts.push(Doubt::StartLost { start_value: value }),
        }
    }

    /// A solution of a start value whose path on one side is not known yet.
    fn next_open(&self) -> Option<(usize, usize, usize)> {
        let last = self.sigmas.len() - 1;
        self.nodes.iter().enumerate().find_map(|(value, nodes)| {
            nodes.iter().enumerate().find_map(|(index, node)| {
                let open = |&side: &usize| {
                    let outwards = value == if side == BELOW { 0 } else { last };
                    !outwards && node.pieces[side].is_none()
                };
                [BELOW, ABOVE].iter().find(|side| open(side)).map(|&side| (value, index, side))
            })
        })
    }

    /// Follows a solution to one side, to the start value where it lands.
    fn follow_from(&mut self, value: usize, index: usize, side: usize) {
        let cell = if side == BELOW { value - 1 } else { value };
        let range = (self.sigmas[cell], self.sigmas[cell + 1]);
        let from = &self.nodes[value][index];
        let (point, vertical) = (from.point.clone(), from.vertical);
        let mut caution = CAUTION;
        loop {
            let system = System { homotopy: self.homotopy, vertical };
            let path = follow(system, point.clone(), range, side == ABOVE, caution);
            let (arrival, is_taken) = match &path.end {
                End::Top(point) => self.arrive(cell + 1, BELOW, point, path.vertical),
                End::Bottom(point) => self.arrive(cell, ABOVE, point, path.vertical),
                End::RanAway { cable, .. } => (Tip::RanAway(*cable), false),
                End::Stalled { .. } => (Tip::Stalled, false),
            };
            let start = Tip::Node(value, index);
            if !is_taken && arrival != start {
                return self.add_path(path, start, side, arrival);
            }
            if caution > CAUTION {
                self.doubts.push(Doubt::TwoPathsAtOne { start_value: value });
                return self.add_path(path, start, side, Tip::Doubtful);
            }
            caution *= MORE_CAUTION;
        }
    }

    /// The solution of a start value where a path has landed, coming from `side`, and whether another
    /// path has come from there before.
    fn arrive(
        &mut self,
        value: usize,
        side: usize,
        point: &Point,
        vertical: [bool; CABLES],
    ) -> (Tip, bool) {
        let nodes = &mut self.nodes[value];
        let known = nodes.iter().position(|node| same_states(&node.point.states, &point.states));
        let index = known.unwrap_or_else(|| {
            let pieces = [None; 2];
            nodes.push(Node { point: point.clone(), vertical, is_start: false, pieces });
            nodes.len() - 1
        });
        (Tip::Node(value, index), nodes[index].pieces[side].is_some())
    }

    /// Cuts a path at its folds.
    fn add_path(&mut self, path: Path, start: Tip, side: usize, arrival: Tip) {
        let mut waypoints = Vec::new();
        let (mut from, mut rises) = (start, side == ABOVE);
        for waypoint in path.waypoints {
            let is_fold = waypoint.is_fold;
            waypoints.push(waypoint.clone());
            if is_fold {
                let to = Tip::Fold(self.folds.len());
                if waypoint.along[SIGMA].abs() > FOLD_TURN {
                    self.doubts.push(Doubt::FoldNotLocated { value: waypoint.point.sigma.exp() });
                }
                self.folds.push(waypoint.point.clone());
                self.add_piece(std::mem::replace(&mut waypoints, vec![waypoint]), from, to, rises);
                (from, rises) = (to, !rises);
            }
        }
        self.add_piece(waypoints, from, arrival, rises);
    }

    fn add_piece(&mut self, mut waypoints: Vec<Waypoint>, from: Tip, to: Tip, rises: bool) {
        let index = self.pieces.len();
        let (mut low, mut high) = (from, to);
        if !rises {
            waypoints.reverse();
            (low, high) = (to, from);
        }
        for (tip, side) in [(low, ABOVE), (high, BELOW)] {
            if let Tip::Node(value, node) = tip {
                self.nodes[value][node].pieces[side] = Some(index);
            }
        }
        self.pieces.push(Piece { waypoints, low, high });
    }

    /// The pieces joined at the start values.
    pub(super) fn chains(&self) -> Vec<Chain> {
        let joined = |tip: Tip, side: usize| match tip {
            Tip::Node(value, node) => self.nodes[value][node].pieces[side],
            _ => None,
        };
        let last = self.sigmas.len() - 1;
        let end = |tip: Tip| match tip {
            Tip::Node(value, _) if value != 0 && value != last => Tip::Doubtful,
            tip => tip,
        };
        let first = self.pieces.iter().filter(|piece| joined(piece.low, BELOW).is_none());
        first
            .map(|first| {
                let mut waypoints = first.waypoints.clone();
                let mut high = first.high;
                while let Some(next) = joined(high, ABOVE) {
                    let piece = &self.pieces[next];
                    // The solution where they join is the end of both.
                    waypoints.extend_from_slice(&piece.waypoints[1..]);
                    high = piece.high;
                }
                Chain { waypoints, low: end(first.low), high: end(high) }
            })
            .collect()
    }
}
