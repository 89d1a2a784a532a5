"""A reinforcement-learning environment: lay a hanging towel over a bar by moving its two upper corners.

The class has the interface of gymnasium, and needs gymnasium only for its spaces. Many instances run in one process:
steps release the interpreter's lock.
"""

import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import energy_dsl as ed

try:
    import gymnasium
except ImportError:
    gymnasium: Any = None  # type: ignore[no-redef]

Array = NDArray[np.floating[Any]]

SCENE: dict[str, Any] = {
    "dt": 0.02,
    "duration": 4.0,
    "gravity": [0.0, 0.0, -9.81],
    "drag": 1.0,
    "integrator": "implicit-euler",
    "mesh": {"sheet": {"cells": [24, 24], "size": [0.6, 0.6]}},
    "fabric": {"density": 0.2, "material": {"stvk": {"stretch_stiffness": 40.0, "poisson_ratio": 0.3}}},
    "pins": [{"nearest": [-0.3, 0.3, 0.0]}, {"nearest": [0.3, 0.3, 0.0]}],
    "obstacles": [
        {
            "name": "bar",
            "capsule": {"from": [-0.5, 0.0, -0.35], "to": [0.5, 0.0, -0.35], "radius": 0.03},
            "friction": 0.3,
        }
    ],
}


class TowelEnv(gymnasium.Env if gymnasium else object):  # type: ignore[misc]
    """Actions: velocities of the two corners (m/s), of shape (2, 3). Observations: positions and velocities of a few
    vertices. Reward: minus the mean distance of the middle row of the towel from the bar."""

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, steps_per_action: int = 4) -> None:
        self.simulation = ed.Simulation(SCENE, threads=1)
        self.steps_per_action = steps_per_action
        self.pins = self.simulation.pinned
        self.seen = np.linspace(0, len(self.simulation.masses) - 1, 32).astype(int)
        self.middle = np.flatnonzero(np.abs(self.simulation.positions[:, 1]) < 1e-9)
        if gymnasium:
            self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2, 3), np.float32)
            self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2, 32, 3), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        if gymnasium:
            super().reset(seed=seed)
        self.simulation.reset()
        return self.observation(), {}

    def step(self, action: ArrayLike) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        action = np.clip(np.asarray(action, float), -1.0, 1.0)
        target = self.simulation.positions[self.pins]
        for _ in range(self.steps_per_action):
            target = target + SCENE["dt"] * action
            self.simulation.move_pins(self.pins, target)
            self.simulation.step()
        distance = self.simulation.positions[self.middle][:, 1:] - [0.0, -0.35]
        reward = -float(np.linalg.norm(distance, axis=1).mean())
        return self.observation(), reward, False, self.simulation.is_finished, {}

    def observation(self) -> Array:
        state = [self.simulation.positions, self.simulation.velocities]
        return np.stack([vectors[self.seen] for vectors in state]).astype(np.float32)


def rollout(env: TowelEnv, seed: int) -> float:
    """Takes random actions to the end. Returns the sum of the rewards."""
    random, total, done = np.random.default_rng(seed), 0.0, False
    env.reset()
    while not done:
        _, reward, _, done, _ = env.step(random.normal(size=(2, 3), scale=0.3))
        total += reward
    return total


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    envs = [TowelEnv() for _ in range(count)]
    start = time.perf_counter()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        returns = list(pool.map(rollout, envs, range(count)))
    seconds = time.perf_counter() - start
    steps = count * envs[0].simulation.steps
    print(f"{count} instances: {steps / seconds:.0f} steps/s, best return {max(returns):.1f}")
