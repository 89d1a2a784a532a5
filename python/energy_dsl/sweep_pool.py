"""Hands the runs of a sweep to an executor, and goes on if workers are killed."""

from __future__ import annotations

import importlib
import pickle
import uuid
from collections import Counter
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from .sweep_run import MARK, failed, run_one

Job = dict[str, Any]
Result = dict[str, Any]

#: How often the worker of one run may be killed before the run is given up.
MOST_LOSSES = 3


def collect(
    executor: Executor | Callable[[], Executor] | None,
    jobs: list[Job],
    progress: Callable[[int, int], object] | None,
) -> dict[str, Result]:
    """Returns the results of all folders. Equal choices share a folder, and run once."""
    token = uuid.uuid4().hex
    distinct = {job["folder"]: {**job, "token": token} for job in jobs}
    work = _Work(distinct, token, progress)
    with _Pool(executor) as pool:
        while work.waiting:
            work.go(pool)
    return work.results


class _Work:
    """The runs of a sweep: those with a result, and those without."""

    def __init__(self, jobs: dict[str, Job], token: str, progress: Callable[[int, int], object] | None) -> None:
        self.results: dict[str, Result] = {}
        self.waiting = dict(jobs)
        self.token = token
        self.count = len(jobs)
        self.progress = progress
        #: How often a pool broke, or a worker was lost, while the run was under way.
        self.losses: Counter[str] = Counter()
        #: How often in a row a pool broke while no run was under way.
        self.idle_breaks = 0

    def go(self, pool: _Pool) -> None:
        """Submits what is left. Runs whose workers were lost twice come last, one at a time: whichever then breaks the
        pool is to blame."""
        calm = [name for name in self.waiting if self.losses[name] < MOST_LOSSES - 1]
        if self._round(pool, calm or list(self.waiting)[:1]):
            pool.rebuild(len(self.waiting), self.count)

    def _round(self, pool: _Pool, names: list[str]) -> bool:
        """Submits runs and waits for them. Returns whether the pool broke."""
        futures: dict[Future[Result], str] = {}
        broken: BaseException | None = None
        done = len(self.results)
        try:
            for name in names:
                try:
                    futures[pool.executor.submit(run_one, self.waiting[name])] = name
                except BrokenExecutor as error:
                    broken = error
                    break
            for future in as_completed(futures):
                name = futures[future]
                try:
                    self._add(name, future.result())
                except BrokenExecutor as error:
                    broken = error
                except (BlockingIOError, ImportError, AttributeError, TypeError, pickle.PickleError):
                    raise
                except Exception as error:
                    # Engines such as Dask and Ray report a lost worker for its run alone.
                    self._lose(name, error)
        except BaseException:
            # Without this, Ctrl-C would wait for runs that have not started.
            for future in futures:
                future.cancel()
            raise
        if broken is None:
            return False
        under_way = [name for name in names if name in self.waiting and self._is_marked(name)]
        for name in under_way:
            self._lose(name, broken)
        self.idle_breaks = 0 if under_way or len(self.results) > done else self.idle_breaks + 1
        if self.idle_breaks >= MOST_LOSSES:
            raise broken
        return True

    def _add(self, name: str, result: Result) -> None:
        self.results[name] = result
        self.waiting.pop(name, None)
        if self.progress is not None:
            self.progress(len(self.results), self.count)

    def _lose(self, name: str, error: BaseException) -> None:
        self.losses[name] += 1
        if self.losses[name] >= MOST_LOSSES:
            why = f"its worker was lost {MOST_LOSSES} times, at last with {type(error).__name__}: {error}"
            message = f"run {Path(name).name}: {why}; the next call tries again"
            self._add(name, failed(self.waiting[name], message))

    def _is_marked(self, name: str) -> bool:
        """Returns whether a worker of this call began the run and did not end it."""
        try:
            return (Path(name) / MARK).read_text() == self.token
        except (OSError, UnicodeDecodeError):
            return False


class _Pool:
    """An executor that can be replaced by one of the same kind after its workers were killed."""

    def __init__(self, given: Executor | Callable[[], Executor] | None) -> None:
        self.make: Callable[[], Executor] | None = None
        if given is None:
            self.make = ProcessPoolExecutor
        elif not hasattr(given, "submit"):
            self.make = given
        self.executor: Executor = self.make() if self.make is not None else given  # type: ignore[assignment]
        self.is_own = self.make is not None

    def __enter__(self) -> _Pool:
        return self

    def __exit__(self, *_: object) -> None:
        if self.is_own:
            self.executor.shutdown()

    def rebuild(self, left: int, count: int) -> None:
        """Replaces a broken executor."""
        make = self.make or _maker(self.executor)
        if make is None:
            kind = type(self.executor).__name__
            remedy = "pass a function that makes one, executor=lambda: …"
            message = f"{kind} lost its workers, and a sweep cannot make another: {remedy}"
            raise RuntimeError(f"{message}. {left} of {count} runs are left; the same call continues")
        self.executor.shutdown(wait=True)
        self.executor, self.is_own = make(), True


def _maker(executor: Executor) -> Callable[[], Executor] | None:
    """Returns a function that makes an executor like this one; `None` for unknown kinds."""

    def kept(names: dict[str, str]) -> dict[str, Any]:
        found = {key: getattr(executor, name, None) for key, name in names.items()}
        return {key: value for key, value in found.items() if value is not None}

    names = {"max_workers": "_max_workers", "initializer": "_initializer", "initargs": "_initargs"}
    if type(executor) is ProcessPoolExecutor:
        names = {**names, "mp_context": "_mp_context", "max_tasks_per_child": "_max_tasks_per_child"}
        return lambda: ProcessPoolExecutor(**kept(names))
    package, loky, _ = type(executor).__module__.partition("loky")
    if loky:
        # joblib has a copy of loky.
        module = importlib.import_module(package + loky)
        options = kept({**names, "timeout": "_timeout"})
        return lambda: module.get_reusable_executor(**options)
    return None
