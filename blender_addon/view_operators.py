"""The buttons that show what was found: relit live, compared, and each basis of a material on a ball."""

import bpy

from ..pipeline.blender import bases
from . import comparison, live, results
from .operators import Acting, allowed
from .stages import STAGES


class LIGHTSPHERE_OT_relight_live(bpy.types.Operator):
    """Keep the relit picture up to date while you move the lights of this scene; press again to end it"""

    bl_idname = "lightsphere.relight_live"
    bl_label = "Relight Live"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "" if live.session else STAGES["relight"].lacks(context.scene))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Start or end it."""
        if live.session is None:
            live.start(context.scene)
        else:
            live.stop()
        return {"FINISHED"}


class LIGHTSPHERE_OT_view_comparison(Acting, bpy.types.Operator):
    """Show the comparison in the Image Editors that are open"""

    bl_idname = "lightsphere.view_comparison"
    bl_label = "Show in Image Editor"

    def act(self, context: bpy.types.Context) -> None:
        """Show it."""
        comparison.show(context.scene)


class LIGHTSPHERE_OT_show_bases(Acting, bpy.types.Operator):
    """Add a ball of each basis of the asset's material beside it, lit as the scene is"""

    bl_idname = "lightsphere.show_bases"
    bl_label = "Show Bases on Balls"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lacking = "" if results.assets(context.scene) else "The scene has no asset: make one"
        return allowed(cls, lacking)

    def act(self, context: bpy.types.Context) -> None:
        """Add the balls of the active object where it is an asset's, else of the last asset."""
        there = results.assets(context.scene)
        item = context.active_object if context.active_object in there else there[-1]
        self.report({"INFO"}, f"{len(bases.add_balls(context.scene, item))} balls stand beside {item.name!r}")


CLASSES = (
    LIGHTSPHERE_OT_relight_live,
    LIGHTSPHERE_OT_view_comparison,
    LIGHTSPHERE_OT_show_bases,
)
