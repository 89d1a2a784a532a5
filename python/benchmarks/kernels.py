"""Value, gradient and Hessian of five kernels (residual and Jacobian of K5) beside JAX, CasADi and SymForce.

    pip install jax casadi symforce numba
    python python/benchmarks/kernels.py

All tools run in turns on one core, in double precision, on the same inputs, from NumPy arrays to arrays. Their results
are compared first. JAX: `jit` of `vmap`, float64. CasADi: `Function.map`. SymForce: its generated Python, compiled by
numba, in a compiled loop. Times are those of the fastest round, in nanoseconds per element. A tool that is not
installed is left out.
"""

import argparse
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
    p, q = x
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


def result_numbers(result):
    return [np.asarray(part).reshape(COUNT, -1) for part in result]


def agree(name, found, expected):
    for a, b in zip(result_numbers(found), result_numbers(expected)):
        error = np.abs(a - b).max() / np.abs(b).max()
        if not error < 1e-9:
            raise SystemExit(f"{name}: results differ by {error:.1e} from those of this package")


def measure(kernel, rounds):
    runs = package_runs(kernel)
    reference = [np.array(part) for part in runs["energy_dsl, library"]()]
    if importlib.util.find_spec("jax"):
        start = time.perf_counter()
        runs["JAX"] = jax_run(kernel)
        result = runs["JAX"]()
        print(f"# {kernel.title}: JAX compiled in {time.perf_counter() - start:.2f} s", flush=True)
        agree("JAX", result, reference)
    if importlib.util.find_spec("casadi"):
        runs["CasADi, map"] = casadi_run(kernel)
        found = [np.asarray(part) for part in runs["CasADi, map"]()]
        n = kernel.flat.shape[1]
        rows = [part.reshape(-1, COUNT, n if i == 2 else 1).transpose(1, 0, 2) for i, part in enumerate(found)]
        agree("CasADi", rows, reference)
    if importlib.util.find_spec("symforce") and importlib.util.find_spec("numba"):
        runs["SymForce, numba"] = symforce_run(kernel)
        agree("SymForce", runs["SymForce, numba"](), reference)
    for name, run in runs.items():
        if name.endswith("text"):
            agree(name, run(), reference)
    times = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            start = time.perf_counter()
            run()
            times[name].append(1e9 * (time.perf_counter() - start) / COUNT)
    return {name: min(list_) for name, list_ in times.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=21)
    options = parser.parse_args()
    found = [(kernel.title, measure(kernel, options.rounds)) for kernel in kernels()]
    names = list(dict.fromkeys(name for _, times in found for name in times))
    print(f"| ns per element | {' | '.join(title for title, _ in found)} |\n|---|{'---:|' * len(found)}")
    for name in names:
        cells = [f"{times[name]:,.0f}" if name in times else "–" for _, times in found]
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
