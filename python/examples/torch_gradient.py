"""A custom gradient for torch: an energy of the package as a differentiable function of positions."""

import numpy as np
import torch

import energy_dsl as ed


class Energy(torch.autograd.Function):
    """Σ U of bound elements."""

    @staticmethod
    def forward(ctx, x, elements):
        U, g = elements.gradient(x.detach().numpy())
        ctx.save_for_backward(torch.from_numpy(g))
        return torch.tensor(U.sum(), dtype=x.dtype)

    @staticmethod
    def backward(ctx, weight):
        (g,) = ctx.saved_tensors
        return weight * g, None


spring = ed.energy("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }")
x = torch.from_numpy(np.random.default_rng(1).normal(size=(100, 2, 3))).requires_grad_()
springs = spring.bind(100, k=2.0, L=1.0)
optimiser = torch.optim.SGD([x], lr=0.2)
for _ in range(50):
    optimiser.zero_grad()
    U = Energy.apply(x, springs)
    U.backward()
    optimiser.step()
print(f"U = {U.item():.2e} J")
