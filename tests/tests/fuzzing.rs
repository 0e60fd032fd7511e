//! What `fuzz/` does for hours, here for a moment: see `cdpr_tests::fuzzing`.

use cdpr_tests::{fuzzing, random_tests};
use proptest::collection::vec;
use proptest::prelude::*;

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
