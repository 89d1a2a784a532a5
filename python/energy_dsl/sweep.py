"""Many runs of one scene with other values: each in a folder of its own, with one index of them all."""

from __future__ import annotations

import copy
import csv
import hashlib
import itertools
import json
import os
import time
import tomllib
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Sweep", "sweep"]

#: Columns of the index after those of the parameters.
RESULTS = ["folder", "status", "seconds", "message"]


@dataclass(frozen=True)
class Sweep:
    """The runs of a sweep, as its index lists them."""

    folder: Path
    #: One dictionary a run: its parameters, `folder`, `status` ("done" or "failed"), `seconds` and `message`.
    runs: list[dict]

    @property
    def failures(self) -> list[dict]:
        """Returns the runs that failed."""
        return [run for run in self.runs if run["status"] != "done"]


def sweep(
    scene: str | os.PathLike[str] | Mapping,
    parameters: Mapping[str, Iterable] | Iterable[Mapping],
    output: str | os.PathLike[str],
    *,
    executor: Executor | None = None,
    checkpoint: int = 50,
    threads: int = 1,
) -> Sweep:
    """Runs a scene once for each choice of parameters.

    `parameters` is a grid, {"fabric.density": [0.1, 0.2], "dt": [0.01]}, or a list of choices, [{"dt": 0.01}, …]; keys
    are paths into the scene. Any executor of concurrent.futures will do, such as those of joblib's loky, Dask and Ray;
    without one, a pool of one process per core is used.

    Runs that are done are skipped, and interrupted ones continue from their last checkpoint, with the same bytes.
    `index.csv` in the folder lists all runs. A run that fails is listed, and the others go on.
    """
    folder = Path(output)
    base, place = _base(scene)
    jobs = [_job(base, place, choice, folder, checkpoint, threads) for choice in _choices(parameters)]
    folder.mkdir(parents=True, exist_ok=True)
    if executor is None:
        with ProcessPoolExecutor() as pool:
            runs = _collect(pool, jobs)
    else:
        runs = _collect(executor, jobs)
    _write_index(folder / "index.csv", runs)
    return Sweep(folder, runs)


def _base(scene) -> tuple[dict, str]:
    if isinstance(scene, Mapping):
        return copy.deepcopy(dict(scene)), os.getcwd()
    path = Path(scene)
    return tomllib.loads(path.read_text(encoding="utf-8")), str(path.resolve().parent)


def _choices(parameters) -> list[dict]:
    if not isinstance(parameters, Mapping):
        return [dict(choice) for choice in parameters]
    names = list(parameters)
    return [dict(zip(names, values)) for values in itertools.product(*(list(parameters[name]) for name in names))]


def _job(base: dict, place: str, choice: dict, folder: Path, checkpoint: int, threads: int) -> dict:
    scene = copy.deepcopy(base)
    for key, value in choice.items():
        *tables, last = key.split(".")
        table = scene
        for name in tables:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise ValueError(f"{key}: `{name}` is not a table of the scene")
        table[last] = value
    text = json.dumps(scene, sort_keys=True)
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    return {
        "choice": choice, "text": text, "path": str(Path(place) / "scene.toml"), "folder": str(folder / name),
        "checkpoint": checkpoint, "threads": threads,
    }


def _collect(executor: Executor, jobs: list[dict]) -> list[dict]:
    futures = [executor.submit(run_one, job) for job in jobs]
    return [future.result() for future in futures]


def run_one(job: dict) -> dict:
    """Runs one choice of a sweep in its folder, unless that is done. Workers call it."""
    from . import _energy

    folder = Path(job["folder"])
    done = folder / "sweep.json"
    if done.exists():
        return json.loads(done.read_text(encoding="utf-8"))
    start = time.perf_counter()
    status, message = "done", ""
    try:
        if (folder / "checkpoint").exists():
            _energy.resume(str(folder), threads=job["threads"])
        else:
            _energy.run(
                job["text"], job["path"], str(folder), overwrite=True, checkpoint=job["checkpoint"],
                threads=job["threads"],
            )
    except (ValueError, RuntimeError, OSError) as error:
        status, message = "failed", str(error)
    seconds = round(time.perf_counter() - start, 3)
    result = {**job["choice"], "folder": folder.name, "status": status, "seconds": seconds, "message": message}
    folder.mkdir(parents=True, exist_ok=True)
    part = done.with_suffix(".part")
    part.write_text(json.dumps(result), encoding="utf-8")
    part.replace(done)
    return result


def _write_index(path: Path, runs: list[dict]) -> None:
    names = sorted({name for run in runs for name in run} - set(RESULTS))
    part = path.with_suffix(".part")
    with part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names + RESULTS)
        writer.writeheader()
        writer.writerows(runs)
    part.replace(path)
