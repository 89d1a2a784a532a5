"""A custom gradient for JAX: an energy of the package as a differentiable function of positions."""

import jax
import jax.numpy as jnp
import numpy as np

import energy_dsl as ed

jax.config.update("jax_enable_x64", True)
spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
springs = spring.bind(100, k=2.0, L=1.0)


def evaluated(x):
    """Returns Σ U and ∂U/∂x, from outside of JAX."""
    shapes = (jax.ShapeDtypeStruct((100,), x.dtype), jax.ShapeDtypeStruct(x.shape, x.dtype))
    U, g = jax.pure_callback(lambda x: springs.gradient(np.asarray(x)), shapes, x)
    return U.sum(), g


@jax.custom_vjp
def energy(x):
    return evaluated(x)[0]


energy.defvjp(evaluated, lambda g, weight: (weight * g,))

x = jnp.asarray(np.random.default_rng(1).normal(size=(100, 2, 3)))
for _ in range(50):
    x = x - 0.2 * jax.jit(jax.grad(energy))(x)
print(f"U = {energy(x):.2e} J")
