"""Limits of the compiler: a text that exceeds them is refused, and a caller may raise them."""

import pickle

import numpy as np
import pytest

import energy_dsl as ed

#: Takes more than 1,000 steps and 50,000 bytes.
TEXT = "energy Dense(p: [Point; 3]; k: Scalar) { sum(i in 0..3, exp(k * norm(p[i]))) * sum(i in 0..3, norm(p[i])) }"


@pytest.mark.parametrize(
    "compile", [ed.energy, ed.energies, ed.show, lambda text, limits: ed.audit(text, quick=True, limits=limits)]
)
def test_every_function_that_compiles_a_text_takes_limits(compile):
    with pytest.raises(ed.EnergyError, match=r"takes more than 1,000 steps to compile.*`Dense`"):
        compile(TEXT, limits={"steps": 1000})
    with pytest.raises(ed.EnergyError, match=r"takes more than 50,000 bytes of memory to compile"):
        compile(TEXT, limits={"bytes": 50_000})
    assert compile(TEXT, limits={"steps": 1e8, "bytes": 1e9})
    assert compile(TEXT, limits={}) and compile(TEXT, limits=None)


def test_files_take_limits(tmp_path):
    (tmp_path / "dense.energy").write_text(TEXT)
    with pytest.raises(ed.EnergyError, match="dense.energy:1:8: this takes more than 1,000 steps"):
        ed.load(tmp_path / "dense.energy", limits={"steps": 1000})
    assert len(ed.load(tmp_path / "dense.energy", limits={"steps": 10**7})) == 1


def test_limits_can_be_raised_above_the_defaults():
    # A dense Hessian of 57 coordinates takes 13 million steps.
    sums = [f"sum(i in 0..19, sum(j in 0..3, {term}))" for term in ("sin(k * p[i][j])", "exp(s * p[i][j])")]
    text = f"energy Dense(p: [Point; 19]; k: Scalar) {{ let s = {sums[0]}; {sums[1]} }}"
    with pytest.raises(ed.EnergyError, match="more than 10,000,000 steps to compile"):
        ed.energy(text)
    raised = ed.energy(text, limits={"steps": 2e7})
    assert raised.value(np.zeros((1, 19, 3)), k=1.0) == 57


def test_pickles_keep_the_limits():
    x = np.random.default_rng(1).normal(size=(3, 3, 3))
    dense = ed.energy(TEXT, limits={"steps": 10**8})
    steps, size = dense.__reduce__()[1][3:]
    assert (steps, size) == (10**8, 400_000_000)
    copy = pickle.loads(pickle.dumps(dense))
    assert np.array_equal(copy.value(x, k=0.1), dense.value(x, k=0.1))
    assert copy.__reduce__()[1] == dense.__reduce__()[1]


@pytest.mark.parametrize(
    ("limits", "error", "message"),
    [
        ({"step": 1e9}, ValueError, "no limit 'step'; expected \"steps\" or \"bytes\""),
        ({1: 1e9}, ValueError, "no limit 1; expected \"steps\" or \"bytes\""),
        ({"steps": 0}, ValueError, r"steps: expected a number from 1 to 2\*\*53, got 0"),
        ({"bytes": -4.0}, ValueError, r"bytes: expected a number from 1 to 2\*\*53, got -4.0"),
        ({"steps": float("nan")}, ValueError, r"steps: expected a number from 1 to 2\*\*53, got nan"),
        ({"steps": float("inf")}, ValueError, r"steps: expected a number from 1 to 2\*\*53, got inf"),
        ({"steps": 10**400}, ValueError, r"steps: expected a number from 1 to 2\*\*53, got 1000"),
        ({"steps": "1e9"}, TypeError, r"steps: expected a number from 1 to 2\*\*53, got str"),
        ({"steps": None}, TypeError, r"steps: expected a number from 1 to 2\*\*53, got NoneType"),
        ({"steps": True}, TypeError, r"steps: expected a number from 1 to 2\*\*53, got bool"),
        (1e9, TypeError, r"limits: expected a mapping such as \{\"steps\": 1e9\}, got float"),
    ],
)
def test_wrong_limits_are_named(limits, error, message):
    with pytest.raises(error, match=message):
        ed.energy(TEXT, limits=limits)


def test_numbers_of_numpy_are_limits():
    assert ed.energy(TEXT, limits={"steps": np.int64(10**8), "bytes": np.float32(1e9)}).name == "Dense"
