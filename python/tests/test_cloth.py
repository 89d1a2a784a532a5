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


PULLED = """
dt = 0.02
duration = 0.4
gravity = [0.0, 0.0, 0.0]
integrator = "newton"
contact = "off"
[[garment]]
name = "strip"
mesh.sheet = { cells = [4, 2], size = [0.2, 0.1] }
fabric = { density = 0.2, material.stvk = { stretch_stiffness = 100.0, poisson_ratio = 0.0 } }
[[pins]]
name = "left"
box = { min = [-0.11, -1.0, -1.0], max = [-0.09, 1.0, 1.0] }
[[pins]]
name = "right"
box = { min = [0.09, -1.0, -1.0], max = [0.11, 1.0, 1.0] }
motion.keys = [{ time = 0.0 }, { time = 0.3, translate = [0.02, 0.0, 0.0] }]
"""


def test_loads_on_pins_and_strains_are_measured(tmp_path):
    scene = tmp_path / "pulled.toml"
    scene.write_text(PULLED)
    simulation = ed.Simulation(scene)
    simulation.step(100)
    reading = simulation.reading()
    # Uniform stretch by a tenth without coupling: Y (ε + ε²/2)(1 + ε) per width.
    assert reading["group right Fx [N]"] == pytest.approx(-0.1 * 100 * 0.105 * 1.1, rel=1e-2)
    assert reading["strip warp mean"] == pytest.approx(0.1, rel=1e-2)
    assert simulation.pin_forces.shape == (15, 3)
    assert simulation.pin_forces[:, 0].sum() == pytest.approx(0, abs=1e-2)
    ed.run(scene, tmp_path / "run")
    columns = ed.measurements(tmp_path / "run")
    assert columns["time [s]"][-1] == pytest.approx(0.4)
    assert columns["pin 1 Fx [N]"][-1] == pytest.approx(reading["pin 1 Fx [N]"], rel=1e-9)
    with pytest.raises(ed.EnergyError, match="is this the folder of a finished run"):
        ed.measurements(tmp_path)


def test_the_drape_of_a_square_is_that_of_its_shadow():
    x = np.array([[0.0, 0, 0], [0.2, 0, 0], [0.2, 0.2, -0.1], [0, 0.2, -0.1]])
    drape = ed.drape(x, [[0, 1, 2], [0, 2, 3]], disc=0.05, specimen=0.15)
    assert drape["area"] == pytest.approx(0.04, rel=1e-6)
    assert drape["coefficient"] == pytest.approx(100 * (0.04 / np.pi - 0.05**2) / (0.15**2 - 0.05**2), rel=1e-5)
    with pytest.raises(ed.EnergyError, match="is not smaller than the specimen"):
        ed.drape(x, [[0, 1, 2]], disc=0.2, specimen=0.1)
