"""What control costs: a step with own forces and moving pins beside a plain step, and many instances in one process."""

import os
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np

import energy_dsl as ed

PULL = ed.energy("energy Pull(p: Point; t: Vec3, k: Scalar) { k / 2 * norm_squared(p - t) }")


def scene(cells: int, steps: int) -> dict[str, Any]:
    return {
        "dt": 0.01, "duration": 0.01 * steps, "gravity": [0.0, 0.0, -9.81], "integrator": "newton", "contact": "off",
        "mesh": {"sheet": {"cells": [cells, cells], "size": [1.0, 1.0]}},
        "fabric": {"density": 0.2, "material": {"stvk": {"stretch_stiffness": 100.0, "poisson_ratio": 0.3}}},
        "pins": [{"nearest": [-0.5, 0.5, 0.0]}, {"nearest": [0.5, 0.5, 0.0]}],
    }


def milliseconds(simulation: ed.Simulation, steps: int, moves: bool) -> float:
    """Returns the mean time of a step."""
    pins = simulation.pinned
    place = simulation.positions[pins]
    start = time.perf_counter()
    for step in range(steps):
        if moves:
            simulation.move_pins(pins, place + [0.0, 0.0, 1e-4 * np.sin(step)])
        simulation.step()
    return 1e3 * (time.perf_counter() - start) / steps


def control(steps: int = 60) -> None:
    cells = 64
    vertices = (cells + 1) ** 2
    stencils, target = np.arange(vertices)[:, None], np.array([0.0, 0.0, -0.5])
    spent = 0.0

    def pull(x: Any, order: int) -> Any:
        nonlocal spent
        start = time.perf_counter()
        d = x[:, 0] - target
        results = [5e-5 * (d * d).sum(1)]
        if order > 0:
            results.append(1e-4 * d[:, None])
        if order > 1:
            results.append(np.broadcast_to(1e-4 * np.eye(3), (vertices, 3, 3)))
        spent += time.perf_counter() - start
        return tuple(results)

    text = {"pull": (PULL, stencils, {"t": target, "k": 1e-4})}
    function = {"pull": ed.OwnEnergy(pull, stencils)}
    closed = milliseconds(ed.Simulation(scene(cells, steps), threads=1), steps, False)
    by_text = milliseconds(ed.Simulation(scene(cells, steps), threads=1, forces=text), steps, True)
    by_function = milliseconds(ed.Simulation(scene(cells, steps), threads=1, forces=function), steps, True)
    own = 1e3 * spent / steps
    print(f"{vertices} vertices, ms per step: closed {closed:.2f}, text {by_text:.2f} ({by_text / closed:.2f} times)")
    rest = (by_function - own) / closed
    print(f"function {by_function:.2f}, of which it takes {own:.2f} itself; the rest is {rest:.2f} times the closed step")


def towel(steps: int) -> None:
    ed.Simulation(scene(24, steps), threads=1).step(steps)


def instances(count: int = 64, steps: int = 40) -> None:
    cores = os.cpu_count() or 1
    seconds = []
    pools: list[ThreadPoolExecutor | ProcessPoolExecutor] = [ProcessPoolExecutor(cores), ThreadPoolExecutor(cores)]
    for pool in pools:
        with pool:
            list(pool.map(towel, [1] * cores))
            start = time.perf_counter()
            list(pool.map(towel, [steps] * count))
            seconds.append(time.perf_counter() - start)
    processes, threads = seconds
    print(f"{count} towels of 625 vertices: {count * steps / threads:.0f} steps/s in one process, "
          f"{count * steps / processes:.0f} in processes ({processes / threads:.2f} times)")


if __name__ == "__main__":
    control()
    instances()
