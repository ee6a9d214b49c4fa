"""Which effects of light a scene cannot show, read from the scene itself: closures, shapes, camera and motion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from ..geometry import RENDERED, surfaces
from .effects import (
    CAUSTICS,
    DEPTH_OF_FIELD,
    DIFFUSE,
    EMISSION,
    GLOSSY,
    MOTION_BLUR,
    SHADOWS,
    SUBSURFACE,
    TRANSMISSION,
    VOLUMES,
)

#: What each kind of shader node can do with light; a kind that is not here may do everything.
CLOSURES: dict[str, frozenset[str]] = {
    "BSDF_DIFFUSE": frozenset({DIFFUSE}),
    "BSDF_SHEEN": frozenset({DIFFUSE}),
    "BSDF_TOON": frozenset({DIFFUSE, GLOSSY}),
    "BSDF_TRANSLUCENT": frozenset({DIFFUSE, TRANSMISSION}),
    "BSDF_GLOSSY": frozenset({GLOSSY}),
    "BSDF_METALLIC": frozenset({GLOSSY}),
    "BSDF_GLASS": frozenset({GLOSSY, TRANSMISSION}),
    "BSDF_REFRACTION": frozenset({TRANSMISSION}),
    "SUBSURFACE_SCATTERING": frozenset({DIFFUSE, SUBSURFACE}),
    "EMISSION": frozenset({EMISSION}),
    "BSDF_TRANSPARENT": frozenset(),
    "HOLDOUT": frozenset(),
    "MIX_SHADER": frozenset(),
    "ADD_SHADER": frozenset(),
}
NO_SURFACE = ("CURVES", "POINTCLOUD", "VOLUME")
ANYTHING = frozenset({DIFFUSE, GLOSSY, TRANSMISSION, SUBSURFACE, EMISSION})
FLAT = 1e-6  # of the extent: to float32 coordinates, points this close are one and lie in one plane
SMALLEST_DENT = 1e-5  # of volume and area
FACES_TRIED, CORNERS_TRIED = 200, 5000  # when looking for a dent that is easy to see
DEEP = 1e-3  # of the extent: a dent that is easy to see


def ruled_out(scene: bpy.types.Scene) -> dict[str, str]:
    """Return the effects that the scene cannot show, each with the reason.

    Interreflection is ruled out where no point of any surface faces another: one closed convex body, or surfaces in
    one plane. Closures are taken as present wherever a shader reaches them, whatever their weight.
    """
    objects = _shown(scene)
    kinds = {item.type for item in objects}
    materials = _materials(objects)
    shown = frozenset().union(*(_of_material(one) for one in materials)) if materials else frozenset({DIFFUSE})
    missing = {
        DIFFUSE: "no diffuse material",
        GLOSSY: "no glossy material",
        TRANSMISSION: "no material lets light through",
        SUBSURFACE: "no material scatters light below its surface",
        EMISSION: "nothing shines but lights",
    }
    found = {name: reason for name, reason in missing.items() if name not in shown}
    if "VOLUME" not in kinds and not any(_shader(one, "Volume") for one in materials):
        found[VOLUMES] = "no volume"
    if not shown & {GLOSSY, TRANSMISSION}:
        found[CAUSTICS] = "nothing glossy or transparent"
    elif DIFFUSE not in shown:
        found[CAUSTICS] = "no diffuse material that they would fall on"
    if not scene.camera.data.dof.use_dof:
        found[DEPTH_OF_FIELD] = "the camera is a pinhole"
    if not scene.render.use_motion_blur:
        found[MOTION_BLUR] = "not switched on in the scene"
    elif not any(_may_move(item) for item in scene.objects):
        found[MOTION_BLUR] = "nothing moves"
    inside = {TRANSMISSION, SUBSURFACE, VOLUMES}
    if inside <= found.keys() and not kinds & set(NO_SURFACE) and _faces_nothing(scene):
        found |= dict.fromkeys((SHADOWS, DIFFUSE, GLOSSY, CAUSTICS), "no surface faces another")
    return found


def _shown(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the evaluated objects and instances that a render shows."""
    layer = scene.view_layers[0]
    layer.update()
    kinds = (*RENDERED, *NO_SURFACE)
    return [
        instance.object
        for instance in layer.depsgraph.object_instances
        if instance.object.type in kinds and not instance.object.hide_render
    ]


def _materials(shown: list[bpy.types.Object]) -> list[bpy.types.Material]:
    """Return the materials of evaluated objects, those that modifiers set, too."""
    found = [slot.material for item in shown for slot in item.material_slots]
    found += [material for item in shown for material in item.data.materials]
    return list(dict.fromkeys(material.original for material in found if material))


def _of_material(material: bpy.types.Material) -> frozenset[str]:
    if material.node_tree is None:
        return frozenset({DIFFUSE})
    return frozenset().union(*(_of_node(node) for node in _shader(material, "Surface")))


def _shader(material: bpy.types.Material, socket: str) -> list[bpy.types.Node]:
    """Return the shader nodes that a material's output may draw on."""
    if material.node_tree is None:
        return []
    output = material.node_tree.get_output_node("CYCLES")
    return list(_before(output.inputs[socket], set())) if output is not None else []


def _before(socket: bpy.types.NodeSocket, seen: set[Any]) -> Iterator[bpy.types.Node]:
    """Yield the shader nodes before a socket; of a group, all that it holds."""
    for link in socket.links:
        node = link.from_node
        if node in seen:
            continue
        seen.add(node)
        if node.type == "GROUP" and node.node_tree is not None:
            yield from (inner for inner in _inside(node.node_tree) if _is_shader(inner))
        elif _is_shader(node):
            yield node
        for before in node.inputs:
            if before.type == "SHADER" or node.type in ("REROUTE", "GROUP"):
                yield from _before(before, seen)


def _inside(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            yield from _inside(node.node_tree)
        yield node


def _is_shader(node: bpy.types.Node) -> bool:
    return node.type not in ("GROUP", "REROUTE") and any(socket.type == "SHADER" for socket in node.outputs)


def _of_node(node: bpy.types.Node) -> frozenset[str]:
    if node.type != "BSDF_PRINCIPLED":
        return CLOSURES.get(node.type, ANYTHING)

    def may_be(name: str, value: float) -> bool:
        """Whether an input may have other values than this one."""
        return bool(node.inputs[name].is_linked or node.inputs[name].default_value != value)

    colour = node.inputs["Emission Color"]
    shines = colour.is_linked or any(value > 0 for value in colour.default_value[:3])
    base = may_be("Metallic", 1) and may_be("Transmission Weight", 1)
    found = {
        GLOSSY: any(
            may_be(name, 0) for name in ("Specular IOR Level", "Metallic", "Coat Weight", "Transmission Weight")
        ),
        DIFFUSE: base or may_be("Sheen Weight", 0),
        TRANSMISSION: may_be("Transmission Weight", 0),
        SUBSURFACE: may_be("Subsurface Weight", 0),
        EMISSION: shines and may_be("Emission Strength", 0),
    }
    return frozenset(name for name, there in found.items() if there)


def _may_move(item: bpy.types.Object) -> bool:
    holders = [item, item.data, getattr(item.data, "shape_keys", None)]
    animated = any(getattr(one, "animation_data", None) for one in holders)
    return animated or bool(item.constraints or item.parent or item.modifiers or item.particle_systems)


def _faces_nothing(scene: bpy.types.Scene) -> bool:
    """Return whether all surfaces are one closed convex body, or lie in one plane."""
    triangles = surfaces(scene, backdrop=True)
    corners = triangles.reshape(-1, 3)
    extent = float(np.ptp(corners, axis=0).max()) if len(corners) else 0.0
    moments = np.linalg.svd(np.cov(corners.T), compute_uv=False) if extent else np.zeros(3)
    if moments[-1] <= (FLAT * extent) ** 2:
        return True
    if _shows_a_dent(triangles, extent):
        return False
    steps = np.round((corners - corners.min(axis=0)) / (FLAT * extent)).astype(np.int64)
    _, first, vertex = np.unique(steps @ (1, 2**21, 2**42), return_index=True, return_inverse=True)
    return _is_closed(vertex.reshape(-1, 3)) and _is_convex(triangles, corners[first])


def _shows_a_dent(triangles: NDArray[np.float64], extent: float) -> bool:
    """Return whether corners lie well on both sides of one of a few large triangles; quick where the hull is not."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normal, axis=1)
    some = np.argsort(area)[len(area) // 2 :: max(1, len(area) // (2 * FACES_TRIED))]
    some = some[area[some] > 0]
    corners = triangles[:: max(1, len(triangles) // CORNERS_TRIED)].reshape(-1, 3)
    normal = normal[some] / area[some, None]
    height = corners @ normal.T - (triangles[some, 0] * normal).sum(axis=1)
    return bool(((height.max(axis=0) > DEEP * extent) & (height.min(axis=0) < -DEEP * extent)).any())


def _is_convex(triangles: NDArray[np.float64], corners: NDArray[np.float64]) -> bool:
    """Return whether triangles (T, 3, 3), a closed surface of some corners, have the volume and area of their hull."""
    try:
        hull = ConvexHull(corners)
    except QhullError:
        return False
    first, second, third = (triangles - corners.mean(axis=0)).transpose(1, 0, 2)
    volume = abs(np.einsum("ij,ij->", first, np.cross(second, third))) / 6
    area = np.linalg.norm(np.cross(second - first, third - first), axis=1).sum() / 2
    return bool(np.allclose((volume, area), (hull.volume, hull.area), rtol=SMALLEST_DENT))


def _is_closed(faces: NDArray[np.int64]) -> bool:
    """Return whether every edge of triangles (T, 3) is shared by two that run along it in opposite ways."""
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    start, end = (np.concatenate([faces[:, i] for i in order]) for order in ((0, 1, 2), (1, 2, 0)))
    count = int(faces.max(initial=0)) + 1
    one_way, other_way = np.sort(start * count + end), np.sort(end * count + start)
    return bool((np.diff(one_way) > 0).all() and np.array_equal(one_way, other_way))
