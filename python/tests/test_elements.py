"""Elements: values, derivatives, shapes and messages."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import energy_dsl as ed

SPRING = "energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }"


@pytest.fixture(scope="module")
def spring():
    return ed.energy(SPRING)


def positions(count, points, seed=1):
    return np.random.default_rng(seed).normal(size=(count, points, 3))


def test_derivatives_agree_with_differences():
    hinge = ed.element("HingeAngle")
    x = positions(5, 4)
    U, g, H = hinge.hessian(x)
    assert U.shape == (5,) and g.shape == (5, 4, 3) and H.shape == (5, 12, 12)
    step = 1e-6
    for i in range(12):
        moved = x.reshape(5, 12).copy()
        moved[:, i] += step
        ahead = hinge.gradient(moved.reshape(5, 4, 3))
        moved[:, i] -= 2 * step
        behind = hinge.gradient(moved.reshape(5, 4, 3))
        np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * step), g.reshape(5, 12)[:, i], rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(
            (ahead[1] - behind[1]).reshape(5, 12) / (2 * step), H[:, i], rtol=1e-5, atol=1e-6 * np.abs(H).max()
        )
    assert np.array_equal(H, H.transpose(0, 2, 1))


def test_vertices_have_their_part_of_the_hessian():
    hinge = ed.element("HingeAngle", vertices=True)
    x = positions(70, 4)
    U, g, H = hinge.hessian(x)
    for point in range(4):
        value, gradient, block = hinge.vertex(x, point)
        assert value.shape == (70,) and gradient.shape == (70, 3) and block.shape == (70, 3, 3)
        np.testing.assert_allclose(value, U, rtol=1e-13)
        np.testing.assert_allclose(gradient, g[:, point], rtol=1e-10, atol=1e-12 * np.abs(g).max())
        own = H[:, 3 * point:3 * point + 3, 3 * point:3 * point + 3]
        np.testing.assert_allclose(block, own, rtol=1e-9, atol=1e-12 * np.abs(H).max())
    assert pickle.loads(pickle.dumps(hinge)).vertex(x, 1)[0][0] == hinge.bind(70, threads=2).vertex(x, 1)[0][0]
    spring = ed.energy("#[vertex] " + SPRING)
    x = np.array([[[0.0, 0, 0], [2, 0, 0]], [[1.0, 0, 0], [1, 0, 0]]])
    out = (np.empty(2), np.empty((2, 3)), np.empty((2, 3, 3)))
    *_, flags = spring.vertex(x, 1, k=3.0, L=1.0, out=out, flags=True)
    assert out[0][0] == 1.5 and out[1][0].tolist() == [3, 0, 0] and np.diag(out[2][0]).tolist() == [3, 1.5, 1.5]
    assert flags.tolist() == [0, 1]
    with pytest.raises(IndexError, match="point: expected less than 2, the number of points of Spring, got 2"):
        spring.vertex(x, 2, k=3.0, L=1.0)
    with pytest.raises(ValueError, match=r"declare it as `#\[vertex\] energy Spring`"):
        ed.energy(SPRING).vertex(x, 1, k=3.0, L=1.0)
    with pytest.raises(ValueError, match="vertices=True"):
        ed.element("HookeSpring").vertex(x, 1, K=3.0, L=1.0)


def test_one_value_for_all_equals_one_for_each(spring):
    x = positions(70, 2)
    same = spring.hessian(x, k=3.0, L=0.5)
    each = spring.hessian(x, k=np.full(70, 3.0), L=np.full(70, 0.5))
    assert all(np.array_equal(a, b) for a, b in zip(same, each))
    bound = spring.bind(70, k=3.0, L=0.5)
    assert len(bound) == 70 and all(np.array_equal(a, b) for a, b in zip(same, bound.hessian(x)))


def test_results_are_written_to_given_arrays(spring):
    x = positions(9, 2)
    out = (np.empty(9), np.empty((9, 2, 3)))
    found = spring.gradient(x, k=2, L=1, out=out)
    assert found[0] is out[0] and found[1] is out[1]
    assert np.array_equal(out[1], spring.gradient(x, k=2, L=1)[1])
    with pytest.raises(ValueError, match=r"out, gradient: expected shape \(9, 2, 3\), got \(9, 6\)"):
        spring.gradient(x, k=2, L=1, out=(np.empty(9), np.empty((9, 6))))
    with pytest.raises(TypeError, match="float64"):
        spring.gradient(x, k=2, L=1, out=(np.empty(9, "f4"), np.empty((9, 2, 3))))
    with pytest.raises(ValueError, match="C-contiguous"):
        spring.gradient(x, k=2, L=1, out=(np.empty(18)[::2], np.empty((9, 2, 3))))
    with pytest.raises(ValueError, match="expected 2 arrays"):
        spring.gradient(x, k=2, L=1, out=np.empty(9))


def test_singular_inputs_are_flagged(spring):
    x = positions(3, 2)
    x[1, 1] = x[1, 0]
    U, g, flags = spring.gradient(x, k=1, L=1, flags=True)
    assert flags.tolist() == [0, 1, 0] and np.isfinite(g).all()


def test_forces_constraints_and_residuals():
    drag = ed.energy(
        "force Drag(p, q: Point, v, w: Velocity; c: Scalar) { let f = c * (v - w) + 0 * (p - q); [-f, f] }"
    )
    x, v = positions(4, 2), positions(4, 2, 2)
    f, by_x, by_v = drag.force_jacobians(x, v, c=2.0)
    assert np.array_equal(f[:, 0], -2 * (v[:, 0] - v[:, 1])) and not by_x.any() and by_v[0, 0, 0] == -2
    length = ed.energy("constraint Length(p, q: Point; L: Scalar) { norm(p - q) - L }")
    C, J = length.constraint(x, L=1, stiffness=1, damping=0)
    assert C.shape == (4, 1) and J.shape == (4, 1, 6)
    fit = ed.energy("residual Fit(a: Vec3, s: Scalar; m: Vec3) { s * (a - m) }")
    r, J = fit.jacobian(np.ones((4, 4)), m=[1.0, 2.0, 3.0])
    assert r.shape == (4, 3) and J.shape == (4, 3, 4) and r[0].tolist() == [0, -1, -2]
    with pytest.raises(ValueError, match="no `hessian`"):
        drag.hessian(x, c=1)


def test_descriptions_name_inputs_with_shapes_and_units(spring):
    assert repr(spring) == "<energy Spring(p, q, k, L)>"
    assert spring.points == 2 and spring.kind == "energy"
    assert [(i.name, i.kind, i.unit) for i in spring.inputs][2:] == [("k", "parameter", "N/m"), ("L", "parameter", "m")]
    assert "in N/m" in spring.description


def test_messages_say_what_was_expected(spring):
    x = positions(3, 2)
    with pytest.raises(TypeError, match="missing parameter `L`; expected k, L"):
        spring.value(x, k=1)
    with pytest.raises(TypeError, match="no input `m` to bind"):
        spring.value(x, k=1, L=1, m=2)
    with pytest.raises(ValueError, match=r"x: expected shape \(3, 2, 3\), got \(3, 6\)"):
        spring.value(x.reshape(3, 6), k=1, L=1)
    with pytest.raises(ValueError, match=r"k: expected shape \(\) or \(3,\), got \(2,\)"):
        spring.value(x, k=[1, 2], L=1)
    with pytest.raises(TypeError, match="array of numbers"):
        spring.value("here", k=1, L=1)
    x[2, 0, 1] = np.nan
    with pytest.raises(ValueError, match="x: entry 13 .* NaN"):
        spring.value(x, k=1, L=1)


def test_texts_that_are_wrong_are_refused_with_their_place():
    with pytest.raises(ed.EnergyError, match="u.energy:1:22"):
        ed.energy("energy U(p: Point) { nrm(p) }", "u.energy")
    with pytest.raises(ed.EnergyError, match="expected one declaration, got 2"):
        ed.energy(SPRING + SPRING.replace("Spring", "Other"))


def test_degenerate_rest_shapes_are_refused():
    sheet = ed.element("StVK")
    rest = {i.name: np.zeros(i.shape) for i in sheet.inputs if i.kind == "rest"}
    parameters = {i.name: np.ones(i.shape) for i in sheet.inputs if i.kind == "parameter"}
    with pytest.raises(ed.EnergyError, match="rest"):
        sheet.value(positions(1, 3), **rest, **parameters)


@given(count=st.integers(0, 140), seed=st.integers(0, 2**31))
@settings(max_examples=30, deadline=None)
def test_batches_of_any_size_equal_single_elements(count, seed):
    spring = ed.energy(SPRING)
    x = positions(count, 2, seed)
    U, g, H = spring.hessian(x, k=2.0, L=0.7)
    assert U.shape == (count,) and H.shape == (count, 6, 6)
    for i in range(0, count, 29):
        single = spring.hessian(x[i : i + 1], k=2.0, L=0.7)
        assert U[i] == single[0][0] and np.array_equal(g[i], single[1][0]) and np.array_equal(H[i], single[2][0])


def test_audits_find_what_is_false():
    assert ed.audit(SPRING, quick=True)
    false = ed.audit("#[invariant(rotation)] energy Weight(p, q: Point; k: Scalar) { k * (p - q).z }", quick=True)
    assert not false and "rotation" in " ".join(false.failures)
    assert "fn gradient" in ed.show(SPRING)


def test_repeated_calls_follow_their_parameters():
    spring = ed.element("HookeSpring")
    x = np.array([[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]])
    first = spring.value(x, K=1.0, L=1.0)
    assert spring.value(x, K=3.0, L=1.0) == 3 * first
    assert spring.value(x, L=1.0, K=1.0) == first
    assert spring.value(x, K=1.0, L=2.0) == 0.0
    assert spring.value(np.concatenate([x, x]), K=1.0, L=1.0).tolist() == 2 * first.tolist()
    assert spring.value(x.astype(np.float32), K=1.0, L=1.0).dtype == np.float32
    with pytest.raises(TypeError, match="missing parameter"):
        spring.value(x, K=1.0)
    with pytest.raises(ValueError, match="NaN"):
        spring.value(x, K=float("nan"), L=1.0)


def test_unknowns_of_any_type():
    """Rotations have four numbers and three increments; derivatives are by these."""
    text = """
    energy Aim(q: Rotation, s: Scalar; d, n: Vec3, k: Scalar) { k / 2 * norm_squared(s * rotate(q, d) - n) }
    force Drag(_x: Point, q: Rotation, v: Velocity, w: Velocity; c: Scalar, d: Vec3) { [-c * v, rotate(q, d) - c * w] }
    """
    aim, drag = ed.energies(text)
    assert (aim.points, aim.unknowns, aim.increments, aim.state) == (0, 5, 4, [])
    half = np.sqrt(0.5)
    u = np.array([[1, 0, 0, 0, 2.0], [half, 0, 0, half, 1.0]])
    inputs = {"d": [1.0, 0, 0], "n": [0.0, 1, 0], "k": 3.0}
    energy, gradient, hessian = aim.hessian(u, **inputs)
    assert (gradient.shape, hessian.shape) == ((2, 4), (2, 4, 4))
    np.testing.assert_allclose(energy, [7.5, 0], atol=1e-15)
    # Turned by a quarter about z, d points along n: nothing is left to turn.
    np.testing.assert_allclose(gradient[1], 0, atol=1e-15)
    np.testing.assert_array_equal(hessian, hessian.transpose(0, 2, 1))
    v = np.array([[0.0, 0, 0.5, 1], [1, 2, 3, 4]])
    np.testing.assert_allclose(aim.hessian_vector(u, v, **inputs), np.einsum("eij,ej->ei", hessian, v), rtol=1e-13)
    x = np.array([[0.0, 0, 0, 1, 0, 0, 0]])
    force, by_u, by_v = drag.force_jacobians(x, np.ones((1, 6)), c=2.0, d=[1.0, 0, 0])
    np.testing.assert_array_equal(force, [[-2, -2, -2, -1, -2, -2]])
    assert (by_u.shape, by_v.shape) == ((1, 6, 6), (1, 6, 6))
    with pytest.raises(ValueError, match=r"u: expected .*\(2, 5\)"):
        aim.value(u[:, :4], **inputs)
    with pytest.raises(TypeError, match="not only points of its own"):
        ed.System(3).add(aim, [[0]], **inputs)


def test_states_go_on():
    """A spring that yields keeps its permanent elongation."""
    text = """
    energy Plastic(x, y: Point; state e: Scalar[m]; k: Scalar[N/m], Y: Scalar[N]) {
        let trial = norm(x - y) - 1 * e;
        next { e = if k * trial > Y { trial + e - Y / k } else { e }; }
        k / 2 * trial^2
    }
    """
    [spring] = ed.energies(text)
    assert spring.state == ["e"]
    x = np.array([[[0.0, 0, 0], [1.2, 0, 0]], [[0, 0, 0], [1.01, 0, 0]]])
    state = spring.next(x, e=[1.0, 1.0], k=10.0, Y=0.5)
    np.testing.assert_allclose(state, [[1.15], [1.0]], rtol=1e-15)
    _, by_x, by_e = spring.next_jacobians(x, e=[1.0, 1.0], k=10.0, Y=0.5)
    assert (by_x.shape, by_e.shape) == ((2, 1, 6), (2, 1, 1))
    np.testing.assert_array_equal(by_e[:, 0, 0], [0, 1])
    slopes, by_e = spring.state_jacobian(x, e=state[:, 0], k=10.0, Y=0.5)
    np.testing.assert_allclose(slopes[0], [-0.5, 0, 0, 0.5, 0, 0], atol=1e-14)
    np.testing.assert_allclose(by_e[0, :, 0], [10, 0, 0, -10, 0, 0], atol=1e-13)
