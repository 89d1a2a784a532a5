"""Sweeps: executors, interruptions, the index and the page."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, ThreadPoolExecutor

import pytest

import energy_dsl as ed

SCENE = {
    "dt": 0.01,
    "duration": 0.1,
    "gravity": [0.0, 0.0, -9.81],
    "mesh": {"sheet": {"cells": [4, 4], "size": [1.0, 1.0]}},
    "fabric": {"density": 0.15, "material": {"stvk": {"stretch_stiffness": 50.0, "poisson_ratio": 0.3}}},
    "pins": [{"nearest": [-0.5, 0.5, 0.0]}],
    "output": {"size": [120, 100]},
}
GRID = {"fabric.density": [0.1, 0.2], "dt": [0.01, 0.02]}


def files(folder):
    """Returns the bytes of all files of a sweep that do not depend on the time that its runs took."""

    def timeless(path):
        if path.name == "run.json":
            record = json.loads(path.read_text())
            del record["summary"]["stepping_time"], record["summary"]["phases"]
            return json.dumps(record).encode()
        return path.read_bytes()

    timed = {"times.csv", "sweep.html", "sweep.json", "summary.txt", "checkpoint", "checkpoint.previous", "cloth.lock"}
    paths = (path for path in folder.rglob("*") if path.is_file() and path.name not in timed)
    return {str(path.relative_to(folder)): timeless(path) for path in paths}


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reference")
    with ThreadPoolExecutor(2) as pool:
        sweep = ed.sweep(SCENE, GRID, folder, executor=pool)
    return sweep, files(folder)


def test_a_sweep_lists_its_runs_and_skips_those_that_are_done(reference):
    sweep, before = reference
    assert [run["status"] for run in sweep.runs] == ["done"] * 4 and not sweep.failures
    told = []
    with ThreadPoolExecutor(1) as pool:
        again = ed.sweep(SCENE, GRID, sweep.folder, executor=pool, progress=lambda *numbers: told.append(numbers))
    assert again == sweep and files(sweep.folder) == before and told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    rows = list(csv.DictReader((sweep.folder / "index.csv").open()))
    choices = {(density, dt) for density in ("0.1", "0.2") for dt in ("0.01", "0.02")}
    assert {(row["fabric.density"], row["dt"]) for row in rows} == choices
    assert {(row["steps"], row["crossings"], row["message"]) for row in rows} == {("10", "0", ""), ("5", "0", "")}
    assert all(float(row["energy"]) < 0 < float(row["kinetic_energy"]) for row in rows), "weight fell"
    times = list(csv.DictReader((sweep.folder / "times.csv").open()))
    assert [row["folder"] for row in times] == [row["folder"] for row in rows]
    page = (sweep.folder / "sweep.html").read_text()
    assert "4 runs, 0 failed" in page and all(row["folder"] in page for row in rows)


def test_a_run_that_fails_is_listed_and_others_go_on(tmp_path):
    with ThreadPoolExecutor(1) as pool:
        sweep = ed.sweep(SCENE, [{"dt": -1.0}, {"dt": 0.01}, {"dt": 0.01}], tmp_path, executor=pool)
        assert [run["status"] for run in sweep.runs] == ["failed", "done", "done"]
        assert "dt" in sweep.failures[0]["message"]
        assert '<tr class="failed">' in (tmp_path / "sweep.html").read_text()
        (tmp_path / sweep.runs[0]["folder"] / "sweep.json").write_text(
            json.dumps({"run": {**sweep.runs[0], "message": "edited"}, "seconds": 0})
        )
        kept = ed.sweep(SCENE, [{"dt": -1.0}], tmp_path, executor=pool)
        retried = ed.sweep(SCENE, [{"dt": -1.0}], tmp_path, executor=pool, retry_failures=True)
    assert kept.runs[0]["message"] == "edited" and retried.runs == sweep.runs[:1]


def test_names_that_are_taken_are_refused(tmp_path):
    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="name of a column of results: energy"):
        ed.sweep(SCENE, [{"energy": 1}], tmp_path, executor=pool)


def test_the_default_pool_of_processes_gives_the_same(reference, tmp_path):
    ed.sweep(SCENE, GRID, tmp_path)
    assert files(tmp_path) == reference[1]


KILLED = """
import json, sys
import energy_dsl as ed
from concurrent.futures import ProcessPoolExecutor

if __name__ == "__main__":
    with ProcessPoolExecutor(2) as pool:
        ed.sweep(json.loads(sys.argv[1]), json.loads(sys.argv[2]), sys.argv[3], executor=pool, checkpoint=2)
"""


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")
def test_a_sweep_that_is_killed_continues_with_the_same_bytes(tmp_path):
    scene = {**SCENE, "duration": 2.0, "mesh": {"sheet": {"cells": [12, 12], "size": [1.0, 1.0]}}}
    grid = {"fabric.density": [0.1, 0.2, 0.3]}
    arguments = [sys.executable, "-c", KILLED, json.dumps(scene), json.dumps(grid), str(tmp_path / "killed")]
    process = subprocess.Popen(arguments, start_new_session=True)
    deadline = time.monotonic() + 60
    while not list((tmp_path / "killed").glob("*/checkpoint")) and time.monotonic() < deadline:
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not (tmp_path / "killed" / "index.csv").exists(), "the sweep ended before it was killed"
    with ThreadPoolExecutor(2) as pool:
        ed.sweep(scene, grid, tmp_path / "killed", executor=pool, checkpoint=2)
        ed.sweep(scene, grid, tmp_path / "whole", executor=pool, checkpoint=2)
    assert files(tmp_path / "killed") == files(tmp_path / "whole")


def test_parquet_has_the_index(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    with ThreadPoolExecutor(1) as pool:
        sweep = ed.sweep(SCENE, [{"dt": 0.05, "gravity": [0, 0, -1]}], tmp_path, executor=pool, parquet=True)
    rows = parquet.read_table(tmp_path / "index.parquet").to_pylist()
    assert rows[0]["dt"] == 0.05 and rows[0]["gravity"] == "[0, 0, -1]" and rows[0]["energy"] == sweep.runs[0]["energy"]


def test_joblib_gives_the_same(reference, tmp_path):
    loky = pytest.importorskip("joblib.externals.loky")
    ed.sweep(SCENE, GRID, tmp_path, executor=loky.get_reusable_executor(max_workers=2))
    assert files(tmp_path) == reference[1]


def test_dask_gives_the_same(reference, tmp_path):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client:
        ed.sweep(SCENE, GRID, tmp_path, executor=client.get_executor(pure=False))
    assert files(tmp_path) == reference[1]


def test_ray_gives_the_same(reference, tmp_path):
    ray = pytest.importorskip("ray")

    class RayExecutor(Executor):
        def submit(self, function, /, *arguments):
            return ray.remote(function).remote(*arguments).future()

    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        ed.sweep(SCENE, GRID, tmp_path, executor=RayExecutor())
    finally:
        ray.shutdown()
    assert files(tmp_path) == reference[1]
