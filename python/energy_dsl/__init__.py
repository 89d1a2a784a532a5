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
from collections.abc import Callable as _Callable, Iterable as _Iterable, Mapping as _Mapping
from typing import TYPE_CHECKING, Any as _Any, NamedTuple as _NamedTuple

from ._energy import Element, Elements, EnergyError, FolderInUseError, Input, ResourceError, Simulation as _Simulation
from ._energy import Snapshot, System as _System, audit as _audit, catalogue, drape, energies
from ._energy import library_element as _library_element, measurement_columns as _measurement_columns
from ._energy import resume as _resume, run as _run, show

if TYPE_CHECKING:
    from .sweeps import Sweep, sweep

    import numpy as _np
    from numpy.typing import ArrayLike as _ArrayLike, NDArray as _NDArray
    from typing_extensions import Self as _Self

    _Scene = str | _os.PathLike[str] | _Mapping[str, _Any]
    #: Called with the number of steps done and of all steps.
    _Progress = _Callable[[int, int], object]
    #: The most `steps` and `bytes` of the compiler. One that is not named is 1e7 or 4e8.
    _Limits = _Mapping[str, float]

__all__ = [
    "AuditReport", "Contacts", "Element", "Elements", "EnergyError", "FolderInUseError", "Input", "Minimum",
    "OwnEnergy", "OwnForce", "ResourceError", "Simulation", "Snapshot", "Sweep", "System", "audit", "catalogue",
    "drape", "element", "energies", "energy", "load", "measurements", "resume", "run", "show", "simulate", "sweep",
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


def energy(text: str, file: str = "<text>", *, limits: _Limits | None = None) -> Element:
    """Compiles the one declaration of a text: an energy, a force, a constraint or a residual.

    `limits={"steps": 1e9, "bytes": 4e9}` lets the compiler take more than its ten million steps, some seconds, and 400
    MB. Ctrl-C ends a compilation.

    Raises EnergyError, which names line and column, if the text is wrong, declares several or exceeds a limit.
    """
    found = energies(text, file, limits=limits)
    if len(found) != 1:
        raise EnergyError(f"{file}: expected one declaration, got {len(found)}; use energies()")
    return found[0]


def load(path: str | _os.PathLike[str], *, limits: _Limits | None = None) -> list[Element]:
    """Compiles all declarations of a file (`.energy`), within `limits` as in `energy`."""
    with open(path, encoding="utf-8") as file:
        return energies(file.read(), _os.fspath(path), limits=limits)


@_functools.cache
def element(name: str, vertices: bool = False) -> Element:
    """Returns an element of the library, such as "HingeAngle". `catalogue()` lists their names.

    Up to 475 operations (100 in float32), its values, gradients, Hessians, forces, residuals and Jacobians are compiled
    code, with the bits of the same text in `energy`. Larger elements and products with Hessians run as tapes.
    `bind(...).is_compiled` tells. With `vertices`, it has `vertex`, which runs as a tape.
    """
    found = _library_element(name, vertices)
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


def audit(
    text: str, *, quick: bool = False, seed: int = 1, file: str = "<text>", limits: _Limits | None = None
) -> AuditReport:
    """Compares all derivatives of a text with independent methods, and checks its claims, as `verify audit` does.

    The text is compiled within `limits` as in `energy`.
    """
    import json

    passed, report, failures = _audit(text, quick=quick, seed=seed, file=file, limits=limits)
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
def _declared(text: str, file: str, number: int, steps: int, size: int) -> Element:
    """Makes an element from a pickle. Workers that get one element many times compile it once."""
    return energies(text, file, limits={"steps": steps, "bytes": size})[number]


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


class OwnEnergy:
    """An energy of a simulation that a function evaluates, for all elements at once.

    `function(x, order)` gets positions (n, points, 3), and returns U of shape (n,) for order 0; U and ∂U/∂x of shape
    (n, points, 3) for order 1; U, ∂U/∂x and ∂²U/∂x² of shape (n, 3 points, 3 points) for order 2. With
    `hessians=False`, order 2 is not asked for, and integrators see no stiffness: good for weak pulls only.
    `stencils`, of shape (n, points), names the vertices.
    """

    is_energy = True

    def __init__(self, function: _Callable[..., _Any], stencils: _ArrayLike, *, hessians: bool = True) -> None:
        if not callable(function):
            raise TypeError(f"OwnEnergy: expected a function, got {type(function).__name__}")
        self.function, self.stencils, self.jacobians = function, stencils, hessians


class OwnForce:
    """A force of a simulation that a function evaluates, for all elements at once.

    `function(x, v, order)` gets positions and velocities (n, points, 3), and returns f of the same shape for order 1.
    It is called once in each step, with the state at its start, and the force stays fixed over the step. So it suits
    every integrator, if the force changes little within a step.

    With `jacobians=True`, implicit integrators evaluate it at the end of a step, several times. It then returns f,
    ∂f/∂x and ∂f/∂v, both of shape (n, 3 points, 3 points), for order 2. `newton` refuses such a force, because it has no
    energy.
    """

    is_energy = False

    def __init__(self, function: _Callable[..., _Any], stencils: _ArrayLike, *, jacobians: bool = False) -> None:
        if not callable(function):
            raise TypeError(f"OwnForce: expected a function, got {type(function).__name__}")
        self.function, self.stencils, self.jacobians = function, stencils, jacobians


class Contacts(_NamedTuple):
    """Pairs of features in certified contact: a point and a triangle, or two edges."""

    #: Vertices of the first feature, then of the second, (n, 4); -1 for those of obstacles.
    vertices: _NDArray[_np.int64]
    #: Number of vertices of the first feature, (n,): 1 for a point and a triangle, 2 for two edges.
    first: _NDArray[_np.int64]
    #: Distances of the features, in m, (n,).
    distances: _NDArray[_np.float64]
    #: Unit vectors from the second feature to the first, (n, 3).
    normals: _NDArray[_np.float64]
    #: Pushes along the normals, in N, without friction, (n,).
    forces: _NDArray[_np.float64]


class Simulation(_Simulation):
    """A scene of cloth, stepped by hand: a path of a TOML file, or a dictionary with the same keys.

    A program may control it between steps:

    - `positions` and `velocities` can be read and assigned;
    - `move_pins(vertices, targets)` sets where pinned vertices are at the end of the next step;
    - `move_obstacle(name, translation, rotation)` moves the obstacles that `obstacles` names;
    - `wind` can be assigned with `wind=True`, if the scene has a wind;
    - `change(parameters)` gives the scene other densities, stiffnesses and so on;
    - `forces` are own forces and energies by name: (element, stencils, inputs) of a text, whose inputs `set(name, …)`
      changes, or functions: OwnEnergy, OwnForce;
    - `snapshot()` and `restore(snapshot)` go back with the same bits; `reset()` goes back to the start, without
      building anything;
    - `pin_forces` and `reading()` are the loads on pins and the strains of garments;
    - `term_forces()` (of the elements that have a free vertex), `contact_forces`, `contacts()` and, after
      `keep_ledger()`, `ledger()` are arrays.

    `step` releases the interpreter's lock. A second thread that uses the same object meanwhile gets a RuntimeError. An
    exception of an own function ends the step, and leaves the state before it.
    """

    def __new__(
        cls,
        scene: _Scene,
        threads: int | None = None,
        *,
        obstacles: _Iterable[str] = (),
        wind: bool = False,
        forces: _Mapping[str, tuple[Element, _Any, _Mapping[str, _Any]] | OwnEnergy | OwnForce] | None = None,
    ) -> _Self:
        text, path = _scene(scene)
        return cls._made(text, path, threads, list(obstacles), wind, dict(forces or {}))

    @classmethod
    def _made(
        cls, text: str, path: str, threads: int | None, obstacles: list[str], wind: bool, forces: dict[str, _Any]
    ) -> _Self:
        texts, functions = [], []
        for name, force in forces.items():
            if isinstance(force, (OwnEnergy, OwnForce)):
                functions.append((name, force.function, force.stencils, force.is_energy, force.jacobians))
            elif isinstance(force, tuple) and len(force) == 3 and isinstance(force[0], Element):
                texts.append((name, force[0], force[1], dict(force[2])))
            else:
                expected = "(element, stencils, inputs), OwnEnergy or OwnForce"
                raise TypeError(f"forces, {name}: expected {expected}, got {type(force).__name__}")
        self = super().__new__(cls, text, path, threads, obstacles, wind, texts, functions)
        self._recipe = (text, _os.path.abspath(path), threads, obstacles, wind, forces)
        self._start, self._changes = None, {}
        return self

    _recipe: tuple[_Any, ...]
    _start: Snapshot | None
    _changes: dict[str, _Any]

    def change(self, parameters: _Mapping[str, _Any]) -> None:
        """Goes on with other parameters of the scene, such as {"fabric.density": 0.3}; keys are paths into the scene.

        The state and all controls stay. `reset` and `restore` keep the parameters of the last change. The scene is
        assembled again, which takes as long as building it.

        Raises ValueError for a wrong path, and for a scene with other time steps, vertices, triangles or terms; nothing
        changes then.
        """
        import json

        from ._energy import scene_tables
        from .plain import plain
        from .scene_paths import set_value

        text, path = self._recipe[:2]
        changes, tables = {**self._changes, **parameters}, scene_tables(text, path)
        for key, value in changes.items():
            set_value(tables, key, value)
        if self._start is None:
            self._start = self.snapshot()
        self.change_scene(json.dumps(tables, default=plain), path)
        self._changes = changes

    def step(self, steps: int = 1) -> int:
        """Takes steps, at most to the end of the scene. Returns the number taken."""
        if self._start is None:
            self._start = self.snapshot()
        return super().step(steps)

    def reset(self) -> None:
        """Goes back to the state before the first step, own parameters included."""
        if self._start is not None:
            self.restore(self._start)

    def contacts(self) -> Contacts:
        """Returns the pairs in certified contact at the end of the last step."""
        return Contacts(*self.contact_pairs())

    def reading(self) -> dict[str, float]:
        """Returns force (N), moment (N m) and mean position (m) of each pin and group of pins, and mean, largest, 5th
        and 95th percentile of the strain of each garment along warp and weft and of its shear angle (°), by column:
        `pin 0 Fx [N]`, `group jaw Mz [N m]`, `shirt warp 95%`. A strain that does not exist is NaN.

        A force is that of the cloth on the pin, with weight and inertia of the held vertices.
        """
        return dict(self.reading_columns())

    def ledger(self) -> dict[str, _NDArray[_np.float64]]:
        """Returns the energy balance so far: `time` (s), then energies and works (J), one number for each step.

        Raises RuntimeError unless `keep_ledger` was called.
        """
        columns = self.ledger_columns()
        if columns is None:
            raise RuntimeError("no ledger is kept; call keep_ledger() before the first step")
        return dict(columns)

    def __reduce__(self) -> tuple[_Any, ...]:
        own = {name: value for name, value in self.__dict__.items() if name not in ("_recipe", "_start", "_changes")}
        return _simulation, (type(self), self._recipe, self._changes, self.snapshot(), self._start, own)


def _simulation(
    cls: type[Simulation],
    recipe: tuple[_Any, ...],
    changes: dict[str, _Any],
    now: Snapshot,
    start: Snapshot | None,
    more: dict[str, _Any],
) -> Simulation:
    """Makes a simulation from a pickle."""
    simulation = cls._made(*recipe)
    if changes:
        simulation.change(changes)
    simulation.restore(now)
    simulation._start = start
    simulation.__dict__.update(more)
    return simulation


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


def measurements(folder: str | _os.PathLike[str]) -> dict[str, _NDArray[_np.float64]]:
    """Returns the readings of a finished run, by column: `time [s]`, then those of `Simulation.reading`, one number for
    each frame. A run with more than 100,000 loads on pins has every second frame, every third and so on;
    `measurements.csv` in its folder has all.

    Raises EnergyError if the folder does not hold a finished run.
    """
    return dict(_measurement_columns(folder))
