#!/usr/bin/env python3
"""Counts the operations of the tetrahedra in `short_hessians.rs` as SymPy writes them: common subexpressions of value,
gradient and upper triangle of the Hessian, with respect to the nine coordinates D of F = D B.

    pip install sympy && python3 count_with_sympy.py
"""

import sympy as sp

F = sp.Matrix(3, 3, sp.symbols("f0:9"))
A = sp.Matrix(3, 3, sp.symbols("a0:9"))
d, e = (sp.Matrix(sp.symbols(f"{name}0:3")) for name in "uv")
μ, λ, κ, a, b, c, k = sp.symbols("μ λ κ a b c k", positive=True)


def ddot(x, y):
    return sum(p * q for p, q in zip(x, y))


I = sp.eye(3)
C = F.T * F
E = (C - I) / 2
ε = (F + F.T) / 2 - I
J = F.row(0).dot(F.row(1).cross(F.row(2)))
G = F.adjugate() / J
I1 = C.trace()
I2 = (I1**2 - ddot(C, C)) / 2
p, q = (v.dot(C * v) - 1 for v in (d, e))
n = F.T.adjugate() * sp.Matrix([0, 0, 1])
third = sp.Rational(1, 3)

POTENTIALS = {
    "NeoHookean": μ / 2 * (ddot(F, F) - 3) - μ * sp.log(J) + λ / 2 * sp.log(J) ** 2,
    "MooneyRivlin": μ * (I1 * J ** (-2 * third) - 3) + λ * (I2 * J ** (-4 * third) - 3) + κ * (J - 1) ** 2,
    "Fung": a * (sp.exp(b * ddot(E, E)) - 1),
    "Fibres": c * (I1 - 3) + a / (2 * b) * (sp.exp(b * p**2) + sp.exp(b * q**2) - 2),
    "Conformal": k * ddot(F, F) / J ** (2 * third),
    "Cofactors": k * ddot(F.adjugate(), F.adjugate()) / J**2 + k * ddot(F, F),
    "StVenantKirchhoff": μ * ddot(E, E) + λ / 2 * E.trace() ** 2,
    "Biderman": a * (I1 - 3) + b * (I1 - 3) ** 2 + c * (I1 - 3) ** 3 + (J - 1) ** 2,
    "Anisotropic": k * ddot(A * C, C * A),
    "SmallStrain": μ * ddot(ε, ε) + λ / 2 * ε.trace() ** 2,
    "Face": k * n.dot(n),
    "SymmetricDirichlet": k * (ddot(F, F) + ddot(G, G)),
    "Opposite": k * ddot(F - G.T, F - G.T),
}


def operations(potential):
    D, B = (sp.Matrix(3, 3, sp.symbols(f"{name}0:9")) for name in "DB")
    potential = potential.subs(dict(zip(F, D * B)))
    gradient = [sp.diff(potential, x) for x in D]
    hessian = [sp.diff(gradient[i], D[j]) for i in range(9) for j in range(i, 9)]
    shared, results = sp.cse([potential, *gradient, *hessian])
    return sum(sp.count_ops(expression) for expression in [x for _, x in shared] + results)


for name, potential in POTENTIALS.items():
    print(f"{name:20} {operations(potential):5}", flush=True)
