"""Static forces of the simulated plant against MoorPy.

Runs `cdpr simulate` for a moment on each of some poses, takes the first row of the log, in which the platform is at
rest with its brakes closed, and asks MoorPy's catenary for the tension of each cable between the same two points
with the same rest length. Tensions must agree to 1e-6 of themselves, and MoorPy's forces must balance the weight of
the platform to 1e-6 of the sum of all forces.

    pip install moorpy
    cargo build --release
    python3 tests/oracles/plant.py
"""
import csv
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import numpy as np
from moorpy.Catenary import catenary

HERE = pathlib.Path(__file__).resolve().parents[2]
ROBOT = tomllib.loads((HERE / "host-sim/robots/marionet-crane.toml").read_text())
RELATIVE = 1e-6
# All taut; one slack; far out, low; high.
POSES = [(2.0, 7.0, 2.5), (3.29, 7.0, 2.5), (2.0, 9.6, 2.5), (2.0, 7.0, 1.0), (2.0, 7.0, 4.5)]


def first_row(pose):
    x, y, z = pose
    with tempfile.TemporaryDirectory() as folder:
        trajectory, log = pathlib.Path(folder, "t.csv"), pathlib.Path(folder, "log.csv")
        trajectory.write_text(f"time_s,x_m,y_m,z_m\n0,{x},{y},{z}\n1,{x},{y},{z + 0.001}\n")
        command = [HERE / "target/release/cdpr", "simulate", "--trajectory", trajectory, "--log", log]
        command += ["--max-length", "60", "--max-tension", "2000", "--precision", "f64"]
        subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
        return next(csv.DictReader(log.open()))


def rotation(q):
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def main():
    worst_tension, worst_balance = 0.0, 0.0
    weight_n_m = ROBOT["cable"]["linear_density_kg_m"] * ROBOT["gravity_m_s2"]
    stiffness_n = ROBOT["cable"]["axial_stiffness_n"]
    load_n = ROBOT["platform"]["mass_kg"] * ROBOT["gravity_m_s2"]
    for pose in POSES:
        row = first_row(pose)
        position = np.array([float(row[c]) for c in ("x_m", "y_m", "z_m")])
        turn = rotation([float(row[c]) for c in ("qw", "qx", "qy", "qz")])
        force, moment, scale = np.array([0.0, 0.0, -load_n]), np.zeros(3), load_n
        for i, cable in enumerate(ROBOT["cables"], start=1):
            lever = turn @ np.array(cable["attachment_m"])
            span = position + lever - np.array(cable["anchor_m"])
            x = np.hypot(span[0], span[1])
            # MoorPy's end A is the lower one, the attachment; no ground near.
            fx_a, fz_a, fx_b, fz_b, _ = catenary(
                x, -span[2], float(row[f"length_m_{i}"]), stiffness_n, weight_n_m, CB=-1e4, Tol=1e-12, MaxIter=500
            )
            tension = float(row[f"tension_n_{i}"])
            moorpy = np.hypot(fx_b, fz_b)
            worst_tension = max(worst_tension, abs(moorpy - tension) / tension)
            # Forces of the line on its ends: it pulls end A towards B.
            pull = np.array([-abs(fx_a) * span[0] / x, -abs(fx_a) * span[1] / x, fz_a])
            force += pull
            moment += np.cross(lever, pull)
            scale += np.linalg.norm(pull)
        worst_balance = max(worst_balance, np.linalg.norm(force) / scale, np.linalg.norm(moment) / scale)
    print(f"largest difference of a tension: {worst_tension:.2e} of it")
    print(f"largest imbalance of MoorPy's forces: {worst_balance:.2e} of the sum of forces")
    sys.exit(0 if max(worst_tension, worst_balance) < RELATIVE else 1)


main()
