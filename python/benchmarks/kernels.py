"""Value, gradient and Hessian of five kernels (residual and Jacobian of K5) beside JAX, torch, CasADi, SymPy, SymForce.

    pip install jax torch casadi sympy symforce numba
    python python/benchmarks/kernels.py

All tools run in turns on one core, in double precision, on the same inputs, from NumPy arrays to arrays. Their results
are compared first. A tool that is not installed is left out.

- JAX: `jit` of `vmap`, float64. torch: `torch.func`, `vmap`, and the same compiled by `torch.compile`.
- CasADi: `Function.map`.
- SymPy: derivatives with common subexpressions eliminated, printed as Python, compiled by numba in a loop.
- SymForce: its generated Python, compiled by numba in a loop.

The first table has nanoseconds per element, of the fastest round; the second one seconds from the formula to the first
result.
"""

import argparse
import importlib
import importlib.util
import os
import time

# One core for all, before the libraries start their threads.
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})

import numpy as np

import energy_dsl as ed

COUNT = 10_000


class Kernel:
    """A kernel: its element, its parameters by the names of the element, and the textbook formula f(m, c, x) of
    constants and points."""

    def __init__(self, title, element, parameters, x, formula, residual=False):
        self.title, self.element, self.parameters = title, ed.element(element), parameters
        self.x, self.formula, self.residual = x, formula, residual
        self.constants = np.concatenate([np.asarray(part, float).reshape(COUNT, -1) for part in parameters.values()], 1)

    @property
    def flat(self):
        return self.x.reshape(COUNT, -1)


class Maths:
    """Functions of vectors for one package: lists of its numbers, or its arrays."""

    def __init__(self, package, vector):
        self.sqrt, self.sin, self.cos = package.sqrt, package.sin, package.cos
        self.atan2 = getattr(package, "atan2", None) or package.arctan2
        self.vector = vector

    @staticmethod
    def dot(a, b):
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]

    def cross(self, a, b):
        return self.vector(
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        )

    def product(self, a, b):
        """Returns the product of two quaternions."""
        real = a[0] * b[0] - self.dot(a[1:], b[1:])
        across = self.cross(a[1:], b[1:])
        return self.vector([real] + [a[0] * b[i + 1] + b[0] * a[i + 1] + across[i] for i in range(3)])


def spring(m, c, x):
    p, q = x[0], x[1]
    d = m.vector([q[i] - p[i] for i in range(3)])
    return c[0] / 2 * (m.sqrt(m.dot(d, d)) - c[1]) ** 2


def difference(m, a, b):
    return m.vector([a[i] - b[i] for i in range(3)])


def hair_bend(m, c, x):
    a, b = difference(m, x[1], x[0]), difference(m, x[2], x[1])
    return c[0] / 2 * (1 - m.dot(a, b) / (m.sqrt(m.dot(a, a)) * m.sqrt(m.dot(b, b))))


def hinge(m, c, x):
    e, a, b = difference(m, x[3], x[2]), difference(m, x[0], x[2]), difference(m, x[1], x[2])
    n1, n2 = m.cross(e, a), m.cross(b, e)
    angle = m.atan2(m.dot(m.cross(n1, n2), e), m.dot(n1, n2) * m.sqrt(m.dot(e, e)))
    return c[0] * (angle - c[1]) ** 2


def stvk(m, c, x):
    u, (lam, mu) = [c[2 * i : 2 * i + 2] for i in range(3)], c[6:8]
    d = [[u[i + 1][j] - u[0][j] for i in range(2)] for j in range(2)]
    det = d[0][0] * d[1][1] - d[0][1] * d[1][0]
    inverse = [[d[1][1] / det, -d[0][1] / det], [-d[1][0] / det, d[0][0] / det]]
    e1, e2 = difference(m, x[1], x[0]), difference(m, x[2], x[0])
    f = [[e1[i] * inverse[0][j] + e2[i] * inverse[1][j] for i in range(3)] for j in range(2)]
    e11, e12, e22 = (m.dot(f[0], f[0]) - 1) / 2, m.dot(f[0], f[1]) / 2, (m.dot(f[1], f[1]) - 1) / 2
    return det / 2 * (mu * (e11**2 + 2 * e12**2 + e22**2) + lam / 2 * (e11 + e22) ** 2)


def point_to_plane(m, c, x):
    w, v, n, u = c[:4], c[4:7], c[7:10], c[10:13]
    real, dual = [0] * 4, [0] * 4
    for k in range(4):
        turn, shift = x[2 * k], x[2 * k + 1]
        angle = m.sqrt(m.dot(turn, turn))
        sinc = m.sin(angle) / angle
        rotation = m.vector([m.cos(angle)] + [turn[i] * sinc for i in range(3)])
        motion = m.product(m.vector([0 * shift[0], shift[0], shift[1], shift[2]]), rotation)
        real = [real[i] + w[k] * rotation[i] for i in range(4)]
        dual = [dual[i] + w[k] / 2 * motion[i] for i in range(4)]
    length = m.sqrt(real[0] * real[0] + m.dot(real[1:], real[1:]))
    real, dual = m.vector([a / length for a in real]), m.vector([a / length for a in dual])
    shift = m.product(dual, m.vector([real[0], -real[1], -real[2], -real[3]]))[1:]

    def rotated(y):
        first = m.cross(real[1:], y)
        second = m.cross(real[1:], first)
        return [y[i] + 2 * (real[0] * first[i] + second[i]) for i in range(3)]

    point, normal = rotated(v), rotated(n)
    return m.dot(normal, [point[i] + 2 * shift[i] - u[i] for i in range(3)])


def kernels():
    draw = np.random.default_rng(1)
    each = lambda low, high: draw.uniform(low, high, COUNT)
    near = lambda points: np.asarray(points, float) + draw.uniform(-0.2, 0.2, (COUNT, len(points), 3))
    corner = lambda u: np.asarray(u, float) + draw.uniform(-0.1, 0.1, (COUNT, 2))
    unit = draw.normal(size=(COUNT, 3))
    weights = draw.uniform(0.1, 1, (COUNT, 4))
    return [
        Kernel("spring", "HookeSpring", {"K": each(1, 2), "L": each(0.5, 1)}, near([[0, 0, 0], [1, 0, 0]]), spring),
        Kernel("hair bend", "HairBend", {"k": each(1, 2)}, near([[0, 0, 0], [1, 0, 0], [2, 0.5, 0]]), hair_bend),
        Kernel("hinge", "QuadraticHinge", {"k": each(1, 2), "θ0": each(-0.2, 0.2)},
               near([[0.5, -1, 0], [0.25, 0.75, 0.25], [0, 0, 0], [1, 0, 0]]), hinge),
        Kernel("StVK triangle", "StVK",
               {"u0": corner([0, 0]), "u1": corner([1, 0.25]), "u2": corner([0.25, 1]),
                "λ": each(1, 2), "μ": each(1, 2)},
               near([[0, 0, 0], [1, 0.25, 0], [0.25, 1, 0]]), stvk),
        Kernel("point to plane", "PointToPlane",
               {"w": weights / weights.sum(1, keepdims=True), "v": draw.normal(size=(COUNT, 3)),
                "n": unit / np.linalg.norm(unit, axis=1, keepdims=True), "u": draw.normal(size=(COUNT, 3))},
               draw.uniform(-0.4, 0.4, (COUNT, 8, 3)), point_to_plane, residual=True),
    ]


def package_runs(kernel):
    """Returns the runs of this package, by name."""
    runs = {}
    text = ed.energy(kernel.element.source)
    for name, element in (("energy_dsl, library", kernel.element), ("energy_dsl, text", text)):
        elements, n = element.bind(COUNT, **kernel.parameters), kernel.flat.shape[1]
        if kernel.residual:
            out = np.empty((COUNT, 1)), np.empty((COUNT, 1, n))
            runs[name] = lambda e=elements, out=out: e.jacobian(kernel.flat, out=out)
        else:
            out = np.empty(COUNT), np.empty(kernel.x.shape), np.empty((COUNT, n, n))
            runs[name] = lambda e=elements, out=out: e.hessian(kernel.x, out=out)
            if name.endswith("library"):
                runs["energy_dsl, library, new arrays"] = lambda e=elements: e.hessian(kernel.x)
    return runs


def jax_run(kernel):
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    maths = Maths(jnp, jnp.stack)
    value = lambda x, c: kernel.formula(maths, c, x)

    def all_derivatives(x, c):
        found = jax.value_and_grad(value)(x, c)
        return found if kernel.residual else (*found, jax.hessian(value)(x, c))

    compiled = jax.jit(jax.vmap(all_derivatives))
    return lambda: jax.block_until_ready(compiled(kernel.x, kernel.constants))


def casadi_run(kernel):
    import casadi

    count, points = kernel.flat.shape[1], kernel.x.shape[1]
    c, x = casadi.SX.sym("c", kernel.constants.shape[1]), casadi.SX.sym("x", count)
    numbers = casadi.vertsplit(x)
    value = kernel.formula(
        Maths(casadi, list), casadi.vertsplit(c), [numbers[3 * i : 3 * i + 3] for i in range(points)]
    )
    if kernel.residual:
        results = [value, casadi.gradient(value, x)]
    else:
        hessian, gradient = casadi.hessian(value, x)
        results = [value, gradient, casadi.densify(hessian)]
    function = casadi.Function("f", [x, c], results, {"cse": True}).map(COUNT)
    xs, cs = casadi.DM(kernel.flat.T), casadi.DM(kernel.constants.T)
    return lambda: function(xs, cs)


def torch_derivatives(kernel):
    """Returns the function of all derivatives, and its inputs."""
    import torch

    torch.set_num_threads(1)
    maths = Maths(torch, torch.stack)
    value = lambda x, c: kernel.formula(maths, c, x)

    def all_derivatives(x, c):
        gradient, found = torch.func.grad_and_value(value)(x, c)
        return (found, gradient) if kernel.residual else (found, gradient, torch.func.hessian(value)(x, c))

    return torch.func.vmap(all_derivatives), [torch.from_numpy(array) for array in (kernel.x, kernel.constants)]


def torch_run(kernel):
    function, inputs = torch_derivatives(kernel)
    return lambda: [part.numpy() for part in function(*inputs)]


def compiled_torch_run(kernel):
    import torch
    from torch.fx.experimental.proxy_tensor import make_fx

    function, inputs = torch_derivatives(kernel)
    # Traced first: the compiler takes no derivatives within `vmap` itself.
    function = torch.compile(make_fx(function)(*inputs))
    return lambda: [part.numpy() for part in function(*inputs)]


def sympy_results(kernel):
    """Returns the symbols of unknowns and constants, and the formula of each entry of the results."""
    import sympy

    n = kernel.flat.shape[1]
    x, c = sympy.symbols(f"x:{n}", real=True), sympy.symbols(f"c:{kernel.constants.shape[1]}", real=True)
    value = kernel.formula(Maths(sympy, list), list(c), [list(x[3 * i : 3 * i + 3]) for i in range(n // 3)])
    gradient = [sympy.diff(value, unknown) for unknown in x]
    results = {"U[e]": value} | {f"g[e, {i}]": entry for i, entry in enumerate(gradient)}
    for i in range(0 if kernel.residual else n):
        results |= {f"H[e, {i}, {j}]": sympy.diff(gradient[i], x[j]) for j in range(i, n)}
    return x, c, results


def sympy_printer():
    """Returns a function that prints Python. Small integer and half-integer powers become products and roots, because
    numba's powers are slow."""
    from sympy.printing.pycode import PythonCodePrinter

    class Powers(PythonCodePrinter):
        def _print_Pow(self, expr, **_):
            base, exponent = f"({self._print(expr.base)})", expr.exp
            if not (exponent.is_Rational and exponent.q in (1, 2) and abs(exponent) <= 4):
                return super()._print_Pow(expr)
            factors = [base] * (abs(exponent.p) // exponent.q) + [f"math.sqrt{base}"] * (exponent.q - 1)
            product = f"({'*'.join(factors)})"
            return product if exponent > 0 else f"(1.0/{product})"

    return Powers().doprint


def sympy_loop(kernel):
    """Returns the text of a function that loops over all elements."""
    import sympy

    x, c, results = sympy_results(kernel)
    shared, outputs = sympy.cse(list(results.values()), symbols=sympy.numbered_symbols("t"), order="none")
    written = sympy_printer()
    lines = [f"{name} = xs[e, {i}]" for i, name in enumerate(x)] + [f"{name} = cs[e, {i}]" for i, name in enumerate(c)]
    lines += [f"{name} = {written(formula)}" for name, formula in shared]
    lines += [f"{name} = {written(formula)}" for name, formula in zip(results, outputs)]
    lines += [f"H[e, {i}, {j}] = H[e, {j}, {i}]" for i in range(0 if kernel.residual else len(x)) for j in range(i)]
    body = "".join(f"        {line}\n" for line in lines)
    return f"def loop(cs, xs, U, g, H):\n    for e in range(len(xs)):\n{body}"


def sympy_run(kernel):
    import math

    import numba

    scope = {"math": math}
    exec(sympy_loop(kernel), scope)
    loop, n = numba.njit(scope["loop"]), kernel.flat.shape[1]
    U, g, H = np.empty(COUNT), np.empty((COUNT, n)), np.empty((COUNT, n, n) if not kernel.residual else (0, 0, 0))

    def run():
        loop(kernel.constants, kernel.flat, U, g, H)
        return (U, g) if kernel.residual else (U, g, H)

    return run


def symforce_run(kernel):
    import logging

    import numba
    import symforce

    # The kernels need no epsilon: their inputs are far from singular.
    symforce.set_epsilon_to_zero()
    logging.getLogger("symforce").setLevel(logging.ERROR)
    import symforce.symbolic as sf
    from symforce.codegen import Codegen, PythonConfig
    from symforce.values import Values

    n, constants = kernel.flat.shape[1], kernel.constants.shape[1]
    x = sf.Matrix(n, 1, [sf.Symbol(f"x{i}") for i in range(n)])
    c = sf.Matrix(constants, 1, [sf.Symbol(f"c{i}") for i in range(constants)])
    value = kernel.formula(Maths(sf, list), list(c), [list(x[3 * i : 3 * i + 3]) for i in range(n // 3)])
    gradient = sf.Matrix([value]).jacobian(x)
    outputs = {"value": sf.Matrix([value]), "gradient": gradient}
    if not kernel.residual:
        outputs["hessian"] = gradient.T.jacobian(x)
    one = Codegen(Values(c=c, x=x), Values(outputs), config=PythonConfig(use_numba=True)).lambdify()
    U, g, H = np.empty(COUNT), np.empty((COUNT, n)), np.empty((COUNT, n, n))

    @numba.njit
    def first_order(c, x, U, g):
        for i in range(COUNT):
            value, gradient = one(c[i], x[i])
            U[i], g[i] = value.ravel()[0], gradient.ravel()

    @numba.njit
    def second_order(c, x, U, g, H):
        for i in range(COUNT):
            value, gradient, hessian = one(c[i], x[i])
            U[i], g[i], H[i] = value.ravel()[0], gradient.ravel(), hessian

    def run():
        if kernel.residual:
            first_order(kernel.constants, kernel.flat, U, g)
            return U, g
        second_order(kernel.constants, kernel.flat, U, g, H)
        return U, g, H

    return run


def result_numbers(name, result):
    """Returns the results as one row of numbers for each element. Those of CasADi lie side by side."""
    if name.startswith("CasADi"):
        parts = [np.asarray(part) for part in result]
        parts = [part.reshape(len(part), COUNT, -1).transpose(1, 0, 2) for part in parts]
    else:
        parts = [np.asarray(part) for part in result]
    return [part.reshape(COUNT, -1) for part in parts]


def agree(name, found, expected):
    for a, b in zip(result_numbers(name, found), result_numbers("energy_dsl", expected)):
        error = np.abs(a - b).max() / np.abs(b).max()
        if not error < 1e-9:
            raise SystemExit(f"{name}: results differ by {error:.1e} from those of this package")


#: The packages that each contender needs, and what makes its run.
CONTENDERS = {
    "JAX": (("jax",), jax_run),
    "torch": (("torch",), torch_run),
    "torch, compiled": (("torch",), compiled_torch_run),
    "CasADi, map": (("casadi",), casadi_run),
    "SymPy, numba": (("sympy", "numba"), sympy_run),
    "SymForce, numba": (("symforce", "numba"), symforce_run),
}


def measure(kernel, rounds, contenders):
    """Returns nanoseconds per element, and seconds to the first result, by contender."""
    start = time.perf_counter()
    ed.energy(kernel.element.source)
    seconds = {"energy_dsl, text": time.perf_counter() - start}
    runs = package_runs(kernel)
    reference = [np.array(part) for part in runs["energy_dsl, library"]()]
    agree("text", runs["energy_dsl, text"](), reference)
    for name in contenders:
        packages, make = CONTENDERS[name]
        if not all(importlib.util.find_spec(package) for package in packages):
            continue
        for package in packages:
            importlib.import_module(package)
        start = time.perf_counter()
        try:
            runs[name] = make(kernel)
            result = runs[name]()
        except Exception as error:
            print(f"# {kernel.title}: {name} failed: {type(error).__name__}: {str(error)[:200]}", flush=True)
            runs.pop(name, None)
            continue
        seconds[name] = time.perf_counter() - start
        print(f"# {kernel.title}: {name} took {seconds[name]:.2f} s to its first result", flush=True)
        agree(name, result, reference)
    times = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            start = time.perf_counter()
            run()
            times[name].append(1e9 * (time.perf_counter() - start) / COUNT)
    return {name: min(list_) for name, list_ in times.items()}, seconds


def table(heading, titles, columns, form):
    names = list(dict.fromkeys(name for column in columns for name in column))
    print(f"\n| {heading} | {' | '.join(titles)} |\n|---|{'---:|' * len(titles)}")
    for name in names:
        cells = [format(column[name], form) if name in column else "–" for column in columns]
        print(f"| {name} | {' | '.join(cells)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=21)
    parser.add_argument("--contenders", nargs="*", default=list(CONTENDERS), choices=list(CONTENDERS))
    options = parser.parse_args()
    all_kernels = kernels()
    found = [measure(kernel, options.rounds, options.contenders) for kernel in all_kernels]
    titles = [kernel.title for kernel in all_kernels]
    table("ns per element", titles, [times for times, _ in found], ",.0f")
    table("seconds to the first result", titles, [seconds for _, seconds in found], ".3g")


if __name__ == "__main__":
    main()
