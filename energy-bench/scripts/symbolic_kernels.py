#!/usr/bin/env python3
"""Times C that SymPy and CasADi generate for the kernels of energy-bench, and TinyAD in C++.

    cargo run --release --manifest-path energy-bench/Cargo.toml -- --inputs DIR
    python3 symbolic_kernels.py DIR [--cc CC] [--repetitions N] [--json] [--keep DIR]
    python3 symbolic_kernels.py DIR --tinyad TINYAD/include EIGEN [--cxx CXX]

DIR contains little-endian doubles, element by element. Inputs are the constants and unknowns of the textbook formula;
numbers that depend on the rest shape alone are precomputed.

- `K1.inputs`: the inputs of kernel K1.
- `K1.expected`: generated value, gradient and upper triangle of 3 x 3 Hessian blocks (K5: residual and Jacobian).
- `K1.near_rest`, `K1.coincident`: inputs near rest and at coincident points. Results are returned, not compared.

Each textbook formula is written once for both packages. SymPy differentiates it, eliminates common subexpressions
(`cse`) and prints C (`ccode`), with integer powers as products. CasADi differentiates it (`hessian`, `gradient`) and
prints C (`CodeGenerator`). Both return exactly the expected numbers: neither computes the lower triangle of blocks.

TinyAD is header-only and needs Eigen. `--tinyad` takes the include folders of both. `tinyad_kernels.hpp` has the
formulas.

All code is compiled with `-O3 -march=native` without fast mathematics, and its results are compared with the expected
ones. Then all tools run in turns, and medians are printed. A package that is not installed is left out with a note.

The script needs numpy and a C compiler.
"""

import argparse
import ctypes
import importlib.util
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile

import numpy

TOLERANCE = 1e-9
# Number of elements whose results the buffer holds. It stays in the cache.
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


# Name, formula, number of constants, number of unknowns, whether to compute second derivatives.
KERNELS = [
    ("K1", spring, 2, 6, True),
    ("K2", hair_bend, 1, 9, True),
    ("K3", hinge, 2, 12, True),
    ("K4", stvk, 7, 9, True),
    ("K5", point_to_plane, 13, 24, False),
]


def triangle(unknowns):
    """Returns the entries (row, column) of the upper triangle of blocks, in the order of generated code."""
    count = unknowns // 3
    blocks = [(i, j) for i in range(count) for j in range(i, count)]
    return [(3 * i + r, 3 * j + c) for i, j in blocks for r in range(3) for c in range(3)]


def sympy_printer():
    """Returns a function that prints C. Small integer powers become products, because `pow` is slow."""
    from sympy.printing.c import C99CodePrinter
    from sympy.printing.precedence import PRECEDENCE

    class Powers(C99CodePrinter):
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

    return Powers().doprint


def sympy_derivatives(formula, constants, unknowns, second):
    """Returns common subexpressions, then value, gradient and, if asked, the triangle of Hessian blocks by them."""
    import sympy

    c, x = sympy.symbols(f"c:{constants}", real=True), sympy.symbols(f"x:{unknowns}", real=True)
    value = formula(sympy, list(c), list(x))
    gradient = [sympy.diff(value, variable) for variable in x]
    outputs = [value] + gradient
    if second:
        entries = {(i, j): sympy.diff(gradient[i], x[j]) for i in range(unknowns) for j in range(i, unknowns)}
        outputs += [entries[min(row, column), max(row, column)] for row, column in triangle(unknowns)]
    return sympy.cse(outputs, symbols=sympy.numbered_symbols("t"), order="none")


def sympy_source(name, derivatives, constants, unknowns, stride=""):
    """Returns a function in C. Its inputs and results are `stride` apart, as in " * 8"."""
    shared, results = derivatives
    print_c = sympy_printer()
    lines = [f"    double c{i} = in[{i}{stride}];" for i in range(constants)]
    lines += [f"    double x{i} = in[{constants + i}{stride}];" for i in range(unknowns)]
    lines += [f"    double {symbol} = {print_c(expression)};" for symbol, expression in shared]
    lines += [f"    out[{i}{stride}] = {print_c(result)};" for i, result in enumerate(results)]
    body = "\n".join(lines)
    return f"static inline void {name}_sympy(const double *in, double *out) {{\n{body}\n}}\n"


def casadi_source(name, formula, constants, unknowns, second, folder):
    import casadi

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
    with open(generator.generate(folder + os.sep), encoding="utf-8") as file:
        return file.read()


TINYAD_KERNELS = {"K1": "Spring", "K2": "HairBend", "K3": "Hinge", "K4": "StVK", "K5": "PointToPlane"}


def tinyad_source(name, second):
    struct = TINYAD_KERNELS[name]
    header = os.path.join(os.path.dirname(os.path.abspath(__file__)), "tinyad_kernels.hpp")
    body = f"kernels::evaluate<kernels::{struct}, {str(second).lower()}>(in, out);"
    return f'#include "{header}"\nstatic inline void {name}_tinyad(const double *in, double *out) {{ {body} }}\n'


LOOP = """
#include <math.h>
#include <time.h>
{source}
static double now(void) {{
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    return at.tv_sec * 1e9 + at.tv_nsec;
}}
#ifdef __cplusplus
extern "C" {{
#endif
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
#ifdef __cplusplus
}}
#endif
"""


def compile_loop(folder, name, extension, source, call, inputs, outputs, command):
    path = os.path.join(folder, name + extension)
    library = os.path.join(folder, f"{name}.so")
    with open(path, "w", encoding="utf-8") as file:
        file.write(LOOP.format(source=source, call=call, inputs=inputs, outputs=outputs, together=TOGETHER))
    flags = ["-O3", "-march=native", "-fno-fast-math", "-fPIC", "-shared", "-o", library, path, "-lm"]
    subprocess.run(command + flags, check=True)
    code = ctypes.CDLL(library)
    code.timed.restype = ctypes.c_double
    return code


def pointer(array):
    return array.ctypes.data_as(ctypes.c_void_p)


def check(name, unknowns, results, expected):
    """Compares value, gradient and Hessian, each relative to the element's largest number, as the benchmark does."""
    for part in (slice(0, 1), slice(1, 1 + unknowns), slice(1 + unknowns, None)):
        found, wanted = results[:, part], expected[:, part]
        if wanted.shape[1] == 0:
            continue
        size = numpy.maximum(numpy.abs(wanted).max(axis=1), sys.float_info.min)
        difference = (numpy.abs(found - wanted).max(axis=1) / size).max()
        if not difference <= TOLERANCE:
            sys.exit(f"{name}: expected a relative difference of at most {TOLERANCE:.0e}, got {difference:.1e}")


def build(kernel, tool, folder, options):
    name, formula, constants, unknowns, second = kernel
    outputs = 1 + unknowns + (len(triangle(unknowns)) if second else 0)
    call, extension, command = f"{name}_{tool}(element, result);", ".c", [options.cc]
    if tool == "sympy":
        source = sympy_source(name, sympy_derivatives(formula, constants, unknowns, second), constants, unknowns)
    elif tool == "casadi":
        source = casadi_source(name, formula, constants, unknowns, second, folder)
        call = f"{name}_casadi(&element, &result, 0, 0, 0);"
    else:
        source = tinyad_source(name, second)
        extension = ".cpp"
        command = [options.cxx, "-std=c++17", "-DNDEBUG"] + [f"-I{include}" for include in options.tinyad]
    return compile_loop(folder, f"{name}_{tool}_loop", extension, source, call, constants + unknowns, outputs, command)


def run(code, inputs, elements, outputs):
    results = numpy.empty((elements, outputs))
    code.all(pointer(inputs), pointer(results), ctypes.c_long(elements))
    return results


def extra_results(code, kernel, which, folder, outputs):
    """Returns one list of numbers for each element of an extra input file, `None` for NaN and infinity."""
    path = os.path.join(folder, f"{kernel[0]}.{which}")
    if not os.path.exists(path):
        return []
    inputs = numpy.fromfile(path, dtype="<f8")
    results = run(code, inputs, len(inputs) // (kernel[2] + kernel[3]), outputs)
    return [[x if math.isfinite(x) else None for x in row] for row in results.tolist()]


def measure(kernel, tools, folder, options):
    name, _, constants, unknowns, _ = kernel
    inputs = numpy.fromfile(os.path.join(options.inputs, f"{name}.inputs"), dtype="<f8")
    expected = numpy.fromfile(os.path.join(options.inputs, f"{name}.expected"), dtype="<f8")
    elements = len(inputs) // (constants + unknowns)
    expected = expected.reshape(elements, -1)
    outputs = expected.shape[1]
    codes = {tool: build(kernel, tool, folder, options) for tool in tools}
    for tool, code in codes.items():
        check(f"{name} by {tool}", unknowns, run(code, inputs, elements, outputs), expected)
    times = {tool: [] for tool in codes}
    for turn in range(options.repetitions + 1):
        for tool, code in codes.items():
            time = code.timed(pointer(inputs), ctypes.c_long(elements)) / elements
            # The first turn warms up.
            if turn > 0:
                times[tool].append(time)
    results = []
    for tool, code in codes.items():
        coincident = extra_results(code, kernel, "coincident", options.inputs, outputs)
        results.append(
            {
                "kernel": name,
                "tool": tool,
                "nanoseconds": statistics.median(times[tool]),
                "least": min(times[tool]),
                "near_rest": extra_results(code, kernel, "near_rest", options.inputs, outputs),
                "coincident": coincident[0] if coincident else [],
            }
        )
    return results


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("inputs", help="the folder that `bench --inputs` wrote")
    parser.add_argument("--cc", default="cc", help="the C compiler")
    parser.add_argument("--cxx", default="g++", help="the C++ compiler")
    parser.add_argument("--tinyad", nargs="+", metavar="INCLUDE", help="include folders of TinyAD and Eigen")
    parser.add_argument("--repetitions", type=int, default=31, help="runs of each tool; the median is printed")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--keep", help="keep the generated code in this folder")
    options = parser.parse_args()
    if options.repetitions < 1:
        parser.error(f"expected at least one repetition, got {options.repetitions}")
    tools, notes = [], []
    for tool, title in (("sympy", "SymPy"), ("casadi", "CasADi")):
        if importlib.util.find_spec(tool):
            tools.append(tool)
        else:
            notes.append(f"{title} was not measured: {sys.executable} has no package {tool}")
    if options.tinyad:
        tools.append("tinyad")
    results = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or temporary
        os.makedirs(folder, exist_ok=True)
        for kernel in KERNELS:
            if os.path.exists(os.path.join(options.inputs, f"{kernel[0]}.inputs")):
                results += measure(kernel, tools, folder, options)
    if options.json:
        json.dump({"results": results, "notes": notes}, sys.stdout)
        return
    for result in results:
        print(f"{result['kernel']} {result['tool']:8}{result['nanoseconds']:10.1f} ns per element")
    for note in notes:
        print(f"note: {note}")


if __name__ == "__main__":
    main()
