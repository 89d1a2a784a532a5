"""Scenes of cloth."""

import signal

import numpy as np
import pytest

import energy_dsl as ed

SCENE = {
    "dt": 0.01,
    "duration": 0.1,
    "gravity": [0.0, 0.0, -9.81],
    "mesh": {"sheet": {"cells": [4, 4], "size": [1.0, 1.0]}},
    "fabric": {"density": 0.15, "material": {"stvk": {"stretch_stiffness": 50.0, "poisson_ratio": 0.3}}},
    "pins": [{"nearest": [-0.5, 0.5, 0.0]}],
}


def test_a_simulation_steps_to_its_end():
    simulation = ed.Simulation(SCENE)
    start = simulation.positions
    assert start.shape == (25, 3) and simulation.triangles.shape == (32, 3) and not simulation.is_finished
    assert simulation.step(3) == 3 and simulation.time == pytest.approx(0.03)
    assert simulation.step(100) == 7 and simulation.is_finished
    assert simulation.positions[:, 2].min() < -0.01 and simulation.velocities.shape == (25, 3)


def test_frames_equal_those_of_steps():
    frames = ed.simulate(SCENE, every=5)
    simulation = ed.Simulation(SCENE, threads=1)
    simulation.step(5)
    assert frames.shape == (3, 25, 3) and np.array_equal(frames[1], simulation.positions)


def test_wrong_scenes_are_refused_with_a_reason():
    with pytest.raises(ed.EnergyError, match="cells"):
        ed.Simulation({**SCENE, "mesh": {"sheet": {"cells": [0, 4], "size": [1.0, 1.0]}}})
    with pytest.raises(ValueError, match="every"):
        ed.simulate(SCENE, every=0)


def test_a_run_writes_its_folder(tmp_path):
    assert ed.run(SCENE, tmp_path / "out") == 10
    assert (tmp_path / "out" / "run.json").exists()
    with pytest.raises(ed.EnergyError, match="overwrite"):
        ed.run(SCENE, tmp_path / "out")


def test_progress_is_told_and_may_stop_a_run(tmp_path):
    told = []
    assert ed.run(SCENE, tmp_path / "out", progress=lambda *numbers: told.append(numbers)) == 10
    assert told == [(step, 10) for step in range(1, 11)]
    frames, told[:] = ed.simulate(SCENE, every=5, progress=lambda *numbers: told.append(numbers)), told[10:]
    assert len(frames) == 3 and told == [(5, 10), (10, 10)]

    def stop(done, _):
        if done == 4:
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        ed.run(SCENE, tmp_path / "stopped", checkpoint=3, progress=stop)
    assert ed.resume(tmp_path / "stopped") == 10
    for frame in (tmp_path / "out").glob("*.usd*"):
        assert frame.read_bytes() == (tmp_path / "stopped" / frame.name).read_bytes()


def test_ctrl_c_ends_a_run_with_its_results(tmp_path):
    def interrupt(done, _):
        if done == 2:
            signal.raise_signal(signal.SIGINT)

    # A process in the background may ignore the signal.
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt, match="results so far"):
            ed.run(SCENE, tmp_path / "out", checkpoint=5, progress=interrupt)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert (tmp_path / "out" / "run.json").exists() and ed.resume(tmp_path / "out") == 10
