"""One run of a sweep, as workers do it."""

from __future__ import annotations

import json
import multiprocessing
import os
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from . import _energy
from .plain import plain
from .sweep_files import damage, fingerprint, replace, result_files

RECORD = "sweep.json"
#: Exists while a worker is at a run.
MARK = "sweep.running"
#: Seconds so far of a run that was interrupted.
CLOCK = "sweep.seconds"
#: Seconds between two looks whether the parent process still lives, and for a run to end after that.
WATCH, GRACE = 0.2, 5.0

#: The process whose parent is watched. A fork inherits the number, but not the thread that watches.
_watcher = 0
#: Set once the parent of this worker has ended.
_orphaned = threading.Event()
_busy = threading.Event()


class _Unfit(Exception):
    """A failure of the machine or of the surroundings: the next call tries again."""


class _Orphaned(BaseException):
    """The process that submitted the run has ended."""


def run_one(job: dict[str, Any]) -> dict[str, Any]:
    """Runs one choice of a sweep in its folder, unless that is done. Workers call it."""
    folder = Path(job["folder"])
    _watch_parent()
    try:
        result = _kept(folder, job["retry"])
        if result is not None:
            return result
        return _run_marked(job, folder)
    except _Orphaned:
        if threading.current_thread() is threading.main_thread():
            os._exit(1)
        raise


def _watch_parent() -> None:
    """Lets a worker of a pool of processes end with its parent. Otherwise, a worker that waits for work would wait
    forever, and one at a run would hold the folder."""
    global _watcher
    is_worker = multiprocessing.parent_process() is not None and threading.current_thread() is threading.main_thread()
    if is_worker and _watcher != os.getpid():
        _watcher = os.getpid()
        _orphaned.clear()
        threading.Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()


def _end_with_parent(parent: int) -> None:
    process = multiprocessing.parent_process()
    while os.getppid() == parent and (os.name == "posix" or process is None or process.is_alive()):
        time.sleep(WATCH)
    _orphaned.set()
    # A run stops after its current step, with a checkpoint.
    deadline = time.monotonic() + GRACE
    while _busy.is_set() and time.monotonic() < deadline:
        time.sleep(0.05)
    os._exit(1)


def failed(job: dict[str, Any], message: str, seconds: float = 0.0) -> dict[str, Any]:
    """Returns the result of a run that failed, for the index."""
    return {"run": _row(job, "failed", {}, message), "seconds": seconds}


def _row(job: dict[str, Any], status: str, results: dict[str, Any], message: str) -> dict[str, Any]:
    choice = json.loads(json.dumps(job["choice"], default=plain))
    return {**choice, "folder": Path(job["folder"]).name, "status": status, **results, "message": message}


def _kept(folder: Path, retry: bool) -> dict[str, Any] | None:
    """Returns the result of an earlier call, if it can be kept."""
    record = folder / RECORD
    try:
        text = record.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        _again(folder, f"{record} cannot be read ({error})", whole=False)
        return None
    try:
        result = json.loads(text)
        is_done, files = result["run"]["status"] == "done", result.pop("files", {})
        result = {"run": result["run"], "seconds": float(result["seconds"])}
    except (ValueError, TypeError, KeyError, AttributeError):
        _again(folder, f"{record} is damaged: {len(text)} characters that are no record of a run", whole=False)
        return None
    if not is_done:
        return None if retry else result
    if found := damage(folder, files):
        _again(folder, found, whole=True)
        return None
    return result


def _again(folder: Path, why: str, whole: bool) -> None:
    """Warns that a run starts again, and removes its record; if `whole`, also the checkpoint."""
    warnings.warn(f"run {folder.name}: {why}; the run is done again", RuntimeWarning, stacklevel=4)
    (folder / RECORD).unlink(missing_ok=True)
    if whole:
        for name in ("checkpoint", "checkpoint.previous"):
            (folder / name).unlink(missing_ok=True)


def _run_marked(job: dict[str, Any], folder: Path) -> dict[str, Any]:
    start = time.perf_counter()
    earlier = _seconds_so_far(folder / CLOCK)

    def seconds() -> float:
        return round(earlier + time.perf_counter() - start, 3)

    status, message, results = "done", "", {}
    _busy.set()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        replace(folder / MARK, str(job["token"]))
        try:
            _run_when_free(job, folder, seconds)
            results = _results(folder)
        except BlockingIOError:
            raise
        except _energy.ResourceError as error:
            raise _Unfit(str(error)) from error
        except (ValueError, RuntimeError) as error:
            status, message = "failed", str(error)
        run = _row(job, status, results, message)
        files = result_files(folder) if status == "done" else {}
        result = {"run": run, "seconds": seconds()}
        replace(folder / RECORD, json.dumps({**result, "files": files}))
        (folder / CLOCK).unlink(missing_ok=True)
        return result
    except BlockingIOError:
        raise
    except (OSError, MemoryError, _Unfit) as error:
        message = f"run {folder.name}: {error}; the next call tries again"
        return failed(job, message, seconds())
    finally:
        _busy.clear()
        (folder / MARK).unlink(missing_ok=True)


def _seconds_so_far(clock: Path) -> float:
    try:
        return float(clock.read_text())
    except (OSError, ValueError):
        return 0.0


def _run_when_free(job: dict[str, Any], folder: Path, seconds: Callable[[], float]) -> None:
    """Runs a job. Workers of a sweep that was killed may need a moment to end; another sweep in the folder is an error
    of the caller, not a failed run."""
    refused = ""
    for _ in range(100):
        try:
            return _run(job, folder, seconds)
        except _energy.FolderInUseError as error:
            refused = str(error)
            time.sleep(0.1)
    raise BlockingIOError(refused)


def _run(job: dict[str, Any], folder: Path, seconds: Callable[[], float]) -> None:
    _check_inputs(job)
    steps = 0

    def after_step(step: int, _steps: int) -> None:
        nonlocal steps
        if steps == 0:
            # The files were read by now: those that the folder is named after, or others.
            _check_inputs(job)
        steps += 1
        if step % job["checkpoint"] == 0:
            _note_time(folder, seconds())
        if _orphaned.is_set():
            raise _Orphaned

    if (folder / "checkpoint").exists():
        try:
            _energy.resume(str(folder), threads=job["threads"], progress=after_step)
            return
        except _energy.FolderInUseError:
            raise
        except (_energy.EnergyError, _energy.ResourceError):
            # The checkpoint is damaged or of another version, or a file of the run is.
            if steps > 0:
                raise
    _energy.run(
        job["text"], job["path"], str(folder), overwrite=True, checkpoint=job["checkpoint"], threads=job["threads"],
        progress=after_step,
    )


def _check_inputs(job: dict[str, Any]) -> None:
    """Raises _Unfit if a file of the scene was edited since the sweep began."""
    for file, digest in job["inputs"]:
        if fingerprint(file) != digest:
            raise _Unfit(f"{file} was edited after the sweep began")


def _note_time(folder: Path, seconds: float) -> None:
    try:
        (folder / CLOCK).write_text(str(seconds))
    except OSError:
        # Times are a courtesy. A full disk stops the run where it matters.
        pass


def _results(folder: Path) -> dict[str, Any]:
    """Returns the results that a run recorded, without its times."""
    file = folder / "run.json"
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise _Unfit(f"{file} is damaged: {error}") from error
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
        **{name: None if value != value else value for name, value in _energy.measured_at_end(folder)},
    }
