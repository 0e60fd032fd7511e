#!/usr/bin/env python3
"""Writes tests/data/solutions.json: the solutions of paper.json and random.json, and two of a pose
that has no rigid solution, to 40 digits. Needs mpmath and Python 3.11. Run from anywhere; the output
is the same in every run.

Each is refined by Newton's iteration on 18 unknowns, Fx, Fz (force on the cable at the attachment) and
L of six cables: H. M. Irvine's elastic catenary in its textbook form (Cable Structures, 1981), with
inverse hyperbolic sines, and the equilibrium of the platform, all in 80 digits. The data are the
doubles that the program has: the numbers of the robot file and of the cases, and the weights and the
compliance as they round there. The rotation is the exact exponential of the rotation vector.
"""

import json
import pathlib
import tomllib

import mpmath
from mpmath import mp, mpf

mp.dps = 80
DIGITS = 40
TESTS = pathlib.Path(__file__).resolve().parents[1]
DATA = TESTS / "data"
ROBOT = TESTS.parent / "host-sim" / "robots" / "marionet-crane.toml"

# Found by a search over the force curves; there is no rigid solution to start from.
WITHOUT_RIGID = {
    "position_m": [3.7647115686606005, 16.85687014836569, 3.958746955731745],
    "rotation_vector_rad": [0.0, 0.0, 0.0],
    "mass_kg": 10.0,
    "linear_density_kg_m": 0.079,
    "axial_stiffness_n": 1256637.0614359172,
    "max_length_m": 5000.0,
    "max_tension_n": 50000.0,
    "solutions": [
        {"lengths_m": [18.470, 21.670, 633.080, 5.905, 7.680, 20.361]},
        {"lengths_m": [18.466, 23.148, 901.718, 5.905, 25.134, 11.567]},
    ],
}


class Pose:
    """One case in long numbers: what the six cables have in common, and their planes."""

    def __init__(self, robot, case):
        # In doubles, as the program computes them.
        self.gravity = float(case.get("gravity_m_s2", robot["gravity_m_s2"]))
        self.weight_n_m = float(case["linear_density_kg_m"]) * self.gravity
        self.compliance_per_n = 1.0 / float(case["axial_stiffness_n"])
        self.platform_weight_n = float(case["mass_kg"]) * self.gravity
        rotation = exponential([mpf(float(v)) for v in case["rotation_vector_rad"]])
        position = mpmath.matrix([mpf(float(v)) for v in case["position_m"]])
        self.planes = []
        for cable in robot["cables"]:
            arm = rotation * mpmath.matrix([mpf(float(v)) for v in cable["attachment_m"]])
            span = position + arm - mpmath.matrix([mpf(float(v)) for v in cable["anchor_m"]])
            x = mpmath.hypot(span[0], span[1])
            self.planes.append((x, span[2], span[0] / x, span[1] / x, arm))

    def wrench(self, cable, fx, fz):
        """Of one cable on the platform: force and moment."""
        _, _, ex, ey, r = self.planes[cable]
        f = (-fx * ex, -fx * ey, -fz)
        return [*f, r[1] * f[2] - r[2] * f[1], r[2] * f[0] - r[0] * f[2], r[0] * f[1] - r[1] * f[0]]

    def end(self, fx, fz, length):
        """Where a cable ends, and the derivative by fx, fz and length."""
        w, c = mpf(self.weight_n_m), mpf(self.compliance_per_n)
        below = fz - w * length
        at_b, at_a = mpmath.hypot(fx, fz), mpmath.hypot(fx, below)
        turn = mpmath.asinh(fz / fx) - mpmath.asinh(below / fx)
        x = c * fx * length + fx / w * turn
        z = c * length * (fz - w * length / 2) + (at_b - at_a) / w
        cross = fx / w * (1 / at_b - 1 / at_a)
        return x, z, (
            (c * length + (turn - fz / at_b + below / at_a) / w, cross, fx * (c + 1 / at_a)),
            (cross, c * length + (fz / at_b - below / at_a) / w, below * (c + 1 / at_a)),
        )

    def system(self, unknowns):
        """The 18 residuals and their derivative."""
        residual, jacobian = mpmath.zeros(18, 1), mpmath.zeros(18, 18)
        residual[14] = -mpf(self.platform_weight_n)
        for i, (x, z, *_) in enumerate(self.planes):
            fx, fz, length = unknowns[3 * i], unknowns[3 * i + 1], unknowns[3 * i + 2]
            end_x, end_z, rows = self.end(fx, fz, length)
            residual[2 * i], residual[2 * i + 1] = end_x - x, end_z - z
            for j in range(3):
                jacobian[2 * i, 3 * i + j] = rows[0][j]
                jacobian[2 * i + 1, 3 * i + j] = rows[1][j]
            for j, unit in enumerate(((1, 0), (0, 1))):
                for row, value in enumerate(self.wrench(i, *unit)):
                    jacobian[12 + row, 3 * i + j] = value
                    residual[12 + row] += value * (fx, fz)[j]
        return residual, jacobian

    def refined(self, unknowns):
        """Newton's iteration until it moves nothing in 60 digits; a step may not turn a force or a
        length round."""
        for _ in range(200):
            residual, jacobian = self.system(unknowns)
            step = mpmath.lu_solve(jacobian, -residual)
            share = mpf(1)
            for i in range(6):
                for k in (3 * i, 3 * i + 2):
                    if step[k] < 0:
                        share = min(share, -unknowns[k] / (2 * step[k]))
            unknowns = unknowns + share * step
            moved = max(abs(step[k]) / max(abs(unknowns[k]), mpf(1)) for k in range(18))
            if moved < mpf(10) ** -60:
                return unknowns
        raise ArithmeticError("does not converge")

    def hanging(self, cable, length):
        """The force of a cable of given length: the end point is the gradient of a convex function
        of the force, so Newton's iteration with shortened steps finds it from anywhere."""
        x, z, *_ = self.planes[cable]
        fx, fz = mpf(1), mpf(0)
        miss = lambda fx, fz: mpmath.hypot(*(a - b for a, b in zip(self.end(fx, fz, length), (x, z))))
        for _ in range(500):
            end_x, end_z, ((a, b, _), (_, d, _)) = self.end(fx, fz, length)
            gx, gz = end_x - x, end_z - z
            step_x, step_z = (b * gz - d * gx) / (a * d - b * b), (b * gx - a * gz) / (a * d - b * b)
            share = mpf(1)
            now = miss(fx, fz)
            while fx + share * step_x <= 0 or miss(fx + share * step_x, fz + share * step_z) > now:
                share /= 2
                if share < mpf(10) ** -20:
                    return fx, fz
            fx, fz = fx + share * step_x, fz + share * step_z
        return fx, fz


def exponential(v):
    """The rotation of a rotation vector (O. Rodrigues)."""
    angle = mpmath.sqrt(sum(x * x for x in v))
    if angle == 0:
        return mpmath.eye(3)
    k = mpmath.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]]) / angle
    return mpmath.eye(3) + mpmath.sin(angle) * k + (1 - mpmath.cos(angle)) * (k * k)


def start(pose, solution):
    """The given solution as 18 unknowns."""
    unknowns = mpmath.zeros(18, 1)
    for i, length in enumerate(solution["lengths_m"]):
        length = mpf(float(length))
        if "fx_n" in solution:
            force = mpf(solution["fx_n"][i]), mpf(solution["fz_n"][i])
        else:
            force = pose.hanging(i, length)
        unknowns[3 * i], unknowns[3 * i + 1], unknowns[3 * i + 2] = *force, length
    return unknowns


def relative_distance(a, b):
    """Largest relative difference of lengths, and of forces."""
    lengths = max(abs(a[k] / b[k] - 1) for k in range(2, 18, 3))
    forces = max(mpmath.hypot(a[k] - b[k], a[k + 1] - b[k + 1]) / mpmath.hypot(b[k], b[k + 1]) for k in range(0, 18, 3))
    return lengths, forces


def main():
    robot = tomllib.loads(ROBOT.read_text())
    assert robot["platform"]["center_of_mass_m"] == [0.0, 0.0, 0.0]
    cases = []
    for name in ("paper", "random"):
        for number, case in enumerate(json.loads((DATA / f"{name}.json").read_text())):
            cases.append((f"{name}.json, case {number}", case))
    cases.append(("without a rigid solution", WITHOUT_RIGID))
    written = []
    for origin, case in cases:
        pose = Pose(robot, case)
        found = []
        for solution in case["solutions"]:
            first = start(pose, solution)
            unknowns = pose.refined(first)
            residual, _ = pose.system(unknowns)
            assert max(abs(r) for r in residual) < mpf(10) ** -60
            moved = relative_distance(first, unknowns)
            print(origin, "moved by", *(mpmath.nstr(m, 2) for m in moved))
            assert "fx_n" not in solution or (moved[0] < 1e-9 and moved[1] < 1e-7), "another solution"
            assert moved[0] < 1e-3, "another solution"
            found.append(unknowns)
        for i, a in enumerate(found):
            assert all(relative_distance(a, b)[0] > 1e-6 for b in found[:i]), "the same solution twice"
        text = lambda unknowns, first: [mpmath.nstr(unknowns[k], DIGITS) for k in range(first, 18, 3)]
        written.append({
            "origin": origin,
            **{key: [float(v) for v in case[key]] for key in ("position_m", "rotation_vector_rad")},
            **{key: float(case[key]) for key in ("mass_kg", "linear_density_kg_m", "axial_stiffness_n", "max_length_m", "max_tension_n")},
            "gravity_m_s2": pose.gravity,
            "weight_n_m": pose.weight_n_m,
            "compliance_per_n": pose.compliance_per_n,
            "platform_weight_n": pose.platform_weight_n,
            "solutions": [{"lengths_m": text(u, 2), "fx_n": text(u, 0), "fz_n": text(u, 1)} for u in found],
        })
    (DATA / "solutions.json").write_text(json.dumps(written, indent=1) + "\n")


if __name__ == "__main__":
    main()
