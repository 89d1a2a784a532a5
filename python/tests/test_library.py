"""Elements of the library: compiled code has the bits of tapes, in both precisions."""

import numpy as np
import pytest

import energy_dsl as ed

#: Sound rest shapes, by the number of coordinates of all points.
REST = {
    6: [0, 0, 1, 0.25, 0.25, 1],
    12: [0, 0, 0, 1, 0.25, 0, 0, 1, 0.25, 0.25, 0, 1],
    18: [0, 0, 0, 1, 0, 0, 0.25, 1, 0, 1, 1, 0, -0.75, 0.75, 0, 0.5, -1, 0],
}
PLATE = [0.5, -1, 0, 0.25, 0.75, 0, 0, 0, 0, 1, 0, 0]


def inputs(element, count, draw):
    """Returns rest shapes and parameters of `count` elements."""
    rest = [i for i in element.inputs if i.kind == "rest"]
    size = sum(int(np.prod(i.shape)) for i in rest)
    flat = np.asarray(REST.get(size, []), float)
    if size == 12 and not element.name.startswith("Tet"):
        flat = np.asarray(PLATE, float)
    shapes = flat + 0.05 * draw.uniform(-1, 1, (count, size))
    given, first = {}, 0
    for i in element.inputs:
        if i.kind == "rest":
            length = int(np.prod(i.shape))
            given[i.name] = shapes[:, first : first + length].reshape(count, *i.shape)
            first += length
        elif i.kind == "parameter":
            given[i.name] = 1 + 0.5 * draw.uniform(-1, 1, (count, *i.shape))
    return given


def routines(element):
    if element.kind == "residual":
        return ["residual", "jacobian"]
    if element.kind == "force":
        return ["force", "force_jacobians"]
    return ["value", "gradient", "hessian", "hessian_vector"]


def is_compiled(name):
    element = ed.element(name)
    return element.bind(1, **inputs(element, 1, np.random.default_rng(1))).is_compiled


#: A package that was built without the feature `compiled` has tapes only.
compiled_code = pytest.mark.skipif(not is_compiled("HookeSpring"), reason="built without compiled elements")


@compiled_code
def test_all_but_the_largest_elements_are_compiled():
    tapes = [name for name in ed.catalogue() if not is_compiled(name)]
    assert is_compiled("QuadraticHinge") and is_compiled("StVK") and is_compiled("HairBend"), tapes
    assert "TetCorotational" in tapes and len(tapes) < 30, tapes


@compiled_code
@pytest.mark.parametrize("name", ed.catalogue())
def test_compiled_code_has_the_bits_of_tapes(name):
    compiled = ed.element(name)
    if not is_compiled(name):
        pytest.skip("too large to be compiled")
    # Texts of files have no combining marks (x̃).
    plain = lambda text: text.replace("\u0303", "2")
    tape = ed.energy(plain(compiled.source))
    draw = np.random.default_rng(1)
    for dtype, count in (("f8", 37), ("f4", 37), ("f8", 1)):
        given = inputs(compiled, count, draw)
        width = (compiled.unknowns,) if compiled.kind == "residual" else (compiled.points, 3)
        x, v = draw.normal(size=(2, count, *width)).astype(dtype)
        # One element with all points at the same place, which takes the general path.
        x[0] = 0.5
        renamed = {plain(key): value for key, value in given.items()}
        a, b = compiled.bind(count, dtype, **given), tape.bind(count, dtype, **renamed)
        assert not b.is_compiled and a.dtype == b.dtype == np.dtype(dtype).name
        for routine in routines(compiled):
            arguments = (x, v) if routine in ("hessian_vector", "force", "force_jacobians") else (x,)
            found = getattr(a, routine)(*arguments, flags=True)
            expected = getattr(b, routine)(*arguments, flags=True)
            for one, other in zip(found, expected):
                assert one.dtype == other.dtype and np.array_equal(one, other, equal_nan=True), (routine, dtype)


def test_the_library_is_the_one_of_rust():
    names = ed.catalogue()
    assert names == sorted(names) and {"HingeAngle", "StVK", "PointToPlane", "ViscousDrag"} <= set(names)
    assert ed.element("StVK") is ed.element("StVK")
    with pytest.raises(KeyError, match="catalogue"):
        ed.element("Sprong")


def test_precision_follows_the_positions():
    spring, draw = ed.element("HookeSpring"), np.random.default_rng(3)
    x = draw.normal(size=(50, 2, 3))
    U, g, H = spring.hessian(x, K=2, L=1)
    u, f, h = spring.hessian(x.astype("f4"), K=2, L=1)
    assert U.dtype == np.float64 and {u.dtype, f.dtype, h.dtype} == {np.dtype("f4")}
    np.testing.assert_allclose(h, H, rtol=1e-4, atol=1e-4)
    single = spring.bind(50, "f4", K=2, L=1)
    assert np.array_equal(single.value(x), u) and np.array_equal(single.value(x.astype("f4")), u)
    out = np.empty(50, "f4")
    assert single.value(x, out=out) is out and np.array_equal(out, u)
    with pytest.raises(TypeError, match="dtype float32, got dtype float64"):
        single.value(x, out=np.empty(50))
    with pytest.raises(TypeError, match="dtype: expected float64 or float32, got int32"):
        spring.bind(50, "i4", K=2, L=1)
