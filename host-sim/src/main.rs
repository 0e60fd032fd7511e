//! The command `cdpr`.
fn main() {}
