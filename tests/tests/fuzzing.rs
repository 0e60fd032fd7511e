//! What `fuzz/` does for hours, here for a moment: see `cdpr_tests::fuzzing`.

use std::fs;
use std::path::Path;

use cdpr_tests::{fuzzing, random_tests};
use proptest::collection::vec;
use proptest::prelude::*;

const TABLE: &[u8] = include_bytes!("../../fuzz/corpus/table/whole");
const ROBOT: &str = include_str!("../../host-sim/robots/marionet-crane.toml");

/// Runs what was found worth keeping: bytes that lead into all corners of the code.
fn replay(target: &str, least: usize, run: impl Fn(&[u8])) {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    let files: Vec<_> = fs::read_dir(corpus).unwrap().map(|file| file.unwrap().path()).collect();
    assert!(files.len() >= least, "{} files", files.len());
    for file in files {
        println!("{}", file.display()); // shown when it fails
        run(&fs::read(file).unwrap());
    }
}

fn control(bytes: &[u8]) {
    fuzzing::tracker(bytes);
    fuzzing::controller(bytes);
}

#[test]
fn corpus_is_safe() {
    replay("controller", 24, control);
    replay("table", 17, fuzzing::table);
    replay("robot_file", 19, fuzzing::robot_file);
}

/// A file with some bytes written over, and an end that may be cut off.
fn edited(whole: &[u8], edits: &[(prop::sample::Index, u8)], kept: prop::sample::Index) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for (at, new) in edits {
        bytes[at.index(whole.len())] = *new;
    }
    // Half of them are as long as they were.
    bytes.truncate(kept.index(2 * whole.len()));
    bytes
}

proptest! {
    #![proptest_config(random_tests(300))]

    #[test]
    fn any_bytes_are_safe(bytes in vec(any::<u8>(), 0..4000)) {
        control(&bytes);
        fuzzing::table(&bytes);
        fuzzing::robot_file(&bytes);
    }

    /// Ordinary numbers get further.
    #[test]
    fn tame_bytes_are_safe(bytes in vec(100_u8..152, 0..4000)) {
        control(&bytes);
    }

    #[test]
    fn damaged_tables_are_safe(
        edits in vec(any::<(prop::sample::Index, u8)>(), 0..40),
        kept in any::<prop::sample::Index>(),
    ) {
        fuzzing::table(&edited(TABLE, &edits, kept));
    }

    #[test]
    fn damaged_robot_files_are_safe(
        // What numbers, names and tables are made of.
        edits in vec((any::<prop::sample::Index>(), prop::sample::select(b"0123456789.-+e_[]{},=\"#\nnaif".to_vec())), 0..6),
        kept in any::<prop::sample::Index>(),
    ) {
        fuzzing::robot_file(&edited(ROBOT.as_bytes(), &edits, kept));
    }
}
