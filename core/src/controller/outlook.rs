//! Limits of the cables that the present speed leads beyond before the platform could halt.

use nalgebra::Vector2;

use crate::{CABLES, CableLimits, Command, Fault, Real, Scalar};

/// What is limited in each cable, at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outlook<T>([Cable<T>; CABLES]);

#[derive(Clone, Copy, Debug, PartialEq)]
struct Cable<T> {
    rest_length_m: T,
    /// Squares of tensions spare the roots; a tension that changes evenly lies above their line, by
    /// the square of its change.
    highest_n2: T,
    anchor_n2: T,
}

impl<T: Real> Outlook<T> {
    pub(super) fn of(command: &Command<T>) -> Self {
        Self(command.cables.map(|cable| {
            let anchor_n2 = norm_sq(&cable.anchor_force_n);
            Cable {
                rest_length_m: cable.rest_length_m,
                highest_n2: norm_sq(&cable.force_n).max(anchor_n2),
                anchor_n2,
            }
        }))
    }

    /// The limit that is passed within `ticks` if everything goes on as in the tick since `self`.
    pub(super) fn fault(
        &self,
        now: &Self,
        limits: &[CableLimits<T>; CABLES],
        ticks: T,
    ) -> Option<Fault<T>> {
        let ahead = |then: T, now: T| (now + (now - then) * ticks).max(T::zero());
        (0..CABLES).find_map(|cable| {
            let (then, now, limit) = (&self.0[cable], &now.0[cable], &limits[cable]);
            let rest_length_m = ahead(then.rest_length_m, now.rest_length_m);
            let highest_n2 = ahead(then.highest_n2, now.highest_n2);
            let anchor_n2 = ahead(then.anchor_n2, now.anchor_n2);
            if rest_length_m > limit.longest_m || rest_length_m < limit.shortest_m {
                Some(Fault::LengthBeyondWinch { cable, rest_length_m })
            } else if highest_n2 > limit.highest_tension_n * limit.highest_tension_n {
                Some(Fault::TensionAbove { cable, tension_n: highest_n2.sqrt() })
            } else if anchor_n2 < limit.lowest_tension_n * limit.lowest_tension_n {
                Some(Fault::TensionBelow { cable, tension_n: anchor_n2.sqrt() })
            } else {
                None
            }
        })
    }
}

fn norm_sq<T: Scalar>(force_n: &Vector2<T>) -> T {
    force_n.x * force_n.x + force_n.y * force_n.y
}
