"""What control costs: a step with own forces and moving pins beside a plain step, and many instances in one process."""

import os
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np

import energy_dsl as ed

#: Half of the weight, and a spring that is too weak to change the motion, so that there is a Hessian to assemble.
OWN = ed.energy("energy Own(p: Point; w: Scalar[N], k: Scalar[N/m]) { w * p.z + k / 2 * norm_squared(p) }")
GRAVITY, SPRING = 9.81, 1e-9


def scene(cells: int, steps: int, gravity: float = GRAVITY, lift: float = 0.0) -> dict[str, Any]:
    """Returns a hanging sheet whose pins rise by `lift` during the scene."""
    end = 0.01 * steps
    pins: list[dict[str, Any]] = [{"nearest": [-0.5, 0.5, 0.0]}, {"nearest": [0.5, 0.5, 0.0]}]
    for pin in pins if lift else []:
        pin["motion"] = {"keys": [{"time": 0.0}, {"time": end, "translate": [0.0, 0.0, lift]}]}
    return {
        "dt": 0.01, "duration": end, "gravity": [0.0, 0.0, -gravity], "integrator": "newton", "contact": "off",
        "mesh": {"sheet": {"cells": [cells, cells], "size": [1.0, 1.0]}},
        "fabric": {"density": 0.2, "material": {"stvk": {"stretch_stiffness": 100.0, "poisson_ratio": 0.3}}},
        "pins": pins,
    }


def milliseconds(simulation: ed.Simulation, steps: int, lift: float = 0.0) -> float:
    """Returns the mean time of a step; its own pins rise by `lift`."""
    pins = simulation.pinned
    place = simulation.positions[pins]
    start = time.perf_counter()
    for step in range(1, steps + 1):
        if lift:
            simulation.move_pins(pins, place + [0.0, 0.0, lift * step / steps])
        simulation.step()
    return 1e3 * (time.perf_counter() - start) / steps


class Own:
    """The energy `OWN` as a function on arrays, which notes the time that it takes."""

    def __init__(self, weights: Any) -> None:
        self.weights, self.hessians = weights, np.tile(SPRING * np.eye(3), (len(weights), 1, 1))
        self.seconds = 0.0

    def __call__(self, x: Any, order: int) -> Any:
        start = time.perf_counter()
        gradient = SPRING * x
        results = [self.weights * x[:, 0, 2] + 0.5 * np.einsum("nij,nij->n", gradient, x)]
        if order > 0:
            gradient[:, 0, 2] += self.weights
            results.append(gradient)
        if order > 1:
            results.append(self.hessians)
        self.seconds += time.perf_counter() - start
        return tuple(results)


def control(steps: int = 60, rounds: int = 5) -> None:
    """One own force and moving pins beside the closed step of the same motion: all weight, and pins of the scene."""
    cells, lift = 64, 0.01
    vertices = (cells + 1) ** 2
    stencils, closed = np.arange(vertices)[:, None], scene(cells, steps, lift=lift)
    opened = scene(cells, steps, GRAVITY / 2)
    weights = ed.Simulation(closed).masses * GRAVITY / 2
    times: dict[str, list[float]] = {"closed": [], "text": [], "function": [], "itself": []}
    for _ in range(rounds):
        own = Own(weights)
        text = {"own": (OWN, stencils, {"w": weights, "k": SPRING})}
        plain = ed.Simulation(closed, threads=1)
        times["closed"].append(milliseconds(plain, steps))
        steered = ed.Simulation(opened, threads=1, forces=text)
        times["text"].append(milliseconds(steered, steps, lift))
        called = ed.Simulation(opened, threads=1, forces={"own": ed.OwnEnergy(own, stencils)})
        own.seconds = 0.0
        times["function"].append(milliseconds(called, steps, lift))
        times["itself"].append(1e3 * own.seconds / steps)
        for simulation in (steered, called):
            # Wrinkles amplify rounding errors.
            np.testing.assert_allclose(simulation.positions, plain.positions, atol=0.05)
    base, by_text, by_function, itself = (min(times[name]) for name in times)
    print(f"{vertices} vertices, ms per step: closed {base:.2f}, text {by_text:.2f} ({by_text / base:.2f} times)")
    rest = (by_function - itself) / base
    print(f"function {by_function:.2f}, of which {itself:.2f} itself; the rest is {rest:.2f} times the closed step")


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
