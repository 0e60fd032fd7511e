//! Runs a Cortex-M image in QEMU and decodes its log, which leaves the image by semihosting as
//! `defmt` frames: [`run`] until the image ends, [`Serving`] with its serial line in the caller's hands.

mod serving;

use std::ffi::OsString;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use defmt_decoder::{DecodeError, Table};

pub use serving::Serving;

/// Why an image did not run to a good end.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The image cannot be read.
    #[error("{}: {source}", path.display())]
    Image {
        /// Where it should be.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// QEMU cannot be started, or its output not be read.
    #[error("qemu-system-arm: {0} (Debian: apt-get install qemu-system-arm)")]
    Qemu(#[from] io::Error),
    /// The image has no table of log messages, or a wrong one.
    #[error("no table of log messages: {0}")]
    Table(String),
    /// What came out is no log.
    #[error("a log frame is malformed")]
    Malformed,
    /// The image says that it has failed, or QEMU does.
    #[error("failed: {0}")]
    Failed(ExitStatus),
    /// The image had not ended after the time allowed.
    #[error("stopped after {0:?}")]
    TimedOut(Duration),
    /// QEMU ended before it opened the serial line; on standard error it has said why.
    #[error("qemu-system-arm does not start (Debian: apt-get install qemu-system-arm)")]
    NotStarted,
}

const QEMU: &str = "qemu-system-arm";

/// What QEMU is told, `serial` being where the first serial line goes.
fn arguments(machine: &str, image: &Path, serial: &str) -> Vec<OsString> {
    let mut arguments: Vec<OsString> =
        ["-machine", machine, "-display", "none", "-monitor", "none", "-serial", serial]
            .into_iter()
            .chain(["-semihosting-config", "enable=on,target=native", "-kernel"])
            .map(OsString::from)
            .collect();
    arguments.push(image.into());
    arguments
}

/// The log messages of an image.
fn log_messages(image: &Path) -> Result<Table, Error> {
    let elf = std::fs::read(image).map_err(|source| Error::Image { path: image.into(), source })?;
    Table::parse(&elf)
        .map_err(|error| Error::Table(error.to_string()))?
        .ok_or_else(|| Error::Table("the image does not log".into()))
}

/// Runs `image` on QEMU's `machine` (`mps2-an386`: Cortex-M4F, `mps2-an500`: Cortex-M7) for at most
/// `limit` and hands each line of its log to `on_line`.
///
/// Every instruction takes 2^6 ns of the machine's own time (`-icount shift=6`): every run is the same,
/// and timers of 25 MHz, 1.6 periods an instruction, count instructions.
///
/// # Errors
/// [`Error`], also when the image ends with failure; lines until then have been handed over.
pub fn run(
    machine: &str,
    image: &Path,
    limit: Duration,
    mut on_line: impl FnMut(&str),
) -> Result<(), Error> {
    let table = log_messages(image)?;
    let mut child = Command::new(QEMU)
        .args(arguments(machine, image, "none"))
        .args(["-icount", "shift=6,align=off,sleep=off"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()?;
    let stdout = child.stdout.take();

    // The output ends when QEMU does, or when the watchdog ends QEMU.
    let (done, is_done) = mpsc::channel::<()>();
    let watchdog = thread::spawn(move || match is_done.recv_timeout(limit) {
        Err(mpsc::RecvTimeoutError::Timeout) => {
            child.kill()?;
            child.wait().map(|_| None)
        }
        _ => child.wait().map(Some),
    });
    let printed = stdout.map_or(Ok(()), |stdout| print(&table, stdout, &mut on_line));
    drop(done);
    let status = watchdog.join().map_err(|_| io::Error::other("the watchdog died"))??;
    printed?;
    match status {
        None => Err(Error::TimedOut(limit)),
        Some(status) if status.success() => Ok(()),
        Some(status) => Err(Error::Failed(status)),
    }
}

/// Decodes all of `log`, also behind a malformed frame.
fn print(table: &Table, mut log: impl Read, on_line: &mut impl FnMut(&str)) -> Result<(), Error> {
    let mut decoder = table.new_stream_decoder();
    let mut buffer = [0; 4096];
    let mut outcome = Ok(());
    loop {
        let n = log.read(&mut buffer)?;
        if n == 0 {
            return outcome;
        }
        decoder.received(&buffer[..n]);
        loop {
            match decoder.decode() {
                Ok(frame) => on_line(&frame.display(false).to_string()),
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => {
                    outcome = Err(Error::Malformed);
                    // Frames of the raw encoding have no ends by which to find the next one.
                    if !table.encoding().can_recover() {
                        return outcome;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_here(image: &Path) -> Result<(), Error> {
        run("mps2-an386", image, Duration::from_mins(1), |line| panic!("{line}"))
    }

    #[test]
    fn refuses_what_is_no_image() {
        let outcome = run_here(Path::new("no/such/image"));
        assert!(matches!(outcome, Err(Error::Image { .. })), "{outcome:?}");
        // This program is an ELF file, but it does not log.
        let outcome = run_here(&std::env::current_exe().unwrap());
        assert!(matches!(outcome, Err(Error::Table(_))), "{outcome:?}");
    }
}
