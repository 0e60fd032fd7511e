//! As `controller.rs`, with `robot_file` in place of `controller`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cdpr_tests::fuzzing::robot_file(bytes));
