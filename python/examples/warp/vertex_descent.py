"""Vertex block descent in Warp: a bent strip of cloth falls to rest, one point at a time.

Each sweep visits the colours of the mesh. A point reads its own gradient and 3x3 block of each element from a generated
vertex routine: membranes (StVK), bending (QuadraticHinge) and weight (Gravity), plus inertia. The energy falls in every
sweep. `verify emit StVK QuadraticHinge Gravity --lang warp -o .` writes the module `energies`.
"""

import numpy as np
import warp as wp

import energies

ROWS, COLUMNS, SIDE = 5, 13, 0.02  # points, points, m
LAMBDA, MU = wp.constant(wp.float64(20.0)), wp.constant(wp.float64(60.0))  # N/m
BENDING, FLAT = wp.constant(wp.float64(1e-4)), wp.constant(wp.float64(0.0))  # J, rad
G, STEP = wp.constant(wp.vec3d(0.0, 0.0, -9.81)), wp.constant(wp.float64(0.01))  # m/s^2, s
HALF = wp.constant(wp.float64(0.5))
Derivatives = wp.types.matrix(shape=(4, 3), dtype=wp.float64)


@wp.struct
class Sheet:
    tris: wp.array2d[int]
    hinges: wp.array2d[int]
    stored: wp.array2d[wp.float64]
    mass: wp.array[wp.float64]
    first: wp.array2d[int]  # of each point: where its triangles and its hinges begin
    tri_list: wp.array2d[int]  # (triangle, number of the point in it)
    hinge_list: wp.array2d[int]
    ahead: wp.array[wp.vec3d]  # where each point would go without forces


@wp.func
def stretched(s: Sheet, x: wp.array[wp.vec3d], t: int) -> wp.float64:
    return energies.st_vk_f64_value(x[s.tris[t, 0]], x[s.tris[t, 1]], x[s.tris[t, 2]], LAMBDA, MU, s.stored[t])


@wp.func
def bent(s: Sheet, x: wp.array[wp.vec3d], h: int) -> wp.float64:
    p = s.hinges[h]
    return energies.quadratic_hinge_f64_value(x[p[0]], x[p[1]], x[p[2]], x[p[3]], BENDING, FLAT)


@wp.func
def alone(s: Sheet, x: wp.array[wp.vec3d], i: int) -> wp.float64:
    d = x[i] - s.ahead[i]
    return energies.gravity_f64_value(x[i], s.mass[i], G) + HALF * s.mass[i] / (STEP * STEP) * wp.dot(d, d)


@wp.func
def around(s: Sheet, x: wp.array[wp.vec3d], i: int) -> wp.float64:
    """The energy of all elements of a point."""
    U = alone(s, x, i)
    for k in range(s.first[i, 0], s.first[i + 1, 0]):
        U += stretched(s, x, s.tri_list[k, 0])
    for k in range(s.first[i, 1], s.first[i + 1, 1]):
        U += bent(s, x, s.hinge_list[k, 0])
    return U


@wp.kernel(enable_backward=False)
def descend(points: wp.array[int], s: Sheet, x: wp.array[wp.vec3d]):
    i = points[wp.tid()]
    a = s.mass[i] / (STEP * STEP)
    g = energies.gravity_f64_gradient(x[i], s.mass[i], G) + a * (x[i] - s.ahead[i])
    H = a * wp.identity(n=3, dtype=wp.float64)
    for k in range(s.first[i, 0], s.first[i + 1, 0]):
        t = s.tri_list[k, 0]
        x0, x1, x2 = x[s.tris[t, 0]], x[s.tris[t, 1]], x[s.tris[t, 2]]
        d = energies.st_vk_f64_vertex(s.tri_list[k, 1], x0, x1, x2, LAMBDA, MU, s.stored[t])
        g += d[0]
        H += wp.matrix_from_rows(d[1], d[2], d[3])
    for k in range(s.first[i, 1], s.first[i + 1, 1]):
        p = s.hinges[s.hinge_list[k, 0]]
        place = s.hinge_list[k, 1]
        d = energies.quadratic_hinge_f64_vertex(place, x[p[0]], x[p[1]], x[p[2]], x[p[3]], BENDING, FLAT)
        g += d[0]
        H += wp.matrix_from_rows(d[1], d[2], d[3])
    step = -wp.inverse(H) * g
    if wp.dot(step, g) >= wp.float64(0.0):  # The block is not positive definite: go downhill.
        step = -g / a
    here = x[i]
    before = around(s, x, i)
    x[i] = here + step
    for halving in range(40):
        if around(s, x, i) > before:
            step = HALF * step
            x[i] = here + step
    if around(s, x, i) > before:
        x[i] = here


@wp.kernel(enable_backward=False)
def energy(s: Sheet, x: wp.array[wp.vec3d], U: wp.array[wp.float64]):
    i = wp.tid()
    U[i] = wp.float64(0.0)
    if i < s.tris.shape[0]:
        U[i] += stretched(s, x, i)
    if i < s.hinges.shape[0]:
        U[i] += bent(s, x, i)
    if i < s.mass.shape[0]:
        U[i] += alone(s, x, i)


@wp.kernel(enable_backward=False)
def at_rest(tris: wp.array2d[int], X: wp.array[wp.vec2d], stored: wp.array2d[wp.float64], flags: wp.array[int]):
    i = wp.tid()
    flags[i] = energies.st_vk_f64_rest(X[tris[i, 0]], X[tris[i, 1]], X[tris[i, 2]], LAMBDA, MU, stored[i])


def mesh():
    """Triangles, hinges (two opposite points, then the ends of the edge) and plane coordinates."""
    grid = np.arange(ROWS * COLUMNS, dtype=np.int32).reshape(ROWS, COLUMNS)
    a, b, c, d = (part.ravel() for part in (grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[1:, 1:]))
    tris = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
    edges = {}
    for tri in tris.tolist():
        for k in range(3):
            edges.setdefault(frozenset(tri[:k] + tri[k + 1 :]), []).append(tri[k])
    hinges = np.array([opposite + sorted(edge) for edge, opposite in edges.items() if len(opposite) == 2], np.int32)
    X = np.stack(np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij"), -1).reshape(-1, 2) * SIDE
    return tris, hinges, X


def incidence(elements, n):
    pairs = sorted((point, e, k) for e, one in enumerate(elements.tolist()) for k, point in enumerate(one))
    return np.searchsorted([p[0] for p in pairs], np.arange(n + 1)), np.array([p[1:] for p in pairs], np.int32)


def colours(elements, n):
    """Greedy: points of one element have different colours."""
    others = [set() for _ in range(n)]
    for one in elements:
        for point in one:
            others[point].update(one)
    colour = [-1] * n
    for i in range(n):
        taken = {colour[j] for j in others[i]}
        colour[i] = next(c for c in range(n) if c not in taken)
    return [np.flatnonzero(np.array(colour) == c).astype(np.int32) for c in range(max(colour) + 1)]


def solve(sweeps=40):
    """Returns the energies before the first and after each sweep of one step of implicit Euler."""
    tris, hinges, X = mesh()
    n, s = len(X), Sheet()
    s.tris, s.hinges = wp.array(tris, dtype=int), wp.array(hinges, dtype=int)
    s.stored = wp.zeros((len(tris), energies.ELEMENTS["st_vk_f64"]["stored"]), dtype=wp.float64)
    flags = wp.zeros(len(tris), dtype=int)
    wp.launch(at_rest, len(tris), inputs=[s.tris, wp.array(X, dtype=wp.vec2d), s.stored, flags])
    assert not flags.numpy().any()
    s.mass = wp.array(np.full(n, 0.2 * SIDE**2), dtype=wp.float64)
    (tri_first, tri_list), (hinge_first, hinge_list) = incidence(tris, n), incidence(hinges, n)
    s.first = wp.array(np.stack([tri_first, hinge_first], 1), dtype=int)
    s.tri_list, s.hinge_list = wp.array(tri_list, dtype=int), wp.array(hinge_list, dtype=int)
    angle = X[:, 1] / (SIDE * COLUMNS) * 2.0  # rolled to an arc of a cylinder
    radius = SIDE * COLUMNS / 2.0
    x = wp.array(np.stack([X[:, 0], radius * np.sin(angle), radius * np.cos(angle)], 1), dtype=wp.vec3d)
    s.ahead = wp.clone(x)
    groups = [wp.array(group, dtype=int) for group in colours(tris.tolist() + hinges.tolist(), n)]
    U = wp.zeros(max(n, len(tris), len(hinges)), dtype=wp.float64)
    history = []
    for sweep in range(sweeps + 1):
        wp.launch(energy, len(U), inputs=[s, x, U])
        history.append(U.numpy().sum())
        print(f"{sweep:3}  U = {history[-1]:.12e} J")
        for group in groups:
            wp.launch(descend, len(group), inputs=[group, s, x])
    return history


if __name__ == "__main__":
    history = solve()
    assert all(after <= before for before, after in zip(history, history[1:], strict=False))
