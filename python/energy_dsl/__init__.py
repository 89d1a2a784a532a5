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

import json as _json
import os as _os
from pathlib import Path as _Path

from ._energy import Element, Elements, EnergyError, Input, Simulation as _Simulation
from ._energy import System as _System, audit as _audit, catalogue as _catalogue, energies
from ._energy import resume as _resume, run as _run, show
from .sweep import Sweep, sweep

__all__ = [
    "AuditReport", "Element", "Elements", "EnergyError", "Input", "Simulation", "Sweep", "System", "audit",
    "catalogue", "element", "energies", "energy", "load", "resume", "run", "show", "simulate", "sweep",
]


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
    path = _Path(path)
    return energies(path.read_text(encoding="utf-8"), str(path))


def catalogue() -> list[str]:
    """Returns the names of the elements of the library."""
    return sorted(name for name, _ in _catalogue())


def element(name: str) -> Element:
    """Returns an element of the library."""
    texts = dict(_catalogue())
    if name not in texts:
        raise KeyError(f"no element {name!r} in the library; catalogue() lists its names")
    return energy(texts[name], name)


class AuditReport:
    """What an audit found. It is true if all checks passed."""

    def __init__(self, passed: bool, report: dict, failures: list[str]):
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
    passed, report, failures = _audit(text, quick=quick, seed=seed, file=file)
    return AuditReport(passed, _json.loads(report), failures)


class System(_System):
    """A sum of energies over the vertices of a mesh.

    `vertices` is their number. Those in `pinned` have no rows in the matrix. `add(element, stencils, **inputs)` adds
    an element for each row of stencils.
    """

    def linearise(self, x, curvature: str = "exact"):
        """Returns U, ∂U/∂x, and ∂²U/∂x² of the free vertices as a scipy.sparse.bsr_array.

        Elements whose vertices are all pinned are left out: they are constant.
        With `curvature` "clamped" or "absolute", element Hessians are made positive semi-definite first. The pattern
        of the matrix stays the same from call to call.
        """
        from scipy.sparse import bsr_array

        U, gradient, (offsets, columns, blocks) = super().linearise(x, curvature)
        size = 3 * len(self.free)
        return U, gradient, bsr_array((blocks, columns, offsets), shape=(size, size))


def _scene(scene) -> tuple[str, str]:
    """Returns the text of a scene, and the path at which relative paths start."""
    if isinstance(scene, dict):
        return _json.dumps(scene), "scene.toml"
    path = _Path(scene)
    return path.read_text(encoding="utf-8"), str(path)


class Simulation(_Simulation):
    """A scene of cloth, stepped by hand: a path of a TOML file, or a dictionary with the same keys."""

    def __new__(cls, scene, threads: int | None = None):
        text, path = _scene(scene)
        return super().__new__(cls, text, path, threads)


def simulate(scene, *, every: int = 1, threads: int | None = None):
    """Simulates a scene to its end. Returns the positions of every `every`-th step, (frames, vertices, 3), and the
    first ones."""
    import numpy as np

    if every < 1:
        raise ValueError(f"every: expected at least 1, got {every}")
    simulation = Simulation(scene, threads)
    frames = [simulation.positions]
    while not simulation.is_finished:
        simulation.step(every)
        frames.append(simulation.positions)
    return np.stack(frames)


def run(scene, output, *, overwrite=False, checkpoint: int | None = None, ignore_memory=False, threads=None) -> int:
    """Runs a scene and writes its results to a folder, as `cloth run` does. Returns the number of steps."""
    text, path = _scene(scene)
    return _run(
        text, path, str(output), overwrite=overwrite, checkpoint=checkpoint, ignore_memory=ignore_memory,
        threads=threads,
    )


def resume(output, *, accept_edited=False, threads=None) -> int:
    """Resumes an interrupted run from the checkpoint in its folder, as `cloth resume` does."""
    return _resume(str(output), accept_edited=accept_edited, threads=threads)
