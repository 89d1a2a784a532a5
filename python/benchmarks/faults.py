"""Drills of faults in sweeps: killed workers and parents, truncated files, a full disk, edited inputs.

`python benchmarks/faults.py [DRILLS]` does faults in turn to sweeps on a process pool and on joblib, Dask and Ray where
they are installed. After each, the same call continues, and its final files are compared with those of an undisturbed
sweep. `--disk FOLDER` names an empty file system of a few megabytes, for full disks.

    mount -t tmpfs -o size=6m tmpfs DISK
    python benchmarks/faults.py 200 --disk DISK
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

TENT = "v 0 0 {z}\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"
SCENE = """
dt = 0.01
duration = 0.3
mesh.obj.path = "tent.obj"
pins = [{ vertex = 0 }]
output.size = [60, 50]
fabric = { density = 0.15, material.file = { path = "own.energy", elements = ["Edge"], parameters = { k = 9.0 } } }
"""
MATERIAL = "energy Edge(p, q: Point; k: Scalar[N], L: Scalar[m]) {{ {factor} * k / L * (norm(p - q) - L)^2 }}\n"
#: Contents of the mesh and of the material: before an edit, and after one of each.
INPUTS = {
    "": {"tent.obj": TENT.format(z=0.3), "own.energy": MATERIAL.format(factor=0.5)},
    "edit the mesh": {"tent.obj": TENT.format(z=0.6), "own.energy": MATERIAL.format(factor=0.5)},
    "edit the material": {"tent.obj": TENT.format(z=0.3), "own.energy": MATERIAL.format(factor=0.7)},
}
#: The package that each engine needs.
ENGINES = {"processes": "concurrent", "joblib": "joblib", "dask": "distributed", "ray": "ray"}
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


def prepare(place: Path, fault: str = "") -> None:
    """Writes a scene with its mesh and its material, as they are after a fault."""
    place.mkdir(exist_ok=True)
    (place / "scene.toml").write_text(SCENE)
    for name, text in INPUTS.get(fault, INPUTS[""]).items():
        (place / name).write_text(text)


def fill_and_sweep(engine: str, place: Path, disk: Path, chance: random.Random) -> None:
    """Sweeps on a disk that becomes full. Then there is space again."""
    (place / "runs").symlink_to(disk)
    ballast = max(0, shutil.disk_usage(disk).free - chance.randrange(10_000, 120_000))
    (disk / "ballast").write_bytes(bytes(ballast))
    finished(engine, place / "scene.toml", place / "runs")
    (disk / "ballast").unlink()


def disturb(fault: str, engine: str, place: Path, disk: Path, chance: random.Random, turn: int) -> str:
    """Begins a sweep in `place / "runs"`, and lets a fault happen. Returns where it happened."""
    scene, output = place / "scene.toml", place / "runs"
    if fault == "full disk":
        fill_and_sweep(engine, place, disk, chance)
        return ""
    if fault == "truncate" or fault in INPUTS:
        finished(engine, scene, output)
        prepare(place, fault)
        if fault == "truncate":
            victims = sorted(file for file in output.rglob("*") if file.is_file() and file.stat().st_size > 0)
            victim = victims[turn % len(victims)]
            os.truncate(victim, int(victim.stat().st_size * chance.choice([0, 0.5, 0.9])))
            return str(victim.relative_to(output))
        return ""
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
    else:
        process.kill()
    process.communicate(timeout=300)
    return f"{len(busy)} at work"


def verdict(told: str, found: dict[str, bytes], expected: dict[str, bytes]) -> str:
    """Returns what is wrong after a sweep was continued; empty if nothing is."""
    bad = sorted(file for file in expected if found.get(file) != expected[file])
    unclean = sorted(file for file in found if file.endswith(".part"))
    is_whole = any(line.startswith("0 failed") for line in told.splitlines())
    return "" if is_whole and not bad and not unclean else f"wrong: {bad} {unclean} {told}"


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("drills", type=int, nargs="?", default=40)
    parser.add_argument("--disk", type=Path)
    parser.add_argument("--engines", nargs="+", choices=list(ENGINES), default=list(ENGINES))
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    chance, wrong, turns = random.Random(options.seed), 0, 0
    engines = [engine for engine in options.engines if importlib.util.find_spec(ENGINES[engine])]
    faults = ["kill a worker", "kill the parent", "truncate", *list(INPUTS)[1:]] + ["full disk"] * bool(options.disk)
    with tempfile.TemporaryDirectory() as name:
        top, expected = Path(name), {}
        for fault in INPUTS:
            place = top / f"undisturbed {fault}"
            prepare(place, fault)
            told = finished("processes", place / "scene.toml", place / "runs")
            assert told.startswith("0 failed"), told
            expected[fault] = files(place / "runs")
        for number in range(options.drills):
            fault, engine = faults[number % len(faults)], engines[number // len(faults) % len(engines)]
            place = top / f"drill {number}"
            prepare(place)
            where = disturb(fault, engine, place, options.disk, chance, turns)
            turns += fault == "truncate"
            told = finished(engine, place / "scene.toml", place / "runs")
            found = verdict(told, files(place / "runs"), expected.get(fault, expected[""]))
            wrong += bool(found)
            print(f"{number:3} {fault:17} {engine:10} {found or 'right'} {where}", flush=True)
            if fault == "full disk":
                for entry in options.disk.iterdir():
                    shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
            shutil.rmtree(place)
    print(f"{options.drills} drills, {wrong} wrong")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
