//! ```text
//! mkdir -p fuzz/found
//! cargo +nightly fuzz run controller fuzz/found fuzz/corpus/controller     # or RUSTC_BOOTSTRAP=1
//! ```
//!
//! What is found goes to the first folder; the second is kept, and replayed by the tests.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    cdpr_tests::fuzzing::tracker(bytes);
    cdpr_tests::fuzzing::controller(bytes);
});
