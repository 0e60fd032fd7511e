"""Writes the trajectories beside it, for MARIONET-CRANE; the platform stays level.

out-and-back.csv, a minute at 0.5 m/s: eight rounds of a tilted circle through (2, 7, 2.5), where all six cables are
taut, then out to where cable 4 hangs slack and back. Every leg begins and ends at rest; the speed rises and falls
smoothly within two seconds.

there-and-back.csv, eight seconds: a metre through the all-taut region and back, from rest to rest.

    python3 host-sim/trajectories/make.py
"""
from math import cos, hypot, pi, sin
from pathlib import Path

SPEED_M_S, RAMP_S, STEP_S = 0.5, 2.0, 0.1
START = (2.0, 7.0, 2.5)


def circle(phase):
    return (START[0] + 0.48 * sin(phase), START[1] + 0.48 * (1 - cos(phase)), START[2] + 0.1 * (1 - cos(phase)))


def legs():
    rounds = 8
    fine = 20000
    yield [circle(2 * pi * rounds * i / fine) for i in range(fine + 1)]
    out = (3.28, 7.0, 2.5)
    line = [tuple(a + (b - a) * i / 2000 for a, b in zip(START, out)) for i in range(2001)]
    yield line
    yield line[::-1]


def way_m(time_s, length_m):
    """Way along a leg: speed rises as 3u^2 - 2u^3, stays, falls; shorter ramps where the leg is too short."""
    ramp_s = min(RAMP_S, length_m / SPEED_M_S)
    total_s = length_m / SPEED_M_S + ramp_s
    if time_s > total_s / 2:
        return length_m - way_m(total_s - time_s, length_m) if time_s < total_s else length_m
    u = min(time_s / ramp_s, 1.0)
    return SPEED_M_S * (ramp_s * (u**3 - u**4 / 2) + max(time_s - ramp_s, 0.0))


def out_and_back():
    begin_s = 0.0
    rows = []
    for points in legs():
        ways = [0.0]
        for a, b in zip(points, points[1:]):
            ways.append(ways[-1] + hypot(*(p - q for p, q in zip(a, b))))
        length_m = ways[-1]
        total_s = length_m / SPEED_M_S + min(RAMP_S, length_m / SPEED_M_S)
        steps = round(total_s / STEP_S)
        j = 0
        for step in range(0 if not rows else 1, steps + 1):
            way = way_m(total_s * step / steps, length_m)
            while j + 2 < len(ways) and ways[j + 1] < way:
                j += 1
            share = (way - ways[j]) / (ways[j + 1] - ways[j])
            place = [a + (b - a) * share for a, b in zip(points[j], points[j + 1])]
            rows.append((begin_s + total_s * step / steps, *place))
        begin_s += total_s
    return rows


def there_and_back():
    for i in range(81):
        u = i / 40 if i <= 40 else 2 - i / 40
        s = u**3 * (10 - 15 * u + 6 * u * u)
        yield STEP_S * i, *(a + s * d for a, d in zip(START, (0.3, 1.0, 0.1)))


def write(name, rows):
    with open(Path(__file__).with_name(name), "w", encoding="ascii") as file:
        print("# Written by make.py beside it. Position of the platform, which stays level.", file=file)
        print("time_s,x_m,y_m,z_m", file=file)
        for row in rows:
            print(",".join(f"{number:.6f}" for number in row), file=file)


write("out-and-back.csv", out_and_back())
write("there-and-back.csv", there_and_back())
