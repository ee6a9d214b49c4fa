"""What the artist sees: a tab in the 3D viewport's sidebar, with a panel and a button for every stage."""

import bpy

from ..pipeline.blender import exr
from . import (
    command,
    files,
    group_operators,
    live,
    operators,
    panels,
    preferences,
    properties,
    rig_gizmos,
    rig_overlay,
    runs,
    translations,
    view_operators,
)

CLASSES = (
    *properties.CLASSES,
    *preferences.CLASSES,
    *operators.CLASSES,
    *group_operators.CLASSES,
    *view_operators.CLASSES,
    *files.CLASSES,
    *panels.CLASSES,
    *rig_gizmos.CLASSES,
)


def register() -> None:
    """Add classes, the scene's settings, menus and the command to Blender."""
    exr.replace_library()
    for item in CLASSES:
        bpy.utils.register_class(item)
    properties.attach()
    files.register()
    live.register()
    rig_overlay.register()
    command.register()
    translations.register()


def unregister() -> None:
    """Stop a running stage and take everything back out."""
    runs.stop()
    translations.unregister()
    command.unregister()
    rig_overlay.unregister()
    live.unregister()
    files.unregister()
    properties.detach()
    for item in reversed(CLASSES):
        bpy.utils.unregister_class(item)
