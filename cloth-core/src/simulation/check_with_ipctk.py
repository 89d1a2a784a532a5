"""Checks states and moves with ipc-toolkit (Python package ipctk): no crossing in a state, no collision in a move.

Reads from standard input: a line with vertices, triangles and edges as counts; the triangles; the edges; then a line
with the coordinates at the start and at the end of each accepted move. Prints how many moves are free. Exit status 77
without the package.
"""

import sys

try:
    import ipctk
    import numpy
except ImportError as missing:
    print(missing)
    sys.exit(77)

vertices, triangles, edges = map(int, sys.stdin.readline().split())
faces = numpy.array([sys.stdin.readline().split() for _ in range(triangles)], dtype=int).reshape(-1, 3)
lines = numpy.array([sys.stdin.readline().split() for _ in range(edges)], dtype=int).reshape(-1, 2)
# The default of the first one shortens moves by a tenth. The second one confirms what it flags.
checks = [ipctk.AdditiveCCD(conservative_rescaling=0.999), ipctk.TightInclusionCCD()]
mesh, moves = None, 0
for line in sys.stdin:
    start, end = numpy.array(line.split(), dtype=float).reshape(2, vertices, 3)
    mesh = mesh or ipctk.CollisionMesh(start, lines, faces)
    assert not ipctk.has_intersections(mesh, end), f"state {moves} crosses itself"
    free = any(ipctk.is_step_collision_free(mesh, start, end, narrow_phase_ccd=check) for check in checks)
    assert free, f"move {moves} collides"
    moves += 1
print(f"{moves} moves")
