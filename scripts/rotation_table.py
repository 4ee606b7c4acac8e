#!/usr/bin/env python3
"""Writes crates/ghand-core/tests/data/rotations.txt: rotations and their derivative at 50 digits, rounded to f64.

Needs mpmath. A line is: name, then 24 f64 as hexadecimal bits: v (3), R(v) row by row (9), a matrix G row by row (9)
and the gradient of <G, R(v)> to v (3). The gradient comes from the Jacobian of the exponential map, not from a
derivative of Rodrigues' coefficients.
"""

import pathlib
import random
import struct

from mpmath import cos, matrix, mp, mpf, pi, sin, sqrt

AXES = {
    "x": (1, 0, 0),
    "-y": (0, -1, 0),
    "z": (0, 0, 1),
    "diagonal": (1, 1, 1),
    "skew": (0.26, -0.53, 0.81),
    "nearly x": (1, 1e-9, -1e-4),
    "nearly -z": (-1e-300, 1e-12, -1),
}
PI, TAU = float(pi), float(2 * pi)
ANGLES = {
    "0": 0.0, "5e-324": 5e-324, "1e-300": 1e-300, "1e-160": 1e-160, "1e-12": 1e-12, "1e-8": 1e-8, "1e-4": 1e-4,
    "0.1": 0.1, "0.3": 0.3, "0.45": 0.45, "0.5 - 1e-9": 0.5 - 1e-9, "0.5 + 1e-9": 0.5 + 1e-9, "0.55": 0.55, "1": 1.0,
    "2": 2.0, "pi - 1e-9": PI - 1e-9, "pi": PI, "pi + 1e-9": PI + 1e-9, "2 pi - 1e-9": TAU - 1e-9, "2 pi": TAU,
    "2 pi + 1e-9": TAU + 1e-9, "12": 12.0, "100": 100.0, "1e4": 1e4, "1e8": 1e8, "1e12": 1e12, "1e15": 1e15,
}


def bits(x):
    """The f64 nearest to x."""
    return struct.pack(">d", float(x)).hex()


def skew(v):
    return matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def rotation_and_gradient(v, g):
    """R(v), and d<G, R(v)>/dv = J^T u with u_i = <G, R [e_i]x>, J = a I - b [v]x + c v v^T (the right Jacobian)."""
    square = sum(x * x for x in v)
    angle = sqrt(square)
    if angle < mpf(10) ** -20:  # The next terms are below 1e-40.
        a, b, c = 1 - square / 6, mpf(1) / 2 - square / 24, mpf(1) / 6 - square / 120
    else:
        a, b, c = sin(angle) / angle, (1 - cos(angle)) / square, (angle - sin(angle)) / (square * angle)
    column = matrix(v)
    outer = column * column.T
    unit = matrix([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    rotation = unit + a * skew(v) + b * skew(v) * skew(v)
    jacobian = a * unit - b * skew(v) + c * outer
    turns = [rotation * skew([unit[i, k] for k in range(3)]) for i in range(3)]
    u = matrix([sum(g[r, k] * t[r, k] for r in range(3) for k in range(3)) for t in turns])
    return rotation, jacobian.T * u


def main():
    # Enough for the sine of 1e15 and for 1 - cos of tiny angles, with 50 digits left.
    mp.dps = 120
    rng = random.Random(1)
    lines = ["# name | v, R, G, d<G, R>/dv as f64 bits; written by scripts/rotation_table.py"]
    for angle_name, angle in ANGLES.items():
        for axis_name, axis in AXES.items():
            length = sum(x * x for x in axis) ** 0.5
            v = [angle * (x / length) for x in axis]
            g = [rng.uniform(-1, 1) for _ in range(9)]
            rotation, gradient = rotation_and_gradient([mpf(x) for x in v], matrix(3, 3) + matrix([g[:3], g[3:6], g[6:]]))
            numbers = [*v, *rotation, *g, *gradient]
            lines.append(f"{angle_name} about {axis_name} | " + " ".join(map(bits, numbers)))
    path = pathlib.Path(__file__).resolve().parent.parent / "crates/ghand-core/tests/data/rotations.txt"
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


main()
