"""What happens to a garment: obstacles, pins and start of each motion, as the text of a scene."""

from math import cos, hypot, pi, sin

from garments import AWAY, GARMENTS, RAIL, lying, scarf

# The thickness of obstacles, in m: contact acts within it.
SKIN = 0.003
HEAD = """# {what}, made by scenes/family.
dt = {dt}
duration = {duration}
frames_per_second = 25
integrator = "newton"
adaptive = true
tolerances.velocity = 1e-3
drag = 0.1
output = {{ gltf = false, usd = false, obj = false, picture = false }}
"""


def numbers(values):
    return "[" + ", ".join(f"{value:.5g}" for value in values) + "]"


class Scene:
    """Tables of a scene, and the meshes that it reads."""

    def __init__(self, fabric):
        self.fabric, self.tables, self.meshes = fabric, [], {}

    def cloth(self, name, garment, more=""):
        self.meshes[f"{name}.obj"] = garment.obj()
        self.tables.append(f'[[garment]]\nname = "{name}"\nmesh.obj.path = "{name}.obj"\nfabric = "{self.fabric}"\n'
                           f'warp = "uv"\n{more}')

    def obstacle(self, shape, friction, motion="", name=""):
        name = f'name = "{name}"\n' if name else ""
        self.tables.append(f"[[obstacles]]\n{name}{shape}\nfriction = {friction:.2f}\nthickness = {SKIN}\n{motion}")

    def pins(self, garment, vertices, more=""):
        self.tables.append(f'[[pins]]\nof = "{garment}"\nvertices = {sorted(set(vertices))}\n{more}')

    def text(self, what, dt, duration):
        return HEAD.format(what=what, dt=dt, duration=duration) + "\n" + "\n".join(self.tables)


def motion(keys, centre=(0, 0, 0), axis=(0, 0, 1), smooth=True):
    """Returns the keys of a motion: (time, angle, translation) each."""
    lines = [f"{{ time = {t:.4g}, angle = {angle:.5g}, translate = {numbers(way)} }}" for t, angle, way in keys]
    interpolation = 'motion.interpolation = "cubic"\n' if smooth else ""
    return (f"motion.centre = {numbers(centre)}\nmotion.axis = {numbers(axis)}\nmotion.keys = [\n    "
            + ",\n    ".join(lines) + "\n]\n" + interpolation)


def capsule(start, end, radius):
    return f"capsule = {{ from = {numbers(start)}, to = {numbers(end)}, radius = {radius:.4g} }}"


def box(centre, size):
    return f"box = {{ centre = {numbers(centre)}, size = {numbers(size)}, rounding = 0.008 }}"


# Bodies: (name, ends of a capsule, radius, joint and axis of its own swing or None). The first one carries the pins.
BODIES = {
    "skirt": [("hips", (0, 0, -0.02), (0, 0, -0.14), 0.11, None),
              ("left leg", (0.06, 0, -0.2), (0.06, 0, -0.6), 0.045, ((0.06, 0, -0.14), (1, 0, 0), 1)),
              ("right leg", (-0.06, 0, -0.2), (-0.06, 0, -0.6), 0.045, ((-0.06, 0, -0.14), (1, 0, 0), -1))],
    "trousers": [("hips", (0, 0, 0.04), (0, 0, 0.03), 0.13, None),
                 ("left leg", (0.1, 0, -0.12), (0.11, 0, -0.75), 0.05, ((0.1, 0, -0.1), (1, 0, 0), 1)),
                 ("right leg", (-0.1, 0, -0.12), (-0.11, 0, -0.75), 0.05, ((-0.1, 0, -0.1), (1, 0, 0), -1))],
    "shirt": [("trunk", (0, 0, -0.5), (0, 0, -0.08), 0.13, None),
              ("left arm", (0.12, 0, 0.09), (0.6, 0, 0.1), 0.035, ((0.12, 0, 0.09), (0, 1, 0), 1)),
              ("right arm", (-0.12, 0, 0.09), (-0.6, 0, 0.1), 0.035, ((-0.12, 0, 0.09), (0, 1, 0), 1))],
    "cape": [("trunk", (0, 0, -0.7), (0, 0, -0.22), 0.12, None)],
    "scarf": [("rail", (-0.3, 0, 0), (0.3, 0, 0), RAIL, None)],
    "blanket": [("trunk", (0, -0.17, -0.8), (0, -0.17, -0.1), 0.13, None)],
}


def wear(scene, draw, kind, garment, keys):
    """Puts a garment on a body that moves by keys (time, angle, way). Legs and arms swing about their joints."""
    friction = draw.uniform(0.1, 0.6)
    swing = draw.uniform(8, 18)
    for name, start, end, radius, joint in BODIES[kind]:
        moves = motion(keys)
        if joint and not any(angle for _, angle, _ in keys):
            centre, axis, side = joint
            moves = motion([(t, side * swing * sin(2 * pi * t / 0.6), way) for t, _, way in keys], centre, axis)
        scene.obstacle(capsule(start, end, radius), friction, moves, name)
    scene.cloth(kind, garment)
    if kind not in ("scarf", "shirt"):
        scene.pins(kind, garment.hold, f'obstacle = "{BODIES[kind][0][0]}"\n')


def worn(kind, size, vertices):
    return scarf(size, vertices, flat=False, worn=True) if kind == "scarf" else GARMENTS[kind](size, vertices, False)


def walk(scene, draw, kind, size, vertices, duration):
    speed, bob = draw.uniform(0.6, 1.6), draw.uniform(0.0, 0.03)
    count = max(2, round(duration / 0.1))
    times = [duration * k / count for k in range(count + 1)]
    keys = [(t, 0.0, (0.0, -speed * t, bob * (1 - cos(4 * pi * t)) / 2)) for t in times]
    wear(scene, draw, kind, worn(kind, size, vertices), keys)


def twirl(scene, draw, kind, size, vertices, duration):
    angle = draw.choice([-1, 1]) * draw.uniform(120, 240) * duration / 0.5
    wear(scene, draw, kind, worn(kind, size, vertices), [(0, 0.0, (0, 0, 0)), (duration, angle, (0, 0, 0))])


def laid(draw, kind, size, vertices, tilt):
    """Returns a garment that lies flat, tilted, with its lowest point at z = 0 and its middle on the axis."""
    garment = lying(GARMENTS[kind](size, vertices, True))
    angle, turn = draw.uniform(0, tilt) * pi / 180, draw.uniform(0, 2 * pi)
    middle = [(min(c) + max(c)) / 2 for c in zip(*garment.points)]
    points = []
    for point in garment.points:
        x, y, z = (a - b for a, b in zip(point, middle))
        x, y = cos(turn) * x - sin(turn) * y, sin(turn) * x + cos(turn) * y
        points.append((x, cos(angle) * y - sin(angle) * z, sin(angle) * y + cos(angle) * z))
    lowest = min(z for _, _, z in points)
    garment.points = [(x, y, z - lowest) for x, y, z in points]
    return garment


def drop(scene, draw, kind, size, vertices, duration):
    garment = laid(draw, kind, size, vertices, 30)
    below, friction = draw.choice(["ball", "box", "rail"]), draw.uniform(0.1, 0.6)
    shapes = {"ball": f"sphere = {{ centre = [0.02, 0.01, -0.22], radius = 0.2 }}",
              "box": box((0.03, 0.02, -0.15), (0.3, 0.25, 0.26)),
              "rail": capsule((-0.6, 0.03, -0.07), (0.6, 0.05, -0.07), 0.05)}
    scene.cloth(kind, garment, f"velocity = [0.0, 0.0, {-draw.uniform(0.5, 3.0):.3f}]\n")
    scene.obstacle(shapes[below], friction)
    scene.obstacle("plane = { point = [0.0, 0.0, -0.5] }", friction)


def stack(scene, draw, kind, size, vertices, duration):
    count, height = draw.randint(3, 5), 0.03
    for number in range(count):
        garment = laid(draw, kind, size, vertices // count, 0)
        garment.points = [(x, y, z + height) for x, y, z in garment.points]
        height = max(z for _, _, z in garment.points) + draw.uniform(0.008, 0.02)
        scene.cloth(f"{kind} {number + 1}", garment, "velocity = [0.0, 0.0, -1.0]\n")
    friction = draw.uniform(0.1, 0.6)
    scene.obstacle(box((0, 0, -0.1), (0.35, 0.35, 0.2)), friction)
    scene.obstacle("plane = { point = [0.0, 0.0, -0.4] }", friction)


def pull(scene, draw, kind, size, vertices, duration):
    """A part of a garment is drawn off a table, and below a bar or over the table's edge."""
    garment = laid(draw, kind, size, vertices, 0)
    garment.points = [(x, y, z + 0.015) for x, y, z in garment.points]
    held = [garment.points[vertex] for vertex in garment.handle]
    x, y = (sum(c) / len(held) for c in list(zip(*held))[:2])
    away = hypot(x, y)
    x, y = x / away, y / away
    friction = draw.uniform(0.1, 0.5)
    scene.obstacle(box((0, 0, -0.1), (1.6, 1.6, 0.2)), friction)
    if draw.random() < 0.5:
        top = max(z for _, _, z in garment.points) + 0.04
        middle, side = (0.5 * away * x, 0.5 * away * y), (-y, x)
        ends = [(middle[0] + s * side[0], middle[1] + s * side[1], top) for s in (-0.8, 0.8)]
        scene.obstacle(capsule(*ends, 0.02), friction)
    scene.cloth(kind, garment)
    way, lift = draw.uniform(0.5, 1.5) * duration, draw.uniform(0.0, 0.15) * duration
    keys = [(0, 0, (0, 0, 0)), (duration, 0, (way * x, way * y, lift))]
    scene.pins(kind, garment.handle, motion(keys))


def hang(scene, kind, size, vertices, is_held=True):
    garment = GARMENTS[kind](size, vertices, False)
    scene.cloth(kind, garment)
    if is_held:
        scene.pins(kind, garment.hold)
    return garment


def reach(garment, radius):
    """Returns the least and the largest y of a hanging garment near its grip."""
    x, z = garment.grip
    near = [p[1] for p in garment.points if hypot(p[0] - x, p[2] - z) < radius]
    return min(near), max(near)


def pinch(scene, draw, kind, size, vertices, duration):
    """Two fingers close on a hanging garment, and draw it aside."""
    garment = hang(scene, kind, size, vertices)
    (x, z), half = garment.grip, draw.uniform(0.03, 0.06)
    gap = garment.layers * 0.006 + 2 * SKIN
    lift = draw.uniform(-0.05, 0.1)
    for side, edge in zip((-1, 1), reach(garment, 2 * half + 0.05)):
        start = edge + side * 0.04
        way = side * gap / 2 - start
        keys = [(0, 0, (0, 0, 0)), (0.6 * duration, 0, (0, way, 0)), (duration, 0, (0, way, lift))]
        scene.obstacle(box((x, start + side * 0.02, z), (2 * half, 0.04, 2 * half)), draw.uniform(0.3, 0.8),
                       motion(keys))


def hit(scene, draw, kind, size, vertices, duration):
    """A ball hits a garment that hangs, or is in the air."""
    garment = hang(scene, kind, size, vertices, is_held=draw.random() < 0.5)
    (x, z), radius, speed = garment.grip, draw.uniform(0.05, 0.12), draw.uniform(5, 20)
    low, _ = reach(garment, radius + 0.05)
    # It stops after a third of a metre, before cloth that hangs is taut.
    way = 0.05 + draw.uniform(0.2, 0.35)
    keys = [(0, 0, (0, 0, 0)), (way / speed, 0, (0, way, 0))]
    centre = (x + 0.01, low - 0.05 - radius, z + 0.01)
    scene.obstacle(f"sphere = {{ centre = {numbers(centre)}, radius = {radius:.4f} }}", draw.uniform(0, 0.6),
                   motion(keys, smooth=False))


MOTIONS = {"walk": walk, "twirl": twirl, "drop": drop, "pull": pull, "pinch": pinch, "hit": hit, "stack": stack}
