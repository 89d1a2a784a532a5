"""Systems whose parameters, pins and masses change; forces, residuals, flags, threads and Newton's method."""

import threading
import time

import numpy as np
import pytest

import energy_dsl as ed

SPRING = "energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }"
PULL = "energy Pull(p: Point; t: Vec3, k: Scalar) { k / 2 * norm_squared(p - t) }"
DRAG = "force Drag(_p: Point, v: Velocity; c: Scalar) { -c * norm(v) * v }"


def dense(system, x, **options):
    offsets, columns, blocks = system.linearise_blocks(x, **options)[2]
    size = len(system.free)
    matrix = np.zeros((size, 3, size, 3))
    for row in range(size):
        for place in range(offsets[row], offsets[row + 1]):
            matrix[row, :, columns[place]] = blocks[place]
    return matrix.reshape(3 * size, 3 * size)


def chain(count, **options):
    system = ed.System(count, **options)
    edges = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    return system, system.add(ed.energy(SPRING), edges, k=3.0, L=0.5)


X = np.random.default_rng(1).normal(size=(6, 3))


@pytest.mark.parametrize(
    "text, inputs, other",
    [(SPRING, {"k": 3.0, "L": 0.5}, {"k": 7.0}), (PULL, {"t": [1.0, 2, 3], "k": 2.0}, {"k": 5.0})],
)
def test_parameters_change_as_if_they_had_been_added_so(text, inputs, other):
    element = ed.energy(text)
    stencils = [[0, 1], [1, 2], [4, 5]] if text is SPRING else [[0], [3], [5]]
    system, fresh = ed.System(6, pinned=[2]), ed.System(6, pinned=[2])
    term = system.add(element, stencils, **inputs)
    system.energy(X), system.linearise_blocks(X)
    for change in (other, {"k": [1.0, 2.0, 3.0]}, inputs):
        system.set(term, **change)
        fresh = ed.System(6, pinned=[2])
        fresh.add(element, stencils, **{**inputs, **change})
        assert system.energy(X) == fresh.energy(X)
        assert np.array_equal(dense(system, X), dense(fresh, X)) and np.array_equal(system.forces(X), fresh.forces(X))
    with pytest.raises(IndexError, match="expected less than 1, the number of terms, got 4"):
        system.set(4, k=1.0)
    with pytest.raises(TypeError, match="no input `j` to bind"):
        system.set(term, j=1.0)
    with pytest.raises(ValueError, match="k: expected shape"):
        system.set(term, k=[1.0, 2.0])
    assert system.energy(X) == fresh.energy(X), "a change that is refused changes nothing"


def test_pins_change():
    system, _ = chain(6)
    assert system.free == list(range(6))
    system.pinned = np.array([0, 5])
    fresh, _ = chain(6, pinned=[0, 5])
    assert system.pinned == [0, 5] and system.free == [1, 2, 3, 4]
    assert np.array_equal(dense(system, X), dense(fresh, X))
    with pytest.raises(ValueError, match="no vertex 6"):
        system.pinned = [6]


def test_forces_have_jacobians_and_no_energy():
    system, _ = chain(6)
    before = system.forces(X)
    system.add(ed.energy(DRAG), [[1], [2]], c=[2.0, 3.0])
    v = np.random.default_rng(2).normal(size=(6, 3))
    drag = np.zeros((6, 3))
    for vertex, c in ((1, 2.0), (2, 3.0)):
        drag[vertex] = -c * np.linalg.norm(v[vertex]) * v[vertex]
    np.testing.assert_allclose(system.forces(X, v), before + drag, rtol=1e-13, atol=1e-13)
    assert np.array_equal(system.forces(X), before), "at rest"
    assert system.energies(X)[1] is None and system.energies(X)[0] == system.energy(X)
    with pytest.raises(TypeError, match="`Drag 2` is a force, which has no energy; use linearise_forces"):
        system.linearise_blocks(X)
    sparse = pytest.importorskip("scipy.sparse")
    force, matrix = system.linearise_forces(X, v, position=0.0, velocity=1.0)
    assert isinstance(matrix, sparse.bsr_array) and np.array_equal(force, system.forces(X, v))
    step, numeric = 1e-6, np.zeros((18, 18))
    for i in range(18):
        d = np.zeros(18)
        d[i] = step
        high, low = (system.forces(X, v + sign * d.reshape(6, 3)) for sign in (1, -1))
        numeric[:, i] = ((high - low) / (2 * step)).ravel()
    np.testing.assert_allclose(matrix.toarray(), numeric, atol=1e-8)


def test_masses_are_added_and_needed():
    pytest.importorskip("scipy")
    system, _ = chain(6, masses=np.arange(1.0, 7.0))
    plain, heavy = (system.linearise_forces(X, mass=mass)[1].toarray() for mass in (0.0, 2.0))
    np.testing.assert_allclose(heavy - plain, np.diag(np.repeat(2.0 * np.arange(1.0, 7.0), 3)), atol=1e-12)
    with pytest.raises(ValueError, match="masses: expected finite numbers of at least 0, got -1 at 1"):
        system.masses = [1, -1, 1, 1, 1, 1]
    with pytest.raises(ValueError, match=r"masses: expected shape \(6,\), got \(2,\)"):
        system.masses = [1, 1]
    system.masses = None
    with pytest.raises(ValueError, match="the system has no masses"):
        system.linearise_forces(X, mass=1.0)


def test_half_of_a_matrix_is_its_upper_triangle():
    system, _ = chain(6, pinned=[3])
    for curvature in ("exact", "clamped", "absolute"):
        whole = dense(system, X, curvature=curvature)
        half = dense(system, X, curvature=curvature, half=True)
        upper = np.kron(np.triu(np.ones((5, 5))), np.ones((3, 3)))
        assert np.array_equal(half, whole * upper)


def test_residuals_are_least_squares():
    residual = ed.energy("residual Apart(u: Vec3; L: Scalar) { [u.x - L, u.x * u.y, u.z] }")
    system = ed.System(3)
    system.add(residual, [[0], [2]], L=[0.5, 1.5])
    x = X[:3]
    energy, gradient, matrix = 0.0, np.zeros((3, 3)), np.zeros((9, 9))
    for vertex, L in ((0, 0.5), (2, 1.5)):
        r, J = residual.jacobian(x[[vertex]], L=L)
        energy += 0.5 * (r**2).sum()
        gradient[vertex] = J[0].T @ r[0]
        matrix[3 * vertex : 3 * vertex + 3, 3 * vertex : 3 * vertex + 3] = J[0].T @ J[0]
    np.testing.assert_allclose(system.energy(x), energy, rtol=1e-14)
    np.testing.assert_allclose(-system.forces(x), gradient, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(dense(system, x), matrix, rtol=1e-13, atol=1e-14)


def test_flags_name_elements_outside_of_their_domain():
    system = ed.System(3)
    system.add(ed.energy("energy Barrier(p: Point) { -log(p.z) }"), [[0], [1], [2]])
    system.add(ed.energy(SPRING), [[0, 1], [1, 2]], k=1.0, L=1.0)
    x = np.array([[0.0, 0, 1], [0, 0, -1], [0, 0, -1]])
    assert system.energy(x) == np.inf
    barrier, springs = system.flags(x)
    assert barrier.tolist() == [0, 1, 1] and springs[0] == 0 and springs[1] != 0


def test_newton_ends_at_a_minimum_and_says_so():
    count = 20
    system = ed.System(count, pinned=[0, count - 1])
    edges = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    system.add(ed.energy(SPRING), edges, k=1e3, L=1.2 / (count - 1))
    system.add(ed.energy("energy Weight(p: Point; w: Scalar) { w * p.z }"), np.arange(count)[:, None], w=0.1)
    x = np.zeros((count, 3))
    x[:, 0] = np.linspace(0, 1, count)
    x[1:-1, 2] = -0.05
    found = system.minimise(x)
    assert found.converged and found.gradient <= 1e-9 and found.x[:, 2].min() < -0.2
    assert np.abs(system.forces(found.x)[1:-1]).max() <= 1e-9 and found.energy == system.energy(found.x)
    assert np.array_equal(found.x[[0, -1]], x[[0, -1]])
    assert not system.minimise(x, iterations=1).converged
    assert system.minimise(found.x).iterations == 0


def test_newton_with_masses_is_implicit_euler():
    system, _ = chain(3, masses=[1.0, 2.0, 3.0], pinned=[0])
    x, v, h = X[:3], np.ones((3, 3)), 0.1
    target = x + h * v
    found = system.minimise(x, mass=1 / h**2, target=target)
    forces, masses = system.forces(found.x)[1:], np.array([[2.0], [3.0]])
    np.testing.assert_allclose(masses * (found.x - target)[1:] / h**2, forces, atol=1e-8)
    with pytest.raises(ValueError, match="mass and target: expected both, or none"):
        system.minimise(x, mass=1.0)


def test_threads_change_no_bit():
    n = 3000
    x = np.random.default_rng(3).normal(size=(n, 2, 3))
    ways = [(ed.energy(SPRING), {"k": 2.0, "L": 1.0}), (ed.element("HookeSpring"), {"K": 2.0, "L": 1.0})]
    for element, inputs in ways:
        x[[70, 2900], 1] = x[[70, 2900], 0]
        one, many = element.bind(n, **inputs), element.bind(n, threads=3, **inputs)
        assert many.threads == 3
        for a, b in zip(one.hessian(x, flags=True), many.hessian(x, flags=True)):
            assert np.array_equal(a, b)
        v = np.ones_like(x)
        assert np.array_equal(one.hessian_vector(x, v), many.hessian_vector(x, v))
        assert one.gradient(x, flags=True)[2].nonzero()[0].tolist() == [70, 2900]
    system, _ = chain(500)
    positions = np.random.default_rng(4).normal(size=(500, 3))
    expected = system.linearise_blocks(positions)
    system.threads = 2
    assert np.array_equal(system.linearise_blocks(positions)[2][2], expected[2][2])
    for wrong in (lambda: element.bind(1, threads=0, **inputs), lambda: setattr(system, "threads", 0)):
        with pytest.raises(ValueError, match="threads: expected at least 1, got 0"):
            wrong()


def test_adding_elements_releases_the_lock():
    n = 300_000
    edges = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    spring, system, gaps, done = ed.energy(SPRING), ed.System(n + 1), [0.0], threading.Event()

    def watch():
        last = time.perf_counter()
        while not done.is_set():
            time.sleep(0.001)
            now = time.perf_counter()
            gaps.append(now - last)
            last = now

    watcher = threading.Thread(target=watch)
    watcher.start()
    start = time.perf_counter()
    system.add(spring, edges, k=np.ones(n), L=1.0)
    taken = time.perf_counter() - start
    done.set()
    watcher.join()
    assert max(gaps) < max(0.5 * taken, 0.1), (max(gaps), taken)


def test_stencils_of_arrays_are_checked():
    system, spring = ed.System(4), ed.energy(SPRING)
    with pytest.raises(ValueError, match="row 0 has 3 vertices; expected 2"):
        system.add(spring, np.array([[0, 1, 2]]), k=1, L=1)
    with pytest.raises(ValueError, match="row 1 names vertex -1"):
        system.add(spring, np.array([[0, 1], [-1, 2]]), k=1, L=1)
    with pytest.raises(TypeError, match="expected integers, got an array of dtype float64"):
        system.add(spring, np.array([[0.0, 1.0]]), k=1, L=1)
    with pytest.raises(ValueError, match=r"stencils: expected shape \(n, 2\), got \(2,\)"):
        system.add(spring, np.array([0, 1]), k=1, L=1)
    assert system.add(spring, np.zeros((0, 2), int), k=1, L=1) == 0
    assert system.add(spring, np.asfortranarray(np.array([[0, 1], [2, 3]], "u2")), k=1, L=1) == 1


def test_flags_of_a_variable_pass_mypy(tmp_path):
    pytest.importorskip("mypy")
    import subprocess
    import sys

    program = tmp_path / "program.py"
    program.write_text(
        "import numpy as np\nimport energy_dsl as ed\n\n\ndef evaluate(flags: bool) -> None:\n"
        "    ed.element('HookeSpring').gradient(np.zeros((1, 2, 3)), K=1, L=1, flags=flags)\n"
        "    ed.element('HookeSpring').bind(1, K=1, L=1).hessian(np.zeros((1, 2, 3)), flags=flags)\n"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), str(program)]
    found = subprocess.run(command, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout
