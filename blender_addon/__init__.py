"""What the artist sees: a tab in the 3D viewport's sidebar, with a panel and a button for every stage."""

import bpy

from . import command, operators, panels, preferences, properties, stages

CLASSES = (*properties.CLASSES, preferences.LIGHTSPHERE_AP_preferences, *operators.CLASSES, *panels.CLASSES)


def register() -> None:
    """Add classes, the scene's settings and the command to Blender."""
    for item in CLASSES:
        bpy.utils.register_class(item)
    properties.attach()
    command.register()


def unregister() -> None:
    """Stop a running stage and take everything back out."""
    stages.stop()
    command.unregister()
    properties.detach()
    for item in reversed(CLASSES):
        bpy.utils.unregister_class(item)
