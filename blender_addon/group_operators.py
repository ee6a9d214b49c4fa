"""The buttons of inverse rendering's groups: which surfaces share a reflectance, and what becomes of it."""

import bpy

from . import groups
from .operators import Acting, allowed


class LIGHTSPHERE_OT_list_groups(Acting, bpy.types.Operator):
    """List which surfaces share a reflectance"""

    bl_idname = "lightsphere.list_groups"
    bl_label = "List Groups"
    bl_options = {"UNDO"}

    def act(self, context: bpy.types.Context) -> None:
        """List them."""
        groups.listed(context.scene)


class LIGHTSPHERE_OT_assign_group(Acting, bpy.types.Operator):
    """Let the selected objects share one reflectance"""

    bl_idname = "lightsphere.assign_group"
    bl_label = "Group Selected"
    bl_options = {"UNDO"}

    name: bpy.props.StringProperty(name="Name", description="Of the group. Empty: back to the rule of the settings")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "" if context.selected_objects else "No object is selected")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the name."""
        return context.window_manager.invoke_props_dialog(self)

    def act(self, context: bpy.types.Context) -> None:
        """Group them."""
        groups.assign(context.scene, context.selected_objects, self.name.strip())


class LIGHTSPHERE_OT_apply_group(Acting, bpy.types.Operator):
    """Give the surfaces of a group the material that was recovered, or the one back that they had"""

    bl_idname = "lightsphere.apply_group"
    bl_label = "Apply Recovered Material"
    bl_options = {"UNDO"}

    index: bpy.props.IntProperty(name="Group", description="Its number; -1: all that were recovered", default=-1)
    revert: bpy.props.BoolProperty(name="Revert", description="Give back the materials that were there")

    def act(self, context: bpy.types.Context) -> None:
        """Change the materials."""
        every = [item for item in context.scene.lightsphere.groups if item.recovered]
        for item in every if self.index < 0 else [context.scene.lightsphere.groups[self.index]]:
            if self.revert:
                groups.revert(item)
            else:
                groups.apply(item)


CLASSES = (LIGHTSPHERE_OT_list_groups, LIGHTSPHERE_OT_assign_group, LIGHTSPHERE_OT_apply_group)
