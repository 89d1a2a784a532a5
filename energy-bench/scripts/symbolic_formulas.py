#!/usr/bin/env python3
"""Times what SymPy generates for the twelve formulas of energy-bench: C, scalar and vectorised over elements, and Python
compiled by numba.

    cargo run --release --manifest-path energy-bench/Cargo.toml -- --formulas --inputs DIR
    python3 symbolic_formulas.py DIR [--elements N ...] [--cc CC] [--repetitions N]

`DIR/NAME.inputs` has the constants and coordinates of each element as little-endian doubles, `DIR/NAME.expected` value,
gradient and upper triangle of 3 x 3 Hessian blocks. More elements than the file has repeat them.

Each formula is written as papers print it. SymPy differentiates it and eliminates common subexpressions (`cse`). From
that come three programs:

- `scalar`: C, one element at a time, `-O3 -march=native`. Inputs and results are element by element.
- `vectors`: the same C, eight elements at a time in a loop that the compiler vectorises, `-O3 -march=native -ffast-math`.
  The numbers of eight elements are interleaved.
- `numba`: Python, one element at a time, `njit(fastmath=True)`. Inputs and results are element by element.

Results are compared with the expected ones to 1e-9. Then all programs run in turns, and medians are printed. With
`--serve`, another program sets the turns: it writes `prepare NAME ELEMENTS` or `run` in a line each, and reads JSON.

The script needs numpy, sympy and a C compiler; without numba, that program is left out with a note.
"""

import argparse
import ctypes
import importlib.util
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

# The other programs' memory has ordinary pages, too.
os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")
import numpy

from symbolic_kernels import check, cross, dot, pointer, points, sub, sympy_derivatives, sympy_source, triangle

# Elements whose numbers are interleaved: one register of AVX-512, two of AVX2.
TOGETHER = 8


def norm2(v):
    return dot(v, v)


def lennard_jones(_m, c, x):
    k, s = c
    p, q = points(x, 2)
    r = s**2 / norm2(sub(p, q))
    return 4 * k * (r**6 - r**3)


def lagged_friction(m, c, x):
    y, u, v = c[:3], c[3:6], c[6:9]
    b, g, lam, eps = c[9:]
    x0, x1, x2, x3 = points(x, 4)
    d = [x0[i] - (1 - b - g) * x1[i] - b * x2[i] - g * x3[i] - y[i] for i in range(3)]
    s = m.sqrt(dot(d, u) ** 2 + dot(d, v) ** 2)
    return lam * m.Piecewise((s**2 / eps - s**3 / (3 * eps**2) + eps / 3, s < eps), (s, True))


def line_barrier(m, c, x):
    k, a = c
    x0, x1, x2, x3 = points(x, 4)
    n = cross(sub(x1, x0), sub(x3, x2))
    s = dot(n, sub(x2, x0)) ** 2 / norm2(n)
    return -k * (s - a) ** 2 * m.log(s / a)


def curvature_binormal(m, c, x):
    p, q, r = points(x, 3)
    e, f = sub(q, p), sub(r, q)
    scale = 2 / (m.sqrt(norm2(e)) * m.sqrt(norm2(f)) + dot(e, f))
    return c[0] / 2 * norm2([scale * component for component in cross(e, f)])


def surface_area(m, c, x):
    k, a = c
    x0, x1, x2 = points(x, 3)
    return k * (m.sqrt(norm2(cross(sub(x1, x0), sub(x2, x0)))) / 2 - a) ** 2


def cohesive_zone(m, c, x):
    k, delta = c
    a0, a1, a2, b0, b1, b2 = points(x, 6)
    g = [(a0[i] + a1[i] + a2[i] - b0[i] - b1[i] - b2[i]) / 3 for i in range(3)]
    p = [(a1[i] + b1[i] - a0[i] - b0[i]) / 2 for i in range(3)]
    q = [(a2[i] + b2[i] - a0[i] - b0[i]) / 2 for i in range(3)]
    n = cross(p, q)
    area = m.sqrt(norm2(n))
    t = dot(g, n) / area
    r = m.sqrt((t**2 + norm2(g)) / 2) / delta
    return k * (1 - (1 + r) * m.exp(-r)) * area / 2


def brick(m, c, x):
    mu, lam = c
    a, b, c_, d, e, f, g, h = points(x, 8)
    u = [(b[i] + c_[i] + f[i] + g[i] - a[i] - d[i] - e[i] - h[i]) / 4 for i in range(3)]
    v = [(c_[i] + d[i] + g[i] + h[i] - a[i] - b[i] - e[i] - f[i]) / 4 for i in range(3)]
    w = [(e[i] + f[i] + g[i] + h[i] - a[i] - b[i] - c_[i] - d[i]) / 4 for i in range(3)]
    j = dot(u, cross(v, w))
    return mu * (norm2(u) + norm2(v) + norm2(w)) / j ** m.Rational(2, 3) + lam * (j - 1) ** 2


def deformation(m, c, x):
    """F = D B of a tetrahedron."""
    x0, x1, x2, x3 = points(x, 4)
    edges = m.Matrix([sub(x1, x0), sub(x2, x0), sub(x3, x0)]).T
    return edges * m.Matrix(3, 3, c[:9])


def ddot(a, b):
    return dot(list(a), list(b))


def determinant(f):
    return dot(list(f[:, 0]), cross(list(f[:, 1]), list(f[:, 2])))


def symmetric_dirichlet(m, c, x):
    f = deformation(m, c, x)
    g = f.adjugate() / determinant(f)
    return c[9] * (ddot(f, f) + ddot(g, g))


def mooney_rivlin(m, c, x):
    mu, lam, kappa = c[9:]
    f = deformation(m, c, x)
    right, j = f.T * f, determinant(f)
    first = right.trace()
    second = (first**2 - ddot(right, right)) / 2
    third = m.Rational(1, 3)
    return mu * (first * j ** (-2 * third) - 3) + lam * (second * j ** (-4 * third) - 3) + kappa * (j - 1) ** 2


def strain(m, c, x):
    f = deformation(m, c, x)
    return (f.T * f - m.eye(3)) / 2


def fung(m, c, x):
    a, b = c[9:]
    e = strain(m, c, x)
    return a * (m.exp(b * ddot(e, e)) - 1)


def fibres(m, c, x):
    u, v, (a, b, k) = m.Matrix(c[9:12]), m.Matrix(c[12:15]), c[15:]
    f = deformation(m, c, x)
    right = f.T * f
    p, q = (u.T * right * u)[0] - 1, (v.T * right * v)[0] - 1
    return k * (right.trace() - 3) + a / (2 * b) * (m.exp(b * p**2) + m.exp(b * q**2) - 2)


def st_venant_kirchhoff(m, c, x):
    mu, lam = c[9:]
    e = strain(m, c, x)
    return mu * ddot(e, e) + lam / 2 * e.trace() ** 2


# Name, formula, number of constants, number of coordinates.
FORMULAS = [
    ("LennardJones", lennard_jones, 2, 6),
    ("LaggedFriction", lagged_friction, 13, 12),
    ("LineBarrier", line_barrier, 2, 12),
    ("CurvatureBinormal", curvature_binormal, 1, 9),
    ("SurfaceArea", surface_area, 2, 9),
    ("CohesiveZone", cohesive_zone, 2, 18),
    ("Brick", brick, 2, 24),
    ("SymmetricDirichlet", symmetric_dirichlet, 10, 12),
    ("MooneyRivlin", mooney_rivlin, 12, 12),
    ("Fung", fung, 11, 12),
    ("Fibres", fibres, 18, 12),
    ("StVenantKirchhoff", st_venant_kirchhoff, 11, 12),
]


LOOP = """
#include <math.h>
{source}
void all(const double *restrict in, double *restrict out, long blocks) {{
    for (long block = 0; block < blocks; block++) {{
        {simd}
        for (int lane = 0; lane < {together}; lane++)
            {name}_sympy(in + block * {inputs} * {together} + lane, out + block * {outputs} * {together} + lane);
    }}
}}
"""


class CCode:
    """A compiled loop over blocks of elements, whose numbers are interleaved."""

    def __init__(self, formula, derivatives, together, folder, options):
        name, _, constants, unknowns = formula
        self.together, self.outputs = together, 1 + unknowns + len(triangle(unknowns))
        stride = f" * {together}" if together > 1 else ""
        source = sympy_source(name, derivatives, constants, unknowns, stride)
        path = os.path.join(folder, f"{name}_{together}.c")
        simd = "#pragma omp simd" if together > 1 else ""
        shape = {"inputs": constants + unknowns, "outputs": self.outputs, "together": together}
        with open(path, "w", encoding="utf-8") as file:
            file.write(LOOP.format(source=source, name=name, simd=simd, **shape))
        fast = ["-ffast-math", "-fopenmp-simd"] if together > 1 else ["-fno-fast-math"]
        flags = ["-O3", "-march=native", *fast, "-fPIC", "-shared", "-o", path[:-2] + ".so", path, "-lmvec", "-lm"]
        subprocess.run([options.cc] + flags, check=True)
        self.code = ctypes.CDLL(path[:-2] + ".so")

    def arranged(self, rows):
        return interleaved(rows, self.together)

    def run(self, inputs, results):
        self.code.all(pointer(inputs), pointer(results), ctypes.c_long(len(inputs) // self.together))

    def rows(self, results):
        """Returns one row per element."""
        blocks = results.reshape(-1, self.outputs, self.together)
        return blocks.transpose(0, 2, 1).reshape(results.shape)


def interleaved(rows, together):
    blocks = rows.reshape(-1, together, rows.shape[1])
    return numpy.ascontiguousarray(blocks.transpose(0, 2, 1)).reshape(rows.shape)


class NumbaCode:
    """The same expressions as a loop in Python, compiled by numba."""

    def __init__(self, formula, derivatives, *_):
        import math

        import numba
        from sympy.printing.pycode import PythonCodePrinter

        _, _, constants, unknowns = formula
        shared, outputs = derivatives
        text = PythonCodePrinter({"fully_qualified_modules": False}).doprint
        lines = ["def loop(inputs, results):", "    for e in range(inputs.shape[0]):"]
        lines += [f"        c{i} = inputs[e, {i}]" for i in range(constants)]
        lines += [f"        x{i} = inputs[e, {constants + i}]" for i in range(unknowns)]
        lines += [f"        {symbol} = {text(expression)}" for symbol, expression in shared]
        lines += [f"        results[e, {i}] = {text(expression)}" for i, expression in enumerate(outputs)]
        names = {name: getattr(math, name) for name in ("sqrt", "exp", "log")}
        exec("\n".join(lines), names)  # noqa: S102
        matrix = numba.float64[:, ::1]
        self.loop = numba.njit(numba.void(matrix, matrix), fastmath=True, error_model="numpy")(names["loop"])

    def arranged(self, rows):
        return rows

    def run(self, inputs, results):
        self.loop(inputs, results)

    def rows(self, results):
        return results


class Programs:
    """All programs for one formula."""

    def __init__(self, formula, builders, folder, options):
        self.name, text, constants, self.unknowns = formula
        self.inputs = self.read(options, "inputs").reshape(-1, constants + self.unknowns)
        self.expected = self.read(options, "expected").reshape(len(self.inputs), -1)
        start = time.perf_counter()
        derivatives = sympy_derivatives(text, constants, self.unknowns, True)
        derived = time.perf_counter() - start
        self.codes, self.seconds = {}, {}
        for program, build in builders.items():
            start = time.perf_counter()
            self.codes[program] = build(formula, derivatives, folder, options)
            self.seconds[program] = derived + time.perf_counter() - start

    def read(self, options, which):
        return numpy.fromfile(os.path.join(options.inputs, f"{self.name}.{which}"), dtype="<f8")

    def prepare(self, elements):
        """Arranges inputs for so many elements, and compares results."""
        self.elements = elements
        repeated = numpy.resize(self.inputs, (elements, self.inputs.shape[1]))
        self.results = numpy.empty((elements, self.expected.shape[1]))
        self.arranged = {program: code.arranged(repeated) for program, code in self.codes.items()}
        compared = min(elements, len(self.inputs))
        for program, code in self.codes.items():
            code.run(self.arranged[program], self.results)
            found = code.rows(self.results)[:compared]
            check(f"{self.name} by {program}", self.unknowns, found, self.expected[:compared])

    def run(self):
        """Runs each program twice and returns the time of the second run in nanoseconds per element."""
        times = {}
        for program, code in self.codes.items():
            # Caches then hold what is left of this program, not of others.
            code.run(self.arranged[program], self.results)
            start = time.perf_counter()
            code.run(self.arranged[program], self.results)
            times[program] = (time.perf_counter() - start) * 1e9 / self.elements
        return times


def serve(builders, notes, folder, options):
    """Follows the commands of another program."""
    prepared = None
    formulas = {formula[0]: formula for formula in FORMULAS}
    print(json.dumps({"notes": notes}), flush=True)
    for line in sys.stdin:
        command, *arguments = line.split()
        if command == "prepare":
            name, elements = arguments
            if prepared is None or prepared.name != name:
                prepared = Programs(formulas[name], builders, folder, options)
            prepared.prepare(int(elements))
            print(json.dumps(prepared.seconds), flush=True)
        elif command == "run":
            print(json.dumps(prepared.run()), flush=True)
        else:
            sys.exit(f"expected `prepare` or `run`, got `{command}`")


def print_times(builders, folder, options):
    for formula in FORMULAS:
        if not os.path.exists(os.path.join(options.inputs, f"{formula[0]}.inputs")):
            continue
        programs = Programs(formula, builders, folder, options)
        for elements in options.elements:
            programs.prepare(elements)
            turns = [programs.run() for _ in range(options.repetitions)]
            for program in builders:
                median = statistics.median(turn[program] for turn in turns)
                print(f"{formula[0]:20}{program:10}{elements:10}{median:10.1f} ns per element", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("inputs", help="the folder that `bench --formulas --inputs` wrote")
    parser.add_argument("--elements", type=int, nargs="+", default=[10_000, 1_000_000], help="multiples of 16")
    parser.add_argument("--cc", default="cc", help="the C compiler")
    parser.add_argument("--repetitions", type=int, default=7, help="runs of each program; the median is printed")
    parser.add_argument("--serve", action="store_true", help="follow the commands of another program")
    options = parser.parse_args()
    if options.repetitions < 1:
        parser.error(f"expected at least one repetition, got {options.repetitions}")
    if any(elements < 16 or elements % 16 for elements in options.elements):
        parser.error(f"expected numbers of elements that are multiples of 16, got {options.elements}")
    builders = {
        "scalar": lambda formula, derivatives, *rest: CCode(formula, derivatives, 1, *rest),
        "vectors": lambda formula, derivatives, *rest: CCode(formula, derivatives, TOGETHER, *rest),
    }
    notes = []
    if importlib.util.find_spec("numba"):
        builders["numba"] = NumbaCode
    else:
        notes.append(f"numba was not measured: {sys.executable} has no package numba")
    with tempfile.TemporaryDirectory() as folder:
        if options.serve:
            serve(builders, notes, folder, options)
            return
        print_times(builders, folder, options)
    for note in notes:
        print(f"note: {note}")


if __name__ == "__main__":
    main()
