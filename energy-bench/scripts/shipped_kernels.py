#!/usr/bin/env python3
"""Compares kernels that simulators ship with code that is generated from their formulas: error and time.

    verify emit shipped_kernels.energy --lang c --precision f64 -o C
    verify emit shipped_kernels.energy --lang warp --precision f32 -o WARP
    python3 shipped_kernels.py --c C --libuipc LIBUIPC --eigen EIGEN --warp WARP --newton NEWTON

`LIBUIPC` and `NEWTON` are checkouts of these projects, `EIGEN` is the folder that contains `Eigen/`. Without the
options of one of them, its rows are left out. Nothing is changed in the checkouts.

- libuipc (f64): its headers and the generated C are compiled into one program, `-O3 -march=native`.
- Newton (f32): its functions and the generated ones run in kernels of Warp on the CPU, vertex by vertex.

The truth comes from the same inputs by second-order duals over numbers of 60 digits (mpmath). An error is the largest
difference of an array divided by its largest number, in units of roundoff, u = 2^-53 or 2^-24: the median and the
largest of all inputs of a case. `NaN` stands where a result is not finite. Times are medians of repeated runs in turns,
in ns per element, or per vertex for Newton.
"""

import argparse
import ctypes
import importlib
import math
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time

import mpmath
import numpy

mpmath.mp.dps = 60


class Dual:
    """A number with its gradient and Hessian by the coordinates."""

    def __init__(self, value, gradient, hessian):
        self.value, self.gradient, self.hessian = value, gradient, hessian

    @staticmethod
    def variables(values):
        n = len(values)
        zero = numpy.full((n, n), mpmath.mpf(0))
        rows = numpy.array([[mpmath.mpf(int(i == j)) for j in range(n)] for i in range(n)], dtype=object)
        return [Dual(mpmath.mpf(float(v)), rows[i], zero) for i, v in enumerate(values)]

    def apply(self, value, first, second):
        """A function of this number, from its value and derivatives."""
        outer = numpy.outer(self.gradient, self.gradient)
        return Dual(value, first * self.gradient, first * self.hessian + second * outer)

    def __add__(self, other):
        if not isinstance(other, Dual):
            return Dual(self.value + other, self.gradient, self.hessian)
        return Dual(self.value + other.value, self.gradient + other.gradient, self.hessian + other.hessian)

    def __mul__(self, other):
        if not isinstance(other, Dual):
            return self.apply(self.value * other, other, 0)
        mixed = numpy.outer(self.gradient, other.gradient)
        return Dual(
            self.value * other.value,
            self.value * other.gradient + other.value * self.gradient,
            self.value * other.hessian + other.value * self.hessian + mixed + mixed.T,
        )

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self):
        return self * -1

    def __sub__(self, other):
        return self + -other

    def reciprocal(self):
        r = 1 / self.value
        return self.apply(r, -(r**2), 2 * r**3)

    def root(self):
        r = mpmath.sqrt(self.value)
        return self.apply(r, 1 / (2 * r), -1 / (4 * r**3))

    def arctangent(self):
        d = 1 / (1 + self.value**2)
        return self.apply(mpmath.atan(self.value), d, -2 * self.value * d**2)


def points(x):
    return [x[i : i + 3] for i in range(0, len(x), 3)]


def sub(a, b):
    return [p - q for p, q in zip(a, b)]


def dot(a, b):
    return sum((p * q for p, q in zip(a[1:], b[1:])), a[0] * b[0])


def cross(a, b):
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def length(a):
    return dot(a, a).root()


def dihedral(x0, x1, x2, x3):
    """The angle of the triangles x0 x2 x3 and x1 x2 x3, by the tangent of its half."""
    edge = sub(x3, x2)
    n1, n2 = cross(sub(x2, x0), sub(x3, x0)), cross(sub(x3, x1), sub(x2, x1))
    sine = dot(cross(n1, n2), edge) * length(edge).reciprocal()
    cosine = dot(n1, n2)
    both = (sine * sine + cosine * cosine).root()
    return 2 * (sine * (both + cosine).reciprocal()).arctangent()


def truth(name, x, c):
    c = [mpmath.mpf(float(v)) for v in c]
    p = points(Dual.variables(x))
    if name in ("Spring", "ParticleSpring"):
        stretch = length(sub(p[0], p[1])) - c[1]
        return c[0] / 2 * stretch * stretch * (1 / c[1] ** 2 if name == "Spring" else 1)
    if name == "Rod":
        a, b = sub(p[1], p[0]), sub(p[2], p[1])
        binormal = cross(a, b)
        scale = 2 * (length(a) * length(b) + dot(a, b)).reciprocal()
        return mpmath.pi * c[0] * c[2] ** 4 / (4 * c[1]) * dot(binormal, binormal) * scale * scale
    bend = dihedral(*p) - c[-1]
    return (c[0] * c[1] / c[2] if name == "Hinge" else c[0] * c[1] / 2) * bend * bend


def direction(source):
    v = [source.gauss(0, 1) for _ in range(3)]
    return [a / math.hypot(*v) for a in v]


def spring(strain):
    def draw(source, constants):
        L = source.uniform(0.5, 2)
        x, d = [source.uniform(-1, 1) for _ in range(3)], direction(source)
        return x + [a + (1 + strain) * L * b for a, b in zip(x, d)], [constants[0], L]

    return draw


def rod(angle):
    def draw(source, constants):
        d, s = direction(source), direction(source)
        along = sum(a * b for a, b in zip(d, s))
        s = [b - along * a for a, b in zip(d, s)]
        s = [b / math.hypot(*s) for b in s]
        l, m = source.uniform(0.5, 2), source.uniform(0.5, 2)
        x = [source.uniform(-1, 1) for _ in range(3)]
        y = [a + l * b for a, b in zip(x, d)]
        z = [a + m * (math.cos(angle) * b + math.sin(angle) * e) for a, b, e in zip(y, d, s)]
        return x + y + z, [constants[0], (l + m) / 2, 0.02]

    return draw


def folded(source, constants):
    """A rod whose ends coincide: its energy is infinite."""
    x, y = ([source.uniform(-1, 1) for _ in range(3)] for _ in range(2))
    return x + y + x, [constants[0], 1.0, 0.02]


def hinge(angle, off, size):
    """Two triangles that meet at about `angle`. The rest angle is off by `off`."""

    def draw(source, constants):
        theta = source.uniform(0.2, 1) if angle is None else angle
        edge, h0, h1 = (size * source.uniform(0.5, 1.5) for _ in range(3))
        s0, s1 = (size * source.uniform(-0.5, 0.5) for _ in range(2))
        local = [[s0, h0, 0], [s1, -h1 * math.cos(theta), h1 * math.sin(theta)], [-edge / 2, 0, 0], [edge / 2, 0, 0]]
        a, b = direction(source), direction(source)
        n = [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]
        n = [v / math.hypot(*n) for v in n]
        b = [n[i - 2] * a[i - 1] - n[i - 1] * a[i - 2] for i in range(3)]
        x = [sum(q * e[i] for q, e in zip(p, (a, b, n))) for p in local for i in range(3)]
        return x, [*constants, 0.0], off

    return draw


# Kernel, case, how inputs are drawn.
LIBUIPC = [
    ("Spring", "strain 0.1", spring(0.1)),
    ("Spring", "strain 1e-6", spring(1e-6)),
    ("Rod", "angle 1", rod(1.0)),
    ("Rod", "angle 1e-6", rod(1e-6)),
    ("Rod", "angle π − 1e-4", rod(math.pi - 1e-4)),
    ("Rod", "straight", rod(0.0)),
    ("Rod", "folded", folded),
    ("Hinge", "0.3 from rest", hinge(None, 0.3, 1.0)),
    ("Hinge", "1e-6 from rest", hinge(None, 1e-6, 1.0)),
    ("Hinge", "flat, 1e-6 from rest", hinge(0.0, 1e-6, 1.0)),
]
NEWTON = [
    ("ParticleSpring", "strain 0.1", spring(0.1)),
    ("ParticleSpring", "strain 1e-3", spring(1e-3)),
    ("Bending", "0.3 from rest", hinge(None, 0.3, 1.0)),
    ("Bending", "1e-3 from rest", hinge(None, 1e-3, 1.0)),
    ("Bending", "edges of 1 mm", hinge(None, 0.3, 1e-3)),
]
CONSTANTS = {
    "Spring": [100.0],
    "ParticleSpring": [100.0],
    "Rod": [1e6],
    "Hinge": [1e-3, 1.0, 0.5],
    "Bending": [1e-3, 1.0],
}


def inputs(name, draw, count, seed, number):
    """Coordinates and constants, rounded to the precision of the kernel, and true gradients and Hessians."""
    source = random.Random(f"{seed} {name}")
    coordinates, constants, gradients, hessians = [], [], [], []
    for _ in range(count):
        x, c, *off = draw(source, CONSTANTS[name])
        x, c = numpy.array(x, number), numpy.array(c, number)
        if off:
            rest = dihedral(*points(Dual.variables(x))).value - mpmath.mpf(off[0])
            c[-1] = number(float(rest))
        coordinates.append(x)
        constants.append(c)
        if draw is folded:
            continue
        exact = truth(name, x, c)
        gradients.append(exact.gradient)
        hessians.append(exact.hessian)
    return numpy.array(coordinates), numpy.array(constants), gradients, hessians


def errors(found, exact, unit):
    """Median and largest error of arrays in units of the last place, as text."""
    if not exact:
        return "finite" if numpy.isfinite(found).all() else "not finite, silently"
    all_errors = []
    for f, e in zip(found, exact):
        if not numpy.isfinite(f).all():
            return "NaN"
        e = numpy.asarray(e).ravel()
        scale = max(abs(v) for v in e)
        difference = max(abs(mpmath.mpf(float(a)) - b) for a, b in zip(numpy.ravel(f), e))
        all_errors.append(float(difference / scale / unit) if scale else (0.0 if difference == 0 else math.inf))
    return f"{statistics.median(all_errors):.2g} / {max(all_errors):.2g}"


LIBUIPC_SOURCE = r"""
#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#define __host__
#define __device__
#define UIPC_GENERIC
namespace uipc::backend::cuda {
using Float = double;
using Vector3 = Eigen::Vector3d;
using Vector12 = Eigen::Matrix<double, 12, 1>;
using Matrix12x12 = Eigen::Matrix<double, 12, 12>;
}
using std::log;
using namespace uipc::backend::cuda;
#include <utils/dihedral_angle.h>
namespace spring {
#include <finite_element/constitutions/sym/hookean_spring_1d.inl>
}
namespace rod {
#include <finite_element/constitutions/sym/kirchhoff_rod_bending.inl>
}
#include <finite_element/constitutions/discrete_shell_bending_function.h>
#include "spring_f64.h"
#include "rod_f64.h"
#include "hinge_f64.h"
namespace shell = uipc::backend::cuda::sym::discrete_shell_bending;

template <int N> using Vector = Eigen::Matrix<double, N, 1>;
template <int N> using Matrix = Eigen::Matrix<double, N, N>;

extern "C" {
void theirs_spring(long n, const double *x, const double *c, double *g, double *h) {
    for (long i = 0; i < n; ++i, x += 6, c += 2, g += 6, h += 36) {
        const Vector<6> X(x);
        Vector<6> G;
        Matrix<6> H;
        spring::dEdX(G, c[0], X, c[1]);
        spring::ddEddX(H, c[0], X, c[1]);
        Eigen::Map<Vector<6>>(g, 6) = G;
        Eigen::Map<Matrix<6>>(h, 6, 6) = H;
    }
}
void theirs_rod(long n, const double *x, const double *c, double *g, double *h) {
    const double pi = 3.14159265358979323846;
    for (long i = 0; i < n; ++i, x += 9, c += 3, g += 9, h += 81) {
        const Vector<9> X(x);
        Vector<9> G;
        Matrix<9> H;
        rod::dEdX(G, c[0], X, c[1], c[2], pi);
        rod::ddEddX(H, c[0], X, c[1], c[2], pi);
        Eigen::Map<Vector<9>>(g, 9) = G;
        Eigen::Map<Matrix<9>>(h, 9, 9) = H;
    }
}
void theirs_hinge(long n, const double *x, const double *c, double *g, double *h) {
    /* Their order is x0, x1, x2, x3 with the edge from x1 to x2. */
    const int order[4] = {0, 3, 1, 2};
    for (long i = 0; i < n; ++i, x += 12, c += 4, g += 12, h += 144) {
        const Eigen::Vector3d x0(x), x3(x + 3), x1(x + 6), x2(x + 9);
        Vector<12> G;
        Matrix<12> H;
        shell::dEdx(G, x0, x1, x2, x3, c[1], c[2], c[3], c[0]);
        shell::ddEddx(H, x0, x1, x2, x3, c[1], c[2], c[3], c[0]);
        for (int a = 0; a < 4; ++a) {
            Eigen::Map<Eigen::Vector3d>(g + 3 * a) = G.segment<3>(3 * order[a]);
            for (int b = 0; b < 4; ++b) {
                for (int r = 0; r < 3; ++r) {
                    for (int s = 0; s < 3; ++s) {
                        h[12 * (3 * a + r) + 3 * b + s] = H(3 * order[a] + r, 3 * order[b] + s);
                    }
                }
            }
        }
    }
}
static void run(void (*evaluate)(int32_t, energy_f64_batch *), long n, int points, const double *x, int constants,
                const double *c, double *values, double *g, double *h, uint32_t *unsettled, long *counts) {
    energy_f64_batch batch = {};
    const size_t size = 3 * points;
    batch.count = n;
    batch.x = {x, size, 1};
    batch.parameters = {c, (size_t)constants, 1};
    batch.results[0].numbers = values;
    batch.results[0].per_element = 1;
    batch.results[1].numbers = g;
    batch.results[1].per_element = size;
    batch.results[1].per_number = 1;
    batch.results[2].numbers = h;
    batch.results[2].layout = ENERGY_FULL;
    batch.results[2].per_element = size * size;
    batch.results[2].per_number = 1;
    batch.unsettled = unsettled;
    batch.room = n;
    evaluate(ENERGY_HESSIAN, &batch);
    counts[0] = batch.flagged;
    counts[1] = batch.unsettled_count;
}
#define OURS(NAME, POINTS, CONSTANTS)                                                                                  \
    void ours_##NAME(long n, const double *x, const double *c, double *values, double *g, double *h, uint32_t *u,      \
                     long *counts) {                                                                                   \
        run(NAME##_f64_evaluate, n, POINTS, x, CONSTANTS, c, values, g, h, u, counts);                                 \
    }                                                                                                                  \
    void lanes_##NAME(long n, const double *x, const double *c, double *values, double *g, double *h, uint32_t *u,     \
                      long *counts) {                                                                                  \
        run(NAME##_f64_evaluate_lanes, n, POINTS, x, CONSTANTS, c, values, g, h, u, counts);                           \
    }
OURS(spring, 2, 2)
OURS(rod, 3, 3)
OURS(hinge, 4, 4)
}
"""

DOUBLES = ctypes.POINTER(ctypes.c_double)


def doubles(array):
    return array.ctypes.data_as(DOUBLES)


def compile_libuipc(options, folder):
    with open(os.path.join(folder, "kernels.cpp"), "w") as file:
        file.write(LIBUIPC_SOURCE)
    # The headers ask for types of the project, which the program above declares.
    open(os.path.join(folder, "type_define.h"), "w").close()
    library = os.path.join(folder, "kernels.so")
    cuda = os.path.join(options.libuipc, "src", "backends", "cuda")
    include = [flag for path in (folder, cuda, options.eigen, options.c) for flag in ("-I", path)]
    flags = ["-O3", "-march=native", "-ffp-contract=off", "-w", "-fPIC"]
    objects = []
    for name in sorted({name.lower() for name, _, _ in LIBUIPC}):
        for source in (f"{name}_f64.c", f"{name}_f64_lanes.c"):
            objects.append(os.path.join(folder, source + ".o"))
            source = os.path.join(options.c, source)
            subprocess.run([options.cc, "-std=gnu99", *flags, "-c", source, "-o", objects[-1]], check=True)
    kernels = os.path.join(folder, "kernels.cpp")
    flags = ["-std=c++20", "-shared", *flags, *include]
    subprocess.run([options.cxx, *flags, kernels, *objects, "-o", library], check=True)
    return ctypes.CDLL(library)


def in_turns(programs, elements):
    """Medians of the times of each program, in ns per element."""
    times = [[] for _ in programs]
    for _ in range(9):
        for program, own in zip(programs, times):
            start = time.perf_counter()
            program()
            own.append((time.perf_counter() - start) / elements * 1e9)
    return [statistics.median(own) for own in times]


def libuipc(options, table):
    with tempfile.TemporaryDirectory() as folder:
        library = compile_libuipc(options, folder)
        for name, case, draw in LIBUIPC:
            x, c, gradients, hessians = inputs(name, draw, options.cases, options.seed, numpy.float64)
            n = x.shape[1]

            def call(prefix, x, c):
                count = len(x)
                g, h = numpy.zeros((count, n)), numpy.zeros((count, n * n))
                arguments = [ctypes.c_long(count), doubles(x), doubles(c)]
                found = getattr(library, f"{prefix}_{name.lower()}")
                flags = (ctypes.c_long * 2)()
                if prefix == "theirs":
                    arguments += [doubles(g), doubles(h)]
                else:
                    unsettled = numpy.zeros(count, numpy.uint32)
                    u = unsettled.ctypes.data_as(ctypes.POINTER(ctypes.c_uint32))
                    arguments += [doubles(numpy.zeros(count)), doubles(g), doubles(h), u, flags]
                return (lambda: found(*arguments)), g, h, flags

            unit, row = 2.0**-53, []
            for prefix in ("theirs", "ours", "lanes"):
                program, g, h, flags = call(prefix, x, c)
                program()
                row += [errors(g, gradients, unit), errors(h, hessians, unit)]
                if prefix != "theirs" and flags[0] == len(x):
                    row[-2:] = ["flagged", "flagged"]
            assert row[2:4] == row[4:6], "lanes differ from scalars"
            many = -(-options.elements // len(x))
            big = numpy.tile(x, (many, 1)), numpy.tile(c, (many, 1))
            times = in_turns([call(prefix, *big)[0] for prefix in ("theirs", "ours", "lanes")], len(big[0]))
            times = f"{times[0]:.0f}, {times[1]:.0f}, {times[2]:.0f}"
            table.append((f"libuipc `{name}`, f64, {case}", row[0], row[2], row[1], row[3], times))


def newton(options, table):
    import warp as wp

    wp.config.quiet = True
    sys.path[:0] = [options.newton, options.warp]
    theirs = importlib.import_module("newton._src.solvers.vbd.particle_vbd_kernels")
    energies = importlib.import_module("energies")
    float1, float2, int1, int2, vec, mat = (
        wp.array[float], wp.array2d[float], wp.array[int], wp.array2d[int], wp.array2d[wp.vec3], wp.array2d[wp.mat33],
    )
    vec1 = wp.array[wp.vec3]

    @wp.kernel(enable_backward=False)
    def their_springs(x: vec1, ends: int1, k: float1, L: float1, none: float1, g: vec, h: mat):
        i, p = wp.tid()
        f, H = theirs.evaluate_spring_force_and_hessian(2 * i + p, i, 1.0, x, x, ends, L, k, none)
        g[i, p] = -f
        h[i, p] = H

    @wp.kernel(enable_backward=False)
    def our_springs(x: vec1, k: float1, L: float1, g: vec, h: mat):
        i, p = wp.tid()
        d = energies.particle_spring_f32_vertex(p, x[2 * i], x[2 * i + 1], k[i], L[i])
        g[i, p] = d[0]
        h[i, p] = wp.matrix_from_rows(d[1], d[2], d[3])

    @wp.kernel(enable_backward=False)
    def their_bends(x: vec1, edges: int2, rest: float1, L: float1, k: float1, g: vec, h: mat):
        i, p = wp.tid()
        f, H = theirs.evaluate_dihedral_angle_based_bending_force_hessian(i, p, x, x, edges, rest, L, k[i], 0.0, 1.0)
        g[i, p] = -f
        h[i, p] = H

    @wp.kernel(enable_backward=False)
    def our_bends(x: vec1, rest: float1, L: float1, k: float1, g: vec, h: mat):
        i, p = wp.tid()
        a = 4 * i
        d = energies.bending_f32_vertex(p, x[a], x[a + 1], x[a + 2], x[a + 3], k[i], L[i], rest[i])
        g[i, p] = d[0]
        h[i, p] = wp.matrix_from_rows(d[1], d[2], d[3])

    for name, case, draw in NEWTON:
        x, c, gradients, hessians = inputs(name, draw, options.cases, options.seed, numpy.float32)
        size = x.shape[1] // 3

        def programs(x, c):
            count = len(x)
            at = wp.array(x.reshape(-1, 3), dtype=wp.vec3)
            constants = [wp.array(numpy.ascontiguousarray(column)) for column in c.T]
            stencils = wp.array(numpy.arange(size * count, dtype=numpy.int32).reshape(count, size))
            results = [
                (wp.zeros((count, size), dtype=wp.vec3), wp.zeros((count, size), dtype=wp.mat33)) for _ in range(2)
            ]
            if name == "Bending":
                k, L, rest = constants
                launches = [(their_bends, [at, stencils, rest, L, k]), (our_bends, [at, rest, L, k])]
            else:
                k, L = constants
                ends = wp.array(numpy.arange(2 * count, dtype=numpy.int32))
                launches = [(their_springs, [at, ends, k, L, wp.zeros(count)]), (our_springs, [at, k, L])]
            runs = [
                lambda kernel=kernel, given=given, to=to: wp.launch(kernel, (count, size), inputs=[*given, *to])
                for (kernel, given), to in zip(launches, results)
            ]
            return runs, results

        runs, results = programs(x, c)
        row = []
        blocks = [numpy.array([e[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(size)]) for e in hessians]
        for run, (g, h) in zip(runs, results):
            run()
            row += [errors(g.numpy(), gradients, 2.0**-24), errors(h.numpy(), blocks, 2.0**-24)]
        if name == "Bending":
            row[1] = "Gauss–Newton"
        many = -(-options.elements // len(x))
        runs, _ = programs(numpy.tile(x, (many, 1)), numpy.tile(c, (many, 1)))
        times = in_turns(runs, many * len(x) * size)
        times = f"{times[0]:.0f}, {times[1]:.0f}"
        table.append((f"Newton `{name}`, f32, {case}", row[0], row[2], row[1], row[3], times))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--c", help="folder that `verify emit --lang c` wrote")
    parser.add_argument("--libuipc", help="a checkout of libuipc")
    parser.add_argument("--eigen", help="the folder that contains Eigen/")
    parser.add_argument("--warp", help="folder that `verify emit --lang warp` wrote")
    parser.add_argument("--newton", help="a checkout of Newton")
    parser.add_argument("--cases", type=int, default=100, help="inputs of each row (100)")
    parser.add_argument("--elements", type=int, default=20000, help="elements of timed runs (20000)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the inputs (1)")
    parser.add_argument("--cc", default="cc", help="C compiler (cc)")
    parser.add_argument("--cxx", default="c++", help="C++ compiler (c++)")
    options = parser.parse_args()
    for flags, text in [(("c", "libuipc", "eigen"), "libuipc"), (("warp", "newton"), "Newton")]:
        given = [getattr(options, flag) for flag in flags]
        if any(given) and not all(given):
            parser.error(f"{text} needs " + ", ".join(f"--{flag}" for flag in flags))
        for folder in filter(None, given):
            if not os.path.isdir(folder):
                parser.error(f"{folder} is not a folder")
    if not (options.c or options.warp):
        parser.error("give --c, --libuipc and --eigen, or --warp and --newton")
    table = []
    if options.c:
        libuipc(options, table)
    if options.warp:
        newton(options, table)
    heads = "kernel, case", "gradient, theirs", "generated", "Hessian, theirs", "generated", "ns: both, in vectors"
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for row in table:
        print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
