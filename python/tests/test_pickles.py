"""Elements and systems are pickled by text and parameters, for processes and clusters."""

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import energy_dsl as ed

TEXT = """
fn stretch(a, L) { norm(a) - L }
/// A spring, with words that a copy keeps.
energy Spring(p, q: Point; k, L: Scalar) { k / 2 * stretch(p - q, L)^2 }
force Drag(_p: Point, v: Velocity; c: Scalar) { -c * v }
residual Pull(u: Vec3; k: Scalar) { k * u }
"""
X = np.random.default_rng(1).normal(size=(70, 2, 3))


def declared():
    return ed.energies(TEXT)


def ways(thing):
    """Returns copies of a thing, made in all ways."""
    copies = [copy.copy(thing), copy.deepcopy(thing)]
    copies += [pickle.loads(pickle.dumps(thing, protocol)) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)]
    try:
        import cloudpickle
    except ImportError:
        return copies
    return [*copies, cloudpickle.loads(cloudpickle.dumps(thing))]


def test_elements_of_texts_are_copied():
    for element in declared():
        for other in ways(element):
            assert (other.name, other.kind, other.source) == (element.name, element.kind, element.source)
            assert other.description == element.description and other.inputs == element.inputs
    spring = declared()[0]
    for other in ways(spring):
        assert np.array_equal(other.hessian(X, k=2.0, L=1.0)[2], spring.hessian(X, k=2.0, L=1.0)[2])


def test_elements_of_the_library_are_copied():
    element = ed.element("HookeSpring")
    assert all(other is element for other in ways(element))


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_bound_elements_are_copied(dtype):
    k = np.linspace(1, 2, 70)
    for springs in (
        declared()[0].bind(70, dtype, threads=2, k=k, L=1),
        ed.element("HookeSpring").bind(70, dtype, K=k, L=np.float64(1)),
    ):
        expected = springs.hessian(X.astype(dtype))
        k_before, k[:] = k.copy(), 0
        for other in ways(springs):
            assert (len(other), other.dtype, other.threads) == (70, dtype, springs.threads)
            assert other.is_compiled == springs.is_compiled
            assert all(np.array_equal(a, b) for a, b in zip(other.hessian(X.astype(dtype)), expected))
        k[:] = k_before


def test_inputs_of_a_description_are_copied():
    for item in ed.element("HookeSpring").inputs:
        assert all(other == item and repr(other) == repr(item) for other in ways(item))


class OwnSystem(ed.System):
    """A class of a user."""


def test_systems_are_copied():
    system = OwnSystem(4, pinned=[1], masses=[1, 2, 3, 4])
    term = system.add(declared()[0], [[0, 1], [1, 2], [2, 3]], k=[1.0, 2.0, 3.0], L=1)
    system.set(term, L=0.5)
    system.threads, system.label = 2, "mine"
    x = X[:2].reshape(4, 3)
    for other in ways(system):
        assert type(other) is OwnSystem and other.label == "mine" and (other.pinned, other.threads) == ([1], 2)
        assert other.energy(x) == system.energy(x) and np.array_equal(other.masses, system.masses)
        assert np.array_equal(other.linearise_blocks(x)[2][2], system.linearise_blocks(x)[2][2])
        other.set(term, L=2.0)
        assert other.energy(x) != system.energy(x), "copies are independent"


spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")


def total(x):
    """Uses a global element, as functions in notebooks do."""
    return float(spring.value(x, k=2.0, L=1.0).sum())


def test_processes_get_elements_and_functions_that_use_them():
    springs = spring.bind(70, k=2.0, L=1.0)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert pool.submit(springs.value, X).result().sum() == pytest.approx(total(X), rel=1e-14)
        assert pool.submit(spring.value, X, k=2.0, L=1.0).result().sum() == pytest.approx(total(X), rel=1e-14)


def test_joblib_takes_functions_of_global_elements():
    joblib = pytest.importorskip("joblib")
    local = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
    results = joblib.Parallel(2)(joblib.delayed(lambda x: float(local.value(x, k=2.0, L=1.0).sum()))(X) for _ in "ab")
    assert results == [total(X)] * 2
