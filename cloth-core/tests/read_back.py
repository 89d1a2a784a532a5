"""Reads the files of a run with the readers of others, and compares what they hold of the last frame.

Usage: read_back.py FOLDER GARMENT. Needs usd-core, pygltflib and trimesh; exit status 77 without them.
"""

import pathlib
import sys

try:
    import numpy
    import pygltflib
    import trimesh
    from pxr import Usd, UsdGeom
except ImportError as missing:
    print(missing)
    sys.exit(77)

TOLERANCE = 2e-6  # single precision, of coordinates below a few metres


def from_usd(path, garment):
    """Frames, and the points of the last one."""
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1 and UsdGeom.GetStageUpAxis(stage) == "Z"
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/scene/{garment}"))
    times = mesh.GetPointsAttr().GetTimeSamples()
    assert times[0] == stage.GetStartTimeCode() and times[-1] == stage.GetEndTimeCode()
    counts = mesh.GetFaceVertexCountsAttr().Get()
    indices = mesh.GetFaceVertexIndicesAttr().Get()
    assert set(counts) == {3} and len(indices) == 3 * len(counts)
    return len(times), numpy.array(mesh.GetPointsAttr().Get(times[-1]))


def from_gltf(path, garment):
    """Frames, and the points of the last one: the first frame and the last morph target."""
    file = pygltflib.GLTF2().load(str(path))
    mesh = next(mesh for mesh in file.meshes if mesh.name == garment)
    primitive = mesh.primitives[0]

    def vectors(number):
        accessor = file.accessors[number]
        view = file.bufferViews[accessor.bufferView]
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        data = file.binary_blob()[start : start + 12 * accessor.count]
        return numpy.frombuffer(data, dtype="<f4").reshape(-1, 3)

    points = vectors(primitive.attributes.POSITION) + vectors(primitive.targets[-1]["POSITION"])
    channel = next(c for c in file.animations[0].channels if file.nodes[c.target.node].name == garment)
    times = file.accessors[file.animations[0].samplers[channel.sampler].input]
    # y is up there: (x, y, z) is (x, z, -y).
    return times.count, numpy.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)


def complaints(path):
    """What the validators of OpenUSD find."""
    try:
        from pxr import UsdValidation
    except ImportError:  # before OpenUSD 24.11
        return []
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))


def main(folder, garment):
    folder = pathlib.Path(folder)
    found = complaints(folder / "cloth.usda")
    assert not found, [error.GetMessage() for error in found]
    frames, points = from_usd(folder / "cloth.usda", garment)
    gltf_frames, gltf_points = from_gltf(folder / "cloth.glb", garment)
    assert frames == gltf_frames, (frames, gltf_frames)
    assert numpy.abs(points - gltf_points).max() < TOLERANCE
    shown = trimesh.load(folder / "cloth.glb")
    assert shown.geometry[garment].vertices.shape == points.shape
    for kind in ("obj", "ply"):
        files = sorted((folder / "frames").glob(f"*.{kind}"))
        assert len(files) == frames, (kind, len(files))
        # The garment comes first in a file of all.
        last = trimesh.load(files[-1], process=False)
        assert numpy.abs(numpy.asarray(last.vertices)[: len(points)] - points).max() < TOLERANCE, kind
    print(f"{frames} frames of {len(points)} vertices, alike in USD, glTF, OBJ and PLY")


main(*sys.argv[1:])
