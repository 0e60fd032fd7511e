//! The cell of a table that is nearest to a pose.

use super::{COORDINATES, MAX_DEPTH, Node, Plane, Table};
use crate::Real;

/// A place is taken so far inside of a cell, in parts of its sides, and so far before a plane, in units of its normal: far
/// more than is rounded.
const INSIDE: f64 = 1.0 / 8.0;

/// A pose, seen from a box.
struct View<T> {
    /// Its coordinates, and how many metres one in each counts for.
    at: [T; COORDINATES],
    unit_m: [T; COORDINATES],
    /// Where it is, the sides of the box from 0 to 1; and these sides.
    place: [T; COORDINATES],
    sides: [T; COORDINATES],
}

/// A box that is halved: where the pose is between its sides, and the node of the half that is still to be looked at, which
/// is never the root; 0 for none.
#[derive(Clone, Copy)]
struct Halved<T> {
    place: T,
    rest: u32,
    coordinate: u8,
    is_rest_upper: bool,
}

/// The coordinates of the best pose found, and the square of its distance, m^2.
struct Best<T> {
    at: Option<[T; COORDINATES]>,
    distance_sq: T,
}

impl<T: Real> View<T> {
    /// The square of the distance to a place in the box, m^2.
    fn distance_sq(&self, to: &[T; COORDINATES]) -> T {
        (0..COORDINATES).fold(T::zero(), |sum, k| {
            let way_m = (self.place[k] - to[k]) * self.sides[k] * self.unit_m[k];
            sum + way_m * way_m
        })
    }

    /// The nearest place that is so far inside of the box.
    fn nearest(&self, inside: T) -> [T; COORDINATES] {
        self.place.map(|t| t.max(inside).min(T::one() - inside))
    }

    /// Takes a place in a cell, before a plane if there is one, when it is nearer than the best.
    fn take(&self, plane: Option<&Plane>, best: &mut Best<T>) {
        let inside = T::constant(INSIDE);
        let mut near = self.nearest(inside);
        if let Some(plane) = plane {
            // Where it is beyond, on the way to the corner that is furthest before the plane.
            let corner = plane.normal.map(|n| if n > 0 { inside } else { T::one() - inside });
            let [here, there] = [&near, &corner].map(|place| plane.beyond(place) + inside);
            if there > T::zero() {
                return;
            }
            let share = if here > T::zero() { here / (here - there) } else { T::zero() };
            near = core::array::from_fn(|k| near[k] + (corner[k] - near[k]) * share);
        }
        let distance_sq = self.distance_sq(&near);
        if distance_sq < best.distance_sq {
            let at =
                core::array::from_fn(|k| self.at[k] + (near[k] - self.place[k]) * self.sides[k]);
            *best = Best { at: Some(at), distance_sq };
        }
    }

    /// Looks at a node of the tree: takes a cell, and tells of a box that is halved, and of the half to be looked at first.
    fn look(
        &self,
        table: &Table<'_>,
        index: usize,
        best: &mut Best<T>,
    ) -> Option<(Halved<T>, usize, bool)> {
        let is_nearer = self.distance_sq(&self.nearest(T::zero())) < best.distance_sq;
        match table.node(index).filter(|_| is_nearer)? {
            Node::Split { coordinate, lower, upper } => {
                let is_upper = *self.place.get(coordinate)? > T::constant(0.5); // the nearer one
                let (first, rest) = if is_upper { (upper, lower) } else { (lower, upper) };
                Some((self.halved(coordinate, rest, !is_upper)?, first, is_upper))
            }
            Node::Half { coordinate, is_upper, inside, .. } => {
                Some((self.halved(coordinate, 0, false)?, inside, is_upper))
            }
            Node::Trim { plane, inside } => {
                if let Some(Node::Cell { .. }) = table.node(inside) {
                    self.take(Some(&plane), best);
                }
                None
            }
            Node::Cell { .. } => {
                self.take(None, best);
                None
            }
            Node::Nothing(_) => None,
        }
    }

    fn halved(&self, coordinate: usize, rest: usize, is_rest_upper: bool) -> Option<Halved<T>> {
        Some(Halved {
            place: *self.place.get(coordinate)?,
            rest: u32::try_from(rest).ok()?,
            coordinate: u8::try_from(coordinate).ok()?,
            is_rest_upper,
        })
    }

    /// From a box that is halved to one of its halves.
    fn enter(&mut self, halved: &Halved<T>, is_upper: bool) {
        let upper = if is_upper { T::one() } else { T::zero() };
        self.move_to(halved, halved.place + halved.place - upper, T::constant(0.5));
    }

    /// And back.
    fn leave(&mut self, halved: &Halved<T>) {
        self.move_to(halved, halved.place, T::constant(2.0));
    }

    fn move_to(&mut self, halved: &Halved<T>, place: T, longer: T) {
        let k = usize::from(halved.coordinate);
        if let (Some(to), Some(side)) = (self.place.get_mut(k), self.sides.get_mut(k)) {
            *to = place;
            *side *= longer; // a power of two: exactly
        }
    }
}

impl Table<'_> {
    /// The coordinates of a pose in the cell that is nearest to coordinates `at`, and there about the nearest. A turn
    /// counts for as much as it moves what is `arm_m` away. `None` where a number is not finite or the table has no cell.
    ///
    /// Cost: some fifty operations for each node whose box is nearer than the best found so far, all nodes at most.
    #[cold]
    #[inline(never)] // its stack is free again when the way begins
    #[must_use]
    pub fn nearest<T: Real>(&self, at: &[T; COORDINATES], arm_m: T) -> Option<[T; COORDINATES]> {
        let unit_m = core::array::from_fn(|k| if k < 3 { T::one() } else { arm_m });
        let sides = self.extent().map(|side| T::constant(f64::from(side)));
        let mut view = View { at: *at, unit_m, place: self.place(at), sides };
        let mut best = Best { at: None, distance_sq: T::HUGE };
        let none = Halved { place: T::zero(), rest: 0, coordinate: 0, is_rest_upper: false };
        let (mut way, mut depth) = ([none; MAX_DEPTH], 0);
        let mut next = Some(0);
        // Each node is looked at once, and each box that is halved left once more.
        for _ in 0..self.words.saturating_mul(2) {
            let found = next.take().and_then(|index| view.look(self, index, &mut best));
            if let Some((halved, first, is_upper)) = found {
                let Some(end) = way.get_mut(depth) else { break }; // deeper than a table is
                *end = halved;
                depth += 1;
                view.enter(&halved, is_upper);
                next = Some(first);
                continue;
            }
            let Some(last) = depth.checked_sub(1).and_then(|last| way.get_mut(last)) else { break };
            view.leave(last);
            if last.rest > 0 {
                view.enter(last, last.is_rest_upper);
                next = Some(last.rest as usize);
                last.rest = 0;
            } else {
                depth -= 1;
            }
        }
        best.at
    }
}
