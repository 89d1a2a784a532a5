#!/usr/bin/env python3
"""Makes a skirt and a body as a modeller would export them: texture coordinates, normals, groups, and the vertices
along the side seams doubled.

    python3 scenes/garment/make.py
    cloth run scenes/garment/skirt.toml -o out/skirt

The skirt is a cone of two panels. Its texture coordinates are the panels laid flat, in metres, so that a scene can
take them as patterns.
"""

from math import asin, cos, pi, sin, sqrt
from pathlib import Path

FOLDER = Path(__file__).parent

# The skirt, in m: radii of waist and hem, height. Columns of a panel, rows of quads, rows of the waistband and of the
# hem.
WAIST, HEM, HEIGHT = 0.115, 0.225, 0.5
COLUMNS, ROWS, BAND = 20, 18, 2

# The body, a surface of revolution: (height, radius), from its top to its bottom. Columns around it.
PROFILE = [(0.10, 0.0), (0.095, 0.05), (0.06, 0.085), (0.0, 0.1), (-0.06, 0.11), (-0.12, 0.125), (-0.18, 0.132),
           (-0.24, 0.125), (-0.3, 0.11), (-0.35, 0.08), (-0.38, 0.04), (-0.39, 0.0)]
AROUND = 32


class Obj:
    """The text of an OBJ file."""

    def __init__(self, name):
        self.lines = [f"# {name}, made by make.py. Lengths in m, z up.", f"mtllib {name}.mtl", f"o {name}"]
        self.vertices = 0

    def vertex(self, position, uv, normal):
        """Adds a vertex with its texture coordinates and normal, and returns its number."""
        for keyword, numbers in [("v", position), ("vt", uv), ("vn", normal)]:
            self.lines.append(" ".join([keyword, *(f"{number:.6f}" for number in numbers)]))
        self.vertices += 1
        return self.vertices

    def face(self, corners):
        self.lines.append(" ".join(["f", *(f"{corner}/{corner}/{corner}" for corner in corners)]))

    def write(self, path):
        path.write_text("\n".join(self.lines) + "\n", encoding="utf-8")


def skirt():
    """Returns a cone of two panels, open at the top and at the bottom."""
    obj = Obj("skirt")
    slant = sqrt(HEIGHT**2 + (HEM - WAIST) ** 2)
    slope = (HEM - WAIST) / slant
    for panel, (name, first) in enumerate([("front", -pi), ("back", 0.0)]):
        numbers = {}
        for row in range(ROWS + 1):
            part = row / ROWS
            radius, height = WAIST + part * (HEM - WAIST), -part * HEIGHT
            for column in range(COLUMNS + 1):
                turn = pi * column / COLUMNS
                angle = first + turn
                # The cone laid flat: points at the distance from its tip, the turn shrunk by the sine of its angle.
                along, flat = radius / slope, slope * (turn - pi / 2)
                uv = (along * sin(flat) + 1.2 * panel, -along * cos(flat))
                lean = cos(asin(slope))
                normal = (lean * cos(angle), lean * sin(angle), slope)
                position = (radius * cos(angle), radius * sin(angle), height)
                numbers[row, column] = obj.vertex(position, uv, normal)
        for row in range(ROWS):
            band = "waistband" if row < BAND else "hem" if row >= ROWS - BAND else "hip"
            obj.lines += [f"g {name} {band}", "usemtl cotton", "s 1"]
            for column in range(COLUMNS):
                corners = [(row, column), (row + 1, column), (row + 1, column + 1), (row, column + 1)]
                obj.face([numbers[corner] for corner in corners])
    return obj


def body():
    """Returns a closed surface of revolution."""
    obj = Obj("body")
    numbers = []
    for height, radius in PROFILE:
        around = 1 if radius == 0.0 else AROUND
        ring = []
        for column in range(around):
            angle = 2 * pi * column / AROUND
            normal = (cos(angle), sin(angle), 0.0) if radius else (0.0, 0.0, 1.0 if height > 0 else -1.0)
            position = (radius * cos(angle), 0.85 * radius * sin(angle), height)
            ring.append(obj.vertex(position, (column / AROUND, height), normal))
        numbers.append(ring)
    for upper, lower in zip(numbers, numbers[1:]):
        for column in range(AROUND):
            after = (column + 1) % AROUND
            if len(upper) == 1:
                obj.face([upper[0], lower[column], lower[after]])
            elif len(lower) == 1:
                obj.face([upper[column], lower[0], upper[after]])
            else:
                obj.face([upper[column], lower[column], lower[after], upper[after]])
    return obj


if __name__ == "__main__":
    skirt().write(FOLDER / "skirt.obj")
    body().write(FOLDER / "body.obj")
