"""The examples give right answers: the hanging sheet is that of NumPy to 1e-12, and vertex descent descends."""

import importlib
import importlib.util
import sys
from pathlib import Path

import numpy as np
import warp as wp

wp.config.quiet = True
wp.set_device("cpu")
sys.path.insert(0, str(Path(__file__).parents[3] / "python" / "examples" / "warp"))


def membrane(x, rest, mu, lam):
    """Gradient and Hessian of A (mu |E|^2 + lam/2 tr(E)^2) by hand: one triangle."""
    edges = np.stack([rest[1] - rest[0], rest[2] - rest[0]], 1)
    inverse, area = np.linalg.inv(edges), np.linalg.det(edges) / 2
    chain = np.zeros((3, 2))  # F = x^T chain
    chain[1:], chain[0] = inverse, -inverse.sum(0)
    F = x.T @ chain
    E = (F.T @ F - np.eye(2)) / 2
    S = 2 * mu * E + lam * np.trace(E) * np.eye(2)
    gradient = area * (F @ S @ chain.T).T
    hessian = np.zeros((9, 9))
    for k in range(9):
        dx = np.zeros(9)
        dx[k] = 1
        dF = dx.reshape(3, 3).T @ chain
        dE = (dF.T @ F + F.T @ dF) / 2
        dS = 2 * mu * dE + lam * np.trace(dE) * np.eye(2)
        hessian[:, k] = area * ((dF @ S + F @ dS) @ chain.T).T.ravel()
    return gradient, hessian


def by_hand(tris, X, mass, pinned, mu, lam, g):
    x = np.insert(X, 1, 0.0, axis=1)
    free = np.repeat(~pinned, 3)
    for _ in range(30):
        gradient, hessian = -mass[:, None] * g, np.zeros((3 * len(x), 3 * len(x)))
        for tri in tris:
            own, block = membrane(x[tri], X[tri], mu, lam)
            gradient[tri] += own
            places = (3 * tri[:, None] + np.arange(3)).ravel()
            hessian[np.ix_(places, places)] += block
        # At rest, nothing resists moves out of the plane, and nothing pushes there.
        step = np.linalg.lstsq(hessian[np.ix_(free, free)], gradient.ravel()[free], rcond=None)[0]
        moved = x.ravel().copy()
        moved[free] -= step
        x = moved.reshape(-1, 3)
        if np.abs(step).max() < 1e-15:
            break
    return x


newton = importlib.import_module("newton")
found = newton.solve()
tris, X, mass = newton.sheet()
mu, lam, g = float(newton.MU), float(newton.LAMBDA), np.array(newton.G)
truth = by_hand(tris, X, mass, X[:, 1] == newton.SIDE, mu, lam, g)
error = np.abs(found - truth).max() / newton.SIDE
assert error < 1e-12, error
# The sheet did stretch, so the solutions agree about something.
assert np.abs(truth - np.insert(X, 1, 0.0, axis=1)).max() > 0.01 * newton.SIDE
print(f"hanging sheet: {error:.1e} of its length")

if importlib.util.find_spec("jax"):
    under_jit = importlib.import_module("jax_sheet")
    start, x, steps = under_jit.hanging()
    error = np.abs(np.array(x) - found).max() / newton.SIDE
    assert error < 1e-12 and steps > 1, (error, steps)
    # The adjoint of the energy's kernel is the generated gradient; nothing moves the pinned points.
    bent = start + 0.01 * start**2
    slopes = np.where(under_jit.FREE, under_jit.jax.grad(under_jit.energy)(bent), 0.0)
    wanted = np.array(under_jit.gradient(bent))
    assert np.abs(slopes - wanted).max() < 1e-15 and np.abs(wanted).max() > 1e-3, np.abs(slopes - wanted).max()
    print(f"under jax.jit: {error:.1e} of its length, after {steps} steps")
else:
    print("skipped: jax_sheet.py, as there is no jax")

history = importlib.import_module("vertex_descent").solve()
assert all(after <= before for before, after in zip(history, history[1:], strict=False)), history
assert history[-1] < history[0] - 1e-6, history
print("vertex descent: the energy falls in each sweep")
