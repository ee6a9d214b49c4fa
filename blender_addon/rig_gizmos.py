"""Handles for the radii of the rig's spheres and the power of its lights, while its object is active."""

from __future__ import annotations

import bpy
from mathutils import Matrix, Vector

from ..pipeline.blender import rig

HANDLES = (  # setting, axis that the arrow stands along, colour
    ("radius_inner", Vector((1.0, 0.0, 0.0)), (1.0, 0.85, 0.4)),
    ("radius_outer", Vector((0.0, 0.0, 1.0)), (0.4, 0.8, 1.0)),
    ("power", Vector((0.0, 1.0, 0.0)), (1.0, 1.0, 0.9)),  # a metre for 1
)


class LIGHTSPHERE_GGT_rig(bpy.types.GizmoGroup):
    """Arrows from the spheres' centre: to each of them, and one as long as the lights are strong."""

    bl_idname = "LIGHTSPHERE_GGT_rig"
    bl_label = "Light Rig"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        item = context.active_object
        return item is not None and rig.LAYOUT in item and item.select_get()

    def setup(self, context: bpy.types.Context) -> None:
        """Make the arrows, each bound to its setting."""
        self.arrows = []
        for name, _, colour in HANDLES:
            arrow = self.gizmos.new("GIZMO_GT_arrow_3d")
            arrow.draw_style, arrow.length = "BOX", 0.05
            arrow.color, arrow.color_highlight = colour, (1.0, 1.0, 1.0)
            arrow.alpha, arrow.alpha_highlight = 0.9, 1.0
            arrow.target_set_prop("offset", context.scene.lightsphere.capture, name)
            self.arrows.append(arrow)

    def draw_prepare(self, context: bpy.types.Context) -> None:
        """Let the arrows stand in the spheres' centre, wherever the rig was moved to."""
        item = context.active_object
        centre = item.matrix_world @ Matrix.Translation(-Vector(item[rig.OFFSET]))
        for arrow, (_, axis, _) in zip(self.arrows, HANDLES, strict=True):
            arrow.matrix_basis = centre @ Vector((0.0, 0.0, 1.0)).rotation_difference(axis).to_matrix().to_4x4()


CLASSES = (LIGHTSPHERE_GGT_rig,)
