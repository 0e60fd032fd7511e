//! `cdpr-qemu MACHINE IMAGE`: the cargo runner of the firmware (see `.cargo/config.toml`).

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

/// The images run for seconds.
const LIMIT: Duration = Duration::from_mins(2);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [machine, image] = &arguments[..] else {
        eprintln!("usage: cdpr-qemu MACHINE IMAGE");
        return ExitCode::from(2);
    };
    match cdpr_qemu::run(machine, Path::new(image), LIMIT, |line| println!("{line}")) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cdpr-qemu: {error}");
            ExitCode::FAILURE
        }
    }
}
