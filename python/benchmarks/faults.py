"""Drills of faults in sweeps: killed workers and parents, truncated files, a full disk, edited inputs.

`python benchmarks/faults.py [DRILLS]` does random faults to sweeps on a process pool and on joblib, Dask and Ray where
they are installed, and compares the final files with those of an undisturbed sweep. `--disk FOLDER` names an empty file
system of a few megabytes, for full disks.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

TENT = "v 0 0 {z}\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"
SCENE = """
dt = 0.01
duration = 0.3
mesh.obj.path = "tent.obj"
pins = [{ vertex = 0 }]
output.size = [60, 50]
fabric = { density = 0.15, material.stvk = { stretch_stiffness = 50.0, poisson_ratio = 0.3 } }
"""
DENSITIES = [0.1, 0.2, 0.3, 0.4]
#: One sweep: engine, scene, output.
PROGRAM = f"""
import sys, energy_dsl as ed
engine, scene, output = sys.argv[1:]
if __name__ == "__main__":
    grid = {{"fabric.density": {DENSITIES}}}
    if engine == "processes":
        from concurrent.futures import ProcessPoolExecutor
        executor = ProcessPoolExecutor(2)
    elif engine == "joblib":
        from joblib.externals.loky import get_reusable_executor
        executor = get_reusable_executor(max_workers=2)
    elif engine == "dask":
        from distributed import Client, LocalCluster
        client = Client(LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None))
        executor = client.get_executor(pure=False)
    else:
        import ray
        from concurrent.futures import Executor
        ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
        class RayExecutor(Executor):
            def submit(self, function, /, *arguments):
                return ray.remote(function).remote(*arguments).future()
        executor = RayExecutor()
    sweep = ed.sweep(scene, grid, output, executor=executor, checkpoint=2)
    print(len(sweep.failures), "failed", [run["message"] for run in sweep.failures])
"""
TIMED = {"times.csv", "sweep.html", "sweep.json", "summary.txt", "checkpoint", "checkpoint.previous", "cloth.lock"}


def files(folder: Path) -> dict[str, bytes]:
    """Returns the files of a sweep that do not depend on the time that its runs took."""
    found = {}
    for path in folder.rglob("*"):
        if path.is_file() and path.name not in TIMED:
            contents = path.read_bytes()
            if path.name == "run.json":
                record = json.loads(contents)
                del record["summary"]["stepping_time"], record["summary"]["phases"], record["path"]
                contents = json.dumps(record).encode()
            found[str(path.relative_to(folder))] = contents
    return found


def start(engine: str, scene: Path, output: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", PROGRAM, engine, str(scene), str(output)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=subprocess.STDOUT, text=True, start_new_session=True)


def finished(engine: str, scene: Path, output: Path) -> str:
    """Sweeps to the end, without a fault. Returns what it printed."""
    with start(engine, scene, output) as process:
        return process.communicate(timeout=300)[0]


def workers(process: subprocess.Popen[str]) -> list[int]:
    """Returns the processes that are at a run: those that have a lock open."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and os.getsid(int(entry.name)) == process.pid and int(entry.name) != process.pid:
                if any("cloth.lock" in os.readlink(file) for file in (entry / "fd").iterdir()):
                    found.append(int(entry.name))
        except OSError:
            continue
    return found


def disturb(fault: str, engine: str, place: Path, disk: Path | None, chance: random.Random) -> None:
    """Begins a sweep in `place / "runs"`, and lets a fault happen."""
    scene, output = place / "scene.toml", place / "runs"
    if fault == "full disk":
        assert disk is not None
        output.symlink_to(disk)
        (disk / "ballast").write_bytes(bytes(max(0, shutil.disk_usage(disk).free - chance.randrange(10_000, 120_000))))
        finished(engine, scene, output)
        (disk / "ballast").unlink()
        return
    if fault in ("truncate", "edit"):
        finished(engine, scene, output)
        if fault == "edit":
            (place / "tent.obj").write_text(TENT.format(z=0.6))
            return
        victims = sorted(file for file in output.rglob("*") if file.is_file())
        victim = chance.choice(victims)
        os.truncate(victim, int(victim.stat().st_size * chance.choice([0, 0.5, 0.9])))
        return
    process = start(engine, scene, output)
    deadline = time.monotonic() + 60
    pause = chance.uniform(0.0, 0.3)
    while not (busy := workers(process)) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    time.sleep(pause)
    if fault == "kill a worker":
        for worker in busy[:1]:
            try:
                os.kill(worker, signal.SIGKILL)
            except ProcessLookupError:
                pass
        process.communicate(timeout=300)
    else:
        process.kill()
        process.communicate(timeout=300)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("drills", type=int, nargs="?", default=40)
    parser.add_argument("--disk", type=Path)
    parser.add_argument("--engines", nargs="+", default=["processes", "joblib", "dask", "ray"])
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    chance, wrong = random.Random(options.seed), 0
    faults = ["kill a worker", "kill the parent", "truncate", "edit"] + (["full disk"] if options.disk else [])
    with tempfile.TemporaryDirectory() as name:
        top, expected = Path(name), {}
        for z in (0.3, 0.6):
            place = top / str(z)
            place.mkdir()
            (place / "scene.toml").write_text(SCENE)
            (place / "tent.obj").write_text(TENT.format(z=z))
            finished("processes", place / "scene.toml", place / "runs")
            expected[z] = files(place / "runs")
        for number in range(options.drills):
            fault, engine = faults[number % len(faults)], options.engines[number // len(faults) % len(options.engines)]
            place = top / f"drill {number}"
            place.mkdir()
            (place / "scene.toml").write_text(SCENE)
            (place / "tent.obj").write_text(TENT.format(z=0.3))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                disturb(fault, engine, place, options.disk, chance)
            told = finished(engine, place / "scene.toml", place / "runs")
            found, wanted = files(place / "runs"), expected[0.6 if fault == "edit" else 0.3]
            bad = {file for file in wanted if found.get(file) != wanted[file]}
            wrong += bool(bad)
            verdict = f"wrong: {sorted(bad)} {told}" if bad else "right"
            print(f"{number:3} {fault:16} {engine:10} {verdict}", flush=True)
            if fault == "full disk" and options.disk:
                for entry in options.disk.iterdir():
                    shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
            shutil.rmtree(place)
    print(f"{options.drills} drills, {wrong} wrong")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
