#!/usr/bin/env python3
"""Makes the ropes and the funnel of the scenes in this folder.

    python3 scenes/contact/make.py
    cloth run scenes/contact/knot.toml -o out/knot
    cloth run scenes/contact/funnel.toml -o out/funnel

The ropes are closed tubes along smooth curves: one is a bight, the other comes up through it, goes around both of its
legs, and leaves as it came. The funnel is a thick shell of revolution.
"""

from math import cos, dist, hypot, pi, sin, sqrt
from pathlib import Path

FOLDER = Path(__file__).parent

# The ropes, in m: radius, and half the distance of the legs of the bight. Rings along a rope, corners of a ring.
RADIUS, KNOT = 0.005, 0.04
RINGS, CORNERS = 72, 6
# Half of each rope, in units of KNOT; the other half is its mirror image at y = 0.
BIGHT = [(-5, 1, 0), (-3, 1, 0), (-1, 1, 0), (0, 1, 0), (0.7, 0.95, 0), (1.1, 0.6, 0), (1.2, 0, 0)]
AROUND = [(5, 0.5, 0), (3.5, 0.5, 0), (2.2, 0.5, -0.3), (1.1, 0.5, -0.6), (0.4, 0.6, 0), (0, 1, 0.6), (-0.5, 1.55, 0),
          (-1, 1, -0.6), (-1.2, 0, -0.6)]

# The funnel, in m: (height, radius) of its inner side from the rim down, and the thickness of its wall.
FUNNEL = [(0.30, 0.34), (0.22, 0.265), (0.14, 0.19), (0.07, 0.125), (0.02, 0.092), (-0.03, 0.078), (-0.10, 0.075),
          (-0.18, 0.075)]
WALL, AROUND_FUNNEL = 0.012, 40


def mirrored(half):
    """Returns the points of a whole rope, in m."""
    whole = half + [(x, -y, z) for x, y, z in reversed(half[:-1])]
    return [tuple(KNOT * c for c in point) for point in whole]


def spline(points, per_span=20):
    """Returns points of the Catmull-Rom spline."""
    curve = []
    for span in range(len(points) - 1):
        a, b, c, d = (points[min(max(span + k, 0), len(points) - 1)] for k in (-1, 0, 1, 2))
        for k in range(per_span):
            t = k / per_span
            weights = (0.5 * t * (-1 + t * (2 - t)), 0.5 * (2 + t * t * (3 * t - 5)), 0.5 * t * (1 + t * (4 - 3 * t)),
                       0.5 * t * t * (t - 1))
            curve.append(tuple(sum(w * p[axis] for w, p in zip(weights, (a, b, c, d))) for axis in range(3)))
    return curve + [points[-1]]


def even(curve, count):
    """Returns count + 1 points at equal distances along a polygon."""
    lengths = [0.0]
    for p, q in zip(curve, curve[1:]):
        lengths.append(lengths[-1] + dist(p, q))
    points, at = [], 0
    for number in range(count + 1):
        along = lengths[-1] * number / count
        while at < len(curve) - 2 and lengths[at + 1] < along:
            at += 1
        part = (along - lengths[at]) / (lengths[at + 1] - lengths[at])
        points.append(tuple(p + part * (q - p) for p, q in zip(curve[at], curve[at + 1])))
    return points


def unit(v):
    size = sqrt(sum(c * c for c in v))
    return tuple(c / size for c in v)


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def tube(half):
    """Returns the vertices of a tube, ring by ring, then the middles of both ends. Rings turn as little as possible."""
    line = even(spline(mirrored(half)), RINGS)
    across, vertices = (0.0, 0.0, 1.0), []
    for at, middle in enumerate(line):
        before, after = line[max(at - 1, 0)], line[min(at + 1, RINGS)]
        along = unit(tuple(q - p for p, q in zip(before, after)))
        side = unit(cross(along, across))
        across = cross(side, along)
        for corner in range(CORNERS):
            angle = 2 * pi * corner / CORNERS
            vertices.append(tuple(m + RADIUS * (cos(angle) * s + sin(angle) * u)
                                  for m, s, u in zip(middle, side, across)))
    return vertices + [line[0], line[-1]]


def outwards(faces):
    """Returns the faces seen from the other side."""
    return [face[::-1] for face in faces]


def caps():
    """Returns the triangles that close a tube."""
    last, ends = RINGS * CORNERS, (RINGS + 1) * CORNERS
    faces = []
    for corner in range(CORNERS):
        after = (corner + 1) % CORNERS
        faces += [(ends + 1, corner + 1, after + 1), (ends + 2, last + after + 1, last + corner + 1)]
    return faces


def rings(count, around, first, ends=False):
    """Returns the quads between rings of vertices, the last ring joined to the first if `ends`."""
    faces = []
    for ring in range(count if ends else count - 1):
        for corner in range(around):
            at = lambda down, right: first + (ring + down) % count * around + (corner + right) % around
            faces.append((at(0, 0), at(0, 1), at(1, 1), at(1, 0)))
    return faces


def write(name, objects):
    """Writes an OBJ file of named objects, each with vertices and faces."""
    lines = [f"# {name}, made by make.py. Lengths in m, z up."]
    for title, vertices, faces in objects:
        lines.append(f"o {title}")
        lines += ["v " + " ".join(f"{c:.5f}" for c in vertex) for vertex in vertices]
        lines += ["f " + " ".join(str(corner) for corner in face) for face in faces]
    (FOLDER / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def ropes():
    count, first = RINGS + 1, 1
    for name, half in (("bight", BIGHT), ("around", AROUND)):
        write(f"{name}.obj", [(name, tube(half), outwards(rings(count, CORNERS, first)) + caps())])


def funnel():
    """The section of the wall is a closed polygon: the inner side down, the outer side up."""
    outer = []
    for at, (height, radius) in enumerate(FUNNEL):
        before, after = FUNNEL[max(at - 1, 0)], FUNNEL[min(at + 1, len(FUNNEL) - 1)]
        down, inwards = after[0] - before[0], after[1] - before[1]
        size = hypot(down, inwards)
        # The normal of the inner side, away from the axis.
        outer.append((height + WALL * inwards / size, radius - WALL * down / size))
    section = FUNNEL + outer[::-1]
    around = AROUND_FUNNEL
    vertices = [(radius * cos(2 * pi * k / around), radius * sin(2 * pi * k / around), height)
                for height, radius in section for k in range(around)]
    write("funnel.obj", [("funnel", vertices, rings(len(section), around, 1, ends=True))])


if __name__ == "__main__":
    ropes()
    funnel()
