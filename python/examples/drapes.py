"""A data set of drapes: one scene with several densities and sizes, two at a time."""

import sys
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import energy_dsl as ed

scene = {
    "dt": 0.01,
    "duration": 0.5,
    "gravity": [0.0, 0.0, -9.81],
    "mesh": {"sheet": {"cells": [16, 16], "size": [1.0, 1.0]}},
    "fabric": {"density": 0.15, "material": {"stvk": {"stretch_stiffness": 50.0, "poisson_ratio": 0.3}}},
    "pins": [{"nearest": [-0.5, 0.5, 0.0]}, {"nearest": [0.5, 0.5, 0.0]}],
}

if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "drapes"
    grid: dict[str, list[Any]] = {"fabric.density": [0.1, 0.2, 0.3], "mesh.sheet.cells": [[8, 8], [16, 16]]}
    with ProcessPoolExecutor(2) as pool:
        sweep = ed.sweep(scene, grid, folder, executor=pool)
    print(f"{len(sweep.runs)} runs, {len(sweep.failures)} failed; see {sweep.folder / 'index.csv'}")
