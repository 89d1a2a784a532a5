"""An energy as a differentiable function of JAX: gradient descent, then products with the Hessian."""

import jax
import jax.numpy as jnp
import numpy as np

import energy_dsl as ed
import energy_dsl.jax as edj

jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]
spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
energies = edj.function(spring, k=2.0, L=1.0)


def energy(x: jax.Array) -> jax.Array:
    total: jax.Array = energies(x).sum()
    return total


x = jnp.asarray(np.random.default_rng(1).normal(size=(100, 2, 3)))
descend = jax.jit(lambda x: x - 0.2 * jax.grad(energy)(x))
for _ in range(50):
    x = descend(x)
print(f"U = {energy(x):.2e} J")

# (∂²U/∂x²) v, and the Hessian of each spring.
product = jax.jit(lambda x, v: jax.jvp(jax.grad(energy), (x,), (v,))[1])
hessians = jax.jit(jax.vmap(jax.hessian(energies)))
v = jnp.ones_like(x)
difference = product(x, v) - jnp.einsum("niajb,njb->nia", hessians(x), v)
print(f"largest difference of products: {jnp.abs(difference).max():.0e} N")
