//! As `controller.rs`, with `table` in place of `controller`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cdpr_tests::fuzzing::table(bytes));
