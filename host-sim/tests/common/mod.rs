//! What all tests of the command need.
#![allow(dead_code)] // each test takes what it needs

use std::fs;
use std::process::{Child, Command as Process, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use tempfile::TempDir;

pub(crate) const CDPR: &str = env!("CARGO_BIN_EXE_cdpr");

pub(crate) fn cdpr<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Assert {
    Command::new(CDPR).args(arguments).assert()
}

pub(crate) fn stdout(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).expect("UTF-8")
}

pub(crate) fn stderr(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).expect("UTF-8")
}

/// Bad input: exit code 2, nothing on stdout, and a message that holds all of `parts`.
pub(crate) fn assert_refused<S: AsRef<std::ffi::OsStr>>(arguments: &[S], parts: &[&str]) {
    let assert = cdpr(arguments).code(2).stdout("");
    let message = stderr(&assert);
    for part in parts {
        assert!(message.contains(part), "{part:?} not in {message:?}");
    }
}

/// A folder, and paths in it.
pub(crate) struct Folder(pub(crate) TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(TempDir::new().expect("a folder"))
    }

    pub(crate) fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().expect("UTF-8").to_owned()
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> String {
        let path = self.path(name);
        fs::write(&path, bytes).expect("a temporary file");
        path
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).expect("a file")
    }

    /// Names of all files.
    pub(crate) fn names(&self) -> Vec<String> {
        let files = fs::read_dir(self.0.path()).expect("the folder");
        let name = |file: fs::DirEntry| file.file_name().into_string().expect("UTF-8");
        let mut names: Vec<_> = files.map(|file| name(file.expect("an entry"))).collect();
        names.sort();
        names
    }
}

pub(crate) fn lines(bytes: &[u8]) -> usize {
    bytes.split(|byte| *byte == b'\n').count() - 1
}

/// Whole lines of a file, which need not be there.
pub(crate) fn lines_of(path: &str) -> usize {
    fs::read(path).map_or(0, |bytes| lines(&bytes))
}

/// Starts the program without a place to write to.
pub(crate) fn start(arguments: &[&str]) -> Child {
    Process::new(CDPR)
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts")
}

/// Starts the program and kills it as soon as `journal` has so many lines; whether it was faster.
pub(crate) fn killed_at(arguments: &[&str], journal: &str, wanted: usize) -> bool {
    let mut child = start(arguments);
    let begin = Instant::now();
    while lines_of(journal) < wanted && child.try_wait().expect("a child").is_none() {
        assert!(begin.elapsed() < Duration::from_mins(5), "{wanted} lines never come");
        sleep(Duration::from_millis(1));
    }
    child.kill().expect("the child"); // SIGKILL
    child.wait().expect("ended").success()
}
