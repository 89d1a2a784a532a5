"""An energy as a differentiable function of torch: gradient descent, then Newton's method."""

import numpy as np
import torch

import energy_dsl as ed
import energy_dsl.torch as edt

spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
energy = edt.function(spring, k=2.0, L=1.0)

x = torch.from_numpy(np.random.default_rng(1).normal(size=(100, 2, 3))).requires_grad_()
optimiser = torch.optim.SGD([x], lr=0.2)
for _ in range(50):
    optimiser.zero_grad()
    U = energy(x).sum()
    U.backward()  # type: ignore[no-untyped-call]
    optimiser.step()
print(f"gradient descent: U = {U.item():.2e} J")

# One Hessian for each spring. A spring is free to move and to turn, so the Hessian has a pseudo-inverse.
hessians = torch.func.vmap(torch.func.hessian(energy))
x = x.detach() + 0.1
x[:, 1] *= 1.2
for _ in range(5):
    gradient = torch.func.grad(lambda x: energy(x).sum())(x).reshape(100, 6, 1)
    x = x - (torch.linalg.pinv(hessians(x).reshape(100, 6, 6), rtol=1e-9) @ gradient).reshape(100, 2, 3)
print(f"Newton's method: U = {energy(x).sum().item():.2e} J")
