"""The examples run."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.mark.parametrize("name, needs", [("newton", "scipy"), ("torch_gradient", "torch"), ("jax_gradient", "jax")])
def test_scripts_run(name, needs, capsys):
    pytest.importorskip(needs)
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert capsys.readouterr().out


def test_the_notebook_runs(monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("scipy")
    matplotlib.use("agg")
    cells = json.loads((EXAMPLES / "first_steps.ipynb").read_text(encoding="utf-8"))["cells"]
    names = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            lines = "".join(cell["source"]).splitlines()
            exec("\n".join(line for line in lines if not line.startswith("%")), names)
    assert names["residuals"][-1] < 1e-9 and not names["sweep"].failures


def test_a_towel_is_folded():
    example = runpy.run_path(str(EXAMPLES / "folding.py"))
    simulation = example["folded"](cells=4, carrying=60)
    width = np.ptp(simulation.positions[:, 0])
    assert width < 0.8 * example["SIDE"], width


def test_environments_start_again_with_the_same_bits():
    example = runpy.run_path(str(EXAMPLES / "towel_env.py"))
    example["SCENE"]["mesh"]["sheet"]["cells"] = [8, 8]
    env, other = example["TowelEnv"](), example["TowelEnv"]()
    action = np.full((2, 3), 0.5)
    results = []
    for one in (env, env, other):
        first, _ = one.reset()
        seen, reward, terminated, truncated, info = one.step(action)
        assert seen.shape == first.shape == (2, 32, 3) and reward < 0 and not terminated and not truncated
        results.append((seen.tobytes(), reward))
    assert results[0] == results[1] == results[2]
