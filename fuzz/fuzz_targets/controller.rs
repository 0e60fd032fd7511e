//! ```text
//! cargo fuzz run controller            # with nightly, or RUSTC_BOOTSTRAP=1
//! ```

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    cdpr_tests::fuzzing::tracker(bytes);
    cdpr_tests::fuzzing::controller(bytes);
});
