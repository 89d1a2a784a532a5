"""Energies, forces, constraints and residuals written as formulas, with exact derivatives; cloth on top.

>>> import numpy as np, energy_dsl as ed
>>> spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
>>> U, g = spring.gradient(np.array([[[0.0, 0, 0], [2, 0, 0]]]), k=3.0, L=1.0)
>>> float(U[0]), g[0, 1].tolist()
(1.5, [3.0, 0.0, 0.0])

Arrays hold one element per row: positions have the shape (n, points, 3), gradients too, Hessians (n, 3 points,
3 points). Parameters and rest shapes are keywords: one value for all elements, or one for each.
"""

from __future__ import annotations

import functools as _functools
import os as _os
from collections.abc import Callable as _Callable, Mapping as _Mapping
from typing import TYPE_CHECKING, Any as _Any, NamedTuple as _NamedTuple

from ._energy import Element, Elements, EnergyError, FolderInUseError, Input, ResourceError, Simulation as _Simulation
from ._energy import System as _System, audit as _audit, catalogue, energies, library_element as _library_element
from ._energy import resume as _resume, run as _run, show

if TYPE_CHECKING:
    from .sweeps import Sweep, sweep

    import numpy as _np
    from numpy.typing import ArrayLike as _ArrayLike, NDArray as _NDArray
    from typing_extensions import Self as _Self

    _Scene = str | _os.PathLike[str] | _Mapping[str, _Any]
    #: Called with the number of steps done and of all steps.
    _Progress = _Callable[[int, int], object]

__all__ = [
    "AuditReport", "Element", "Elements", "EnergyError", "FolderInUseError", "Input", "Minimum", "ResourceError", "Simulation",
    "Sweep", "System", "audit", "catalogue", "element", "energies", "energy", "load", "resume", "run", "show", "simulate", "sweep",
]


def __getattr__(name: str) -> _Any:
    """Imports sweeps when they are first used: their executors take longer to import than the rest."""
    if name in ("Sweep", "sweep"):
        from . import sweeps

        globals().update(Sweep=sweeps.Sweep, sweep=sweeps.sweep)
        return globals()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def energy(text: str, file: str = "<text>") -> Element:
    """Compiles the one declaration of a text: an energy, a force, a constraint or a residual.

    Raises EnergyError, which names line and column, if the text is wrong or declares several.
    """
    found = energies(text, file)
    if len(found) != 1:
        raise EnergyError(f"{file}: expected one declaration, got {len(found)}; use energies()")
    return found[0]


def load(path: str | _os.PathLike[str]) -> list[Element]:
    """Compiles all declarations of a file (`.energy`)."""
    with open(path, encoding="utf-8") as file:
        return energies(file.read(), _os.fspath(path))


@_functools.cache
def element(name: str) -> Element:
    """Returns an element of the library, such as "HingeAngle". `catalogue()` lists their names.

    Up to 800 operations, its values, gradients, Hessians, forces, residuals and Jacobians are compiled code, with the
    bits of the same text in `energy`. Larger elements and products with Hessians run as tapes. `bind(...).is_compiled`
    tells.
    """
    found = _library_element(name)
    if found is None:
        raise KeyError(f"no element {name!r} in the library; catalogue() lists its names")
    return found


class AuditReport:
    """What an audit found. It is true if all checks passed."""

    def __init__(self, passed: bool, report: dict[str, _Any], failures: list[str]) -> None:
        self.passed = passed
        #: All findings, as `verify audit --json` writes them.
        self.report = report
        #: Each failure in words.
        self.failures = failures

    def __bool__(self) -> bool:
        return self.passed

    def __repr__(self) -> str:
        verdict = "passed" if self.passed else f"{len(self.failures)} failures"
        return f"<AuditReport: {verdict}>"


def audit(text: str, *, quick: bool = False, seed: int = 1, file: str = "<text>") -> AuditReport:
    """Compares all derivatives of a text with independent methods, and checks its claims, as `verify audit` does."""
    import json

    passed, report, failures = _audit(text, quick=quick, seed=seed, file=file)
    return AuditReport(passed, json.loads(report), failures)


class Minimum(_NamedTuple):
    """Where `System.minimise` ended."""

    #: Positions, (vertices, 3).
    x: _NDArray[_np.float64]
    #: U, in J.
    energy: float
    #: The largest component of the gradient at a free vertex, in N.
    gradient: float
    #: Steps of Newton's method.
    iterations: int
    #: Whether `gradient` is within the tolerance.
    converged: bool


class System(_System):
    """A sum of energies, forces and residuals over the vertices of a mesh.

    `vertices` is their number. Those in `pinned` have no rows in the matrix. `masses` (kg), of shape (vertices,), count
    where a method has a factor `mass`.

    `add(element, stencils, **inputs)` adds an element for each row of stencils, and returns the number of the term. A
    residual whose unknowns are the coordinates of vertices adds ½ ‖r‖², with the Hessian JᵀJ of Gauss and Newton.
    `set(term, **inputs)` changes inputs later. `pinned`, `masses` and `threads` can be assigned at any time.

    `flags(x)` tells which elements are degenerate or outside of their formula's domain, where `energy` is infinite.
    """

    def linearise(
        self, x: _ArrayLike, curvature: str = "exact", *, half: bool = False
    ) -> tuple[float, _NDArray[_np.float64], _Any]:
        """Returns U (J), ∂U/∂x, and ∂²U/∂x² of the free vertices as a scipy.sparse.bsr_array.

        Elements whose vertices are all pinned are left out: they are constant.
        With `curvature` "clamped" or "absolute", element Hessians are made positive semi-definite first. The pattern
        of the matrix stays the same from call to call. With `half`, blocks below the diagonal are left out.

        Raises RuntimeError, which names the element, if one is outside of its formula's domain, such as an inverted
        triangle with a logarithm of its area. `energy` returns infinity there, so that a line search steps back.
        Raises TypeError if the system has a force, which has no energy.
        """
        U, gradient, blocks = self.linearise_blocks(x, curvature, half)
        return U, gradient, self._matrix(blocks)

    def linearise_forces(
        self,
        x: _ArrayLike,
        v: _ArrayLike | None = None,
        *,
        position: float = -1.0,
        velocity: float = 0.0,
        mass: float = 0.0,
        curvature: str = "exact",
        half: bool = False,
    ) -> tuple[_NDArray[_np.float64], _Any]:
        """Returns f (N), of shape (vertices, 3), and the matrix position ∂f/∂x + velocity ∂f/∂v + mass M of the free
        vertices as a scipy.sparse.bsr_array.

        Energies act with f = −∂U/∂x. Velocities are 0 by default. A step of implicit Euler with step size h solves
        (M − h² ∂f/∂x − h ∂f/∂v) Δv = h (f + h ∂f/∂x v): position=−h², velocity=−h, mass=1.
        """
        force, blocks = self.linearise_forces_blocks(
            x, v, position=position, velocity=velocity, mass=mass, curvature=curvature, half=half
        )
        return force, self._matrix(blocks)

    def _matrix(self, blocks: tuple[_Any, _Any, _Any]) -> _Any:
        from scipy.sparse import bsr_array

        offsets, columns, numbers = blocks
        size = 3 * len(self.free)
        return bsr_array((numbers, columns, offsets), shape=(size, size))

    def minimise(
        self,
        x: _ArrayLike,
        *,
        tolerance: float = 1e-9,
        iterations: int = 100,
        mass: float = 0.0,
        target: _ArrayLike | None = None,
    ) -> Minimum:
        """Minimises U(x) + mass/2 Σ mᵢ ‖xᵢ − targetᵢ‖² over the free vertices.

        Newton's method with sparse Cholesky factors and a line search; Hessians are exact where their sum is positive
        definite, elsewhere those of elements are clamped. It ends where no component of the gradient exceeds
        `tolerance` (N), or after `iterations` steps; `converged` tells. A step of implicit Euler from positions x with
        velocities v and step size h has target = x + h v and mass = 1/h².

        Raises RuntimeError if x is outside of a formula's domain, TypeError if the system has a force.
        """
        return Minimum(
            *self.minimise_energy(x, tolerance=tolerance, iterations=iterations, mass=mass, target=target)
        )

    def __reduce__(self) -> tuple[_Any, ...]:
        arguments = (self.vertices, self.pinned, self.masses)
        return _system, (type(self), arguments, self.threads, self._terms(), self.__dict__)


def _system(cls: type[System], arguments: tuple[_Any, ...], threads: int, terms: list[_Any], more: _Any) -> System:
    """Makes a system from a pickle."""
    system = cls.__new__(cls, *arguments)
    system.threads = threads
    for element, stencils, inputs in terms:
        system.add(element, stencils, **inputs)
    system.__dict__.update(more)
    return system


@_functools.lru_cache(maxsize=1024)
def _declared(text: str, file: str, number: int) -> Element:
    """Makes an element from a pickle. Workers that get one element many times compile it once."""
    return energies(text, file)[number]


def _bound(element: Element, count: int, dtype: str, threads: int, inputs: dict[str, _Any]) -> Elements:
    """Binds elements from a pickle."""
    return element.bind(count, dtype, threads=threads, **inputs)


def _scene(scene: _Scene) -> tuple[str, str]:
    """Returns the text of a scene, and the path at which relative paths start."""
    if isinstance(scene, _Mapping):
        import json

        from .plain import plain

        return json.dumps(scene, default=plain), "scene.toml"
    with open(scene, encoding="utf-8") as file:
        return file.read(), _os.fspath(scene)


class Simulation(_Simulation):
    """A scene of cloth, stepped by hand: a path of a TOML file, or a dictionary with the same keys.

    `step` releases the interpreter's lock. A second thread that uses the same object meanwhile gets a RuntimeError.
    """

    def __new__(cls, scene: _Scene, threads: int | None = None) -> _Self:
        text, path = _scene(scene)
        return super().__new__(cls, text, path, threads)


def simulate(
    scene: _Scene, *, every: int = 1, threads: int | None = None, progress: _Progress | None = None
) -> _NDArray[_np.float64]:
    """Simulates a scene to its end. Returns the positions (m) of every `every`-th step, (frames, vertices, 3), and the
    first ones. `progress(done, steps)` is called after each of these."""
    import numpy as np

    if every < 1:
        raise ValueError(f"every: expected at least 1, got {every}")
    simulation = Simulation(scene, threads)
    frames = [simulation.positions]
    while not simulation.is_finished:
        simulation.step(every)
        frames.append(simulation.positions)
        if progress is not None:
            progress(simulation.steps_done, simulation.steps)
    return np.stack(frames)


def run(
    scene: _Scene,
    output: str | _os.PathLike[str],
    *,
    overwrite: bool = False,
    checkpoint: int | None = None,
    ignore_memory: bool = False,
    threads: int | None = None,
    progress: _Progress | None = None,
) -> int:
    """Runs a scene and writes its results to a folder, as `cloth run` does. Returns the number of steps.

    `progress(done, steps)` is called after each step. Ctrl-C, or an exception of `progress`, ends the run after the
    current step; the results so far are written, and with `checkpoint`, `resume` continues.
    """
    text, path = _scene(scene)
    return _run(
        text, path, str(output), overwrite=overwrite, checkpoint=checkpoint, ignore_memory=ignore_memory,
        threads=threads, progress=progress,
    )


def resume(
    output: str | _os.PathLike[str],
    *,
    accept_edited: bool = False,
    threads: int | None = None,
    progress: _Progress | None = None,
) -> int:
    """Resumes an interrupted run from the checkpoint in its folder, as `cloth resume` does."""
    return _resume(str(output), accept_edited=accept_edited, threads=threads, progress=progress)
