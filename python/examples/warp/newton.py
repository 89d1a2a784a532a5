"""Newton's method in Warp: a sheet hangs from its upper edge. Energies, gradients and 3x3 blocks are generated.

`verify emit StVK Gravity --lang warp -o .` writes the module `energies`. Runs on the CPU and on CUDA.
"""

import numpy as np
import warp as wp
from warp.optim.linear import cg
from warp.sparse import bsr_from_triplets

import energies

CELLS, SIDE, DENSITY = 12, 0.5, 0.4  # m, kg/m^2
LAMBDA, MU = wp.constant(wp.float64(2.0)), wp.constant(wp.float64(10.0))  # N/m
G = wp.constant(wp.vec3d(0.0, 0.0, -9.81))  # m/s^2


@wp.kernel
def at_rest(tris: wp.array2d[int], X: wp.array[wp.vec2d], stored: wp.array2d[wp.float64], flags: wp.array[int]):
    i = wp.tid()
    flags[i] = energies.st_vk_f64_rest(X[tris[i, 0]], X[tris[i, 1]], X[tris[i, 2]], LAMBDA, MU, stored[i])


@wp.kernel
def weights(x: wp.array[wp.vec3d], mass: wp.array[wp.float64], pinned: wp.array[wp.float64], g: wp.array[wp.vec3d]):
    i = wp.tid()
    g[i] = (wp.float64(1.0) - pinned[i]) * energies.gravity_f64_gradient(x[i], mass[i], G)


@wp.kernel
def triangles(
    tris: wp.array2d[int],
    x: wp.array[wp.vec3d],
    stored: wp.array2d[wp.float64],
    pinned: wp.array[wp.float64],
    g: wp.array[wp.vec3d],
    own: wp.array2d[wp.vec3d],
    blocks: wp.array2d[wp.mat33d],
    flags: wp.array[int],
):
    i = wp.tid()
    x0, x1, x2 = x[tris[i, 0]], x[tris[i, 1]], x[tris[i, 2]]
    flags[i] = energies.st_vk_f64_hessian(x0, x1, x2, LAMBDA, MU, stored[i], own[i], blocks[i])
    for j in range(3):
        wp.atomic_add(g, tris[i, j], (wp.float64(1.0) - pinned[tris[i, j]]) * own[i, j])
        for k in range(3):  # Pinned points keep their place: their rows and columns are those of the identity.
            free = (wp.float64(1.0) - pinned[tris[i, j]]) * (wp.float64(1.0) - pinned[tris[i, k]])
            blocks[i, 3 * j + k] = free * blocks[i, 3 * j + k]
        blocks[i, 4 * j] = blocks[i, 4 * j] + pinned[tris[i, j]] * wp.identity(n=3, dtype=wp.float64)


def sheet():
    """Triangles, plane coordinates and masses of the points."""
    n = CELLS + 1
    grid = np.arange(n * n, dtype=np.int32).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[1:, 1:]))
    tris = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
    X = np.stack(np.meshgrid(*[np.linspace(0, SIDE, n)] * 2, indexing="ij"), -1).reshape(-1, 2)
    mass = np.bincount(tris.ravel(), minlength=n * n) * DENSITY * (SIDE / CELLS) ** 2 / 6
    return tris, X, mass


def solve():
    tris, X, mass = sheet()
    n, count = len(X), len(tris)
    elements, m = wp.array(tris, dtype=int), wp.array(mass, dtype=wp.float64)
    pinned = wp.array(X[:, 1] == SIDE, dtype=wp.float64)
    stored = wp.zeros((count, energies.ELEMENTS["st_vk_f64"]["stored"]), dtype=wp.float64)
    flags = wp.zeros(count, dtype=int)
    wp.launch(at_rest, count, inputs=[elements, wp.array(X, dtype=wp.vec2d), stored, flags])
    x = wp.array(np.insert(X, 1, 0.0, axis=1), dtype=wp.vec3d)  # in the plane y = 0
    g, step, own = wp.zeros_like(x), wp.zeros_like(x), wp.zeros((count, 3), dtype=wp.vec3d)
    blocks = wp.zeros((count, 9), dtype=wp.mat33d)
    rows, columns = (wp.array(one.ravel(), dtype=int) for one in (np.repeat(tris, 3, axis=1), np.tile(tris, 3)))
    for iteration in range(30):
        wp.launch(weights, n, inputs=[x, m, pinned, g])
        wp.launch(triangles, count, inputs=[elements, x, stored, pinned, g, own, blocks, flags])
        assert not flags.numpy().any()
        residual = np.abs(g.numpy()).max()
        print(f"{iteration:3}  |g| = {residual:.1e} N")
        if residual < 1e-13:
            break
        H = bsr_from_triplets(n, n, rows, columns, blocks.flatten())
        step.zero_()
        cg(H, g, step, tol=1e-12, atol=0.0, maxiter=10 * n)
        x = wp.array(x.numpy() - step.numpy(), dtype=wp.vec3d)
    return x.numpy()


if __name__ == "__main__":
    x = solve()
    print(f"The sheet is {x[:, 2].max() - x[:, 2].min():.6f} m long; unloaded, {SIDE} m.")
