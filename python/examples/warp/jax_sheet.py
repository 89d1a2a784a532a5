"""Newton's method under `jax.jit`: the hanging sheet of newton.py, with generated functions in kernels of Warp.

`verify emit StVK Gravity --lang warp -o .` writes the module `energies`. Runs on the CPU and on CUDA, where JAX does.
`jax.grad` of the energy runs the adjoint of the kernel, which is the generated gradient. The derivative of `gradient`
along a vector is the generated product with the Hessian, so `jax.jvp` of it needs no tape.
"""

import jax
import jax.numpy as jnp
import newton
import numpy as np
import warp as wp
from jax.scipy.sparse.linalg import cg

import energies

jax.config.update("jax_enable_x64", True)

TRIS, PLANE, MASS = newton.sheet()
COUNT, STORED = len(TRIS), energies.ELEMENTS["st_vk_f64"]["stored"]
LAMBDA, MU = newton.LAMBDA, newton.MU
FREE = jnp.array(PLANE[:, 1] != newton.SIDE)[:, None]  # the upper edge is pinned
WEIGHT = jnp.array(MASS[:, None] * np.array(newton.G))  # N
VECTORS = {"launch_dims": COUNT, "output_dims": (COUNT, 3)}


@wp.kernel
def at_rest(tris: wp.array[wp.vec3i], X: wp.array[wp.vec2d], stored: wp.array2d[wp.float64]):
    i = wp.tid()
    energies.st_vk_f64_rest(X[tris[i][0]], X[tris[i][1]], X[tris[i][2]], LAMBDA, MU, stored[i])


@wp.kernel
def values(tris: wp.array[wp.vec3i], x: wp.array[wp.vec3d], stored: wp.array2d[wp.float64], U: wp.array[wp.float64]):
    i = wp.tid()
    U[i] = energies.st_vk_f64_value(x[tris[i][0]], x[tris[i][1]], x[tris[i][2]], LAMBDA, MU, stored[i])


@wp.kernel
def gradients(tris: wp.array[wp.vec3i], x: wp.array[wp.vec3d], stored: wp.array2d[wp.float64], g: wp.array2d[wp.vec3d]):
    i = wp.tid()
    own = energies.st_vk_f64_gradient(x[tris[i][0]], x[tris[i][1]], x[tris[i][2]], LAMBDA, MU, stored[i])
    for j in range(3):
        g[i, j] = own[j]


@wp.kernel
def products(
    tris: wp.array[wp.vec3i],
    x: wp.array[wp.vec3d],
    v: wp.array[wp.vec3d],
    stored: wp.array2d[wp.float64],
    Hv: wp.array2d[wp.vec3d],
):
    i = wp.tid()
    a, b, c = tris[i][0], tris[i][1], tris[i][2]
    own = energies.st_vk_f64_hessian_vector(x[a], x[b], x[c], v[a], v[b], v[c], LAMBDA, MU, stored[i])
    for j in range(3):
        Hv[i, j] = own[j]


tris = jnp.array(TRIS, dtype=jnp.int32)
stored = wp.jax_kernel(at_rest, launch_dims=COUNT, output_dims=(COUNT, STORED))(tris, jnp.array(PLANE))[0]
stretched = wp.jax_kernel(values, enable_backward=True)  # a number for each entry of the first array
pulled, pushed = wp.jax_kernel(gradients, **VECTORS), wp.jax_kernel(products, **VECTORS)


def energy(x):
    return stretched(tris, x, stored)[0].sum() - (WEIGHT * x).sum()


def summed(own):
    """Vectors of triangles, added to their free points."""
    return jnp.where(FREE, jnp.zeros_like(WEIGHT).at[tris].add(own), 0.0)


@jax.custom_jvp
def gradient(x):
    return summed(pulled(tris, x, stored)[0]) - jnp.where(FREE, WEIGHT, 0.0)


@gradient.defjvp
def product(points, directions):
    (x,), (v,) = points, directions
    return gradient(x), summed(pushed(tris, x, v, stored)[0])


@jax.jit
def solve(x):
    """Newton's method until no force exceeds 1e-13 N: the points, and the number of steps."""

    def step(state):
        x, steps = state
        g, along = gradient(x), lambda v: jax.jvp(gradient, (x,), (v,))[1]
        return x - cg(along, g, tol=1e-12, maxiter=10 * len(MASS))[0], steps + 1

    def unfinished(state):
        return (jnp.abs(gradient(state[0])).max() > 1e-13) & (state[1] < 30)

    return jax.lax.while_loop(unfinished, step, (x, 0))


def hanging():
    """The sheet at the start, and where it hangs, with the number of steps."""
    start = jnp.array(np.insert(PLANE, 1, 0.0, axis=1))
    return start, *solve(start)


if __name__ == "__main__":
    _, x, steps = hanging()
    print(f"After {steps} steps, the sheet is {x[:, 2].max() - x[:, 2].min():.6f} m long; unloaded, {newton.SIDE} m.")
