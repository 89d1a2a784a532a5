#!/usr/bin/env python3
"""Counts the operations of the formulas in `short_hessians.rs` as SymPy writes them: common subexpressions of value,
gradient and upper triangle of the Hessian. Tetrahedra are differentiated by the nine coordinates D of F = D B, the
formulas of `formulas/of_points.energy` by the differences of points to the first one.

    pip install sympy && python3 count_with_sympy.py
"""

import pathlib
import re

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


def operations(potential, unknowns):
    gradient = [sp.diff(potential, x) for x in unknowns]
    n = len(unknowns)
    hessian = [sp.diff(gradient[i], unknowns[j]) for i in range(n) for j in range(i, n)]
    shared, results = sp.cse([potential, *gradient, *hessian])
    return sum(sp.count_ops(expression) for expression in [x for _, x in shared] + results)


def of_tetrahedron(potential):
    D, B = (sp.Matrix(3, 3, sp.symbols(f"{name}0:9")) for name in "DB")
    return operations(potential.subs(dict(zip(F, D * B))), list(D))


FUNCTIONS = {
    "norm": lambda v: sp.sqrt(v.dot(v)),
    "unit": lambda v: v / sp.sqrt(v.dot(v)),
    "norm_squared": lambda v: v.dot(v),
    "dot": lambda x, y: x.dot(y),
    "cross": lambda x, y: x.cross(y),
    "angle": lambda x, y: sp.atan2(sp.sqrt(x.cross(y).dot(x.cross(y))), x.dot(y)),
    "columns": lambda *v: sp.Matrix.hstack(*v),
    "det": lambda x: x.det(method="berkowitz"),
    "inverse": lambda x: x.adjugate() / x.det(method="berkowitz"),
    "transpose": lambda x: x.T,
    "trace": lambda x: x.trace(),
    "identity": sp.eye,
    "ddot": ddot,
    "exp": sp.exp,
    "log": sp.log,
    "sqrt": sp.sqrt,
}
SHAPES = {"Scalar": (1, 1), "Vec3": (3, 1), "Mat2x2": (2, 2), "Mat3x3": (3, 3)}


def of_points(inputs, formula):
    """Returns the operations of a formula in the language: but for `let` and `^`, it is Python."""
    known, unknowns = dict(FUNCTIONS), []
    for number, part in enumerate(inputs.split(";")):
        names, kind = part.replace("rest", "").split(":")
        for place, name in enumerate(names.replace(" ", "").split(",")):
            if number == 0:
                point = sp.Matrix(sp.symbols(f"{name}_0:3", real=True)) if place else sp.zeros(3, 1)
                known[name] = point
                unknowns += list(point) if place else []
                continue
            rows, columns = SHAPES[kind.strip()]
            symbols = sp.symbols(f"{name}_0:{rows * columns}", real=True, positive=kind.strip() == "Scalar")
            known[name] = symbols[0] if rows == 1 else sp.Matrix(rows, columns, symbols)
    formula = re.sub(r"\[(\d)\]\[(\d)\]", r"[\1, \2]", formula.replace("^", "**"))
    *statements, result = (" ".join(part.split()) for part in formula.split(";"))
    for statement in statements:
        name, value = statement.replace("let", "").split("=", 1)
        known[name.strip()] = eval(value, known)
    return operations(eval(result, known), unknowns)


for name, potential in POTENTIALS.items():
    print(f"{name:20} {of_tetrahedron(potential):5}", flush=True)
FOLDER = pathlib.Path(__file__).parent / "formulas"
DECLARATION = re.compile(r"// (\d+)\nenergy (\w+)\((.*?)\) {\n(?: *rest {(.*?);? }\n)?(.*?)\n}\n", re.DOTALL)
for recorded, name, inputs, rest, formula in DECLARATION.findall((FOLDER / "of_points.energy").read_text()):
    formula = f"{rest};{formula}" if rest else formula
    print(f"{name:20} {of_points(inputs, formula):5}, recorded {recorded}", flush=True)
