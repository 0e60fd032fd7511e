#!/usr/bin/env python3
"""One warm f64 IK step: this project against CasADi's generated Newton solver, in one run.

    python3 host-sim/benches/casadi/compare.py

Needs python3 with venv, gcc, cargo and (the first time) PyPI: CasADi and NumPy go into a virtual
environment under the cargo target directory, next to the generated C.

Same for both: robot, poses, 64-bit floats, linear extrapolation of the last two solutions, and the
criterion that ends a solve, a Newton step that changes no force or length by more than 1e-5
(relative), which leaves 1e-10. CasADi's unknowns are divided by the forces and lengths at the first
pose, its equations by the lengths and the weight of the platform, so that its `abstolStep` means
that. Each call is timed by itself with the monotonic clock, whose own cost is in all figures.
Neither side is built for the local processor: `cargo bench` here, plain `gcc -O3` there.

Two more columns show what these choices cost CasADi: `-O2`, which suits its code better, and
`abstolStep = 1e-10`, for which the equations are evaluated once more to confirm the accuracy.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import venv
from pathlib import Path

WORKSPACE = Path(__file__).resolve().parents[3]
# Largest relative difference of a length between the programs.
SAME_LENGTHS = 1e-8
# The goal: our time over that of the first variant.
GOAL = 1 / 3
# Rounds, each with one run of every program, and turns of the circle in one run.
ROUNDS = 11
TURNS = 20
# Compiler flag and, over the tolerance of the Rust side, `abstolStep`.
VARIANTS = {"-O3": ("-O3", 1), "-O2": ("-O2", 1), "-O3, 1e-10": ("-O3", 1e-5)}

DRIVER = r"""
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
static long iterations;
#include "ik.c"

/* ARG, RES, IW, W, TICKS and TURNS come from the command line. */
enum { UNKNOWNS = 18, PARAMETERS = 12, STEPS = TURNS * TICKS };
static double poses[TICKS][PARAMETERS], solutions[TICKS][UNKNOWNS];
static double now[UNKNOWNS], before[UNKNOWNS], next[UNKNOWNS], times[STEPS];
static const double *arg[ARG];
static double *res[RES], w[W];
static casadi_int iw[IW];

static double clock_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * t.tv_sec + t.tv_nsec;
}

static int compare(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static double median(void) {
  qsort(times, STEPS, sizeof *times, compare);
  return times[STEPS / 2];
}

/* The guess goes where the solver reads it; the new solution becomes the present one. */
static void step(int tick) {
  for (int k = 0; k < UNKNOWNS; ++k) next[k] = 2 * now[k] - before[k];
  arg[0] = next, arg[1] = poses[tick], res[0] = next;
  if (ik(arg, res, iw, w, 0)) exit(1);
  memcpy(before, now, sizeof now);
  memcpy(now, next, sizeof now);
}

int main(void) {
  FILE *file = fopen("path.bin", "rb");
  if (!file || fread(poses, sizeof poses, 1, file) != 1) return 1;
  if (fread(solutions, sizeof solutions, 1, file) != 1) return 1;
  memcpy(before, solutions[TICKS - 2], sizeof now);
  memcpy(now, solutions[TICKS - 1], sizeof now);
  for (int tick = 0; tick < TICKS; ++tick) step(tick);
  iterations = 0;
  for (int i = 0; i < STEPS; ++i) {
    double start = clock_ns();
    step(i % TICKS);
    times[i] = clock_ns() - start;
    memcpy(solutions[i % TICKS], now, sizeof now);
  }
  double step_median = median(), step_minimum = times[0];
  for (int i = 0; i < STEPS; ++i) {
    double start = clock_ns();
    times[i] = clock_ns() - start;
  }
  printf("%g %g %g %g\n", step_median, step_minimum, median(), (double)iterations / STEPS);
  file = fopen("solutions.bin", "wb");
  return !file || fwrite(solutions, sizeof solutions, 1, file) != 1 || fclose(file);
}
"""


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    directory = arguments.parse_args().inside
    if directory is None:
        run_in_environment()
    else:
        compare(directory)


def run_in_environment():
    """Runs this script again with the Python of an environment that has CasADi."""
    directory = (WORKSPACE / os.environ.get("CARGO_TARGET_DIR", "target") / "casadi-compare").resolve()
    python = directory / "venv" / "bin" / "python"
    complete = directory / "venv" / "complete"
    if not complete.exists():
        venv.create(directory / "venv", clear=True, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "casadi", "numpy"], check=True)
        complete.touch()
    sys.exit(subprocess.run([python, __file__, "--inside", directory]).returncode)


def compare(directory):
    import numpy as np

    binary = build_rust()
    problem = run_rust(binary)["problem"]
    our_states = np.array(problem["states"])
    start = our_states[0].reshape(6, 3)
    force_scales = np.abs(start[:, :2]).sum(axis=1)
    scales = np.column_stack([force_scales, force_scales, start[:, 2]]).ravel()
    equations = make_equations(problem, scales)
    # Position, then the rotation matrix by rows: the platform stays level.
    poses = np.array([position + [1, 0, 0, 0, 1, 0, 0, 0, 1] for position in problem["positions_m"]], dtype=float)
    drivers = {
        name: build_casadi(directory / f"variant{i}", flag, problem["tolerance"] * factor, equations, poses,
                           our_states / scales)
        for i, (name, (flag, factor)) in enumerate(VARIANTS.items())
    }
    reference = converge(equations, poses, np.roll(our_states / scales, 1, axis=0)) * scales

    ours, theirs = [], {name: [] for name in drivers}
    for _ in range(ROUNDS):
        for name, driver in drivers.items():
            theirs[name].append(run_casadi(driver))
        ours.append(run_rust(binary))

    lengths = {"ours": our_states[:, 2::3]}
    for name, driver in drivers.items():
        states = np.fromfile(driver.parent / "solutions.bin").reshape(our_states.shape) * scales
        lengths[name] = states[:, 2::3]
    report(theirs, ours, lengths, reference[:, 2::3])


def build_rust():
    """Builds the bench and returns its path."""
    command = ["cargo", "bench", "--no-run", "--quiet", "-p", "cdpr-host-sim", "--bench", "warm_step",
               "--message-format=json"]
    output = subprocess.run(command, cwd=WORKSPACE, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = map(json.loads, output.splitlines())
    return next(m["executable"] for m in messages
                if m["reason"] == "compiler-artifact" and m["target"]["name"] == "warm_step")


def run_rust(binary):
    return json.loads(subprocess.run([binary, "--json"], check=True, stdout=subprocess.PIPE).stdout)


def make_equations(problem, scales):
    """18 equations in 18 unknowns: Fx, Fz, L of each cable over `scales`; parameter: pose.

    The end-point equations are Irvine's in the form without cancellation.
    """
    import casadi as ca

    unknowns, pose = ca.SX.sym("unknowns", 18), ca.SX.sym("pose", 12)
    position, rotation = pose[:3], ca.reshape(pose[3:], 3, 3).T
    weight_n, moment_arm_m = problem["weight_n"], problem["moment_arm_m"]
    residuals = []
    force, moment = ca.vertcat(0, 0, -weight_n), ca.SX.zeros(3)
    for i, cable in enumerate(problem["cables"]):
        fx, fz, length = (unknowns[3 * i + k] * scales[3 * i + k] for k in range(3))
        arm = ca.mtimes(rotation, ca.DM(cable["attachment_m"]))
        span = position + arm - ca.DM(cable["anchor_m"])
        x = ca.sqrt(span[0] ** 2 + span[1] ** 2)
        weight = cable["weight_n_m"] * length
        tensions = ca.sqrt(fx**2 + fz**2) + ca.sqrt(fx**2 + (fz - weight) ** 2)
        q, c, strain = weight / tensions, (2 * fz - weight) / tensions, tensions * (cable["compliance_per_n"] / 2)
        end_x = 2 * length / tensions * fx * (ca.atanh(q) / q + strain)
        end_z = length * c * (1 + strain)
        residuals += [(end_x - x) / scales[3 * i + 2], (end_z - span[2]) / scales[3 * i + 2]]
        pull = -ca.vertcat(fx * span[0] / x, fx * span[1] / x, fz)
        force += pull
        moment += ca.cross(arm, pull)
    residuals += [force / weight_n, moment / (weight_n * moment_arm_m)]
    return {"x": unknowns, "p": pose, "g": ca.vertcat(*residuals)}


def build_casadi(directory, flag, tolerance, equations, poses, solutions):
    """Generates and compiles the solver and a driver that walks the path."""
    import casadi as ca

    options = {"abstolStep": tolerance, "abstol": 1e-10, "max_iter": 10}
    solver = ca.rootfinder("ik", "fast_newton", equations, options)
    directory.mkdir(parents=True, exist_ok=True)
    os.chdir(directory)  # CasADi writes into the current directory only
    solver.generate("ik.c")
    source = Path("ik.c").read_text()
    one_iteration = "if (casadi_newton(&m)) break;"
    if source.count(one_iteration) != 1:
        sys.exit("CasADi generates another loop than this script expects")
    Path("ik.c").write_text(source.replace(one_iteration, "++iterations; " + one_iteration))
    sizes = {"ARG": solver.sz_arg(), "RES": solver.sz_res(), "IW": solver.sz_iw() + 1, "W": solver.sz_w(),
             "TICKS": len(poses), "TURNS": TURNS}
    defines = [f"-D{name}={size}" for name, size in sizes.items()]
    Path("driver.c").write_text(DRIVER)
    with open("path.bin", "wb") as file:
        poses.tofile(file)
        solutions.tofile(file)
    subprocess.run(["gcc", flag, *defines, "driver.c", "-o", "driver", "-lm"], check=True)
    return directory / "driver"


def run_casadi(driver):
    """Median and shortest time of a step, median time between two clock readings (ns), iterations a step."""
    output = subprocess.run([driver], cwd=driver.parent, check=True, stdout=subprocess.PIPE, text=True).stdout
    return [float(field) for field in output.split()]


def converge(equations, poses, starts):
    """The solutions to rounding, by CasADi's interpreter: from some 1e-4 away, four Newton steps."""
    import casadi as ca
    import numpy as np

    options = {"abstol": 0, "abstolStep": 0, "max_iter": 4, "error_on_fail": False}
    solver = ca.rootfinder("reference", "fast_newton", equations, options)
    return np.array([solver(start, pose).full().ravel() for start, pose in zip(starts, poses)])


def report(theirs, ours, lengths, reference):
    """Prints the table; exits with a failure when the lengths differ or the goal is missed."""
    import numpy as np

    our_medians = [run["median_ns"] for run in ours]
    rows = {"ours": [statistics.median(our_medians), min(run["minimum_ns"] for run in ours), 1, None]}
    ratios = {}
    for name, runs in theirs.items():
        medians, minima, _, iterations = zip(*runs)
        ratios[name] = [mine / other for mine, other in zip(our_medians, medians)]
        rows[name] = [statistics.median(medians), min(minima), iterations[0], statistics.median(ratios[name])]
    print(f"{'':16}{'median, ns':>12}{'shortest, ns':>14}{'iterations':>12}{'per iteration':>15}"
          f"{'length error':>14}{'ours/CasADi':>13}")
    for name, (median, minimum, iterations, ratio) in rows.items():
        error = np.max(np.abs(lengths[name] / reference - 1))
        label = name if name == "ours" else "CasADi " + name
        print(f"{label:16}{median:12.0f}{minimum:14.0f}{iterations:12.2f}{median / iterations:15.0f}{error:14.1e}"
              + (f"{ratio:13.3f}" if ratio else ""))

    first = next(iter(theirs))
    clock_ns = statistics.median(run[2] for run in theirs[first])
    print(f"reading the clock: {clock_ns:.0f} ns of each; ratios to {first} by round: "
          + " ".join(f"{ratio:.3f}" for ratio in ratios[first]))
    difference = max(np.max(np.abs(lengths[name] / lengths["ours"] - 1)) for name in theirs)
    if difference > SAME_LENGTHS:
        sys.exit(f"two programs differ by {difference:.1e} in a length")
    ratio = rows[first][3]
    verdict = "met" if ratio <= GOAL else "missed"
    print(f"lengths agree within {difference:.1e}; goal of at most {GOAL:.3f}: {ratio:.3f}, {verdict}")
    sys.exit(ratio > GOAL)


if __name__ == "__main__":
    main()
