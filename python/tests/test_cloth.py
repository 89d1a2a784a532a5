"""Scenes of cloth, and sweeps."""

import csv
from concurrent.futures import ThreadPoolExecutor

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


def test_a_sweep_lists_its_runs_and_skips_those_that_are_done(tmp_path):
    grid = {"fabric.density": [0.1, 0.2], "dt": [0.01, 0.02]}
    with ThreadPoolExecutor(2) as pool:
        sweep = ed.sweep(SCENE, grid, tmp_path, executor=pool)
        index = (tmp_path / "index.csv").read_bytes()
        again = ed.sweep(SCENE, grid, tmp_path, executor=pool)
    assert [run["status"] for run in sweep.runs] == ["done"] * 4 and not sweep.failures
    assert again.runs == sweep.runs and (tmp_path / "index.csv").read_bytes() == index
    rows = list(csv.DictReader((tmp_path / "index.csv").open()))
    choices = {(density, dt) for density in ("0.1", "0.2") for dt in ("0.01", "0.02")}
    assert {(row["fabric.density"], row["dt"]) for row in rows} == choices
    assert all((tmp_path / row["folder"] / "run.json").exists() for row in rows)


def test_a_run_that_fails_is_listed_and_others_go_on(tmp_path):
    with ThreadPoolExecutor(1) as pool:
        sweep = ed.sweep(SCENE, [{"dt": -1.0}, {"dt": 0.01}], tmp_path, executor=pool)
    assert [run["status"] for run in sweep.runs] == ["failed", "done"]
    assert "dt" in sweep.failures[0]["message"]


def test_processes_do_the_same(tmp_path):
    threads = ed.sweep(SCENE, {"dt": [0.01]}, tmp_path / "a", executor=ThreadPoolExecutor(1))
    processes = ed.sweep(SCENE, {"dt": [0.01]}, tmp_path / "b")
    name = threads.runs[0]["folder"]
    assert name == processes.runs[0]["folder"]
    frames = sorted(path.name for path in (tmp_path / "a" / name).glob("*.usd*"))
    for frame in frames:
        assert (tmp_path / "a" / name / frame).read_bytes() == (tmp_path / "b" / name / frame).read_bytes()
