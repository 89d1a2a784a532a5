"""Newton's method in twenty lines: a chain of springs hangs between two pins."""

import numpy as np
from scipy.sparse import eye_array
from scipy.sparse.linalg import spsolve

import energy_dsl as ed

n = 50
system = ed.System(n, pinned=[0, n - 1])
spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
weight = ed.energy("energy Weight(p: Point; w: Scalar) { w * p.z }")
system.add(spring, [[i, i + 1] for i in range(n - 1)], k=1e3, L=1.2 / (n - 1))
system.add(weight, [[i] for i in range(n)], w=0.02)

x = np.zeros((n, 3))
x[:, 0] = np.linspace(0, 1, n)
x[1:-1, 2] = -0.05
free = system.free
for iteration in range(100):
    U, g, H = system.linearise(x, curvature="clamped")
    print(f"{iteration:3}  U = {U:.6f} J  |g| = {np.abs(g[free]).max():.1e} N")
    if np.abs(g[free]).max() < 1e-9:
        break
    # A slack chain has no stiffness across; a little keeps the matrix regular.
    H = H.tocsc() + 1e-4 * eye_array(H.shape[0], format="csc")
    step, length = -spsolve(H, g[free].ravel()).reshape(-1, 3), 1.0
    trial = x.copy()
    trial[free] += step
    while system.energy(trial) > U and length > 1e-9:
        length /= 2
        trial[free] = x[free] + length * step
    x = trial
print(f"The chain sags by {-x[:, 2].min():.3f} m.")
