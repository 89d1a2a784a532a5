"""Sums of elements over meshes, and Newton's method with SciPy."""

import numpy as np
import pytest

import energy_dsl as ed

sparse = pytest.importorskip("scipy.sparse")

SPRING = "energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }"
WEIGHT = "energy Weight(p: Point; w: Scalar) { w * p.z }"


def chain(count):
    system = ed.System(count, pinned=[0, count - 1])
    edges = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    system.add(ed.energy(SPRING), edges.tolist(), k=1e3, L=0.9 / (count - 1))
    system.add(ed.energy(WEIGHT), [[i] for i in range(count)], w=0.1)
    x = np.zeros((count, 3))
    x[:, 0] = np.linspace(0, 1, count)
    return system, x


def test_the_matrix_is_the_sum_of_the_elements():
    system, x = chain(6)
    x = x + 0.01 * np.random.default_rng(1).normal(size=x.shape)
    U, g, H = system.linearise(x)
    assert isinstance(H, sparse.bsr_array) and H.shape == (12, 12) and H.blocksize == (3, 3)
    expected, gradient, energy = np.zeros((18, 18)), np.zeros((6, 3)), 0.0
    spring = ed.energy(SPRING)
    for i in range(5):
        u, f, h = spring.hessian(x[None, i : i + 2], k=1e3, L=0.9 / 5)
        energy += u[0]
        gradient[i : i + 2] += f[0]
        expected[3 * i : 3 * i + 6, 3 * i : 3 * i + 6] += h[0]
    gradient[:, 2] += 0.1
    np.testing.assert_allclose(H.toarray(), expected[3:15, 3:15], rtol=1e-14, atol=1e-10)
    np.testing.assert_allclose(g[1:5], gradient[1:5], rtol=1e-13, atol=1e-12)
    np.testing.assert_allclose(U, energy + 0.1 * x[1:5, 2].sum(), rtol=1e-13)
    assert system.energy(x) == U and system.free == [1, 2, 3, 4]


def test_the_pattern_stays_and_the_numbers_change():
    system, x = chain(5)
    first, second = system.linearise(x)[2], system.linearise(x + 0.01 * np.arange(15).reshape(5, 3) ** 2)[2]
    assert np.array_equal(first.indices, second.indices) and np.array_equal(first.indptr, second.indptr)
    assert not np.array_equal(first.data, second.data)


def test_clamped_curvature_is_positive():
    system, x = chain(5)
    x[:, 0] *= 0.5
    exact, clamped = [system.linearise(x, curvature)[2].toarray() for curvature in ("exact", "clamped")]
    assert np.linalg.eigvalsh(exact).min() < -1 and np.linalg.eigvalsh(clamped).min() > -1e-9


def test_newton_finds_the_shape_of_a_hanging_chain():
    from scipy.sparse.linalg import spsolve

    system, x = chain(20)
    free = system.free
    for _ in range(50):
        U, g, H = system.linearise(x, "clamped")
        if np.abs(g[free]).max() < 1e-9:
            break
        step = -spsolve(H.tocsc(), g[free].ravel()).reshape(-1, 3)
        length = 1.0
        trial = x.copy()
        while True:
            trial[free] = x[free] + length * step
            if system.energy(trial) <= U + 1e-12 or length < 1e-6:
                break
            length /= 2
        x = trial
    assert np.abs(g[free]).max() < 1e-9 and x[:, 2].min() < -0.01
    np.testing.assert_allclose(x[:, 2], x[::-1, 2], atol=1e-9)


def test_elements_outside_of_their_domain_are_infinite():
    text = """energy NeoHooke(x0, x1, x2: Point; mu: Scalar) {
        let a = x1 - x0;
        let b = x2 - x0;
        let J = a.x * b.y - a.y * b.x;
        mu / 2 * (norm_squared(a) + norm_squared(b) - 2 - 2 * log(J))
    }"""
    element = ed.energy(text)
    system = ed.System(4)
    system.add(element, [[0, 1, 2], [1, 3, 2]], mu=2.0)
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1.2, 0.9, 0]])
    assert np.isfinite(system.energy(x))
    x[3, :2] = 0.2
    assert system.energy(x) == np.inf
    with pytest.raises(RuntimeError, match="NeoHooke 1: element 1"):
        system.linearise(x)
    U, marks = element.value(x[[1, 3, 2]][None], mu=2.0, flags=True)
    assert U[0] == np.inf and marks[0] == 1


def test_newton_never_inverts_a_triangle():
    text = """energy NeoHooke(x0, x1, x2: Point; mu: Scalar) {
        let a = x1 - x0;
        let b = x2 - x0;
        let J = a.x * b.y - a.y * b.x;
        mu / 2 * (norm_squared(a) + norm_squared(b) - 2 - 2 * log(J)) + 2 * (J - 1)^2
    }"""
    system = ed.System(3, pinned=[0, 1])
    system.add(ed.energy(text), [[0, 1, 2]], mu=1.0)
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0.3, 8.0, 0]])
    from scipy.sparse.linalg import spsolve

    for _ in range(60):
        U, g, H = system.linearise(x, curvature="clamped")
        step, length = np.zeros((3, 3)), 1.0
        step[2] = -spsolve((H + 1e-9 * sparse.eye_array(3)).tocsc(), g[2])
        while system.energy(x + length * step) > U and length > 1e-9:
            length /= 2
        x = x + length * step
        assert x[2, 1] > 0
    np.testing.assert_allclose(x[2], [0, 1, 0], atol=1e-6)


def test_messages_say_what_was_expected():
    system, x = chain(4)
    spring = ed.energy(SPRING)
    with pytest.raises(ValueError, match="row 0 has 3 vertices; expected 2"):
        system.add(spring, [[0, 1, 2]], k=1, L=1)
    with pytest.raises(ValueError, match="row 1 names vertex 4"):
        system.add(spring, [[0, 1], [1, 4]], k=1, L=1)
    with pytest.raises(ValueError, match="names vertex 2 twice"):
        system.add(spring, [[2, 2]], k=1, L=1)
    with pytest.raises(ValueError, match=r"x: expected shape \(4, 3\)"):
        system.energy(x[:3])
    with pytest.raises(ValueError, match="curvature"):
        system.linearise(x, "soft")
    with pytest.raises(ValueError, match="no vertex 7"):
        ed.System(4, pinned=[7])


def test_systems_of_any_size_are_refused_or_work():
    with pytest.raises(ValueError, match="vertices: expected at most 4294967295, got 1099511627776"):
        ed.System(2**40)
    energy = ed.System(0).energy(np.zeros((0, 3)))
    assert energy == 0 and not np.signbit(energy)
