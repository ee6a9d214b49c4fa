"""The extension's preferences: where results of a file that was never saved go."""

import bpy

PACKAGE = __package__.removesuffix(".blender_addon")


class LIGHTSPHERE_AP_preferences(bpy.types.AddonPreferences):
    """What holds for every file."""

    bl_idname = PACKAGE

    results: bpy.props.StringProperty(
        name="Results",
        description="Folder for captures and shapes of files that were never saved; "
        "those of a saved file go beside it. Empty: the extension's own folder",
        subtype="DIR_PATH",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the preferences."""
        self.layout.prop(self, "results")


def results() -> str:
    """Return the folder for results of files that were never saved, empty for the extension's own."""
    return bpy.context.preferences.addons[PACKAGE].preferences.results
