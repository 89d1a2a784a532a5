"""Elements as functions of torch and JAX: derivatives are right, or refused by name."""

import numpy as np
import pytest

import energy_dsl as ed

SPRING = "energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }"
DRAG = "force Drag(p: Point, v: Velocity; c: Scalar) { -c * norm(v) * v * p.x }"
TWO = "residual Two(u: Vec3; L: Scalar) { [u.x - L, u.x * u.y] }"
X = np.random.default_rng(1).normal(size=(5, 2, 3))
K = np.linspace(1, 2, 5)


@pytest.fixture(scope="module")
def spring():
    return ed.energy(SPRING)


def exact(spring, x=X, k=2.0):
    """Returns U, ∂U/∂x and ∂²U/∂x² by the package itself."""
    U, g, H = spring.hessian(x, k=k, L=1.0)
    return U, g, H.reshape(len(x), 2, 3, 2, 3)


def whole(H):
    """Returns the Hessian of a sum of elements, (n, 2, 3, n, 2, 3)."""
    n = len(H)
    matrix = np.zeros((n, 2, 3, n, 2, 3))
    for i in range(n):
        matrix[i, :, :, i] = H[i]
    return matrix


def by_torch(x, **options):
    import torch

    return torch.tensor(x, **options)


class TestTorch:
    @pytest.fixture(autouse=True)
    def needs(self):
        pytest.importorskip("torch")

    @pytest.fixture
    def energy(self, spring):
        import energy_dsl.torch as edt

        return edt.function(spring, k=2.0, L=1.0)

    def test_first_and_second_derivatives(self, spring, energy):
        import torch

        U, g, H = exact(spring)
        x = by_torch(X, requires_grad=True)
        assert np.array_equal(energy(x).detach(), U)
        (found,) = torch.autograd.grad(energy(x).sum(), x)
        assert np.array_equal(found, g)
        assert torch.autograd.gradcheck(energy, x) and torch.autograd.gradgradcheck(energy, x)
        found = torch.autograd.functional.hessian(lambda x: energy(x).sum(), x)
        np.testing.assert_allclose(found, whole(H), rtol=1e-13, atol=1e-13)
        v = torch.ones_like(x)
        found = torch.autograd.functional.hvp(lambda x: energy(x).sum(), x, v)[1]
        np.testing.assert_allclose(found, np.einsum("niajb,njb->nia", H, v), rtol=1e-13, atol=1e-13)

    def test_transformations(self, spring, energy):
        import torch
        from torch import func

        U, g, H = exact(spring)
        x = by_torch(X)
        total = lambda x: energy(x).sum()
        ones = torch.ones_like(x)
        for one in (lambda x: func.grad(total)(x), lambda x: func.jacrev(total)(x), lambda x: func.jacfwd(total)(x)):
            np.testing.assert_allclose(one(x), g, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(func.jvp(energy, (x,), (ones,))[1], g.sum((1, 2)), rtol=1e-12, atol=1e-13)
        for two in (func.hessian, lambda f: func.jacrev(func.jacrev(f)), lambda f: func.jacrev(func.jacfwd(f))):
            np.testing.assert_allclose(two(total)(x), whole(H), rtol=1e-13, atol=1e-13)
        # One element at a time, batches of batches, and per-sample Hessians.
        assert np.array_equal(func.vmap(energy)(x), U)
        np.testing.assert_allclose(func.vmap(func.grad(energy))(x), g, rtol=1e-14)
        np.testing.assert_allclose(func.vmap(func.hessian(energy))(x), H, rtol=1e-13, atol=1e-14)
        both = torch.stack([x, x + 1, 2 * x], 1)
        assert np.array_equal(func.vmap(energy, in_dims=1)(both), torch.stack([energy(both[:, i]) for i in range(3)]))

    def test_one_parameter_for_each_element(self, spring):
        import energy_dsl.torch as edt
        import torch

        energy = edt.function(spring, k=torch.tensor(K), L=1.0)
        U, g, _ = exact(spring, k=K)
        x = by_torch(X)
        assert np.array_equal(energy(x), U)
        batch = torch.stack([x, x])
        assert np.array_equal(torch.func.vmap(energy)(batch), np.stack([U, U]))
        with pytest.raises(ValueError, match=r"x: expected shape \(…, 5, 2, 3\), got \(4, 2, 3\)"):
            energy(x[:4])

    def test_forces_and_residuals(self):
        import energy_dsl.torch as edt
        import torch

        drag, two = ed.energy(DRAG), ed.energy(TWO)
        force, residual = edt.function(drag, c=2.0), edt.function(two, L=0.5)
        x, v = by_torch(X[:, :1], requires_grad=True), by_torch(X[:, 1:], requires_grad=True)
        assert np.array_equal(force(x, v).detach(), drag.force(X[:, :1], X[:, 1:], c=2.0))
        assert torch.autograd.gradcheck(force, (x, v))
        assert torch.autograd.gradcheck(force, (x, v), check_forward_ad=True)
        u = by_torch(X[:, 0], requires_grad=True)
        assert torch.autograd.gradcheck(residual, u) and torch.autograd.gradcheck(residual, u, check_forward_ad=True)
        for function, arguments in ((force, (x, v)), (residual, (u,))):
            with pytest.raises(NotImplementedError, match="(Drag|Two): second derivatives are not available"):
                (g,) = torch.autograd.grad(function(*arguments).sum(), arguments[0], create_graph=True)
                torch.autograd.grad(g.sum(), arguments[0])

    def test_what_is_not_available_is_refused_by_name(self, spring, energy):
        import energy_dsl.torch as edt
        import torch

        with pytest.raises(NotImplementedError, match="Spring: third derivatives are not available"):
            x = by_torch(X, requires_grad=True)
            (g,) = torch.autograd.grad(energy(x).sum(), x, create_graph=True)
            (h,) = torch.autograd.grad(g.sum(), x, create_graph=True)
            torch.autograd.grad(h.sum(), x)
        with pytest.raises(NotImplementedError, match="Spring: third derivatives"):
            torch.func.jacrev(torch.func.hessian(lambda x: energy(x).sum()))(by_torch(X))
        # Torch loses tangents here and would return zero.
        for two in (
            lambda f, x: torch.func.jacfwd(torch.func.jacfwd(f))(x),
            lambda f, x: torch.func.jvp(lambda x: torch.func.jvp(f, (x,), (x,))[1], (x,), (x,)),
            lambda f, x: torch.func.jacfwd(torch.func.jacfwd(torch.func.jacrev(f)))(x),
        ):
            with pytest.raises(NotImplementedError, match="Spring: forward mode over forward mode is not available"):
                two(lambda x: energy(x).sum(), by_torch(X))
        with pytest.raises(TypeError, match="the input `k` requires a gradient"):
            edt.function(spring, k=torch.tensor(2.0, requires_grad=True), L=1.0)
        with pytest.raises(TypeError, match="expected an element and its inputs"):
            edt.function(spring.bind(5, k=1.0, L=1.0))
        with pytest.raises(TypeError, match="missing parameter `L`"):
            edt.function(spring, k=1.0)

    def test_single_precision(self, spring, energy):
        import torch

        found = energy(by_torch(X.astype("f4")))
        assert found.dtype == torch.float32
        np.testing.assert_allclose(found, exact(spring)[0], rtol=1e-4, atol=1e-5)

    def test_arrays_are_exchanged(self, spring):
        import torch

        U = spring.value(by_torch(X), k=2.0, L=1.0)
        assert np.array_equal(U, exact(spring)[0])
        assert torch.from_dlpack(U).data_ptr() == U.ctypes.data, "without a copy"


class TestJax:
    @pytest.fixture(autouse=True)
    def needs(self):
        jax = pytest.importorskip("jax")
        jax.config.update("jax_enable_x64", True)
        yield
        jax.config.update("jax_enable_x64", False)

    @pytest.fixture
    def energy(self, spring):
        import energy_dsl.jax as edj

        return edj.function(spring, k=2.0, L=1.0)

    def test_first_and_second_derivatives(self, spring, energy):
        import jax
        import jax.numpy as jnp

        U, g, H = exact(spring)
        total = lambda x: energy(x).sum()
        x, ones = jnp.asarray(X), jnp.ones((5, 2, 3))
        assert np.array_equal(energy(x), U)
        for one in (jax.grad(total), jax.jit(jax.grad(total)), jax.jacfwd(total), jax.jacrev(total)):
            np.testing.assert_allclose(one(x), g, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(jax.jvp(energy, (x,), (ones,))[1], g.sum((1, 2)), rtol=1e-12, atol=1e-13)
        twice = (jax.hessian(total), jax.jit(jax.hessian(total)), jax.jacrev(jax.jacrev(total)))
        for two in (*twice, jax.jacfwd(jax.jacfwd(total)), jax.jacrev(jax.jacfwd(total))):
            np.testing.assert_allclose(two(x), whole(H), rtol=1e-13, atol=1e-13)
        product = jax.jvp(jax.grad(total), (x,), (ones,))[1]
        np.testing.assert_allclose(product, H.sum((3, 4)), rtol=1e-12, atol=1e-13)

    def test_transformations(self, spring, energy):
        import jax
        import jax.numpy as jnp

        U, g, H = exact(spring)
        x = jnp.asarray(X)
        for wrap in (lambda f: f, jax.jit):
            assert np.array_equal(wrap(jax.vmap(energy))(x), U)
            np.testing.assert_allclose(wrap(jax.vmap(jax.grad(energy)))(x), g, rtol=1e-14)
            np.testing.assert_allclose(wrap(jax.vmap(jax.hessian(energy)))(x), H, rtol=1e-13, atol=1e-14)
        both = jnp.stack([x, x + 1, 2 * x], 1)
        expected = jnp.stack([energy(both[:, i]) for i in range(3)])
        assert np.array_equal(jax.vmap(energy, in_axes=1)(both), expected)
        assert np.array_equal(jax.lax.map(energy, x), U)

        def step(x, _):
            return x - 0.1 * jax.grad(lambda x: energy(x).sum())(x), energy(x).sum()

        energies = jax.jit(lambda x: jax.lax.scan(step, x, None, 20)[1])(x)
        assert np.all(np.diff(energies) < 0)

    def test_one_parameter_for_each_element(self, spring):
        import energy_dsl.jax as edj
        import jax
        import jax.numpy as jnp

        energy = edj.function(spring, k=jnp.asarray(K), L=1.0)
        U, g, _ = exact(spring, k=K)
        x = jnp.asarray(X)
        assert np.array_equal(energy(x), U)
        assert np.array_equal(jax.vmap(energy)(jnp.stack([x, x])), np.stack([U, U]))
        with pytest.raises(ValueError, match=r"x: expected shape \(…, 5, 2, 3\), got \(4, 2, 3\)"):
            energy(x[:4])

    def test_forces_and_residuals(self):
        import energy_dsl.jax as edj
        import jax
        import jax.numpy as jnp
        from jax.test_util import check_grads

        drag, two = ed.energy(DRAG), ed.energy(TWO)
        force, residual = edj.function(drag, c=2.0), edj.function(two, L=0.5)
        x, v, u = jnp.asarray(X[:, :1]), jnp.asarray(X[:, 1:]), jnp.asarray(X[:, 0])
        assert np.array_equal(force(x, v), drag.force(X[:, :1], X[:, 1:], c=2.0))
        assert np.array_equal(residual(u), two.residual(X[:, 0], L=0.5))
        check_grads(force, (x, v), order=1, atol=1e-6, rtol=1e-6)
        check_grads(residual, (u,), order=1, atol=1e-6, rtol=1e-6)
        # v is not mapped.
        mapped = jax.vmap(force, in_axes=(0, None))(jnp.stack([x, 2 * x]), v)
        assert np.array_equal(mapped, jnp.stack([force(x, v), force(2 * x, v)]))
        for function, arguments in ((force, (x, v)), (residual, (u,))):
            with pytest.raises(NotImplementedError, match="(Drag|Two): second derivatives are not available"):
                jax.hessian(lambda *arguments: function(*arguments).sum())(*arguments)

    def test_what_is_not_available_is_refused_by_name(self, spring, energy):
        import energy_dsl.jax as edj
        import jax
        import jax.numpy as jnp

        with pytest.raises(NotImplementedError, match="Spring: third derivatives are not available"):
            jax.jacfwd(jax.hessian(lambda x: energy(x).sum()))(jnp.asarray(X))
        with pytest.raises(TypeError, match="the input `k` is traced"):
            jax.grad(lambda k: edj.function(spring, k=k, L=1.0)(jnp.asarray(X)).sum())(2.0)

    def test_single_precision(self, spring, energy):
        import jax
        import jax.numpy as jnp

        jax.config.update("jax_enable_x64", False)
        found = jax.jit(energy)(jnp.asarray(X, jnp.float32))
        assert found.dtype == jnp.float32
        np.testing.assert_allclose(found, exact(spring)[0], rtol=1e-4, atol=1e-5)

    def test_arrays_are_exchanged(self, spring):
        import jax.numpy as jnp

        U = spring.value(jnp.asarray(X), k=2.0, L=1.0)
        assert np.array_equal(U, exact(spring)[0]) and np.array_equal(jnp.from_dlpack(U), U)
