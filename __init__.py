"""Lightsphere as a Blender extension: this file is its entry, :mod:`blender_addon` what the artist sees.

Nothing is imported before Blender registers the extension: the same file makes the checkout a package when
tests and the command line import its parts, with no bpy at hand.
"""


def register() -> None:
    """Add the panels, operators and the command to Blender."""
    from . import blender_addon

    blender_addon.register()


def unregister() -> None:
    """Take everything back out of Blender."""
    from . import blender_addon

    blender_addon.unregister()
