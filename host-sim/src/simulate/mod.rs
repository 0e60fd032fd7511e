//! A controller and the plant that it drives, period by period.

pub mod firmware;
