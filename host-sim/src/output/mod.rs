//! Answers for people and for programs: for one pose, over a parameter, of a run.

mod axis;
pub mod diagram;
mod json;
pub mod pen;
pub mod run;
pub mod shapes;
mod text;

pub use json::json;
pub use text::text;
pub(crate) use text::{counted, heading, plain, sign, significant, why_degrees_differ};
