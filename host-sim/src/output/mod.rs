//! The answer for one pose, for people and for programs.

mod json;
pub mod pen;
mod text;

pub use json::json;
pub use text::text;
