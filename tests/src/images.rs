//! The firmware images, built as the aliases of `.cargo/config.toml` build them.

use std::path::PathBuf;
use std::process::{Command, Output};

/// Images for one machine.
#[derive(Clone, Copy, Debug)]
pub struct Images {
    /// What QEMU calls the machine.
    pub machine: &'static str,
    /// What cargo is told besides the image.
    arguments: &'static [&'static str],
}

/// Cortex-M4F, f32.
pub const M4F_F32: Images = Images { machine: "mps2-an386", arguments: &["--release"] };

/// Cortex-M7, f64.
pub const M7_F64: Images = Images {
    machine: "mps2-an500",
    arguments: &[
        "--profile=m7",
        "--features=f64",
        "--config=target.thumbv7em-none-eabihf.rustflags=['-Ctarget-cpu=cortex-m7']",
    ],
};

impl Images {
    /// Builds the image `bin` and tells where it is.
    ///
    /// # Panics
    /// When it does not build.
    #[must_use]
    pub fn build(&self, bin: &str) -> PathBuf {
        let mut arguments = vec!["build", "--package=cdpr-firmware-example", "--bin", bin];
        arguments.extend(["--target=thumbv7em-none-eabihf", "--message-format=json"]);
        arguments.extend(self.arguments);
        let Output { status, stdout, stderr } = cargo(&arguments);
        assert!(status.success(), "{bin}: {}", String::from_utf8_lossy(&stderr));
        String::from_utf8_lossy(&stdout)
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
            .find_map(|message| message["executable"].as_str().map(PathBuf::from))
            .expect("no image was built")
    }
}

/// Runs cargo at the root of the workspace, where `.cargo/config.toml` is found.
///
/// # Panics
/// When there is none.
#[must_use]
pub fn cargo(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO"))
        .args(arguments)
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .output()
        .unwrap()
}
