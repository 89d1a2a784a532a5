"""The round trip with Blender: reads the USD file of a run, compares its last frame, and exports USD and OBJ again.

Usage: blender.py FOLDER GARMENT. Needs the package bpy and usd-core; exit status 77 without them. The OBJ file of the
last frame is FOLDER/from_blender.obj, as a modeller would export it: z up, with texture coordinates and groups.
"""

import pathlib
import sys

try:
    import bpy
    import numpy
    from pxr import Usd, UsdGeom
except ImportError as missing:
    print(missing)
    sys.exit(77)

TOLERANCE = 2e-6  # single precision, of coordinates below a few metres


def from_usd(path, garment):
    """The last frame of a garment, in world space."""
    stage = Usd.Stage.Open(str(path))
    prims = (prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    mesh = next(prim for prim in prims if garment in str(prim.GetPath()))
    end = stage.GetEndTimeCode()
    place = UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(end)
    return numpy.array([place.Transform(point) for point in UsdGeom.Mesh(mesh).GetPointsAttr().Get(end)])


def from_scene(blender_object, frame):
    """The points of an object in a frame, in world space."""
    bpy.context.scene.frame_set(frame)
    shown = blender_object.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = shown.to_mesh()
    points = numpy.empty(3 * len(mesh.vertices), dtype=numpy.float32)
    mesh.vertices.foreach_get("co", points)
    place = numpy.array(shown.matrix_world)
    return points.reshape(-1, 3) @ place[:3, :3].T + place[:3, 3]


def cached(path, frame):
    """The points of a frame of a point cache (PC2), after its header of 32 bytes."""
    data = path.read_bytes()
    vertices = int(numpy.frombuffer(data[16:20], dtype="<i4")[0])
    return numpy.frombuffer(data[32 + 12 * vertices * frame :][: 12 * vertices], dtype="<f4").reshape(-1, 3)


def main(folder, garment):
    folder = pathlib.Path(folder)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=str(folder / "cloth.usda"))
    scene, imported = bpy.context.scene, bpy.data.objects[garment]
    expected = from_usd(folder / "cloth.usda", garment)
    points = from_scene(imported, scene.frame_end)
    assert numpy.abs(points - expected).max() < TOLERANCE, numpy.abs(points - expected).max()
    assert [slot.material.name for slot in imported.material_slots], "the material arrives"

    # In place: a point cache on a mesh with the same vertices.
    plain = bpy.data.objects.new("plain", imported.data.copy())
    bpy.context.collection.objects.link(plain)
    cache = plain.modifiers.new("cache", "MESH_CACHE")
    cache.cache_format, cache.filepath = "PC2", str(folder / "caches" / f"{garment}.pc2")
    cache.forward_axis, cache.up_axis = "POS_Y", "POS_Z"
    last = scene.frame_end
    assert numpy.abs(from_scene(plain, last) - cached(folder / "caches" / f"{garment}.pc2", last)).max() < TOLERANCE
    bpy.data.objects.remove(plain)

    bpy.ops.wm.usd_export(filepath=str(folder / "from_blender.usda"), export_animation=True)
    back = from_usd(folder / "from_blender.usda", garment)
    assert numpy.abs(back - expected).max() < TOLERANCE, numpy.abs(back - expected).max()

    scene.frame_set(scene.frame_end)
    for other in bpy.data.objects:
        other.select_set(other == imported)
    bpy.ops.wm.obj_export(
        filepath=str(folder / "from_blender.obj"),
        export_selected_objects=True,
        forward_axis="Y",
        up_axis="Z",
        export_uv=True,
        export_normals=True,
        export_material_groups=True,
    )
    print(f"{last + 1} frames of {len(points)} vertices to Blender {bpy.app.version_string} and back")


main(*sys.argv[1:])
