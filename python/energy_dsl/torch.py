"""Elements as functions of torch, with exact derivatives.

>>> import energy_dsl as ed, energy_dsl.torch as edt, torch
>>> spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
>>> energy = edt.function(spring, k=2.0, L=1.0)
>>> x = torch.randn(100, 2, 3, dtype=torch.float64, requires_grad=True)
>>> energy(x).sum().backward()

Needs torch: pip install torch. Functions run on the CPU; tensors of other devices are copied.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch

from ._energy import Element
from .functions import Kernel, kernel

__all__ = ["function"]


def function(element: Element, **inputs: Any) -> Callable[..., torch.Tensor]:
    """Returns an element as a function of tensors.

    An energy or constraint becomes U(x) with x of shape (…, points, 3) and U of shape (…); a force becomes f(x, v) with
    the shape of x; a residual becomes r(u) with u of shape (…, unknowns) and r of shape (…, rows). Inputs are shared by
    all elements, or there is one for each along the last leading axis.

    `backward`, `torch.autograd` and `torch.func` (`grad`, `jvp`, `vjp`, `jacfwd`, `jacrev`, `hessian`, `vmap`) work,
    with first and second derivatives of energies and first ones of forces and residuals. Tensors of float32 are
    evaluated in single precision.

    Raises NotImplementedError for higher derivatives, and for forward over forward mode (`jvp` of `jvp`), where torch
    loses the tangents of functions that it does not know; TypeError for inputs that require a gradient, ValueError for
    wrong shapes.
    """
    found = kernel(element, inputs)
    if element.kind == "force":
        return lambda x, v: _Force.of(found, *torch.broadcast_tensors(_floating(x), _floating(v)))
    if found.is_residual:
        return lambda u: _Residual.of(found, _floating(u))
    return lambda x: _Energy.of(found, _floating(x))


def _floating(x: Any) -> torch.Tensor:
    x = torch.as_tensor(x)
    return x if x.dtype in (torch.float32, torch.float64) else x.to(torch.float64)


def _evaluated(method: Callable[..., Any], *tensors: torch.Tensor) -> Any:
    """Calls a method of a kernel on tensors."""
    results = method(*(tensor.detach().cpu().numpy() for tensor in tensors))
    back = [torch.from_numpy(result).to(tensors[0].device) for result in _tuple(results)]
    return tuple(back) if isinstance(results, tuple) else back[0]


def _forward_levels() -> int:
    """Returns how many transformations in forward mode are under way."""
    functorch = torch._C._functorch
    stack = functorch.get_interpreter_stack() or []
    return sum(level.key() == functorch.TransformType.Jvp for level in stack)


def _tuple(results: Any) -> tuple[Any, ...]:
    return results if isinstance(results, tuple) else (results,)


class _Function(torch.autograd.Function):
    """The method of a kernel that a subclass names. Its leading axes are free, so vmap adds one more."""

    method: str

    def __init_subclass__(cls) -> None:
        def forward(kernel: Kernel, *tensors: torch.Tensor) -> Any:
            return _evaluated(getattr(kernel, cls.method), *tensors)

        def vmap(info: Any, in_dims: Any, kernel: Kernel, *tensors: torch.Tensor) -> Any:
            return cls._mapped(info, in_dims, kernel, *tensors)

        for function in (forward, vmap):
            setattr(cls, function.__name__, staticmethod(function))

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        ctx.kernel, *tensors = inputs
        ctx.save_for_backward(*tensors)
        ctx.save_for_forward(*tensors)

    @classmethod
    def of(cls, kernel: Kernel, *tensors: torch.Tensor) -> Any:
        """Evaluates the function, unless torch would return zero for its derivative."""
        if _forward_levels() > 1:
            remedy = "use torch.func.hessian, or jacrev for one of the two derivatives"
            raise NotImplementedError(f"{kernel.name}: forward mode over forward mode is not available; {remedy}")
        return cls.apply(kernel, *tensors)

    @classmethod
    def _mapped(cls, info: Any, in_dims: Any, kernel: Kernel, *tensors: torch.Tensor) -> Any:
        """Evaluates with the mapped axis in front."""
        front = [
            tensor.expand(info.batch_size, *tensor.shape) if axis is None else tensor.movedim(axis, 0)
            for tensor, axis in zip(tensors, in_dims[1:])
        ]
        results = cls.apply(kernel, *front)
        return results, (0,) * len(results) if isinstance(results, tuple) else 0


def _contracted(matrix: torch.Tensor, vector: torch.Tensor) -> torch.Tensor:
    return torch.einsum("...iajb,...jb->...ia", matrix, vector)


def _transposed(matrix: torch.Tensor, vector: torch.Tensor) -> torch.Tensor:
    return torch.einsum("...iajb,...ia->...jb", matrix, vector)


class _Energy(_Function):
    """U(x)."""

    method = "value"

    @staticmethod
    def backward(ctx: Any, weight: torch.Tensor) -> Any:
        (x,) = ctx.saved_tensors
        return None, weight[..., None, None] * _Gradient.of(ctx.kernel, x)

    @staticmethod
    def jvp(ctx: Any, _: None, dx: torch.Tensor) -> Any:
        (x,) = ctx.saved_tensors
        return (_Gradient.of(ctx.kernel, x) * dx).sum((-2, -1))


class _Gradient(_Function):
    """∂U/∂x. Its Jacobian is symmetric."""

    method = "derivative"

    @staticmethod
    def backward(ctx: Any, weight: torch.Tensor) -> Any:
        (x,) = ctx.saved_tensors
        return None, _contracted(_Hessian.of(ctx.kernel, x), weight)

    @staticmethod
    def jvp(ctx: Any, _: None, dx: torch.Tensor) -> Any:
        (x,) = ctx.saved_tensors
        return _contracted(_Hessian.of(ctx.kernel, x), dx)


class _Final(_Function):
    """A function whose derivatives are refused by name."""

    @staticmethod
    def backward(ctx: Any, *_: Any) -> Any:
        order = "third" if ctx.kernel.element.kind in ("energy", "constraint") else "second"
        raise NotImplementedError(ctx.kernel.refusal(f"{order} derivatives"))

    @staticmethod
    def jvp(ctx: Any, *_: Any) -> Any:
        return _Final.backward(ctx)


class _Hessian(_Final):
    """∂²U/∂x²."""

    method = "hessian"


class _Force(_Function):
    """f(x, v)."""

    method = "force"

    @staticmethod
    def backward(ctx: Any, weight: torch.Tensor) -> Any:
        by_x, by_v = _ForceJacobians.of(ctx.kernel, *ctx.saved_tensors)
        return None, _transposed(by_x, weight), _transposed(by_v, weight)

    @staticmethod
    def jvp(ctx: Any, _: None, dx: torch.Tensor | None, dv: torch.Tensor | None) -> Any:
        jacobians = _ForceJacobians.of(ctx.kernel, *ctx.saved_tensors)
        parts = [_contracted(matrix, d) for matrix, d in zip(jacobians, (dx, dv)) if d is not None]
        return sum(parts[1:], parts[0])


class _ForceJacobians(_Final):
    """∂f/∂x and ∂f/∂v."""

    method = "force_jacobians"


class _Residual(_Function):
    """r(u)."""

    method = "value"

    @staticmethod
    def backward(ctx: Any, weight: torch.Tensor) -> Any:
        (u,) = ctx.saved_tensors
        return None, torch.einsum("...ri,...r->...i", _Jacobian.of(ctx.kernel, u), weight)

    @staticmethod
    def jvp(ctx: Any, _: None, du: torch.Tensor) -> Any:
        (u,) = ctx.saved_tensors
        return torch.einsum("...ri,...i->...r", _Jacobian.of(ctx.kernel, u), du)


class _Jacobian(_Final):
    """∂r/∂u."""

    method = "derivative"
