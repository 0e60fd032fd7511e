//! The drivers in `cluster/`: parts made by other processes, some of which are killed in the middle.
#![cfg(target_os = "linux")]

mod common;

use std::fs::{self, File};
use std::io::Read as _;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::LazyLock;
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::CDPR;
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use tempfile::TempDir;

const DASK_SHARDS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/cluster/dask_shards.py");
const SLURM_ARRAY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/cluster/slurm-array.sh");

/// Longer than anything here takes, on a machine that does much else.
const PATIENCE: Duration = Duration::from_mins(3);
const SHARDS: usize = 4;

/// A table of many tiles, on one thread, each of which takes long enough to be caught in it.
const TABLE: [&str; 9] = [
    "table",
    "build",
    "--region=1..3,4..12,2.4..2.6",
    "--position=2,7,2.5",
    "--max-length=50",
    "--depth=5",
    "--format=json",
    "--threads",
    "1",
];
/// A map with many tiles, on one thread.
const WORKSPACE: [&str; 6] =
    ["workspace", "--grid=16,16,8", "--region=0..6,4..12,1..4", "--mass=10", "--threads", "1"];
/// What a map consists of.
const MAP: [&str; 3] = ["workspace.csv", "workspace.parquet", "workspace.json"];

/// A program of the environment that `tests/run` makes.
fn python(name: &str) -> Command {
    let folder = std::env::var_os("CDPR_VENV").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/venv"),
        PathBuf::from,
    );
    let path = folder.join("bin").join(name);
    assert!(path.exists(), "{} is missing; tests/run makes it", path.display());
    Command::new(path)
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

fn until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}");
        sleep(Duration::from_millis(10));
    }
}

fn pid(child: &Child) -> Pid {
    Pid::from_child(child)
}

fn signal(pid: Pid, signal: Signal) {
    kill_process(pid, signal).expect("the process is there");
}

/// The processes of cdpr whose command line holds `part`, with their parents.
fn running(part: &str) -> Vec<(Pid, i32, Vec<String>)> {
    let processes = fs::read_dir("/proc").expect("/proc").flatten();
    let find = |entry: fs::DirEntry| {
        let number: i32 = entry.file_name().to_str()?.parse().ok()?;
        let command = fs::read(entry.path().join("cmdline")).ok()?;
        let words: Vec<String> =
            command.split(|b| *b == 0).map(|word| String::from_utf8_lossy(word).into()).collect();
        let is_wanted = words[0] == CDPR && words.iter().any(|word| word.contains(part));
        let status = fs::read_to_string(entry.path().join("status")).ok().filter(|_| is_wanted)?;
        let parent = status.lines().find_map(|line| line.strip_prefix("PPid:"))?.trim().parse();
        Some((Pid::from_raw(number)?, parent.ok()?, words))
    };
    processes.filter_map(find).collect()
}

/// A scheduler and workers, each a process with a group of its own.
struct Cluster {
    scheduler: Child,
    address: String,
    workers: Vec<Child>,
}

impl Cluster {
    fn new(folder: &Path, workers: usize) -> Self {
        let file = folder.join("scheduler.json");
        let option = ["--scheduler-file", file.to_str().expect("UTF-8")];
        let log = |name: &str| File::create(folder.join(name)).expect("a log");
        let scheduler = python("dask")
            .args(["scheduler", "--host=127.0.0.1", "--port=0", "--no-dashboard"])
            .args(option)
            .stdout(log("scheduler.log"))
            .stderr(log("scheduler.err"))
            .spawn()
            .expect("a scheduler");
        let address = until("the scheduler", || {
            let document: serde_json::Value = serde_json::from_str(&text(&file)).ok()?;
            document["address"].as_str().map(str::to_owned)
        });
        let worker = |number: usize| {
            python("dask")
                .args(["worker", "--nthreads=1", "--no-nanny", "--no-dashboard"])
                .args(option)
                .arg("--local-directory")
                .arg(folder.join("scratch"))
                .stdout(Stdio::null())
                .stderr(log(&format!("worker-{number}.err")))
                .process_group(0)
                .spawn()
                .expect("a worker")
        };
        Self { scheduler, address, workers: (0..workers).map(worker).collect() }
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for worker in &mut self.workers {
            let _ = kill_process_group(pid(worker), Signal::KILL);
            let _ = worker.wait();
        }
        let _ = self.scheduler.kill();
        let _ = self.scheduler.wait();
    }
}

/// A driver that runs, its stderr in a file.
struct Driver {
    child: Child,
    log: PathBuf,
}

impl Driver {
    fn new(folder: &Path, where_: [&str; 2], out: &Path, command: &[&str]) -> Self {
        let log = folder.join("driver.err");
        let child = python("python")
            .arg(DASK_SHARDS)
            .args(where_)
            .args(["--keep-parts", "--shards", &SHARDS.to_string(), "--out"])
            .arg(out)
            .args(["--", CDPR])
            .args(command)
            .current_dir(folder)
            .stdout(Stdio::null())
            .stderr(File::create(&log).expect("a log"))
            .spawn()
            .expect("a driver");
        Self { child, log }
    }

    /// Waits for its end.
    fn code(mut self) -> (Option<i32>, String) {
        let status = until("the driver", || self.child.try_wait().expect("its status"));
        (status.code(), text(&self.log))
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("{}", text(&self.log));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Makes what `command` makes in one, for comparison.
fn in_one(command: &[&str], out: &Path) {
    let made = Command::new(CDPR).args(command).arg("--out").arg(out).output().expect("it runs");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

/// The map of [`WORKSPACE`], made in one.
static WANTED_MAP: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = TempDir::new().expect("a folder");
    in_one(&WORKSPACE, folder.path());
    folder
});

fn assert_is_the_map(found: &Path) {
    for name in MAP {
        let read = |folder: &Path| fs::read(folder.join(name)).expect("a file of the map");
        assert!(read(found) == read(WANTED_MAP.path()), "{name} differs");
    }
}

/// A part in the middle of its making: the process that makes it is stopped, and so is its worker.
struct Halted {
    /// The worker, by its place.
    worker: usize,
    process: Pid,
    journal: PathBuf,
    /// What it held when everything stood still.
    held: String,
}

/// Stops a process that makes a part, and its worker, where it has made two tiles at least but not `tiles`. They run
/// a few milliseconds at a time until then, so that the place is not missed, whatever else the machine does.
fn halt(cluster: &Cluster, parts: &Path, tiles: usize) -> Halted {
    let name = parts.to_str().expect("UTF-8");
    until("a part in the middle", || {
        let mut found = running(name).into_iter();
        let (process, worker, words) = found.find_map(|(process, parent, words)| {
            let is_parent = |worker: &Child| pid(worker).as_raw_nonzero().get() == parent;
            Some((process, cluster.workers.iter().position(is_parent)?, words))
        })?;
        let shard = words.iter().position(|word| word == "--shard").map(|at| &words[at + 1])?;
        let journal = parts.join(format!("part-{}.jsonl", shard.replace('/', "-of-")));
        let group = pid(&cluster.workers[worker]);
        loop {
            kill_process_group(group, Signal::STOP).ok()?;
            sleep(Duration::from_millis(10));
            let held = text(&journal);
            let made = held.matches('\n').count().saturating_sub(1); // beside the order
            if (2..tiles).contains(&made) {
                return Some(Halted { worker, process, journal, held });
            }
            kill_process_group(group, Signal::CONT).ok()?;
            if made >= tiles {
                return None; // the next one
            }
            sleep(Duration::from_millis(5));
        }
    })
}

/// Whole lines of a journal.
fn whole_lines(held: &str) -> &str {
    held.rfind('\n').map_or("", |end| &held[..=end])
}

#[test]
fn a_part_goes_on_elsewhere_when_its_machine_dies() {
    let folder = TempDir::new().expect("a folder");
    let folder = folder.path();
    let (out, wanted) = (folder.join("table.cdpr"), folder.join("wanted.cdpr"));
    in_one(&TABLE, &wanted);
    let cluster = Cluster::new(folder, 2);
    let driver = Driver::new(folder, ["--scheduler", &cluster.address], &out, &TABLE);
    let halted = halt(&cluster, &folder.join("table.cdpr.parts"), 16 / SHARDS);
    kill_process_group(pid(&cluster.workers[halted.worker]), Signal::KILL).expect("it was there");
    let (code, log) = driver.code();
    assert_eq!(code, Some(0), "{log}");
    assert!(fs::read(&out).expect("a table") == fs::read(&wanted).expect("a table"));
    // It went on, and did not begin anew.
    let whole = text(&halted.journal);
    assert!(whole.starts_with(whole_lines(&halted.held)) && whole.len() > halted.held.len());
}

#[test]
fn a_worker_that_is_only_thought_lost_is_waited_for() {
    let folder = TempDir::new().expect("a folder");
    let folder = folder.path();
    let out = folder.join("map");
    let mut cluster = Cluster::new(folder, 2);
    let driver = Driver::new(folder, ["--scheduler", &cluster.address], &out, &WORKSPACE);
    let tiles = 16 * 16 * 8 / 64 / SHARDS;
    let halted = halt(&cluster, &folder.join("map.parts"), tiles / 2);
    // The worker dies, and what it started lives on. It must run meanwhile: to what stands still in a group that has
    // lost its leader the system says SIGHUP.
    signal(halted.process, Signal::CONT);
    let worker = &mut cluster.workers[halted.worker];
    worker.kill().and_then(|()| worker.wait()).expect("it was there");
    signal(halted.process, Signal::STOP);
    sleep(Duration::from_millis(50));
    let held = text(&halted.journal);
    assert!(held.matches('\n').count() < 1 + tiles, "it was too quick");
    let waits = "another process is making it; waiting for that";
    until("the other worker waits", || text(&driver.log).contains(waits).then_some(()));
    assert_eq!(text(&halted.journal), held, "two write one journal");
    signal(halted.process, Signal::CONT);
    let (code, log) = driver.code();
    assert_eq!(code, Some(0), "{log}");
    assert_is_the_map(&out);
    assert!(text(&halted.journal).starts_with(whole_lines(&halted.held)));
}

#[test]
fn an_interrupted_driver_stops_its_workers_and_goes_on_later() {
    let folder = TempDir::new().expect("a folder");
    let folder = folder.path();
    let out = folder.join("map");
    let parts = folder.join("map.parts");
    let name = parts.to_str().expect("UTF-8");
    let driver = Driver::new(folder, ["--local", "2"], &out, &WORKSPACE);
    until("a part", || (!running(name).is_empty()).then_some(()));
    signal(pid(&driver.child), Signal::INT);
    let (code, log) = driver.code();
    assert_eq!(code, Some(130), "{log}");
    assert_eq!(running(name), [], "left behind");
    assert!(!out.exists());
    let (code, log) = Driver::new(folder, ["--local", "2"], &out, &WORKSPACE).code();
    assert_eq!(code, Some(0), "{log}");
    assert_is_the_map(&out);
}

#[test]
fn what_fails_is_told() {
    let folder = TempDir::new().expect("a folder");
    let folder = folder.path();
    let run = |arguments: &[&str]| {
        let output: Output =
            python("python").arg(DASK_SHARDS).args(arguments).current_dir(folder).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let options = ["--local", "1", "--shards", "2", "--out", "t", "--"];
    let fails = |command: &[&str], wanted: i32, part: &str| {
        let (code, message) = run(&[&options, command].concat());
        assert_eq!(code, Some(wanted), "{message}");
        assert!(message.contains(part), "{message}");
    };
    // What cdpr says about its own arguments comes through.
    let wrong = [CDPR, "table", "build", "--region=0..1,0..1,0..1", "--depth=many"];
    fails(&wrong, 1, "invalid value 'many' for '--depth <N>'");
    fails(&["/no/such/program", "workspace"], 1, "exit code 127");
    fails(&[CDPR, "enumerate"], 2, "neither 'cdpr table build ...' nor 'cdpr workspace ...'");
    fails(&[CDPR, "workspace", "--out=there"], 2, "--out is set here");
    fails(&[CDPR, "table", "build", "--shard", "1/2"], 2, "--shard is set here");
    fails(&[CDPR, "workspace", "merge"], 2, "not merge one");
    let (code, message) = run(&options[..6]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("the command is missing"), "{message}");
    let nobody = ["--scheduler", "tcp://127.0.0.1:1", "--shards", "2", "--out", "t", "--"];
    let (code, message) = run(&[&nobody[..], &[CDPR, "workspace"]].concat());
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("--scheduler tcp://127.0.0.1:1"), "{message}");
    let (code, _) = run(&["--help"]);
    assert_eq!(code, Some(0));
}

/// `sbatch` as far as the script needs it: runs each task of an array at once, keeps what it was asked, and refuses
/// a dependency on a job that it does not know.
const SBATCH: &str = r#"#!/usr/bin/env bash
set -euo pipefail
printf '%s\n' "$*" >> "$FAKE/asked"
tasks=
while [[ "$1" == --* ]]; do
    case "$1" in
        --array=*) tasks=${1#--array=} ;;
        --dependency=afterok:*) [ -e "$FAKE/done-${1#*:}" ] || { echo "no job ${1#*:}" >&2; exit 1; } ;;
    esac
    shift
done
number=$(( $(wc -l < "$FAKE/asked") + 100 ))
if [ -n "$tasks" ]; then
    for k in $(seq "${tasks%-*}" "${tasks#*-}"); do
        SLURM_ARRAY_TASK_ID=$k SLURM_CPUS_PER_TASK=1 "$@" >&2
    done
else
    "$@" >&2
fi
touch "$FAKE/done-$number"
echo "$number;cluster"
"#;

fn slurm(folder: &Path, arguments: &[&str]) -> Output {
    use std::os::unix::fs::PermissionsExt as _;

    let fake = folder.join("fake");
    fs::create_dir_all(&fake).expect("a folder");
    let sbatch = fake.join("sbatch");
    if !sbatch.exists() {
        fs::write(&sbatch, SBATCH).expect("a script");
        fs::set_permissions(&sbatch, fs::Permissions::from_mode(0o755)).expect("permissions");
    }
    let path = format!("{}:{}", fake.display(), std::env::var("PATH").expect("a path"));
    let mut script = Command::new(SLURM_ARRAY);
    script.args(arguments).current_dir(folder).env("PATH", path).env("FAKE", &fake);
    script.output().expect("it runs")
}

#[test]
fn slurm_makes_the_parts_and_merges_them() {
    let folder = TempDir::new().expect("a folder");
    let folder = folder.path();
    in_one(&TABLE, &folder.join("wanted.cdpr"));
    let options = ["--shards", "3", "--sbatch", "--time=1:00:00"];
    let submit = |out: &str, command: &[&str]| {
        let made = slurm(folder, &[&options[..], &["--out", out, "--", CDPR], command].concat());
        let message = String::from_utf8_lossy(&made.stderr).into_owned();
        assert!(made.status.success(), "{message}");
        String::from_utf8(made.stdout).expect("UTF-8")
    };
    assert_eq!(submit("table.cdpr", &TABLE), "parts: job 101\nmerge: job 102\n");
    // Without --threads: as many as Slurm gives.
    assert_eq!(submit("map", &WORKSPACE[..4]), "parts: job 103\nmerge: job 104\n");
    let read = |name: &str| fs::read(folder.join(name)).expect("a table");
    assert!(read("table.cdpr") == read("wanted.cdpr"));
    assert_is_the_map(&folder.join("map"));
    let asked = text(&folder.join("fake/asked"));
    let asked: Vec<&str> = asked.lines().collect();
    assert!(asked[0].contains("--requeue") && asked[0].contains("--array=1-3 --time=1:00:00"));
    assert!(asked[1].contains("--dependency=afterok:101"), "{asked:?}");
    assert_eq!(fs::read_dir(folder.join("map.parts")).expect("parts").count(), 3);
}

#[test]
fn slurm_waits_for_a_part_that_another_process_makes() {
    let folder = TempDir::new().expect("a folder");
    let folder = folder.path();
    // A program that is busy once, then says how it was called.
    let program = folder.join("busy-once");
    fs::write(
        &program,
        "#!/bin/sh\n[ -e was ] || { touch was; exit 75; }\necho \"$*\" >> called\n",
    )
    .expect("a script");
    let arguments =
        ["--shards", "1", "--out", "out dir", "--", "sh", "busy-once", "workspace", "--grid=1,1,1"];
    let made = slurm(folder, &arguments);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let part = "workspace --grid=1,1,1 --threads 1 --shard 1/1 --out out dir.parts";
    let merge = "workspace merge --out out dir out dir.parts/part-1-of-1.jsonl";
    assert_eq!(text(&folder.join("called")), format!("{part}\n{merge}\n"));
}

#[test]
fn slurm_refuses_what_cannot_be_made() {
    let folder = TempDir::new().expect("a folder");
    for (arguments, part) in [
        (&["--out", "t", "--", "cdpr", "workspace"][..], "--shards"),
        (&["--shards", "0", "--out", "t", "--", "cdpr", "workspace"], "--shards"),
        (&["--shards", "2", "--", "cdpr", "workspace"], "--out is missing"),
        (&["--shards", "2", "--out", "t"], "the command is missing"),
        (&["--shards", "2", "--out", "t", "--", "cdpr", "enumerate"], "neither"),
        (
            &["--shards", "2", "--out", "t", "--", "cdpr", "workspace", "--out=x"],
            "--out is set here",
        ),
        (&["--shards", "2", "--out", "t", "--", "cdpr", "workspace", "merge"], "not merge one"),
        (&["--shrads", "2"], "--shrads: no such option"),
        (&["--shards"], "--shards: its value is missing"),
    ] {
        let made = slurm(folder.path(), arguments);
        let message = String::from_utf8_lossy(&made.stderr).into_owned();
        assert_eq!(made.status.code(), Some(2), "{message}");
        assert!(message.contains(part), "{message}");
    }
    assert!(!folder.path().join("fake/asked").exists(), "submitted");
    let mut help = String::new();
    let made = slurm(folder.path(), &["--help"]);
    made.stdout.as_slice().read_to_string(&mut help).expect("UTF-8");
    assert!(help.contains("--sbatch OPTION") && !help.contains("set -euo"), "{help}");
}
