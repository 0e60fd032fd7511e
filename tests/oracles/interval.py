#!/usr/bin/env python3
"""Writes tests/data/interval.json: ranges of elementary operations on intervals, for the host's
`Interval`. Needs mpmath. Run from anywhere; the output is the same in every run.

A case is one line of numbers: low and high of each operand, then the largest float that is not
above the least value of the operation and the smallest float that is not below its greatest value.
An enclosure [low, high] is sound if and only if low <= the first and high >= the second, so that the
test needs no long numbers. Empty results are written as "inf -inf".

Rational operations are computed exactly; roots are compared with floats by squaring, exactly; the
logarithms and the series of atanh_tail are computed with 120 digits, and a result that has a float
within 1e-80 of it is refused.
"""

import json
import math
import pathlib
import random
from fractions import Fraction

import mpmath

mpmath.mp.dps = 120
OUT = pathlib.Path(__file__).parent.parent / "data" / "interval.json"
INF = math.inf
MAX = math.nextafter(INF, 0.0)
LEAST = 5e-324
rng = random.Random(20240607)


# Brackets ---------------------------------------------------------------------------------------


def nearest(value):
    """Some float close to the rational `value`, perhaps infinite."""
    try:
        return value.numerator / value.denominator
    except OverflowError:
        return INF if value > 0 else -INF


def bracket(guess, is_above):
    """Largest float not above and smallest not below the number of which `is_above(f)` says how the
    finite float f, as a fraction, compares with it (-1 below, 0 equal, 1 above)."""

    def compare(f):
        if math.isinf(f):
            return 1 if f > 0 else -1
        return is_above(Fraction(f))

    low = guess
    while compare(low) > 0:
        low = math.nextafter(low, -INF)
    while True:
        following = math.nextafter(low, INF)
        if following == low or compare(following) > 0:
            break
        low = following
    high = low if compare(low) == 0 else math.nextafter(low, INF)
    return low, high


def bracket_rational(value):
    """For a fraction or an infinity."""
    if isinstance(value, float):
        return value, value
    sign = lambda x: (x > 0) - (x < 0)
    return bracket(nearest(value), lambda f: sign(f - value))


def bracket_root(square, less=Fraction(0)):
    """For sqrt(square) - less, exactly."""

    def compare(f):
        t = f + less
        if t < 0:
            return -1
        return (t * t > square) - (t * t < square)

    with mpmath.workdps(800):
        root = mpmath.sqrt(mpmath.mpf(square.numerator) / square.denominator)
        guess = root - mpmath.mpf(less.numerator) / less.denominator
        guess = float(guess) if guess < MAX else MAX
    return bracket(guess, compare)


def bracket_long(value):
    """For an mpmath number of 120 digits."""
    man, exp = abs(value).man_exp
    exact = Fraction(man) * Fraction(2) ** exp * (1 if value > 0 else -1)
    low, high = bracket_rational(exact)
    for f in (low, high):
        assert abs(Fraction(f) - exact) > abs(exact) * Fraction(1, 10**80), value
    return low, high


# Operations on operands given as (low, high), to the brackets of the range -----------------------


def ends(low, high):
    """Of the range between two numbers, fractions or infinities."""
    return bracket_rational(low)[0], bracket_rational(high)[1]


def exact(x):
    return x if math.isinf(x) else Fraction(x)


def sum_of(x, y):
    # Only ends of the same side meet, so infinities never cancel.
    if isinstance(x, float):
        return x
    return y if isinstance(y, float) else x + y


def product(x, y):
    # Of reals of which one grows without bound: zero times that is zero.
    if x == 0 or y == 0:
        return Fraction(0)
    if isinstance(x, float) or isinstance(y, float):
        return INF if (x > 0) == (y > 0) else -INF
    return x * y


def hull_of_products(a, b):
    products = [product(x, y) for x in a for y in b]
    return min(products), max(products)


def reciprocal(x):
    return Fraction(0) if isinstance(x, float) else 1 / x


def add(a, b):
    return ends(sum_of(exact(a[0]), exact(b[0])), sum_of(exact(a[1]), exact(b[1])))


def neg(a):
    return -a[1], -a[0]


def sub(a, b):
    return add(a, neg(b))


def mul(a, b):
    return ends(*hull_of_products([exact(x) for x in a], [exact(x) for x in b]))


def div(a, b):
    assert b[0] > 0 or b[1] < 0
    return ends(*hull_of_products([exact(x) for x in a], [reciprocal(exact(x)) for x in b]))


def near_and_far(a):
    near = 0.0 if a[0] <= 0 <= a[1] else min(abs(a[0]), abs(a[1]))
    return exact(near), exact(max(abs(a[0]), abs(a[1])))


def square(a):
    near, far = near_and_far(a)
    return ends(product(near, near), product(far, far))


def sqrt(a):
    assert a[1] >= 0
    low = bracket_root(Fraction(max(a[0], 0.0)))[0]
    return low, INF if a[1] == INF else bracket_root(Fraction(a[1]))[1]


def distance(x, z):
    (near_x, far_x), (near_z, far_z) = near_and_far(x), near_and_far(z)
    infinite = isinstance(far_x, float) or isinstance(far_z, float)
    low = bracket_root(near_x**2 + near_z**2)[0]
    return low, INF if infinite else bracket_root(far_x**2 + far_z**2)[1]


def excess(x, z):
    near, far = near_and_far(x)
    at = lambda x, z: bracket_root(x * x + z * z, z)
    low = 0.0 if z[1] == INF else at(near, Fraction(z[1]))[0]
    infinite = isinstance(far, float) or z[0] == -INF
    return low, INF if infinite else at(far, Fraction(z[0]))[1]


def tail_at(q):
    """(atanh(q)/q - 1)/q^2 of a fraction 0 <= q < 1."""
    if q < Fraction(1, 4):
        q2 = mpmath.mpf(q.numerator) / q.denominator
        q2 *= q2
        total, power, k = mpmath.mpf(0), mpmath.mpf(1), 3
        while power > mpmath.mpf(10) ** -115:
            total += power / k
            power *= q2
            k += 2
        if q2 < mpmath.mpf(10) ** -70:
            # Rounds as 1/3 does, a little above it.
            return bracket_rational(Fraction(1, 3))
        return bracket_long(total)
    complement = 1 - q
    ratio = (1 + q) / complement
    q = mpmath.mpf(q.numerator) / q.denominator
    ratio = mpmath.mpf(ratio.numerator) / ratio.denominator
    return bracket_long((mpmath.log(ratio) / (2 * q) - 1) / (q * q))


def tail(q, complement):
    """Over the numbers of `q` whose complement to one is in `complement`."""
    low = max(Fraction(q[0]), 1 - Fraction(complement[1]), Fraction(0))
    high = min(Fraction(q[1]), 1 - Fraction(complement[0]))
    assert low <= high and low < 1
    return tail_at(low)[0], INF if high >= 1 else tail_at(high)[1]


def ln(a):
    at = lambda x: bracket_rational(Fraction(0)) if x == 1 else bracket_long(mpmath.log(mpmath.mpf(x)))
    return at(a[0])[0], INF if a[1] == INF else at(a[1])[1]


def hull(a, b):
    return min(a[0], b[0]), max(a[1], b[1])


def intersection(a, b):
    low, high = max(a[0], b[0]), min(a[1], b[1])
    return (low, high) if low <= high else (INF, -INF)


def around(center, radius):
    c, r = Fraction(center[0]), Fraction(radius[0])
    return ends(c - r, c + r)


# Operands ---------------------------------------------------------------------------------------

EDGES = [0.0, LEAST, 3 * LEAST, 1e-310, 2.0**-1022, 1e-300, 1e-160, 1e-140, 1e-20, 2.0**-53]
EDGES += [0.5, 1 - 2.0**-53, 1.0, 1 + 2.0**-52, 1.5, 1 / 3, 2.5, 2.0**53, 1e100, 1e150, 1e160, 1e300, MAX]


def any_sign(x):
    return x if rng.random() < 0.5 else -x


def edge():
    return any_sign(rng.choice(EDGES))


def ordinary():
    return any_sign(rng.uniform(1.0, 2.0) * 2.0 ** rng.randint(-20, 20))


def extreme():
    return any_sign(rng.uniform(1.0, 2.0) * 2.0 ** rng.randint(-1060, 1022))


def point(number):
    x = number()
    return x, x


def wide(number):
    x, y = sorted((number(), number()))
    return x, y


def thin(number):
    """A few floats wide."""
    x = number()
    y = x
    for _ in range(rng.randint(1, 4)):
        y = math.nextafter(y, INF)
    return x, min(y, MAX)


def unbounded(number):
    x = number()
    return rng.choice([(x, INF), (-INF, x), (-INF, INF)])


KINDS = [(point, ordinary, 30), (point, extreme, 15), (point, edge, 30), (thin, ordinary, 10)]
KINDS += [(wide, ordinary, 30), (wide, extreme, 10), (wide, edge, 25), (unbounded, edge, 8)]


def without_zero(make):
    while True:
        b = make()
        if b[0] > 0 or b[1] < 0:
            return b


def not_negative(make):
    """Not negative as a whole."""
    while True:
        a = make()
        if a[1] >= 0:
            return a


def positive(make):
    while True:
        a = make()
        if a[0] > 0:
            return a


def cases_of(operation, arguments, given, second=lambda make: make(), first=lambda make: make()):
    """Rows of the given operands and of random ones of every kind."""
    operands = list(given)
    for kind, number, count in KINDS:
        make = lambda: kind(number)
        for _ in range(count):
            operands.append([first(make)] + ([second(make)] if arguments == 2 else []))
    return [(row, operation(*row)) for row in operands]


def at(*values):
    """Points."""
    return [(v, v) for v in values]


TINY_STEP = 2.0**-60
# Sums that round to a power of two, or half way between two floats, from either side.
SUMS = [at(a, s * b) for a in (1.0, -1.0, 4.0, 1 - 2.0**-53, 1 + 2.0**-52, -1 - 2.0**-52)
        for b in (TINY_STEP, 2.0**-53, 2.0**-54, 2.0**-54 + TINY_STEP) for s in (1, -1)]
SUMS += [at(MAX, MAX), at(-MAX, -MAX), at(MAX, 2.0**970), at(LEAST, LEAST), at(1e-310, -LEAST)]
SUMS += [at(2.0**-1022, -LEAST), at(0.1, 0.2), at(0.0, 0.0), at(1e16, 1.0), at(1e16, 3.0)]
# Products just beside a power of two, half way, below the least number and above the largest.
PRODUCTS = [at(s * (1 + 2.0**-k), 1 - 2.0**-k) for k in (27, 30, 40, 52) for s in (1, -1)]
PRODUCTS += [at(s * a, b) for s in (1, -1) for a, b in (
    (1e-200, 1e-200), (LEAST, 0.5), (LEAST, 1.5), (LEAST, 0.25), (1e-160, 1e-160), (1e-300, 1e-10),
    (1e200, 1e200), (1e154, 1.5e154), (0.0, MAX), (1 + 2.0**-52, 1.5), (1 + 2.0**-27, 1 + 2.0**-26),
    (2.0**-1022, 1 - 2.0**-53), (0.1, 3.0), (1 / 3, 3.0))]
PRODUCTS += [[a, b] for a in ((-1.5, 0.7), (0.1, 0.3), (-0.3, -0.1), (0.0, 0.3), (-0.3, 0.0), (0.0, 0.0))
             for b in ((-2.3, 1.1), (0.7, 1.3), (-1.3, -0.7), (0.0, 1.3), (0.7, INF), (-INF, -0.7), (-INF, INF))]
QUOTIENTS = [at(s * a, b) for s in (1, -1) for a, b in (
    (1.0, 3.0), (2.0, 3.0), (1.0, 49.0), (0.0, 5.0), (LEAST, 2.0), (LEAST, 3.0), (1e-200, 1e200),
    (1e200, 1e-200), (1.0, MAX), (1.0, LEAST), (6.0, 3.0), (MAX, 0.5), (1 - 2.0**-53, 1 + 2.0**-52),
    (1.0, 1 + 2.0**-52), (1.0, 1 - 2.0**-53), (-1.0, 3.0), (1.0, -3.0), (-2.0, -3.0))]
QUOTIENTS += [[a, b] for a in ((-1.5, 0.7), (0.1, 0.3), (-0.3, -0.1), (0.0, 0.3), (-0.3, 0.0), (0.0, 0.0), (-INF, 1.0))
              for b in ((0.7, 1.3), (-1.3, -0.7), (LEAST, 1.3), (0.7, INF), (-INF, -0.7))]
SQUARES = [at(x) for k in (26, 27, 30, 52) for x in (1 + 2.0**-k, 1 - 2.0**-k, -1 - 2.0**-k)]
SQUARES += [at(x) for x in (1e-162, 1e-165, 2.0**-537, 1e-160, 1e-154, 1e154, 1.4e154, 1e300, 0.1, 3.0)]
SQUARES += [[(-1e200, 0.1)], [(-0.1, 1e-170)], [(1e-170, 0.3)], [(-3.0, -0.1)], [(0.1, 1e200)]]
ROOTS = [at(x) for x in (0.0, LEAST, 3 * LEAST, 2.0, 3.0, 4.0, 0.25, 1e-300, 1e300, MAX, 1 - 2.0**-53,
                         1 + 2.0**-52, 4 + 2.0**-50, 4 - 2.0**-51, (1 + 2.0**-30) ** 2, 1e-160)]
ROOTS += [[(-1.0, 2.0)], [(-1.0, 0.0)], [(0.0, 3.0)], [(2.0, INF)], [(-INF, INF)], [(0.5, 7.0)]]
LOGARITHMS = [at(x) for x in (1.0, 2.0, 5 / 3, 0.5, LEAST, 1e-310, 1e300, MAX, 1 - 2.0**-53, 1 + 2.0**-52, 3.0, 7.3)]
LOGARITHMS += [at(rng.uniform(1.6, 100.0)) for _ in range(30)]
# Both regimes of the distance and their borders, cancellation, squares that underflow or overflow.
MAGNITUDES = (0.0, LEAST, 1e-310, 1e-170, 9.9e-141, 1.1e-140, 1e-20, 1e-8, 0.1, 1.0, 3.0, 1e16, 9.9e149, 1.1e150, 1e200, MAX)
PLANES = [at(x, s * z) for x in MAGNITUDES for z in MAGNITUDES for s in (1, -1) if rng.random() < 0.3]
PLANES += [at(3.0, 4.0), at(3.0, -4.0), at(1e-9, 1.0), at(1e-9, -1.0), at(-1e-170, 1e-170), at(1e-300, 1e-300)]
PLANES += [[x, z] for x in ((-1.0, 2.0), (0.3, 0.4), (-0.4, -0.3), (0.0, 0.0), (1e-200, 1e-9), (0.1, INF))
           for z in ((-2.0, 1.0), (0.1, 0.7), (-0.7, -0.1), (0.0, 0.0), (5.0, 5e9), (-INF, 0.1), (0.1, INF))]
CENTERS = SUMS[:30] + [at(x, r) for x in (0.0, 1.0, -1 / 3, 1e300, -1e-310, 7.7) for r in (0.0, LEAST, 1e-17, 0.1, 3.3, 1e200)]
CENTERS = [[c, (abs(r[0]), abs(r[0]))] for c, r in CENTERS]


def towards_one(complement):
    """The floats around 1 - complement."""
    return bracket_rational(1 - Fraction(complement))


def tails():
    """Rows of q and complement: the same number, or one the wider view of the other."""
    rows = []
    quarter = 0.25
    near_quarter = [math.nextafter(quarter, 0.0), quarter, math.nextafter(quarter, 1.0)]
    qs = [0.0, LEAST, 1e-300, 1e-160, 1e-40, 1e-20, 1e-8, 1e-5, 0.0624, 0.0625, 0.063, 0.2, 0.249]
    qs += near_quarter + [0.251, 0.3, 0.5, 0.75, 0.9, 0.99, 1 - 2.0**-20, 1 - 2.0**-40, 1 - 2.0**-53]
    qs += [rng.uniform(0.0, 0.25) for _ in range(40)] + [rng.uniform(0.25, 1.0) for _ in range(40)]
    full, unit = (-1.0, 2.0), (0.0, 1.0)
    for q in qs:
        # q alone, as a point beside its complement, and a few floats wide.
        rows.append([(q, q), full])
        around_q = bracket_rational(1 - Fraction(q))
        rows.append([(q, q), around_q])
        if rng.random() < 0.5:
            rows.append([(math.nextafter(q, -1.0), math.nextafter(q, 1.0)), around_q])
    complements = [10.0**-k for k in (1, 3, 5, 8, 10, 12, 15, 16, 17, 20, 30, 100, 160, 300, 310)]
    complements += [LEAST, 0.5, 0.75, math.nextafter(0.75, 1.0), 0.76, 1.0]
    complements += [rng.uniform(1.0, 2.0) * 2.0 ** -rng.randint(2, 80) for _ in range(40)]
    for c in complements:
        rows.append([towards_one(c), (c, c)])
        rows.append([unit, (c, c)])
        low, high = towards_one(c)
        rows.append([(math.nextafter(low, 0.0), math.nextafter(high, 2.0)), (c, math.nextafter(c, 1.0))])
    # Wide: the tighter view differs from end to end.
    for _ in range(25):
        a, b = sorted((rng.uniform(0.0, 1.0), rng.uniform(0.0, 1.0)))
        c, d = 1.0 - b, 1.0 - a
        rows.append([(a, b), (0.5 * c, 0.5 * (1.0 + d))])
        rows.append([(0.5 * a, 0.5 * (1.0 + b)), (c, d)])
        rows.append([(a, 0.5 * (1.0 + b)), (c, 0.5 * (1.0 + d))])
        rows.append([(0.5 * a, b), (0.5 * c, d)])
    rows += [[(0.0, 1.0), (0.0, 1.0)], [(0.1, 1.0), (0.0, 0.9)], [(0.2, 0.3), full], [(-1e-17, 1e-17), (1.0, 1.0)]]
    rows += [[(0.5, 1.5), (-0.5, 0.5)], [(-0.5, 0.5), (0.5, 1.5)], [(0.1, 0.2), (0.8, 0.9)], [full, (0.9, 1.1)]]
    return [(row, tail(*row)) for row in rows]


def constants():
    """Reciprocals, given as the float next to them, and the fraction itself must be enclosed."""
    return [(at(1.0 / k), bracket_rational(Fraction(1, k))) for k in range(1, 60)]


def main():
    data = {
        "add": cases_of(add, 2, SUMS),
        "sub": cases_of(sub, 2, SUMS),
        "mul": cases_of(mul, 2, PRODUCTS),
        "div": cases_of(div, 2, QUOTIENTS, second=without_zero),
        "neg": cases_of(neg, 1, []),
        "square": cases_of(square, 1, SQUARES),
        "sqrt": cases_of(sqrt, 1, ROOTS, first=not_negative),
        "ln": cases_of(ln, 1, LOGARITHMS, first=positive),
        "hull": cases_of(hull, 2, []),
        "intersection": cases_of(intersection, 2, []),
        "around": [(row, around(*row)) for row in CENTERS],
        "distance": cases_of(distance, 2, PLANES),
        "excess": cases_of(excess, 2, PLANES),
        "tail": tails(),
        "constant": constants(),
    }
    lines = {
        name: [" ".join(repr(x) for pair in (*row, result) for x in pair) for row, result in rows]
        for name, rows in data.items()
    }
    OUT.write_text(json.dumps(lines, indent=0) + "\n")
    print({name: len(rows) for name, rows in lines.items()}, OUT.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
