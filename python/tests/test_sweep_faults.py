"""Sweeps under faults: edited inputs, damaged files, killed workers and parents, full disks."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import pytest
from test_sweeps import GRID, SCENE, files

import energy_dsl as ed

TENT = "v 0 0 {z}\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"


def swept(scene, grid, folder, **options):
    """Runs a sweep on one thread."""
    with ThreadPoolExecutor(1) as pool:
        return ed.sweep(scene, grid, folder, executor=pool, **options)


def mesh_scene(folder, z=0.3):
    (folder / "tent.obj").write_text(TENT.format(z=z))
    lines = [
        'dt = 0.01', 'duration = 0.1', 'mesh.obj.path = "tent.obj"', 'pins = [{ vertex = 0 }]',
        'output.size = [120, 100]',
        '[fabric]', 'density = 0.15', 'material.stvk = { stretch_stiffness = 50.0, poisson_ratio = 0.3 }',
    ]
    (folder / "scene.toml").write_text("\n".join(lines))


def test_an_edited_mesh_is_never_answered_from_an_earlier_run(tmp_path):
    mesh_scene(tmp_path)
    scene, grid = tmp_path / "scene.toml", {"fabric.density": [0.1]}
    first = swept(scene, grid, tmp_path / "runs")
    mesh_scene(tmp_path, z=0.6)
    second = swept(scene, grid, tmp_path / "runs")
    fresh = swept(scene, grid, tmp_path / "fresh")
    assert second.runs == fresh.runs and first.runs[0]["energy"] != second.runs[0]["energy"]
    mesh_scene(tmp_path)
    assert swept(scene, grid, tmp_path / "runs") == first, "the first mesh has its results still"


def test_a_mesh_that_is_edited_during_a_sweep_fails_its_run_until_the_next_call(tmp_path, monkeypatch):
    mesh_scene(tmp_path)
    scene, grid = tmp_path / "scene.toml", {"fabric.density": [0.1, 0.2]}

    class Editing(Executor):
        """Edits the mesh before the second run, as somebody may while a long sweep is under way."""

        done = 0

        def submit(self, function, /, *arguments):
            if self.done == 1:
                mesh_scene(tmp_path, z=0.6)
            self.done += 1
            future = Future()
            future.set_result(function(*arguments))
            return future

    sweep = ed.sweep(scene, grid, tmp_path / "runs", executor=Editing())
    assert [run["status"] for run in sweep.runs] == ["done", "failed"]
    message = sweep.failures[0]["message"]
    assert "tent.obj was edited after the sweep began" in message and sweep.failures[0]["folder"] in message
    assert swept(scene, grid, tmp_path / "runs").runs == swept(scene, grid, tmp_path / "fresh").runs


def test_a_mesh_that_appears_is_read(tmp_path):
    mesh_scene(tmp_path)
    (tmp_path / "tent.obj").unlink()
    scene, grid = tmp_path / "scene.toml", {"fabric.density": [0.1]}
    assert "tent.obj" in swept(scene, grid, tmp_path / "runs").failures[0]["message"]
    mesh_scene(tmp_path)
    assert not swept(scene, grid, tmp_path / "runs").failures


def test_another_version_of_the_package_has_other_folders(tmp_path, monkeypatch):
    first = swept(SCENE, {"dt": [0.02]}, tmp_path)
    monkeypatch.setattr(ed._energy, "version", lambda: "0.2.0")
    assert swept(SCENE, {"dt": [0.02]}, tmp_path).runs[0]["folder"] != first.runs[0]["folder"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    scene = {**SCENE, "output": {**SCENE["output"], "obj": True, "usd": True}}
    return scene, {"dt": [0.02]}, folder, swept(scene, {"dt": [0.02]}, folder, checkpoint=2)


def test_each_file_of_a_run_can_be_truncated(whole, tmp_path):
    scene, grid, folder, sweep = whole
    run = folder / sweep.runs[0]["folder"]
    names = sorted(file.relative_to(folder) for file in folder.rglob("*") if file.is_file())
    frames = [name for name in names if name.parent.name == "frames"]
    names = [name for name in names if name not in frames[1:]]
    assert {"sweep.json", "run.json", "checkpoint", "index.csv", "cloth.usda"} <= {name.name for name in names}
    for number, name in enumerate(names):
        copy, length = tmp_path / "copy", number % 2 / 2
        shutil.copytree(folder, copy)
        size = (copy / name).stat().st_size
        os.truncate(copy / name, int(length * size))
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            again = swept(scene, grid, copy, checkpoint=2)
        assert again.runs == sweep.runs and files(copy) == files(folder), name
        told = "".join(str(warning.message) for warning in warned)
        in_run = name.parts[0] == run.name
        assert not in_run or (f"run {run.name}" in told and str(copy / name) in told), (name, told)
        shutil.rmtree(copy)


def test_parts_of_files_that_a_killed_worker_was_writing_are_removed(whole, tmp_path):
    scene, grid, folder, sweep = whole
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    run = copy / sweep.runs[0]["folder"]
    (run / "sweep.json").rename(run / "sweep.json.123.part")
    (copy / "index.csv.123.part").write_text("torn")
    again = swept(scene, grid, copy, checkpoint=2)
    assert again.runs == sweep.runs and files(copy) == files(folder)
    assert list(copy.rglob("*.part")) == []


def test_a_changed_file_of_the_same_size_is_noticed_and_a_copied_folder_is_not_run_again(whole, tmp_path):
    scene, grid, folder, sweep = whole
    shutil.copytree(folder, tmp_path / "copy", copy_function=shutil.copyfile)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = swept(scene, grid, tmp_path / "copy", checkpoint=2)
    assert (again.runs, again.seconds) == (sweep.runs, sweep.seconds)
    picture = tmp_path / "copy" / sweep.runs[0]["folder"] / "cloth.png"
    picture.write_bytes(picture.read_bytes()[::-1])
    with pytest.warns(RuntimeWarning, match="cloth.png was changed after the run wrote it"):
        swept(scene, grid, tmp_path / "copy", checkpoint=2)
    assert files(tmp_path / "copy") == files(folder)


KILLER = """
import os, signal, sys
from concurrent.futures import ProcessPoolExecutor
import energy_dsl.sweep_run as sweep_run

def kill_once(marker):
    # Runs in each worker: the first one to take a second step ends as if for want of memory.
    plain = sweep_run._energy.run
    def run(*arguments, progress=None, **options):
        def after(step, steps):
            progress(step, steps)
            if step == 3:
                try:
                    os.close(os.open(marker, os.O_CREAT | os.O_EXCL))
                except FileExistsError:
                    return
                os.kill(os.getpid(), signal.SIGKILL)
        return plain(*arguments, progress=after, **options)
    sweep_run._energy.run = run
"""


@pytest.fixture
def killer(tmp_path, monkeypatch):
    (tmp_path / "killer.py").write_text(KILLER)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    import killer

    yield killer.kill_once
    del sys.modules["killer"]


def loky_pool(initializer, marker):
    loky = pytest.importorskip("joblib.externals.loky")
    return loky.get_reusable_executor(max_workers=2, initializer=initializer, initargs=(marker,), reuse=False)


def process_pool(initializer, marker):
    return ProcessPoolExecutor(2, initializer=initializer, initargs=(marker,))


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
@pytest.mark.parametrize("make", [process_pool, loky_pool])
def test_a_killed_worker_costs_its_own_run_only(make, killer, tmp_path):
    marker = tmp_path / "killed"
    ed.sweep(SCENE, GRID, tmp_path / "runs", executor=make(killer, str(marker)), checkpoint=2)
    assert marker.exists()
    swept(SCENE, GRID, tmp_path / "whole", checkpoint=2)
    assert files(tmp_path / "runs") == files(tmp_path / "whole")


def always_killed(density):
    import energy_dsl.sweep_run as sweep_run

    plain = sweep_run._energy.run

    def run(text, *arguments, **options):
        if json.loads(text)["fabric"]["density"] == density:
            os.kill(os.getpid(), signal.SIGKILL)
        return plain(text, *arguments, **options)

    sweep_run._energy.run = run


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_a_run_whose_workers_always_die_is_listed_and_others_are_done(tmp_path):
    def pool():
        return ProcessPoolExecutor(2, initializer=always_killed, initargs=(0.2,))

    grid = {"fabric.density": [0.1, 0.2, 0.3, 0.4]}
    sweep = ed.sweep(SCENE, grid, tmp_path, executor=pool)
    assert [run["status"] for run in sweep.runs] == ["done", "failed", "done", "done"]
    assert sweep.failures[0]["message"].startswith(f"run {sweep.failures[0]['folder']}: its worker was lost 3 times")
    assert not swept(SCENE, grid, tmp_path).failures


def test_a_broken_executor_of_unknown_kind_says_what_to_pass(tmp_path):
    class Broken(ThreadPoolExecutor):
        def submit(self, function, /, *arguments):
            from concurrent.futures import BrokenExecutor

            raise BrokenExecutor("gone")

    with pytest.raises(RuntimeError, match="pass a function that makes one, .* 1 of 1 runs are left"):
        ed.sweep(SCENE, {"dt": [0.01]}, tmp_path, executor=Broken(1))


class Losing(Executor):
    """Loses the worker of the first runs, as engines of clusters report it."""

    def __init__(self, times):
        self.times = times

    def submit(self, function, /, *arguments):
        future = Future()
        if self.times > 0:
            self.times -= 1
            future.set_exception(OSError("worker-3 died"))
        else:
            future.set_result(function(*arguments))
        return future


def test_runs_of_lost_workers_are_submitted_again_a_bounded_number_of_times(tmp_path):
    assert not ed.sweep(SCENE, {"dt": [0.01, 0.02]}, tmp_path / "a", executor=Losing(3)).failures
    sweep = ed.sweep(SCENE, {"dt": [0.01]}, tmp_path / "b", executor=Losing(9))
    assert "lost 3 times, at last with OSError: worker-3 died" in sweep.failures[0]["message"]


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")
def test_workers_of_a_killed_parent_end(tmp_path):
    program = (
        "import energy_dsl as ed, json, sys\n"
        "if __name__ == '__main__': ed.sweep(json.loads(sys.argv[1]), {'dt': [1e-3, 2e-3]}, sys.argv[2], checkpoint=2)"
    )
    scene = {**SCENE, "duration": 60.0, "mesh": {"sheet": {"cells": [12, 12], "size": [1.0, 1.0]}}}
    parent = subprocess.Popen([sys.executable, "-c", program, json.dumps(scene), str(tmp_path)], start_new_session=True)
    try:
        wait_for(lambda: list(tmp_path.glob("*/checkpoint")))
        parent.kill()
        parent.wait()
        wait_for(lambda: not list(tmp_path.glob("*/cloth.lock")))
        wait_for(lambda: not alive_in_group(parent.pid))
    finally:
        try:
            os.killpg(parent.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass


def alive_in_group(group):
    """Returns whether a process of a group lives."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def wait_for(condition, seconds=30):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "too late"
        time.sleep(0.02)


def test_a_full_disk_names_file_and_run_and_the_next_call_continues(tmp_path, monkeypatch):
    import energy_dsl.sweep_run as sweep_run

    plain = sweep_run.replace

    def full(path, text):
        if path.name == "sweep.json":
            raise OSError(28, "No space left on device", str(path))
        plain(path, text)

    monkeypatch.setattr(sweep_run, "replace", full)
    sweep = swept(SCENE, {"dt": [0.01]}, tmp_path)
    run = sweep.failures[0]
    assert run["message"].startswith(f"run {run['folder']}: ") and "sweep.json" in run["message"]
    assert "No space left" in run["message"] and "the next call tries again" in run["message"]
    monkeypatch.undo()
    assert not swept(SCENE, {"dt": [0.01]}, tmp_path).failures


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_run_that_cannot_write_its_results_names_the_file_and_is_not_kept(tmp_path):
    first = swept(SCENE, {"dt": [0.01]}, tmp_path / "runs")
    run = tmp_path / "runs" / first.runs[0]["folder"]
    shutil.rmtree(run)
    run.mkdir()
    (run / "frames").write_text("a file where a folder has to be")
    failed = swept(SCENE, {"dt": [0.01]}, tmp_path / "runs").failures[0]["message"]
    assert str(run) in failed and "the next call tries again" in failed
    (run / "frames").unlink()
    assert swept(SCENE, {"dt": [0.01]}, tmp_path / "runs").runs == first.runs


def test_an_index_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "index.csv").mkdir()
    with pytest.raises(OSError, match="index.csv"):
        swept(SCENE, {"dt": [0.01]}, tmp_path)
    (tmp_path / "index.csv").rmdir()
    assert not swept(SCENE, {"dt": [0.01]}, tmp_path).failures


def test_arrays_of_numpy_are_values_of_scenes(tmp_path):
    np = pytest.importorskip("numpy")
    scene = {**SCENE, "gravity": np.array([0.0, 0.0, -9.81]), "dt": np.float64(0.01)}
    assert np.array_equal(ed.simulate(scene), ed.simulate(SCENE))
    assert swept(scene, {"dt": [0.01]}, tmp_path).runs == swept(SCENE, {"dt": [0.01]}, tmp_path / "b").runs
