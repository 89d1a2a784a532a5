#!/usr/bin/env python3
"""Times C that SymPy and CasADi generate for the kernels of energy-bench.

    cargo run --release -p energy-bench -- --inputs DIR
    python3 symbolic_kernels.py DIR [--cc CC] [--repetitions N] [--json] [--keep DIR]

DIR holds, for each kernel, `K1.inputs` and `K1.expected`: little-endian doubles, element by element. Inputs are those of the
textbook formula; what a rest shape determines is in them already. Expected are the value, the gradient and the triangle of
3 x 3 blocks of the Hessian (of K5 the residual and its Jacobian), as the library computes them.

Each kernel's textbook formula is written once, for both packages. SymPy differentiates it, finds common subexpressions (`cse`)
and prints C (`ccode`), integer powers as products. CasADi builds the same outputs by `jacobian` and prints C (`CodeGenerator`).
Both return exactly the expected numbers: neither computes the lower triangle of blocks. All is compiled with
`cc -O3 -march=native` without fast mathematics, compared with the expected results, and timed in turns; medians are printed.

It needs the packages sympy, casadi and numpy, and a C compiler.
"""

import argparse
import ctypes
import json
import os
import statistics
import subprocess
import sys
import tempfile

import casadi
import numpy
import sympy
from sympy.printing.c import C99CodePrinter
from sympy.printing.precedence import PRECEDENCE

TOLERANCE = 1e-9
# Results are written over after so many elements, so that they stay in the cache.
TOGETHER = 16


def sub(a, b):
    return [x - y for x, y in zip(a, b)]


def dot(a, b):
    return sum((x * y for x, y in zip(a[1:], b[1:])), a[0] * b[0])


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def points(x, count):
    return [x[3 * i : 3 * i + 3] for i in range(count)]


def spring(m, c, x):
    p, q = points(x, 2)
    d = sub(q, p)
    return c[0] / 2 * (m.sqrt(dot(d, d)) - c[1]) ** 2


def hair_bend(m, c, x):
    p0, p1, p2 = points(x, 3)
    a, b = sub(p1, p0), sub(p2, p1)
    return c[0] / 2 * (1 - dot(a, b) / (m.sqrt(dot(a, a)) * m.sqrt(dot(b, b))))


def hinge(m, c, x):
    x1, x2, x3, x4 = points(x, 4)
    e, a, b = sub(x4, x3), sub(x1, x3), sub(x2, x3)
    n1, n2 = cross(e, a), cross(b, e)
    sine, cosine = dot(cross(n1, n2), e), dot(n1, n2) * m.sqrt(dot(e, e))
    return c[0] * (m.atan2(sine, cosine) - c[1]) ** 2


def stvk(_m, c, x):
    lam, mu, area = c[:3]
    b = [c[3:5], c[5:7]]
    x0, x1, x2 = points(x, 3)
    d = [sub(x1, x0), sub(x2, x0)]
    f = [[d[0][i] * b[0][j] + d[1][i] * b[1][j] for i in range(3)] for j in range(2)]
    e11, e12, e22 = (dot(f[0], f[0]) - 1) / 2, dot(f[0], f[1]) / 2, (dot(f[1], f[1]) - 1) / 2
    return area * (mu * (e11**2 + 2 * e12**2 + e22**2) + lam / 2 * (e11 + e22) ** 2)


def product(a, b):
    across = cross(a[1:], b[1:])
    return [a[0] * b[0] - dot(a[1:], b[1:])] + [a[0] * b[i + 1] + b[0] * a[i + 1] + across[i] for i in range(3)]


def point_to_plane(m, c, x):
    w, v, n, u = c[:4], c[4:7], c[7:10], c[10:13]
    real, dual = [0] * 4, [0] * 4
    for k in range(4):
        turn, shift = x[6 * k : 6 * k + 3], x[6 * k + 3 : 6 * k + 6]
        angle = m.sqrt(dot(turn, turn))
        sinc = m.sin(angle) / angle
        rotation = [m.cos(angle)] + [t * sinc for t in turn]
        motion = product([0] + shift, rotation)
        real = [sum_ + w[k] * part for sum_, part in zip(real, rotation)]
        dual = [sum_ + w[k] / 2 * part for sum_, part in zip(dual, motion)]
    length = m.sqrt(dot(real, real))
    real, dual = [a / length for a in real], [a / length for a in dual]
    shift = product(dual, [real[0]] + [-a for a in real[1:]])[1:]

    def rotated(y):
        first = cross(real[1:], y)
        second = cross(real[1:], first)
        return [y[i] + 2 * (real[0] * first[i] + second[i]) for i in range(3)]

    point, normal = rotated(v), rotated(n)
    return dot(normal, [point[i] + 2 * shift[i] - u[i] for i in range(3)])


# Name, formula, constants, unknowns, whether second derivatives are wanted.
KERNELS = [
    ("K1", spring, 2, 6, True),
    ("K2", hair_bend, 1, 9, True),
    ("K3", hinge, 2, 12, True),
    ("K4", stvk, 7, 9, True),
    ("K5", point_to_plane, 13, 24, False),
]


def triangle(unknowns):
    """The entries (row, column) of the triangle of blocks, in the library's order."""
    count = unknowns // 3
    blocks = [(i, j) for i in range(count) for j in range(i, count)]
    return [(3 * i + r, 3 * j + c) for i, j in blocks for r in range(3) for c in range(3)]


class Powers(C99CodePrinter):
    """C in which small integer powers are products, as a person would write them: `pow` is slow."""

    def _print_Pow(self, expr):
        base, exponent = expr.as_base_exp()
        if exponent.is_Integer and 1 < abs(exponent) <= 8:
            factor = self.parenthesize(base, PRECEDENCE["Mul"] + 1)
            powers = "*".join([factor] * abs(exponent))
            return f"({powers})" if exponent > 0 else f"(1.0/({powers}))"
        if exponent.is_Rational and exponent.q == 2 and abs(exponent.p) <= 15:
            half = [f"sqrt({self._print(base)})"]
            powers = "*".join(half + [f"({self._print(base)})"] * ((abs(exponent.p) - 1) // 2))
            return f"({powers})" if exponent > 0 else f"(1.0/({powers}))"
        return super()._print_Pow(expr)


def sympy_source(name, formula, constants, unknowns, second):
    c, x = sympy.symbols(f"c:{constants}", real=True), sympy.symbols(f"x:{unknowns}", real=True)
    value = formula(sympy, list(c), list(x))
    gradient = [sympy.diff(value, variable) for variable in x]
    outputs = [value] + gradient
    entries = {}
    if second:
        for row, column in triangle(unknowns):
            key = (min(row, column), max(row, column))
            if key not in entries:
                entries[key] = sympy.diff(gradient[key[0]], x[key[1]])
        outputs += [entries[key] for key in sorted(entries)]
    shared, results = sympy.cse(outputs, symbols=sympy.numbered_symbols("t"), order="none")
    print_c = Powers().doprint
    lines = [f"    double c{i} = in[{i}];" for i in range(constants)]
    lines += [f"    double x{i} = in[{constants + i}];" for i in range(unknowns)]
    lines += [f"    double {symbol} = {print_c(expression)};" for symbol, expression in shared]
    lines += [f"    out[{i}] = {print_c(result)};" for i, result in enumerate(results[: 1 + unknowns])]
    if second:
        places = {key: results[1 + unknowns + i] for i, key in enumerate(sorted(entries))}
        seen = {}
        for i, (row, column) in enumerate(triangle(unknowns)):
            key, place = (min(row, column), max(row, column)), 1 + unknowns + i
            lines.append(f"    out[{place}] = {f'out[{seen[key]}]' if key in seen else print_c(places[key])};")
            seen.setdefault(key, place)
    body = "\n".join(lines)
    return f"static inline void {name}_sympy(const double *in, double *out) {{\n{body}\n}}\n"


def casadi_source(name, formula, constants, unknowns, second, folder):
    c, x = casadi.SX.sym("c", constants), casadi.SX.sym("x", unknowns)
    value = formula(casadi, casadi.vertsplit(c), casadi.vertsplit(x))
    if second:
        hessian, gradient = casadi.hessian(value, x)
        outputs = [value, gradient] + [casadi.vertcat(*[hessian[row, column] for row, column in triangle(unknowns)])]
    else:
        outputs = [value, casadi.gradient(value, x)]
    results = casadi.densify(casadi.vertcat(*outputs))
    function = casadi.Function(f"{name}_casadi", [casadi.vertcat(c, x)], [results], {"cse": True})
    generator = casadi.CodeGenerator(f"{name}_casadi.c", {"with_header": False, "casadi_int": "int"})
    generator.add(function)
    return open(generator.generate(folder + os.sep), encoding="utf-8").read()


LOOP = """
#include <math.h>
#include <time.h>
{source}
static double now(void) {{
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    return at.tv_sec * 1e9 + at.tv_nsec;
}}
void all(const double *in, double *out, long elements) {{
    for (long i = 0; i < elements; i++) {{
        const double *element = in + i * {inputs};
        double *result = out + i * {outputs};
        {call}
    }}
}}
double timed(const double *in, long elements) {{
    static double results[{together} * {outputs}];
    double start = now();
    for (long i = 0; i < elements; i++) {{
        const double *element = in + i * {inputs};
        double *result = results + i % {together} * {outputs};
        {call}
        if (i % {together} == {together} - 1) __asm__ volatile("" : : "r"(results) : "memory");
    }}
    return now() - start;
}}
"""


def compile_c(folder, name, source, call, inputs, outputs, cc):
    path = os.path.join(folder, f"{name}.c")
    library = os.path.join(folder, f"{name}.so")
    with open(path, "w", encoding="utf-8") as file:
        file.write(LOOP.format(source=source, call=call, inputs=inputs, outputs=outputs, together=TOGETHER))
    command = [cc, "-O3", "-march=native", "-fno-fast-math", "-fPIC", "-shared", "-o", library, path, "-lm"]
    subprocess.run(command, check=True)
    code = ctypes.CDLL(library)
    code.timed.restype = ctypes.c_double
    return code


def pointer(array):
    return array.ctypes.data_as(ctypes.c_void_p)


def check(name, unknowns, results, expected):
    """Compares by order of derivative, relative to the largest number of the element, as the program does."""
    for part in (slice(0, 1), slice(1, 1 + unknowns), slice(1 + unknowns, None)):
        found, wanted = results[:, part], expected[:, part]
        if wanted.shape[1] == 0:
            continue
        size = numpy.maximum(numpy.abs(wanted).max(axis=1), sys.float_info.min)
        apart = (numpy.abs(found - wanted).max(axis=1) / size).max()
        if not apart <= TOLERANCE:
            sys.exit(f"{name}: results are off by {apart:.1e}")


def build(kernel, tool, folder, cc):
    name, formula, constants, unknowns, second = kernel
    outputs = 1 + unknowns + (len(triangle(unknowns)) if second else 0)
    if tool == "sympy":
        source = sympy_source(name, formula, constants, unknowns, second)
        call = f"{name}_sympy(element, result);"
    else:
        source = casadi_source(name, formula, constants, unknowns, second, folder)
        call = f"{name}_casadi(&element, &result, 0, 0, 0);"
    return compile_c(folder, f"{name}_{tool}_loop", source, call, constants + unknowns, outputs, cc)


def measure(kernel, folder, inputs_folder, cc, repetitions):
    name, _, constants, unknowns, second = kernel
    inputs = numpy.fromfile(os.path.join(inputs_folder, f"{name}.inputs"), dtype="<f8")
    expected = numpy.fromfile(os.path.join(inputs_folder, f"{name}.expected"), dtype="<f8")
    elements = len(inputs) // (constants + unknowns)
    expected = expected.reshape(elements, -1)
    codes = {tool: build(kernel, tool, folder, cc) for tool in ("sympy", "casadi")}
    for tool, code in codes.items():
        results = numpy.empty_like(expected)
        code.all(pointer(inputs), pointer(results), ctypes.c_long(elements))
        check(f"{name} by {tool}", unknowns, results, expected)
    times = {tool: [] for tool in codes}
    for turn in range(repetitions + 1):
        for tool, code in codes.items():
            time = code.timed(pointer(inputs), ctypes.c_long(elements)) / elements
            if turn > 0:
                times[tool].append(time)
    return [
        {"kernel": name, "tool": tool, "nanoseconds": statistics.median(of), "least": min(of)}
        for tool, of in times.items()
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("inputs", help="the folder that `bench --inputs` wrote")
    parser.add_argument("--cc", default="cc", help="the C compiler")
    parser.add_argument("--repetitions", type=int, default=31, help="turns, of which the median is taken")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--keep", help="keep the generated C in this folder")
    arguments = parser.parse_args()
    if arguments.repetitions < 1:
        parser.error("a median needs repetitions")
    lines = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or temporary
        os.makedirs(folder, exist_ok=True)
        for kernel in KERNELS:
            if os.path.exists(os.path.join(arguments.inputs, f"{kernel[0]}.inputs")):
                lines += measure(kernel, folder, arguments.inputs, arguments.cc, arguments.repetitions)
    if arguments.json:
        json.dump(lines, sys.stdout)
    else:
        for line in lines:
            print(f"{line['kernel']} {line['tool']:8}{line['nanoseconds']:10.1f} ns an element")


if __name__ == "__main__":
    main()
