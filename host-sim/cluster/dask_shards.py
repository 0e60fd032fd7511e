#!/usr/bin/env python3
"""Makes the parts of a table or a workspace on the workers of a Dask cluster, then merges them.

    dask_shards.py --local 4 --shards 16 --out crane.cdpr -- cdpr table build --region 0..4,4..12,1..4
    dask_shards.py --scheduler tcp://head:8786 --shards 64 --out ws -- cdpr workspace --grid 40,40,20 ...

The command after `--` is run once for each part with `--shard K/N --out PLACE` added; the command that merges
follows from it. The result is the same bytes as that of the command alone.

Parts lie in PARTS (--parts, default OUT.parts), a folder that all workers must see under the same path, as they
must the program, the robot file and the folder this is started in. A part is its own journal: whoever gets a part
goes on where the last one was killed, and so does this driver when the same command is run again. While a process
makes a part it holds a lock on the journal; a worker that is only thought lost is waited for (exit code 75 of
cdpr), so that two never write one journal. That needs a file system whose locks (flock) reach over all machines,
as those of NFS do; one that keeps them on each machine (Lustre with localflock) protects only workers of one.

Workers should have one thread each (dask worker --nthreads 1): cdpr itself uses all cores of its machine, or as
many as --threads after `--` says. With --local they are shared out among the workers.

Exit code: 0 merged; 1 a part or the merge failed, with what it wrote on stderr; 2 bad arguments; 130 interrupted,
with all journals intact.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import Client, Event, Future, LocalCluster, as_completed, get_worker, wait

TOPIC = "cdpr-parts"
BUSY = 75  # what cdpr says when another process is making the part
STOPPED = -15  # as if terminated
STOP_TIMEOUT_S = 30  # cdpr ends at once; a worker asks every second whether it should

INTERRUPTED = threading.Event()


def interrupt(_number: int, _frame: Any) -> None:
    """What Ctrl-C does: what it raises may be lost where Python ignores exceptions, in a finalizer, say."""
    INTERRUPTED.set()
    raise KeyboardInterrupt


def heed_interrupt() -> None:
    """Raises what was lost."""
    if INTERRUPTED.is_set():
        raise KeyboardInterrupt


@dataclass(frozen=True)
class Job:
    """What is to be done: the command of each part, and the one that merges."""

    parts: list[Path]
    commands: list[list[str]]
    merge: list[str]


class UsageError(Exception):
    """The command line is not right."""


def split_command(command: list[str]) -> tuple[list[str], str, list[str]]:
    """The program, which of the two it is to make, and the arguments of that."""
    for place, word in enumerate(command):
        if place == 0:
            continue
        if word == "workspace":
            return command[:place], "workspace", command[place + 1 :]
        if word == "table" and command[place + 1 : place + 2] == ["build"]:
            return command[:place], "table", command[place + 2 :]
    raise UsageError("the command after -- is neither 'cdpr table build ...' nor 'cdpr workspace ...'")


def plan(command: list[str], shards: int, out: Path, folder: Path, threads: int | None) -> Job:
    """Commands for all parts of `command`."""
    program, kind, arguments = split_command(command)
    for option in ("--shard", "--out"):
        if any(word == option or word.startswith(option + "=") for word in arguments):
            raise UsageError(f"{option} is set here, not in the command after --")
    if kind == "workspace" and arguments[:1] == ["merge"]:
        raise UsageError("the command after -- must make a workspace, not merge one")
    if threads is not None and not any(word.split("=")[0] == "--threads" for word in arguments):
        arguments = [*arguments, "--threads", str(threads)]
    numbers = range(1, shards + 1)
    parts = [folder / f"part-{k}-of-{shards}.jsonl" for k in numbers]
    if kind == "workspace":  # it names the parts itself
        make, merge, places = [*program, "workspace"], [*program, "workspace", "merge"], [folder] * shards
    else:
        make, merge, places = [*program, "table", "build"], [*program, "table", "merge"], parts
    commands = [
        [*make, *arguments, "--shard", f"{k}/{shards}", "--out", str(place)]
        for k, place in zip(numbers, places)
    ]
    return Job(parts, commands, [*merge, "--out", str(out), *map(str, parts)])


def make_part(number: int, command: list[str], folder: str, stop_name: str) -> dict[str, Any]:
    """Runs the command of a part on a worker, to its end or until `stop_name` is set.

    Waits while another process makes the part. Raises nothing when the command fails: the driver decides.
    """
    worker = get_worker()
    stop = Event(stop_name)
    told = False

    def result(code: int, text: str) -> dict[str, Any]:
        return {"number": number, "code": code, "stderr": text, "worker": worker.address}

    def stopped() -> bool:
        try:
            return stop.is_set()
        except (OSError, RuntimeError, ValueError):  # without a scheduler nobody waits for the part
            return True

    while not stopped():
        try:
            child = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
            )
        except OSError as error:
            return result(127, str(error))
        while True:
            try:
                _, text = child.communicate(timeout=1.0)
                break
            except subprocess.TimeoutExpired:
                if stopped():
                    child.terminate()
        if child.returncode != BUSY:
            return result(child.returncode, text)
        if not told:
            worker.log_event(TOPIC, f"part {number}: another process is making it; waiting for that")
            told = True
        time.sleep(2.0)
    return result(STOPPED, "stopped")


def say(text: str) -> None:
    """Progress, on stderr."""
    print(f"dask_shards: {text}", file=sys.stderr, flush=True)


def make_all(client: Client, job: Job, retries: int) -> bool:
    """Makes all parts; whether all are there."""
    client.subscribe_topic(TOPIC, lambda event: say(str(event[1])))
    stop_name = f"cdpr-stop-{uuid.uuid4()}"
    stop = Event(stop_name, client=client)
    folder = str(Path.cwd())
    left = dict.fromkeys(range(len(job.commands)), retries)
    indices: dict[Future, int] = {}

    def submit(index: int) -> Future:
        name = f"cdpr-part-{index + 1}-{uuid.uuid4()}"
        command = job.commands[index]
        future = client.submit(make_part, index + 1, command, folder, stop_name, key=name, pure=False)
        indices[future] = index
        return future

    if not client.scheduler_info()["workers"]:
        say("waiting for workers")
    try:
        running = as_completed([submit(index) for index in range(len(job.commands))])
        done = 0
        for future in running:
            heed_interrupt()
            index = indices.pop(future)
            command = shlex.join(job.commands[index])
            if future.status == "finished":
                made = future.result()
                where, code, text = made["worker"], made["code"], made["stderr"].rstrip()
                if code == 0:
                    done += 1
                    say(f"part {index + 1} done on {where} ({done} of {len(job.commands)})")
                    continue
                say(f"part {index + 1} failed on {where}, exit code {code}: {command}")
            else:
                code, text = -1, str(future.exception())
                say(f"part {index + 1} was lost with the workers that had it: {command}")
            print(text, file=sys.stderr, flush=True)
            # Killed from outside, it may live elsewhere; what cdpr itself refuses it refuses anywhere.
            if code > 0 or left[index] == 0:
                return False
            left[index] -= 1
            running.add(submit(index))
        return True
    finally:
        if indices:  # nobody wants them any more: let them stop what they started
            stop.set()
            with contextlib.suppress(TimeoutError):
                wait(list(indices), timeout=STOP_TIMEOUT_S)
            client.cancel(list(indices))


def parse(arguments: list[str]) -> tuple[argparse.Namespace, list[str]]:
    """The options, and the command after `--`."""
    about, _, more = (__doc__ or "").partition("\n\n")
    parser = argparse.ArgumentParser(
        description=about,
        epilog=more,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage="%(prog)s (--scheduler ADDRESS | --local N) --shards N --out OUT [options] -- COMMAND ...",
    )
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--scheduler", metavar="ADDRESS", help="a scheduler that runs, like tcp://head:8786")
    where.add_argument("--local", metavar="N", type=positive, help="N worker processes on this machine")
    parser.add_argument("--shards", metavar="N", type=positive, required=True, help="number of parts")
    parser.add_argument("--out", type=Path, required=True, help="the table, or the folder of the workspace")
    parser.add_argument("--parts", type=Path, metavar="FOLDER", help="for the parts [default: OUT.parts]")
    parser.add_argument("--keep-parts", action="store_true", help="leave the parts when they are merged")
    parser.add_argument(
        "--retries",
        type=int,
        default=3,
        metavar="N",
        help="how often a part is tried again when its process or worker was killed [default: 3]",
    )
    if "--" not in arguments:
        options = parser.parse_args(arguments)  # --help ends here
        parser.error("the command is missing: -- cdpr table build ..., or -- cdpr workspace ...")
    place = arguments.index("--")
    options = parser.parse_args(arguments[:place])
    if options.retries < 0:
        parser.error("--retries: is negative")
    return options, arguments[place + 1 :]


def positive(text: str) -> int:
    """A number of things."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("is not positive")
    return value


def connect(options: argparse.Namespace) -> tuple[Client, LocalCluster | None]:
    """A client of the scheduler that is wanted."""
    if options.scheduler:
        return Client(options.scheduler, timeout=30), None
    cluster = LocalCluster(
        n_workers=options.local,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
        memory_limit=0,  # the memory is that of cdpr, which Dask does not see
    )
    return Client(cluster), cluster


def run(options: argparse.Namespace, command: list[str]) -> int:
    """Everything but the arguments; the exit code."""
    out = options.out.absolute()
    folder = (options.parts or out.with_name(out.name + ".parts")).absolute()
    threads = max(1, (os.cpu_count() or 1) // options.local) if options.local else None
    job = plan(command, options.shards, out, folder, threads)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"--parts {folder}: {error.strerror}") from error
    try:
        client, cluster = connect(options)
    except (OSError, ValueError) as error:
        say(f"--scheduler {options.scheduler}: {error}")
        return 1
    try:
        if not make_all(client, job, options.retries):
            return 1
    finally:
        client.close()
        if cluster:
            cluster.close()
    heed_interrupt()
    merged = subprocess.run(job.merge, check=False)
    if merged.returncode != 0:
        say(f"merging failed, exit code {merged.returncode}: {shlex.join(job.merge)}")
        return 1
    if not options.keep_parts:
        for part in job.parts:
            part.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # something else lies there
            folder.rmdir()
    return 0


def main() -> int:
    """The command line."""
    options, command = parse(sys.argv[1:])
    signal.signal(signal.SIGINT, interrupt)
    try:
        return run(options, command)
    except UsageError as error:
        say(str(error))
        return 2
    except KeyboardInterrupt:
        say("interrupted; the same command goes on from here")
        return 130


if __name__ == "__main__":
    sys.exit(main())
