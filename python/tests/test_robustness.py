"""Wrong arrays, many calls and many threads: exceptions that say what was expected, and no leak."""

import gc
import hashlib
import os
import signal
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import energy_dsl as ed

POINTS = 2
SHAPE = (5, POINTS, 3)


@pytest.fixture(scope="module")
def springs():
    text = "energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }"
    return [ed.energy(text).bind(5, k=2, L=1), ed.element("HookeSpring").bind(5, K=2, L=1)]


def arrays(shape, dtype):
    return np.ones(shape, dtype)


shapes = st.lists(st.integers(0, 6), max_size=4).map(tuple)


@given(shape=shapes.filter(lambda shape: shape != SHAPE))
@settings(max_examples=60, deadline=None)
def test_wrong_shapes_name_the_expected_one(springs, shape):
    for elements in springs:
        with pytest.raises(ValueError, match=r"x: expected shape \(5, 2, 3\), got \("):
            elements.value(np.ones(shape))


@given(shape=shapes.filter(lambda shape: shape != (5, 6, 6)), which=st.integers(0, 2))
@settings(max_examples=60, deadline=None)
def test_wrong_results_name_the_expected_shape(springs, shape, which):
    expected = [(5,), SHAPE, (5, 6, 6)]
    if shape == expected[which]:
        return
    out = [np.empty(right) for right in expected]
    out[which] = np.empty(shape)
    name = ["U", "gradient", "Hessian"][which]
    for elements in springs:
        with pytest.raises(ValueError, match=f"out, {name}: expected shape"):
            elements.hessian(np.ones(SHAPE), out=tuple(out))


@given(dtype=st.sampled_from(["c16", "U3", "M8[s]", "V8", object]))
@settings(max_examples=20, deadline=None)
def test_arrays_of_other_things_are_refused(springs, dtype):
    things = np.full(SHAPE, None, object) if dtype is object else np.zeros(SHAPE, dtype)
    for elements in springs:
        with pytest.raises(TypeError, match="x: expected an array of numbers, got dtype"):
            elements.value(things)


@given(index=st.integers(0, 29), dtype=st.sampled_from(["f4", "f8"]))
@settings(max_examples=30, deadline=None)
def test_a_number_that_is_none_is_found(springs, index, dtype):
    x = np.ones(SHAPE, dtype)
    x.flat[index] = np.nan
    for elements in springs:
        with pytest.raises(ValueError, match=f"x: entry {index} .* NaN"):
            elements.gradient(x)


@given(
    axes=st.permutations(range(3)),
    step=st.sampled_from([-2, -1, 1, 2]),
    dtype=st.sampled_from(["f8", "f4", "i4", ">f8"]),
)
@settings(max_examples=40, deadline=None)
def test_any_strides_give_the_same_bits(springs, axes, step, dtype):
    wide = (100 * np.random.default_rng(1).normal(size=(10, POINTS, 3))).astype(dtype)
    strided = wide[::step][:5].transpose(axes).copy().transpose(np.argsort(axes))
    for elements in springs:
        expected = elements.value(np.array(strided, "f8", order="C"))
        assert np.array_equal(elements.value(strided), expected)


def test_empty_batches_return_empty_arrays(springs):
    for element in (springs[0].element, springs[1].element):
        names = [i.name for i in element.inputs if i.kind == "parameter"]
        U, g, H, flags = element.hessian(np.empty((0, 2, 3)), **dict.fromkeys(names, 1.0), flags=True)
        assert U.shape == (0,) and g.shape == (0, 2, 3) and H.shape == (0, 6, 6) and flags.shape == (0,)


def test_results_are_not_written_twice(springs):
    both = np.empty(SHAPE)
    for elements in springs:
        with pytest.raises(ValueError, match="read-only, or used twice"):
            elements.gradient(np.ones(SHAPE), out=(both[:, 0, 0].copy(), both)[:1] + (frozen(both),))
        x = np.ones(SHAPE)
        with pytest.raises(ValueError, match="read-only, or used twice"):
            elements.gradient(x, out=(np.empty(5), x))


def frozen(array):
    copy = array.copy()
    copy.flags.writeable = False
    return copy


def in_threads(count, work):
    """Runs `work(i)` in threads; returns the exceptions that they raised."""
    raised = []

    def guarded(i):
        try:
            work(i)
        except Exception as error:
            raised.append(error)

    threads = [threading.Thread(target=guarded, args=(i,)) for i in range(count)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    return raised


def test_threads_share_elements(springs):
    x = np.random.default_rng(1).normal(size=SHAPE)
    expected = [elements.hessian(x)[2] for elements in springs]

    def work(_):
        for _ in range(50):
            assert all(np.array_equal(elements.hessian(x)[2], e) for elements, e in zip(springs, expected))

    assert not in_threads(4, work)


def test_a_second_thread_in_one_system_is_told_so():
    n = 20_000
    system = ed.System(n)
    system.add(ed.element("HookeSpring"), np.stack([np.arange(n - 1), np.arange(1, n)], 1), K=1, L=1)
    x = np.random.default_rng(1).normal(size=(n, 3))
    U, g, blocks = system.linearise_blocks(x)
    started = threading.Barrier(2)

    def work(_):
        started.wait()
        for _ in range(20):
            found = system.linearise_blocks(x)
            assert found[0] == U and np.array_equal(found[1], g) and np.array_equal(found[2][2], blocks[2])

    raised = in_threads(2, work)
    assert raised and all(isinstance(error, RuntimeError) for error in raised)
    assert "this System is in use by another thread: expected one thread at a time" in str(raised[0])
    assert system.energy(x) == U


def test_a_second_thread_in_one_simulation_is_told_so():
    scene = {
        "dt": 0.01, "duration": 1.0, "gravity": [0.0, 0.0, -9.81],
        "mesh": {"sheet": {"cells": [24, 24], "size": [1.0, 1.0]}},
        "fabric": {"density": 0.15, "material": {"stvk": {"stretch_stiffness": 50.0, "poisson_ratio": 0.3}}},
        "pins": [{"nearest": [-0.5, 0.5, 0.0]}],
    }
    simulation, alone = ed.Simulation(scene, threads=1), ed.Simulation(scene, threads=1)
    running = threading.Thread(target=lambda: simulation.step(100))
    running.start()
    raised = []
    while running.is_alive():
        try:
            simulation.positions
        except RuntimeError as error:
            raised.append(str(error))
    running.join()
    assert raised and "this Simulation is in use by another thread" in raised[0]
    alone.step(100)
    assert np.array_equal(simulation.positions, alone.positions)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_takes_the_steps_of_its_parent():
    scene = {
        "dt": 0.01, "duration": 1.0, "integrator": "newton",
        "mesh": {"sheet": {"cells": [40, 40], "size": [1.0, 1.0]}},
        "fabric": {"density": 0.15, "material": {"stvk": {"stretch_stiffness": 50.0, "poisson_ratio": 0.3}}},
        "pins": [{"nearest": [-0.5, 0.5, 0.0]}],
    }
    simulation = ed.Simulation(scene, threads=2)
    simulation.step(1)
    receiver, sender = os.pipe()
    child = os.fork()
    if child == 0:
        # Threads do not survive a fork. A step that waited for them would never end.
        signal.alarm(30)
        simulation.step(1)
        os.write(sender, hashlib.sha256(simulation.positions.tobytes()).digest())
        os._exit(0)
    simulation.step(1)
    assert os.waitpid(child, 0)[1] == 0
    assert os.read(receiver, 32) == hashlib.sha256(simulation.positions.tobytes()).digest()


def resident():
    """Returns the bytes of memory that the process uses."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_calls_do_not_leak(springs, calls=4000):
    """`python tests/test_robustness.py` makes 100,000 calls."""
    x = np.random.default_rng(1).normal(size=SHAPE)
    element, out = springs[1].element, (np.empty(5), np.empty(SHAPE), np.empty((5, 6, 6)))
    system = ed.System(4)
    system.add(element, [[0, 1], [1, 2]], K=1, L=1)

    def one():
        for elements in springs:
            elements.hessian(x, out=out, flags=True)
            elements.gradient(x)
        element.value(x, K=1, L=1)
        system.linearise_blocks(x[:4, 0])
        for wrong in (x[:, 0], "none"):
            with pytest.raises((TypeError, ValueError)):
                element.value(wrong, K=1, L=1)

    for _ in range(500):
        one()
    gc.collect()
    before = resident()
    for _ in range(calls // 8):
        one()
    gc.collect()
    # A leak of one small object in each call would be larger.
    assert resident() - before < max(1_000_000, 16 * calls), resident() - before


if __name__ == "__main__":
    text = "energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }"
    both = [ed.energy(text).bind(5, k=2, L=1), ed.element("HookeSpring").bind(5, K=2, L=1)]
    test_calls_do_not_leak(both, 100_000)
    print("100,000 calls: no leak")


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="the system does not tell the memory of a process")
def test_texts_leave_no_memory_behind():
    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def compile_texts(numbers):
        for number in numbers:
            text = f"/// {'x' * 10_000}\nenergy E{number}(p: Point; k{number}: Scalar) {{ k{number} * p.z }}"
            ed.energy(text).bind(1, **{f"k{number}": 1.0}).value(np.zeros((1, 1, 3)))

    compile_texts(range(100))
    before = resident()
    compile_texts(range(100, 500))
    assert resident() - before < 400 * 10_000 / 2
