"""The surfaces that a render of a scene shows, as triangles in world space."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.errors import LightsphereError
from ..core.inside import distance_to, winding_number

BACKDROP = "lightsphere_backdrop"
TOUCHING = 1e-5  # of the object's extent: a light this close to the surface stands on it, to float32 coordinates
RENDERED = ("MESH", "CURVE", "SURFACE", "META", "FONT")


def object_triangles(scene: bpy.types.Scene) -> NDArray[np.float64]:
    """Return the corners (T, 3, 3) of the object's triangles, see :func:`surfaces`.

    Raises
    ------
    LightsphereError
        When the scene shows no surface that is not marked as backdrop.
    """
    found = surfaces(scene, backdrop=False)
    if not len(found):
        raise LightsphereError(f"the scene {scene.name!r} shows no surface; add the object to capture")
    return found


def surfaces(scene: bpy.types.Scene, backdrop: bool) -> NDArray[np.float64]:
    """Return the corners (T, 3, 3) of a scene's triangles, world space [m], modifiers and instances applied.

    Not modelled: what a render shows but the viewport hides, and modifiers that differ between the two.
    """
    found = [corners(mesh, matrix) for _, mesh, matrix in meshes(scene, backdrop)]
    return np.concatenate([np.empty((0, 3, 3)), *found])


def meshes(
    scene: bpy.types.Scene, backdrop: bool
) -> Iterator[tuple[bpy.types.Object, bpy.types.Mesh, NDArray[np.float64]]]:
    """Yield every object that a render shows, evaluated, as a mesh that lives until the next, and its matrix."""
    layer = scene.view_layers[0]
    layer.update()
    for instance in layer.depsgraph.object_instances:
        item = instance.object
        if item.type not in RENDERED or item.hide_render or (item.original.get(BACKDROP) and not backdrop):
            continue
        mesh = item.to_mesh()
        if mesh is not None:
            mesh.calc_loop_triangles()
            yield item, mesh, np.array(instance.matrix_world, np.float64)
            item.to_mesh_clear()


def hide_object(scene: bpy.types.Scene) -> None:
    """Keep what is not backdrop from renders."""
    for item in scene.objects:
        if item.type in RENDERED and not item.get(BACKDROP):
            item.hide_render = True


def check_outside(positions: NDArray[np.float64], triangles: NDArray[np.float64]) -> None:
    """Raise LightsphereError naming the first light that stands inside the object or on its surface."""
    wrong = inside_or_on(positions, triangles)
    if len(wrong):
        x, y, z = positions[wrong[0]]
        raise LightsphereError(
            f"light {wrong[0]} at ({x:.3g}, {y:.3g}, {z:.3g}) m is inside the object or on its surface, as "
            f"{len(wrong)} of {len(positions)} lights are; enlarge the rig or move them"
        )


def inside_or_on(positions: NDArray[np.float64], triangles: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the numbers of the lights (N, 3) that stand inside the object (T, 3, 3) or on its surface.

    Only lights inside the object's bounding box can, so that the costly test is rare.
    """
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    touching = TOUCHING * (high - low).max()
    near = np.flatnonzero(((positions >= low - touching) & (positions <= high + touching)).all(axis=1))
    inside = abs(winding_number(positions[near], triangles)) > 0.5
    return near[inside | (distance_to(positions[near], triangles) <= touching)]


def corners(mesh: bpy.types.Mesh, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners (T, 3, 3) of a mesh's triangles in the world."""
    index = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", index)
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    world = points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    return world[index].reshape(-1, 3, 3)
