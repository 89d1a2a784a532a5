"""Many runs of one scene with other values: each in a folder of its own, with one index of them all."""

from __future__ import annotations

import copy
import hashlib
import itertools
import json
import os
import time
import tomllib
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .sweep_index import write_index, write_page, write_parquet

__all__ = ["Sweep", "sweep"]

Scene = str | os.PathLike[str] | Mapping[str, Any]
Choice = dict[str, Any]


@dataclass(frozen=True)
class Sweep:
    """The runs of a sweep, as its index lists them."""

    folder: Path
    #: One dictionary a run: its parameters, `folder`, `status` ("done" or "failed"), results (`steps`, `frames`,
    #: `energy` and `kinetic_energy` in J at the end, `crossings`, `obstacle_crossings`, `warnings`), `message`.
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
    executor: Executor | None = None,
    checkpoint: int = 50,
    threads: int = 1,
    retry_failures: bool = False,
    parquet: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Sweep:
    """Runs a scene once for each choice of parameters.

    `parameters` is a grid, {"fabric.density": [0.1, 0.2], "dt": [0.01]}, or choices from any sampler,
    [{"dt": 0.01}, …]; keys are paths into the scene. Any executor of concurrent.futures will do, such as those of
    joblib's loky and Dask; without one, a pool of one process per core is used. `progress(done, runs)` is called after
    each run.

    Each run has a folder in `output`. Runs that are done are skipped, and interrupted ones continue from their last
    checkpoint, with the same bytes. A run that fails is listed, and the others go on; with `retry_failures`, runs that
    failed earlier start again.

    `index.csv` lists parameters, results and failures; it is the same after an interruption. `times.csv` has the
    seconds of each run, and `sweep.html` shows both. With `parquet`, `index.parquet` is written, too (needs pyarrow).
    """
    folder = Path(output)
    base, place = _base(scene)
    jobs = [_job(base, place, choice, folder, checkpoint, threads) for choice in _choices(parameters)]
    for job in jobs:
        job["retry"] = retry_failures
    folder.mkdir(parents=True, exist_ok=True)
    if executor is None:
        with ProcessPoolExecutor() as pool:
            found = _collect(pool, jobs, progress)
    else:
        found = _collect(executor, jobs, progress)
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
    return tomllib.loads(path.read_text(encoding="utf-8")), str(path.resolve().parent)


def _choices(parameters: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]]) -> list[Choice]:
    if not isinstance(parameters, Mapping):
        return [dict(choice) for choice in parameters]
    names = list(parameters)
    return [dict(zip(names, values)) for values in itertools.product(*(list(parameters[name]) for name in names))]


def _job(
    base: dict[str, Any], place: str, choice: Choice, folder: Path, checkpoint: int, threads: int
) -> dict[str, Any]:
    scene = copy.deepcopy(base)
    for key, value in choice.items():
        _set(scene, key, value)
    text = json.dumps(scene, sort_keys=True, default=_plain)
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    return {
        "choice": choice, "text": text, "path": str(Path(place) / "scene.toml"), "folder": str(folder / name),
        "checkpoint": checkpoint, "threads": threads,
    }


def _set(scene: dict[str, Any], path: str, value: Any) -> None:
    """Sets the value at a path, such as "obstacles.0.friction". Numbers are places in lists."""
    *tables, last = path.split(".")
    table: Any = scene
    for name in tables:
        if isinstance(table, list):
            if not (name.isdigit() and int(name) < len(table)):
                raise ValueError(f"{path}: expected one of {len(table)} places, counted from 0, got `{name}`")
            table = table[int(name)]
        elif isinstance(table, dict):
            table = table.setdefault(name, {})
    if not isinstance(table, dict):
        raise ValueError(f"{path}: `{'.'.join(tables)}` is not a table of the scene")
    table[last] = value


def _plain(value: Any) -> Any:
    """Returns the Python number or list behind a NumPy one."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"expected a number, a text, a list or a table for a scene, got {type(value).__name__}")


def _collect(
    executor: Executor, jobs: list[dict[str, Any]], progress: Callable[[int, int], object] | None
) -> dict[str, dict[str, Any]]:
    """Returns the results of all folders. Equal choices share a folder, and run once."""
    distinct = {job["folder"]: job for job in jobs}
    futures: dict[Future[dict[str, Any]], str] = {executor.submit(run_one, job): name for name, job in distinct.items()}
    results = {}
    try:
        for done, future in enumerate(as_completed(futures), 1):
            results[futures[future]] = future.result()
            if progress is not None:
                progress(done, len(futures))
    except BaseException:
        # Without this, Ctrl-C would wait for runs that have not started.
        for future in futures:
            future.cancel()
        raise
    return results


def run_one(job: dict[str, Any]) -> dict[str, Any]:
    """Runs one choice of a sweep in its folder, unless that is done. Workers call it."""
    folder = Path(job["folder"])
    done = folder / "sweep.json"
    if done.exists():
        result: dict[str, Any] = json.loads(done.read_text(encoding="utf-8"))
        if result["run"]["status"] == "done" or not job["retry"]:
            return result
    clock = folder / "sweep.seconds"
    earlier = float(clock.read_text()) if clock.exists() else 0.0
    start = time.perf_counter()
    results, status, message = {}, "done", ""
    try:
        _run_when_free(job, folder, lambda: earlier + time.perf_counter() - start)
        results = _results(folder)
    except BlockingIOError:
        raise
    except (ValueError, RuntimeError, OSError) as error:
        status, message = "failed", str(error)
    seconds = round(earlier + time.perf_counter() - start, 3)
    choice = json.loads(json.dumps(job["choice"], default=_plain))
    run = {**choice, "folder": folder.name, "status": status, **results, "message": message}
    result = {"run": run, "seconds": seconds}
    folder.mkdir(parents=True, exist_ok=True)
    _replace(done, json.dumps(result))
    clock.unlink(missing_ok=True)
    return result


def _run_when_free(job: dict[str, Any], folder: Path, seconds: Callable[[], float]) -> None:
    """Runs a job. Workers of a sweep that was killed may need a moment to end; another sweep in the folder is an error
    of the caller, not a failed run."""
    from . import _energy

    for _ in range(100):
        try:
            return _run(job, folder, seconds)
        except _energy.FolderInUseError as error:
            refused = error
            time.sleep(0.1)
    raise BlockingIOError(str(refused))


def _run(job: dict[str, Any], folder: Path, seconds: Callable[[], float]) -> None:
    from . import _energy

    def note_time(step: int, _steps: int) -> None:
        if step % job["checkpoint"] == 0:
            _replace(folder / "sweep.seconds", str(seconds()))

    if (folder / "checkpoint").exists():
        try:
            _energy.resume(str(folder), threads=job["threads"], progress=note_time)
            return
        except _energy.FolderInUseError:
            raise
        except _energy.EnergyError:
            # The checkpoint is damaged or of another version.
            pass
    _energy.run(
        job["text"], job["path"], str(folder), overwrite=True, checkpoint=job["checkpoint"], threads=job["threads"],
        progress=note_time,
    )


def _results(folder: Path) -> dict[str, Any]:
    """Returns the results that a run recorded, without its times."""
    record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    summary = record["summary"]
    energies = [term["energy"] for term in summary["terms"] if term["energy"] is not None]
    return {
        "steps": summary["steps"],
        "frames": record["frames"],
        "energy": sum(energies),
        "kinetic_energy": summary["kinetic_energy"],
        "crossings": summary["crossings"],
        "obstacle_crossings": summary["obstacle_crossings"],
        "warnings": len(summary["warnings"]),
    }


def _replace(path: Path, text: str) -> None:
    """Writes a file whole."""
    part = path.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)
