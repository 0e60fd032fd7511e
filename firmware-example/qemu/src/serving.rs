//! An image that serves a serial line.

use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::Duration;

use crate::{Error, QEMU, arguments, log_messages, print};

/// Runs its arguments until its input ends, which it does when this process does, however that comes about.
const GUARD: &str = "\"$@\" </dev/null & exec >&- 2>&-; read -r _; kill -KILL $!; wait";

/// How often it is looked whether QEMU has opened the line.
const LOOK: Duration = Duration::from_millis(5);

/// An image that runs in QEMU, and its serial line: what is written the image receives, what is read it has
/// sent. QEMU ends with this value, and with this process.
///
/// Reading waits for a byte as long as `patience` says and fails then with [`ErrorKind::WouldBlock`]; it finds
/// the end when the image has ended.
#[derive(Debug)]
pub struct Serving {
    line: UnixStream,
    log: Receiver<String>,
    _guard: Guard,
}

impl Serving {
    /// Starts `image` on QEMU's `machine` (as for [`run`](crate::run)). Time in the machine is that on the
    /// wall, and its instructions are not counted: to count them makes a byte on the line cost twice as much.
    ///
    /// # Errors
    /// [`Error`] of an image that does not log, or when QEMU does not start.
    pub fn launch(machine: &str, image: &Path, patience: Duration) -> Result<Self, Error> {
        let table = log_messages(image)?;
        let folder = tempfile::tempdir()?; // only until both ends of the line are open
        let socket = folder.path().join("line");
        let listener = UnixListener::bind(&socket)?;
        listener.set_nonblocking(true)?;
        let mut guard = Guard(
            Command::new("sh")
                .args(["-c", GUARD, "sh", QEMU])
                .args(arguments(machine, image, "chardev:line"))
                .arg("-chardev")
                .arg(format!("socket,id=line,path={}", socket.display()))
                .stdin(Stdio::piped())
                .stdout(Stdio::piped())
                .spawn()?,
        );
        // Read as it comes: a full pipe would stop QEMU.
        let (sender, log) = mpsc::channel();
        let stdout = guard.0.stdout.take().ok_or_else(|| io::Error::other("no output"))?;
        let reader = thread::spawn(move || {
            // Nobody may want the log any more.
            print(&table, stdout, &mut |line| drop(sender.send(line.to_owned())))
        });
        let line = loop {
            match listener.accept() {
                Ok((line, _)) => break line,
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error.into()),
            }
            if reader.is_finished() {
                return Err(Error::NotStarted);
            }
            thread::sleep(LOOK);
        };
        line.set_nonblocking(false)?;
        line.set_read_timeout(Some(patience))?;
        Ok(Self { line, log, _guard: guard })
    }

    /// What the image has logged since this was last asked.
    pub fn log(&self) -> impl Iterator<Item = String> {
        self.log.try_iter()
    }
}

impl Read for Serving {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.line.read(buffer)
    }
}

impl Write for Serving {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.line.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.line.flush()
    }
}

/// The shell that ends QEMU.
#[derive(Debug)]
struct Guard(Child);

impl Drop for Guard {
    fn drop(&mut self) {
        drop(self.0.stdin.take());
        let _ = self.0.wait(); // a moment: it has no more to do
    }
}
