#!/usr/bin/env python3
"""One warm f64 IK step: this project against CasADi's generated Newton solver, in one run.

    python3 host-sim/benches/casadi/compare.py

Needs python3 with venv, gcc, cargo and (once) access to PyPI: CasADi and NumPy go into a virtual
environment under the cargo target directory, next to the generated C.

Same for both: robot, poses, 64-bit floats, linear extrapolation of the last two solutions, and the
criterion that ends a solve, a Newton step that changes no force or length by more than 1e-5
(relative), which leaves 1e-10. CasADi's unknowns are divided by the forces and lengths at the first
pose, its equations by the lengths and the weight of the platform, so that its `abstolStep` means that.
Each call is timed by itself with the monotonic clock, whose own cost is in both figures and is printed.
Neither side is built for the local processor: `cargo bench` here, `gcc -O3` there.
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
# Largest relative difference of the lengths found by the two programs.
SAME_LENGTHS = 1e-8
# The goal: our time over CasADi's.
GOAL = 1 / 3
ROUNDS = 7
TURNS = 20

DRIVER = r"""
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
static long iterations;
#include "ik.c"

enum { UNKNOWNS = 18, PARAMETERS = 12, TICKS = @ticks@, TURNS = @turns@ };
static double poses[TICKS][PARAMETERS], solutions[TICKS][UNKNOWNS];
static double now[UNKNOWNS], before[UNKNOWNS], next[UNKNOWNS], times[TURNS * TICKS];
static const double *arg[ik_SZ_ARG];
static double *res[ik_SZ_RES], w[ik_SZ_W];
static casadi_int iw[ik_SZ_IW + 1];

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
  qsort(times, TURNS * TICKS, sizeof *times, compare);
  return times[TURNS * TICKS / 2];
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
  if (!file || fread(poses, sizeof poses, 1, file) != 1 || fread(solutions, sizeof solutions, 1, file) != 1) return 1;
  memcpy(before, solutions[TICKS - 2], sizeof now);
  memcpy(now, solutions[TICKS - 1], sizeof now);
  for (int tick = 0; tick < TICKS; ++tick) step(tick);
  iterations = 0;
  for (int i = 0; i < TURNS * TICKS; ++i) {
    double start = clock_ns();
    step(i % TICKS);
    times[i] = clock_ns() - start;
    memcpy(solutions[i % TICKS], now, sizeof now);
  }
  double step_median = median(), step_minimum = times[0];
  for (int i = 0; i < TURNS * TICKS; ++i) {
    double start = clock_ns();
    times[i] = clock_ns() - start;
  }
  printf("%g %g %g %g\n", step_median, step_minimum, median(), (double)iterations / (TURNS * TICKS));
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
    target = Path(os.environ.get("CARGO_TARGET_DIR", WORKSPACE / "target"))
    directory = target.resolve() / "casadi-compare"
    python = directory / "venv" / "bin" / "python"
    if subprocess.run([python, "-c", "import casadi, numpy"], capture_output=True).returncode if python.exists() else True:
        venv.create(directory / "venv", clear=True, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "casadi", "numpy"], check=True)
    sys.exit(subprocess.run([python, __file__, "--inside", directory]).returncode)


def compare(directory):
    import numpy as np

    binary = build_rust()
    first = run_rust(binary)
    problem = first["problem"]
    ours_states = np.array(problem["states"])
    scales = np.array([s for fx, fz, length in ours_states[0].reshape(6, 3)
                       for s in (abs(fx) + abs(fz), abs(fx) + abs(fz), length)])
    equations = make_equations(problem, scales)
    poses = np.hstack([np.array(problem["positions_m"]),
                       np.tile(np.eye(3).reshape(1, 9), (len(ours_states), 1))])
    driver = build_casadi(directory, equations, poses, ours_states / scales, problem["tolerance"])
    reference = converge(equations, poses, ours_states / scales) * scales

    ours, theirs = [], []
    for _ in range(ROUNDS):
        theirs.append([float(f) for f in subprocess.run(
            [driver], cwd=directory, check=True, capture_output=True, text=True).stdout.split()])
        ours.append(run_rust(binary))
    theirs_states = np.fromfile(directory / "solutions.bin").reshape(ours_states.shape) * scales

    report(theirs, ours, theirs_states[:, 2::3], ours_states[:, 2::3], reference[:, 2::3])


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


def build_casadi(directory, equations, poses, solutions, tolerance):
    """Generates and compiles the solver and a driver that walks the path."""
    import casadi as ca

    options = {"abstolStep": tolerance, "abstol": tolerance**2, "max_iter": 10}
    solver = ca.rootfinder("ik", "fast_newton", equations, options)
    os.chdir(directory)  # CasADi writes into the current directory only
    solver.generate("ik.c", {"with_mem": False, "with_header": False})
    source = Path("ik.c").read_text()
    count = "if (casadi_newton(&m)) break;"
    assert source.count(count) == 1, "CasADi generates another loop than this script expects"
    Path("ik.c").write_text(source.replace(count, "++iterations; " + count))
    sizes = "".join(f"#define ik_SZ_{name} {size}\n" for name, size in
                    zip(("ARG", "RES", "IW", "W"), (solver.sz_arg(), solver.sz_res(), solver.sz_iw(), solver.sz_w())))
    driver = DRIVER.replace("@ticks@", str(len(poses))).replace("@turns@", str(TURNS))
    Path("driver.c").write_text(sizes + driver)
    with open("path.bin", "wb") as file:
        poses.tofile(file)
        solutions.tofile(file)
    subprocess.run(["gcc", "-O3", "driver.c", "-o", "driver", "-lm"], check=True)
    return directory / "driver"


def converge(equations, poses, starts):
    """The solutions to rounding, by CasADi's interpreted solver; walks the path like the others."""
    import casadi as ca
    import numpy as np

    solver = ca.rootfinder("reference", "newton", equations, {"abstol": 1e-13, "max_iter": 20})
    return np.array([solver(start, pose).full().ravel() for start, pose in zip(starts, poses)])


def report(theirs, ours, theirs_lengths, ours_lengths, reference):
    import numpy as np

    def error(lengths):
        return np.max(np.abs(lengths / reference - 1))

    theirs_median, ours_median = [t[0] for t in theirs], [o["median_ns"] for o in ours]
    ratios = [o / t for o, t in zip(ours_median, theirs_median)]
    iterations = theirs[0][3]
    print(f"{'':24}{'CasADi':>10}{'ours':>10}{'ours/CasADi':>14}")
    rows = [
        ("median step, ns", statistics.median(theirs_median), statistics.median(ours_median), statistics.median(ratios)),
        ("shortest step, ns", min(t[1] for t in theirs), min(o["minimum_ns"] for o in ours), None),
        ("iterations a step", iterations, 1, None),
        ("median iteration, ns", statistics.median(theirs_median) / iterations, statistics.median(ours_median), None),
    ]
    for name, casadi, rust, ratio in rows:
        print(f"{name:24}{casadi:10.4g}{rust:10.4g}" + (f"{ratio:14.3f}" if ratio else ""))
    print(f"{'largest length error':24}{error(theirs_lengths):10.1e}{error(ours_lengths):10.1e}")
    print(f"ratios of the {len(ratios)} rounds: " + " ".join(f"{r:.3f}" for r in ratios)
          + f"; reading the clock: {theirs[0][2]:.0f} ns")
    difference = np.max(np.abs(theirs_lengths / ours_lengths - 1))
    if difference > SAME_LENGTHS:
        sys.exit(f"the two programs differ by {difference:.1e} in a length")
    met = statistics.median(ratios) <= GOAL
    print(f"lengths agree within {difference:.1e}; goal of at most {GOAL:.3f}: {'met' if met else 'missed'}")
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
