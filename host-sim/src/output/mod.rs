//! The answer for one pose, for people and for programs.

pub mod diagram;
mod json;
pub mod pen;
mod text;

pub use json::json;
pub use text::text;
