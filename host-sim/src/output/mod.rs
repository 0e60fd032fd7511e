//! Answers for people and for programs: for one pose, over a parameter, of a run.

mod axis;
pub mod diagram;
mod json;
pub mod pen;
pub mod run;
mod text;

pub use json::json;
pub use text::text;
