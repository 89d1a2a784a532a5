"""Overhead of calls from Python, and throughput of a large batch beside Rust.

    cargo bench -p energy-elements --bench matrices --no-run      # prints the path of the program
    python python/benchmarks/calls.py [--rust PROGRAM]

The overhead of a call is its time less that of the same elements in a large batch. Medians of the fastest rounds are
printed, in microseconds.
"""

import argparse
import subprocess
import time

import numpy as np

import energy_dsl as ed


def fastest(call, rounds=400, seconds=0.001):
    """Returns the microseconds of a call in the fastest of some rounds."""
    count = 1
    while (elapsed := timed(call, count)) < seconds:
        count = max(2 * count, int(count * seconds / max(elapsed, 1e-9)))
    return 1e6 * min(timed(call, count) for _ in range(rounds)) / count


def timed(call, count):
    start = time.perf_counter()
    for _ in range(count):
        call()
    return time.perf_counter() - start


def outputs(count, points):
    return np.empty(count), np.empty((count, points, 3)), np.empty((count, 3 * points, 3 * points))


def table(rows):
    print("| call | µs |\n|---|---:|")
    for name, value in rows:
        print(f"| {name} | {value:.2f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rust", help="the program of `cargo bench -p energy-elements --bench matrices`")
    options = parser.parse_args()
    hinge, draw = ed.element("QuadraticHinge"), np.random.default_rng(1)
    one, x, out = hinge.bind(1, k=1.5, θ0=0.25), draw.normal(size=(1, 4, 3)), outputs(1, 4)
    spring = ed.element("HookeSpring").bind(1, K=1.0, L=1.0)
    ends, energy = draw.normal(size=(1, 2, 3)), np.empty(1)
    rows = [
        ("an empty call: `len(hinges)`", fastest(lambda: len(one))),
        ("value of one spring, `out=`", fastest(lambda: spring.value(ends, out=energy))),
        ("value of one spring, new array", fastest(lambda: spring.value(ends))),
        ("Hessian of one hinge, `out=`", fastest(lambda: one.hessian(x, out=out))),
        ("Hessian of one hinge, new arrays", fastest(lambda: one.hessian(x))),
        ("Hessian of one hinge, parameters in the call, `out=`",
         fastest(lambda: hinge.hessian(x, k=1.5, θ0=0.25, out=out))),
    ]
    table(rows)

    count = 10_000
    many, x, out = hinge.bind(count, k=1.5, θ0=0.25), draw.uniform(-1, 1, (count, 4, 3)), outputs(count, 4)
    given, new, rust = [], [], []
    for _ in range(5):
        if options.rust:
            run = subprocess.run([options.rust], check=True, capture_output=True, text=True)
            rust.append(float(run.stdout))
        given.append(1e3 * fastest(lambda: many.hessian(x, out=out), 200) / count)
        new.append(1e3 * fastest(lambda: many.hessian(x), 200) / count)
    print(f"\n{count} hinge Hessians, ns per hinge: `out=` {min(given):.1f}, new arrays {min(new):.1f}", end="")
    print(f"; Rust {min(rust):.1f}, ratio {min(given) / min(rust):.2f}" if rust else "")


if __name__ == "__main__":
    main()
