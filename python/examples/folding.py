"""A gripper folds a towel on a table: it takes one edge, carries it over to the other, lays it down and lets go."""

import sys
from typing import Any

import numpy as np

import energy_dsl as ed

SIDE, TABLE = 0.4, 0.005
SCENE: dict[str, Any] = {
    "dt": 0.01,
    "duration": 3.0,
    "integrator": "newton",
    "gravity": [0.0, 0.0, -9.81],
    "drag": 2.0,
    "contact": "on",
    "garment": [
        {
            "fabric": {
                "density": 0.3,
                "thickness": 2e-3,
                "friction": 0.4,
                "material": {"stvk": {"stretch_stiffness": 100.0, "poisson_ratio": 0.3}},
            },
            "placement": {"translate": [0.0, 0.0, TABLE + 0.004]},
            "mesh": {"sheet": {"cells": [12, 12], "size": [SIDE, SIDE]}},
        }
    ],
    "obstacles": [{"name": "table", "plane": {"point": [0.0, 0.0, 0.0]}, "friction": 0.5, "thickness": TABLE}],
}

# Springs between the gripped vertices and the places where the gripper holds them. Without stiffness, it is open.
GRIP = ed.energy("energy Grip(p: Point; place: Vec3, k: Scalar) { k / 2 * norm_squared(p - place) }")


def folded(cells: int = 12, carrying: int = 140, report_every: int = 0) -> ed.Simulation:
    """Folds the towel. Returns the simulation."""
    SCENE["garment"][0]["mesh"]["sheet"]["cells"] = [cells, cells]
    start = ed.Simulation(SCENE).positions
    edge = np.flatnonzero(start[:, 0] < start[:, 0].min() + 1e-9)
    grip = (GRIP, edge[:, None], {"place": start[edge], "k": 0.0})
    simulation = ed.Simulation(SCENE, forces={"grip": grip})
    goal = start[edge] * [-1.0, 1.0, 1.0] + [0.0, 0.0, 0.015]
    centre, radius = (start[edge] + goal) / 2, SIDE / 2
    simulation.step(20)
    for step in range(carrying + 1):
        # Half a circle from edge to edge, slower at its ends.
        part = step / carrying
        angle = np.pi * part * part * (3 - 2 * part)
        place = centre + np.array([-np.cos(angle), 0.0, np.sin(angle)]) * [radius, 0.0, 0.8 * radius]
        simulation.set("grip", place=place, k=30.0)
        simulation.step()
        if report_every and step % report_every == 0:
            pull = np.linalg.norm(dict(simulation.term_forces())["grip"].sum(0))
            height, contacts = simulation.positions[edge, 2].mean(), len(simulation.contacts().forces)
            edge_is = f"t = {simulation.time:.2f} s: the edge is {height:.3f} m high"
            print(f"{edge_is}, the gripper pulls with {pull:.2f} N, {contacts} contacts")
    simulation.set("grip", k=0.0)
    simulation.step(60)
    return simulation


if __name__ == "__main__":
    simulation = folded(report_every=20)
    x = simulation.positions
    width = np.ptp(x[:, 0])
    print(f"folded from {SIDE:.2f} m to {width:.2f} m; it lies up to {x[:, 2].max():.3f} m high")
    sys.exit(0 if width < 0.7 * SIDE else 1)
