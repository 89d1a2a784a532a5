"""Garments as triangle meshes: worn, hanging, or lying flat.

Each garment starts at rest. Lengths are in m, z is up, y points backwards. Tubes are rings of vertices, lofted from one
closed curve to the next; sleeves and legs branch off where half a ring and a curve across it close a ring of their own.
"""

from math import cos, dist, pi, sin, sqrt

# Half the distance of the layers of a garment that lies flat.
FLAT = 0.012


class Garment:
    """A mesh, and what scenes need to know about it."""

    def __init__(self):
        self.points, self.triangles = [], []
        self.hold = []  # vertices that carry the garment: its waistband, neck or upper corners
        self.handle = []  # vertices to pull at
        self.grip = (0.0, 0.0)  # x and z of a place to pinch and hit, while it hangs
        self.layers = 1  # layers of cloth there

    def add(self, points):
        """Adds vertices and returns their numbers."""
        first = len(self.points)
        self.points += [tuple(point) for point in points]
        return list(range(first, len(self.points)))

    def strip(self, upper, lower, closed, turned=False):
        """Adds the triangles between two rows of equally many vertices, with alternating diagonals. Rows that run the
        other way around are `turned`, so that all triangles have the same front."""
        count = len(upper) if closed else len(upper) - 1
        for column in range(count):
            after = (column + 1) % len(upper)
            a, b, c, d = upper[column], lower[column], lower[after], upper[after]
            # Corners with their texture coordinates; the first of these grows downwards: the warp.
            if (column + upper[0] // len(upper)) % 2:
                both = [((a, 1), (b, 2), (c, 3)), ((a, 1), (c, 3), (d, 4))]
            else:
                both = [((a, 1), (b, 2), (d, 4)), ((b, 2), (c, 3), (d, 4))]
            self.triangles += [triangle[::-1] if turned else triangle for triangle in both]

    def loft(self, ring, end, spacing, closed=True, turned=False):
        """Adds rows from a row of vertices to a curve of equally many points. Returns the last row."""
        start = [self.points[vertex] for vertex in ring]
        mean = sum(dist(p, q) for p, q in zip(start, end)) / len(end)
        rows = max(1, round(mean / spacing))
        for row in range(1, rows + 1):
            part = row / rows
            after = self.add(blend(p, q, part) for p, q in zip(start, end))
            self.strip(ring, after, closed, turned)
            ring = after
        return ring

    def obj(self):
        """Returns the text of an OBJ file."""
        lines = ["# Made by scenes/family. Lengths in m, z up.", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
        lines += ["v " + " ".join(f"{c:.6f}" for c in point) for point in self.points]
        lines += ["f " + " ".join(f"{v + 1}/{t}" for v, t in triangle) for triangle in self.triangles]
        return "\n".join(lines) + "\n"


def blend(p, q, part):
    return tuple(a + part * (b - a) for a, b in zip(p, q))


def even(curve, count, closed):
    """Returns points at equal distances along a polygon: `count` of them, its ends included unless it is closed."""
    polygon = curve + curve[:1] if closed else curve
    lengths = [0.0]
    for p, q in zip(polygon, polygon[1:]):
        lengths.append(lengths[-1] + dist(p, q))
    spans, points, at = (count if closed else count - 1), [], 0
    for number in range(count):
        along = lengths[-1] * number / spans
        while at < len(polygon) - 2 and lengths[at + 1] < along:
            at += 1
        points.append(blend(polygon[at], polygon[at + 1], (along - lengths[at]) / (lengths[at + 1] - lengths[at])))
    return points


def section(radius, flat):
    """Returns a closed curve (across, y) of the perimeter of a circle, from its right along the front: the circle, or
    two layers."""
    turns = [2 * pi * k / 64 for k in range(64)]
    if not flat:
        return [(radius * cos(turn), -radius * sin(turn)) for turn in turns]
    half = pi / 2 * (radius - FLAT)
    side = lambda turn: half if cos(turn) > 0 else -half
    return [(side(turn + 1e-6) + FLAT * cos(turn), -FLAT * sin(turn)) for turn in turns]


def ring(radius, height, count, flat):
    """Returns a horizontal ring."""
    return even([(x, y, height) for x, y in section(radius, flat)], count, closed=True)


def spacing_of(area, vertices):
    return sqrt(area / vertices)


def skirt(size, vertices, flat):
    """A cone: waist and hem, with a pinned waistband of one row."""
    waist, hem, length = 0.135, 0.135 + 0.14 * size, 0.5 * size
    spacing = spacing_of(pi * (waist + hem) * sqrt(length**2 + (hem - waist) ** 2), vertices)
    count = 4 * max(2, round(pi * (waist + hem) / spacing / 4))
    garment = Garment()
    garment.hold = garment.add(ring(waist, 0.0, count, flat))
    last = garment.loft(garment.hold, ring(hem, -length, count, flat), spacing)
    garment.handle, garment.grip, garment.layers = last[: count // 6], (0.0, -0.6 * length), 2
    return garment


def branches(garment, ring_, gap, over):
    """Returns the closed rings of two branches from a ring: each takes the vertices of one side, and the points `over`
    (for the right side) that lead from its front across to its back. With a gap of 0 both share these."""
    count = len(ring_)
    quarter, added, found = count // 4, None, []
    for mirror in (1, -1):
        front = ring_[: quarter - gap + 1] if mirror == 1 else ring_[quarter + gap: 2 * quarter + 1][::-1]
        back = ring_[3 * quarter + gap:] if mirror == 1 else ring_[2 * quarter + 1: 3 * quarter - gap + 1][::-1]
        if gap > 0 or added is None:
            added = garment.add((mirror * x, y, z) for x, y, z in over)
        # From the side along the front, across, and along the back.
        found.append((front + added + back, added))
    return found


def trousers(size, vertices, flat):
    """A waistband, hips, and two legs."""
    waist, hips, leg, length = 0.15, 0.175, 0.085, 0.7 * size
    spacing = spacing_of(2 * pi * hips * 0.33 + 4 * pi * leg * length, vertices)
    count = 4 * max(2, round(2 * pi * hips / spacing / 4))
    garment = Garment()
    garment.hold = garment.add(ring(waist, 0.16, count, flat))
    crotch = garment.loft(garment.hold, ring(hips, -0.17, count, flat), spacing)
    front = garment.points[crotch[count // 4]]
    across = 2 * max(1, round(-front[1] / spacing))
    over = [(0.0, front[1] * (1 - 2 * k / across), -0.17) for k in range(1, across)]
    for (loop, _), mirror in zip(branches(garment, crotch, 0, over), (1, -1)):
        centre = 0.11 if not flat else 0.025 + pi / 2 * leg
        for height in (-0.27, -0.17 - length):
            curve = [(mirror * (centre + x), y, height) for x, y in section(leg, flat)]
            loop = garment.loft(loop, even(curve, len(loop), closed=True), spacing, turned=mirror < 0)
        garment.handle = loop[: len(loop) // 3]
    garment.grip, garment.layers = (0.11, -0.17 - 0.6 * length), 2
    return garment


def shirt(size, vertices, flat):
    """A trunk, two short sleeves, and a hole for the neck."""
    chest, cuff, length, sleeve = 0.175, 0.075, 0.42 * size, 0.3 + 0.1 * size
    spacing = spacing_of(2 * pi * chest * (length + 0.1) + 4 * pi * 0.1 * sleeve, vertices)
    count = 4 * max(3, round(2 * pi * chest / spacing / 4))
    garment = Garment()
    hem = garment.add(ring(chest * 1.05, -length, count, flat))
    top = garment.loft(hem, ring(chest, 0.0, count, flat), spacing)
    gap = max(1, round(0.4 * count / 4))
    x, y, _ = garment.points[top[count // 4 - gap]]
    arc = [(x, y * cos(pi * k / 32), 0.19 * sin(pi * k / 32)) for k in range(33)]
    length_of_arc = sum(dist(p, q) for p, q in zip(arc, arc[1:]))
    over = even(arc, 2 * max(1, round(length_of_arc / spacing / 2)) + 1, closed=False)[1:-1]
    edge = []
    for (loop, added), mirror in zip(branches(garment, top, gap, over), (1, -1)):
        # The lowest point of a cuff belongs to the armpit. Sleeves of a shirt that lies flat point upwards: rows leave
        # the chest at an angle.
        end = (0.14 if not flat else pi / 2 * chest - 0.1) + sleeve
        curve = [(mirror * end, q, (0.35 if flat else 0.1) - p) for p, q in section(cuff, flat)]
        last = garment.loft(loop, even(curve, len(loop), closed=True), spacing, turned=mirror < 0)
        garment.handle = last[: len(last) // 3]
        edge += added
    quarter = count // 4
    garment.hold = edge + top[quarter - gap: quarter + gap + 1] + top[3 * quarter - gap: 3 * quarter + gap + 1]
    garment.grip, garment.layers = (0.0, -0.6 * length), 2
    return garment


def cape(size, vertices, flat):
    """A cone that is open in front. It lies flat as a part of a ring."""
    neck, hem, length = 0.09, 0.09 + 0.2 * size, 0.6 * size
    slant = sqrt(length**2 + (hem - neck) ** 2)
    opening = 1.7 * pi
    spacing = spacing_of(opening / 2 * (neck + hem) * slant, vertices)
    count = max(4, round(opening / 2 * (neck + hem) / spacing))
    turns = [pi / 2 + opening * (k / count - 0.5) for k in range(count + 1)]
    slope = (hem - neck) / slant

    def row(radius, height):
        if flat:
            return [(radius / slope * sin(slope * (t - pi / 2)), 0.0, -radius / slope * cos(slope * (t - pi / 2)))
                    for t in turns]
        return [(radius * cos(turn), radius * sin(turn), height) for turn in turns]

    garment = Garment()
    garment.hold = garment.add(row(neck, 0.0))
    last = garment.loft(garment.hold, row(hem, -length), spacing, closed=False)
    garment.handle, garment.grip = last[: max(2, count // 6)], (0.0, -0.6 * length)
    return garment


def sheet(width, length, vertices, curve):
    """A rectangle: rows along x at the points (y, z) of a curve of its length."""
    spacing = spacing_of(width * length, vertices)
    across, rows = max(2, round(width / spacing)), max(2, round(length / spacing))
    garment, last = Garment(), None
    for y, z in even(curve, rows + 1, closed=False):
        line = garment.add((width * (k / across - 0.5), y, z) for k in range(across + 1))
        if last:
            garment.strip(last, line, False)
        else:
            garment.hold = line
        last = line
    garment.handle = last[: max(2, len(last) // 3)]
    return garment


def blanket(size, vertices, flat):
    """A rectangle, which hangs by its upper corners."""
    width, length = 0.8 * size, 0.9 * size
    garment = sheet(width, length, vertices, [(0.0, 0.0), (0.0, -length)])
    corner = max(1, len(garment.hold) // 8)
    garment.hold = garment.hold[:corner] + garment.hold[-corner:]
    garment.grip = (0.0, -0.6 * length)
    return garment


# The radius of the rail that a scarf is worn on, and how far it stays away.
RAIL, AWAY = 0.05, 0.012


def scarf(size, vertices, flat, worn=False):
    """A long rectangle. Worn, it hangs over a rail along x, with a longer end behind it."""
    width, length = 0.22, 1.3 * size
    if not worn:
        garment = sheet(width, length, vertices, [(0.0, 0.0), (0.0, -length)])
        garment.grip = (0.0, -0.6 * length)
        return garment
    radius = RAIL + AWAY
    rest = length - pi * radius
    bend = [(-radius * cos(pi * k / 32), radius * sin(pi * k / 32)) for k in range(33)]
    curve = [(-radius, -0.4 * rest)] + bend + [(radius, -0.6 * rest)]
    return sheet(width, length, vertices, curve)


GARMENTS = {"skirt": skirt, "shirt": shirt, "trousers": trousers, "scarf": scarf, "cape": cape, "blanket": blanket}


def lying(garment):
    """Turns a garment that is flat across y, so that it lies on a plane."""
    garment.points = [(x, -z, y) for x, y, z in garment.points]
    return garment
