"""Compares distances, barriers and the mollifier with those of ipc-toolkit (Python package ipctk).

Reads lines `NAME SIZE NUMBERS` from standard input: SIZE coordinates, parameters, then value, gradient and Hessian.
Prints how many agree. Exit status 77 without the package.
"""

import sys

try:
    import ipctk
    import numpy
except ImportError as missing:
    print(missing)
    sys.exit(77)

TOLERANCE = 1e-9  # relative to the largest entry; distances are roots of what ipctk computes


def root(square, gradient, hessian):
    """A distance and its derivatives, from those of its square."""
    distance = numpy.sqrt(square)
    slope = gradient / (2 * distance)
    return distance, slope, (hessian - 2 * numpy.outer(slope, slope)) / (2 * distance)


def squared(kind, x):
    """The square of a distance of some kind, with its derivatives."""
    return tuple(getattr(ipctk, f"{kind}_distance{order}")(*x) for order in ("", "_gradient", "_hessian"))


def through(outer, inner):
    """The chain rule: an outer function with its first two derivatives, of an inner one."""
    value, first, second = outer
    _, slope, curvature = inner
    return value, first * slope, second * numpy.outer(slope, slope) + first * curvature


def barrier_of(scale, s, active):
    functions = (ipctk.barrier, ipctk.barrier_first_derivative, ipctk.barrier_second_derivative)
    return tuple(scale * f(s, active) for f in functions)


def distance_barrier(x, stiffness, active):
    distance = root(*squared("point_point", x))
    return through(barrier_of(stiffness, distance[0], active), distance)


def squared_barrier(x, stiffness, active):
    square = squared("point_point", x)
    return through(barrier_of(stiffness, square[0], active**2), square)


def mollifier(x, energy, area):
    functions = (ipctk.edge_edge_mollifier, ipctk.edge_edge_mollifier_gradient, ipctk.edge_edge_mollifier_hessian)
    return tuple(energy * f(*x, area) for f in functions)


KNOWN = {
    "Distance": lambda x: root(*squared("point_point", x)),
    "PointEdgeDistance": lambda x: root(*squared("point_line", x)),
    "PointTriangleDistance": lambda x: root(*squared("point_plane", x)),
    "EdgeEdgeDistance": lambda x: root(*squared("line_line", x)),
    "DistanceBarrier": distance_barrier,
    "SquaredDistanceBarrier": squared_barrier,
    "ParallelEdges": mollifier,
}

agreed = {name: 0 for name in KNOWN}
for line in sys.stdin:
    name, size, *numbers = line.split()
    size, numbers = int(size), numpy.array(numbers, dtype=float)
    results = 1 + size + size * size
    parameters = numbers[size : len(numbers) - results]
    value, gradient, hessian = numpy.split(numbers[-results:], [1, 1 + size])
    expected = KNOWN[name](numbers[:size].reshape(-1, 3), *parameters)
    for own, other in zip((value, gradient, hessian), expected):
        other = numpy.atleast_1d(other).ravel()
        scale = max(numpy.abs(other).max(), 1e-300)
        assert numpy.abs(own - other).max() <= TOLERANCE * scale, (name, own, other)
    agreed[name] += 1
print(" ".join(f"{name} {count}" for name, count in agreed.items()))
