//! All branches over a parameter: as tables, as JSON, and as a picture.

mod json;
mod plot;
mod text;

pub use json::json;
pub use plot::svg;
pub use text::text;

use crate::branches::BranchPoint;

/// The longest cable of a point, counted from 0, and its rest length, m.
fn longest(point: &BranchPoint) -> (usize, f64) {
    point.states.iter().map(|state| state.rest_length_m).enumerate().fold(
        (0, 0.0),
        |longest, (cable, length_m)| {
            if length_m > longest.1 { (cable, length_m) } else { longest }
        },
    )
}
