"""Elements as functions of JAX, with exact derivatives.

>>> import energy_dsl as ed, energy_dsl.jax as edj, jax
>>> spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
>>> energy = edj.function(spring, k=2.0, L=1.0)
>>> force = jax.jit(jax.grad(lambda x: -energy(x).sum()))

Needs JAX: pip install jax. Functions call back into Python, so they run on the CPU; arrays of other devices are copied.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ._energy import Element
from .functions import Kernel, kernel

__all__ = ["function"]


def function(element: Element, **inputs: Any) -> Callable[..., Any]:
    """Returns an element as a function of JAX arrays.

    An energy or constraint becomes U(x) with x of shape (…, points, 3) and U of shape (…); a force becomes f(x, v) with
    the shape of x; a residual becomes r(u) with u of shape (…, unknowns) and r of shape (…, rows). Inputs are shared by
    all elements, or there is one for each along the last leading axis.

    `grad`, `jvp`, `vjp`, `jacfwd`, `jacrev`, `hessian`, `vmap` and `jit` work, with first and second derivatives of
    energies and first ones of forces and residuals. Arrays of float32 are evaluated in single precision.

    Raises NotImplementedError for higher derivatives, TypeError for inputs that are traced, ValueError for wrong
    shapes.
    """
    found = kernel(element, inputs)
    if element.kind == "force":
        return _force(found)
    return _residual(found) if found.is_residual else _energy(found)


def _callback(kernel: Kernel, method: str, tail: tuple[int, ...], count: int = 1) -> Callable[..., Any]:
    """Returns a method of a kernel as a function of JAX; `tail` are the axes of its results after the leading ones."""
    call = getattr(kernel, method)

    def evaluate(*arguments: Any) -> Any:
        arrays = [np.asarray(argument) for argument in arguments]
        # Axes that vmap adds have length 1 in arguments that it does not map.
        return call(*(np.ascontiguousarray(array) for array in np.broadcast_arrays(*arrays)))

    def traced(x: Any, *others: Any) -> Any:
        lead = kernel.leading(x.shape, "u" if kernel.is_residual else "x")
        shape = jax.ShapeDtypeStruct((*lead, *tail), x.dtype)
        shapes = shape if count == 1 else (shape,) * count
        return jax.pure_callback(evaluate, shapes, x, *others, vmap_method="expand_dims")

    return traced


def _floating(x: Any) -> Any:
    x = jnp.asarray(x)
    return x if jnp.issubdtype(x.dtype, jnp.floating) else x.astype(jnp.result_type(float))


def _final(kernel: Kernel, function: Callable[..., Any], what: str) -> Callable[..., Any]:
    """Returns a function whose derivatives are refused by name. Those of a callback are errors without a name."""
    final = jax.custom_jvp(function)

    def refuse(primals: Any, tangents: Any) -> Any:
        raise NotImplementedError(kernel.refusal(what))

    final.defjvp(refuse)
    return final


def _energy(kernel: Kernel) -> Callable[..., Any]:
    own = kernel.own
    hessian = _final(kernel, _callback(kernel, "hessian", own + own), "third derivatives")
    gradient = jax.custom_jvp(_callback(kernel, "derivative", own))
    value = jax.custom_jvp(_callback(kernel, "value", ()))

    # Rules are linear in the tangents and free of callbacks on them, so that JAX can transpose them.
    @gradient.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        (x,), (dx,) = primals, tangents
        return gradient(x), jnp.einsum("...iajb,...jb->...ia", hessian(x), dx)

    @value.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        (x,), (dx,) = primals, tangents
        return value(x), jnp.sum(gradient(x) * dx, axis=(-2, -1))

    def energy(x: Any) -> Any:
        """Returns U, of shape (…), for positions of shape (…, points, 3)."""
        return value(_floating(x))

    return energy


def _force(kernel: Kernel) -> Callable[..., Any]:
    own = kernel.own
    jacobians = _final(kernel, _callback(kernel, "force_jacobians", own + own, 2), "second derivatives")
    value = jax.custom_jvp(_callback(kernel, "force", own))

    @value.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        by_x, by_v = jacobians(*primals)
        product = "...iajb,...jb->...ia"
        return value(*primals), jnp.einsum(product, by_x, tangents[0]) + jnp.einsum(product, by_v, tangents[1])

    def force(x: Any, v: Any) -> Any:
        """Returns f(x, v), of the shape of x."""
        x = _floating(x)
        return value(x, jnp.broadcast_to(jnp.asarray(v, x.dtype), x.shape))

    return force


def _residual(kernel: Kernel) -> Callable[..., Any]:
    rows = kernel.call("residual", np.zeros((kernel.count or 1, *kernel.own)))[0].shape[-1]
    jacobian = _final(kernel, _callback(kernel, "derivative", (rows, *kernel.own)), "second derivatives")
    value = jax.custom_jvp(_callback(kernel, "value", (rows,)))

    @value.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        (u,), (du,) = primals, tangents
        return value(u), jnp.einsum("...ri,...i->...r", jacobian(u), du)

    def residual(u: Any) -> Any:
        """Returns r, of shape (…, rows), for unknowns of shape (…, unknowns)."""
        return value(_floating(u))

    return residual
