"""Elements as functions of arrays with any leading axes: what the functions for torch and JAX share."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._energy import Element, Elements

Array = NDArray[np.floating[Any]]


class Kernel:
    """An element with its inputs, evaluated for positions of shape (…, points, 3), or unknowns of shape (…, unknowns).

    Inputs are shared by all elements, or there is one for each along the last leading axis; its length is then fixed.
    """

    def __init__(self, element: Element, inputs: Mapping[str, Any]) -> None:
        self.element = element
        self.name = element.name
        self.is_residual = element.kind == "residual"
        # Points have three coordinates each, and are not counted among the unknowns.
        moves_by_addition = element.points > 0 or self.is_residual and element.unknowns == element.increments
        if not moves_by_addition:
            raise TypeError(
                f"{element.name}: a function takes points, or a residual's unknowns without rotations. "
                "Call the methods of the element instead"
            )
        self.own = (element.unknowns,) if self.is_residual else (element.points, 3)
        self.inputs: dict[str, Any] = {}
        self.each: set[str] = set()
        self.count: int | None = None
        shapes = {item.name: tuple(item.shape) for item in element.inputs}
        for name, value in inputs.items():
            array = _constant(element, name, value)
            if name in shapes and array.ndim == len(shapes[name]) + 1:
                if self.count is not None and self.count != len(array):
                    raise ValueError(f"{name}: expected one for each of {self.count} elements, got {len(array)}")
                self.count = len(array)
                self.each.add(name)
            self.inputs[name] = array
        self.bound: dict[tuple[int, str], Elements] = {}
        self.lock = threading.Lock()
        # Wrong inputs are refused at once, not in the first call.
        self.of(1 if self.count is None else self.count, "float64")

    def of(self, count: int, dtype: str) -> Elements:
        """Returns so many bound elements. Those of the last few sizes are kept."""
        key = (count, dtype)
        # Compiled functions call back from several threads.
        with self.lock:
            if key not in self.bound:
                times = count // self.count if self.count else 1
                inputs: dict[str, Any] = {
                    name: np.concatenate([value] * times) if name in self.each else value
                    for name, value in self.inputs.items()
                }
                if len(self.bound) >= 8:
                    self.bound.pop(next(iter(self.bound)))
                self.bound[key] = self.element.bind(count, dtype, **inputs)
            return self.bound[key]

    def leading(self, shape: tuple[int, ...], name: str) -> tuple[int, ...]:
        """Returns the leading axes of an argument."""
        lead = tuple(shape[: -len(self.own)])
        wanted = ", ".join(map(str, self.own))
        if tuple(shape[-len(self.own) :]) != self.own:
            raise ValueError(f"{name}: expected shape (…, {wanted}), got {tuple(shape)}")
        if self.count is not None and (not lead or lead[-1] != self.count):
            raise ValueError(f"{name}: expected shape (…, {self.count}, {wanted}), got {tuple(shape)}")
        return lead

    def call(self, method: str, *arguments: Array) -> tuple[Array, ...]:
        """Evaluates a method of bound elements. Leading axes of the results are those of the first argument."""
        first = np.asarray(arguments[0])
        dtype = "float32" if first.dtype == np.float32 else "float64"
        lead = self.leading(first.shape, "u" if self.is_residual else "x")
        count = int(np.prod(lead, dtype=np.int64))
        flat = [np.ascontiguousarray(argument, dtype).reshape(count, *self.own) for argument in arguments]
        results = getattr(self.of(count, dtype), method)(*flat)
        listed = results if isinstance(results, tuple) else (results,)
        return tuple(result.reshape((*lead, *result.shape[1:])) for result in listed)

    def value(self, x: Array) -> Array:
        """Returns U, or the residual r."""
        return self.call("residual" if self.is_residual else "value", x)[0]

    def derivative(self, x: Array) -> Array:
        """Returns ∂U/∂x, of the shape of x, or ∂r/∂u, (…, rows, unknowns)."""
        return self.call("jacobian" if self.is_residual else "gradient", x)[1]

    def hessian(self, x: Array) -> Array:
        """Returns ∂²U/∂x², of shape (…, points, 3, points, 3)."""
        H = self.call("hessian", x)[2]
        return H.reshape(*H.shape[:-2], *self.own, *self.own)

    def force(self, x: Array, v: Array) -> Array:
        """Returns f(x, v), of the shape of x."""
        return self.call("force", x, v)[0]

    def force_jacobians(self, x: Array, v: Array) -> tuple[Array, Array]:
        """Returns ∂f/∂x and ∂f/∂v, of shape (…, points, 3, points, 3)."""
        _, by_x, by_v = self.call("force_jacobians", x, v)
        shape = (*by_x.shape[:-2], *self.own, *self.own)
        return by_x.reshape(shape), by_v.reshape(shape)

    def refusal(self, what: str) -> str:
        """Returns the message for derivatives that do not exist here."""
        known = {"force": "first", "residual": "first"}.get(self.element.kind, "first and second")
        return f"{self.name}: {what} are not available, only {known} derivatives by {self.arguments()}"

    def arguments(self) -> str:
        """Returns what the function depends on, for messages."""
        return {"force": "positions and velocities", "residual": "unknowns"}.get(self.element.kind, "positions")


def _constant(element: Element, name: str, value: Any) -> Array:
    """Returns an input as an array. One that a framework differentiates by is refused: its gradient would be lost."""
    if getattr(value, "requires_grad", False):
        message = f"{element.name}: the input `{name}` requires a gradient, but derivatives by inputs are not available"
        raise TypeError(f"{message}; pass {name}.detach()")
    try:
        return np.asarray(value, dtype=np.float64).copy()
    except Exception as error:
        kind = type(value).__name__
        if "Tracer" in kind:
            message = f"{element.name}: the input `{name}` is traced, but derivatives by inputs are not available"
            raise TypeError(f"{message}; pass a number or an array from outside of the traced function") from error
        raise


def kernel(element: Element, inputs: Mapping[str, Any]) -> Kernel:
    """Returns the kernel of an element. Refuses bound elements, whose inputs are fixed in number."""
    if isinstance(element, Elements):
        raise TypeError("expected an element and its inputs, function(element, k=…), got bound elements")
    return Kernel(element, inputs)
