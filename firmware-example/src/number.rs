//! The number type of the images, and its bits.

use cdpr_core::winch::Countable;

/// The number type of the images: single precision, for a Cortex-M4F.
#[cfg(not(feature = "f64"))]
pub type Float = f32;
/// The number type of the images: double precision, for a Cortex-M7.
#[cfg(feature = "f64")]
pub type Float = f64;

/// A real number whose bits can be told, so that two machines can be compared.
pub trait Number: Countable {
    /// The bits.
    fn bits(self) -> u64;
}

impl Number for f32 {
    fn bits(self) -> u64 {
        self.to_bits().into()
    }
}

impl Number for f64 {
    fn bits(self) -> u64 {
        self.to_bits()
    }
}
