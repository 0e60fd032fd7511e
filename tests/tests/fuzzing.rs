//! What `fuzz/` does for hours, here for a moment: see `cdpr_tests::fuzzing`.

use std::fs;
use std::path::Path;

use cdpr_tests::{fuzzing, random_tests};
use proptest::collection::vec;
use proptest::prelude::*;

/// What the fuzzer found worth keeping: bytes that lead into all corners of the code.
#[test]
fn corpus_is_safe() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus/controller");
    let files: Vec<_> = fs::read_dir(corpus).unwrap().map(|file| file.unwrap().path()).collect();
    assert!(files.len() >= 24, "{} files", files.len());
    for file in files {
        println!("{}", file.display()); // shown when it fails
        let bytes = fs::read(file).unwrap();
        fuzzing::tracker(&bytes);
        fuzzing::controller(&bytes);
    }
}

proptest! {
    #![proptest_config(random_tests(300))]

    #[test]
    fn any_bytes_are_safe(bytes in vec(any::<u8>(), 0..4000)) {
        fuzzing::tracker(&bytes);
        fuzzing::controller(&bytes);
    }

    /// Ordinary numbers get further.
    #[test]
    fn tame_bytes_are_safe(bytes in vec(100_u8..152, 0..4000)) {
        fuzzing::tracker(&bytes);
        fuzzing::controller(&bytes);
    }
}
