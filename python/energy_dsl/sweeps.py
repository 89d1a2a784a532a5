"""Many runs of one scene with other values: each in a folder of its own, with one index of them all."""

from __future__ import annotations

import copy
import hashlib
import itertools
import json
import os
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _energy
from .plain import plain
from .scene_paths import set_value
from .sweep_files import listed_inputs
from .sweep_index import write_index, write_page, write_parquet
from .sweep_pool import collect

__all__ = ["Sweep", "sweep"]

Scene = str | os.PathLike[str] | Mapping[str, Any]
Choice = dict[str, Any]


@dataclass(frozen=True)
class Sweep:
    """The runs of a sweep, as its index lists them."""

    folder: Path
    #: One dictionary a run: its parameters, `folder`, `status` ("done" or "failed"), results (`steps`, `frames`,
    #: `energy` and `kinetic_energy` in J at the end, `crossings`, `obstacle_crossings`, `warnings`), `message`, and
    #: forces of pins and strains of garments at the end, such as `pin 0 Fx [N]` and `shirt warp mean`.
    runs: list[dict[str, Any]]
    #: Seconds of each run. A run that was resumed counts from its start to its end, without the pause.
    seconds: list[float]

    @property
    def failures(self) -> list[dict[str, Any]]:
        """Returns the runs that failed."""
        return [run for run in self.runs if run["status"] != "done"]


def sweep(
    scene: Scene,
    parameters: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]],
    output: str | os.PathLike[str],
    *,
    executor: Executor | Callable[[], Executor] | None = None,
    checkpoint: int = 50,
    threads: int = 1,
    retry_failures: bool = False,
    parquet: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Sweep:
    """Runs a scene once for each choice of parameters.

    `parameters` is a grid, {"fabric.density": [0.1, 0.2], "dt": [0.01]}, or choices from any sampler,
    [{"dt": 0.01}, …]; keys are paths into the scene. Any executor of concurrent.futures will do, such as those of
    joblib's loky and Dask, or a function that makes one; without one, a pool of one process per core is used.
    `progress(done, runs)` is called after each run.

    Each run has a folder in `output`. Its name is a hash of everything that the run reads: scene, meshes, materials,
    and the version of the package. Runs that are done are skipped if all their files are whole, and interrupted ones
    continue from their last checkpoint, with the same bytes. A run that fails is listed, and the others go on.

    - A scene that cannot be simulated fails for good; with `retry_failures`, such runs start again.
    - Runs that the machine failed (full disk, short memory) are listed as failed, and the next call tries again.
    - A worker that is killed costs its own run: the others continue in a new pool. A run whose worker is killed three
      times is listed as failed, and the next call tries again.

    `index.csv` lists parameters, results and failures; it is the same after an interruption. `times.csv` has the
    seconds of each run, and `sweep.html` shows both. With `parquet`, `index.parquet` is written, too (needs pyarrow).

    Raises ValueError for a wrong path or parameter, OSError for an index that cannot be written, and BlockingIOError
    if another sweep is at work in a folder of a run. The same call continues after each of these.
    """
    folder = Path(output)
    base, place = _base(scene)
    known: dict[str, str] = {}
    jobs = [_job(base, place, choice, folder, known) for choice in _choices(parameters)]
    for job in jobs:
        job.update(checkpoint=checkpoint, threads=threads, retry=retry_failures)
    folder.mkdir(parents=True, exist_ok=True)
    found = collect(executor, jobs, progress)
    results = [found[job["folder"]] for job in jobs]
    runs = [result["run"] for result in results]
    seconds = [result["seconds"] for result in results]
    names = sorted({name for job in jobs for name in job["choice"]})
    write_index(folder, names, runs, seconds)
    write_page(folder / "sweep.html", names, runs, seconds)
    if parquet:
        write_parquet(folder / "index.parquet", names, runs)
    return Sweep(folder, runs, seconds)


def _base(scene: Scene) -> tuple[dict[str, Any], str]:
    if isinstance(scene, Mapping):
        return copy.deepcopy(dict(scene)), os.getcwd()
    path = Path(scene)
    return _energy.read_scene(str(path)), str(path.resolve().parent)


def _choices(parameters: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]]) -> list[Choice]:
    if not isinstance(parameters, Mapping):
        return [dict(choice) for choice in parameters]
    names = list(parameters)
    return [dict(zip(names, values)) for values in itertools.product(*(list(parameters[name]) for name in names))]


def _job(base: dict[str, Any], place: str, choice: Choice, folder: Path, known: dict[str, str]) -> dict[str, Any]:
    """Describes a run to a worker. `known` holds hashes of files that were read already."""
    scene = copy.deepcopy(base)
    for key, value in choice.items():
        set_value(scene, key, value)
    text = json.dumps(scene, sort_keys=True, default=plain)
    path = str(Path(place) / "scene.toml")
    inputs = listed_inputs(text, path, known)
    identity = json.dumps([_energy.version(), text, [[name, digest] for name, _, digest in inputs]])
    name = hashlib.sha256(identity.encode()).hexdigest()[:16]
    files = [[file, digest] for _, file, digest in inputs]
    return {"choice": choice, "text": text, "path": path, "folder": str(folder / name), "inputs": files}
