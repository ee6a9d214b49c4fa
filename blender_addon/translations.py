"""The words of the interface in other languages, by Blender's own mechanism."""

import bpy

GERMAN = {}


def register() -> None:
    """Give Blender the translations."""
    bpy.app.translations.register(__package__, {"de_DE": {("*", key): words for key, words in GERMAN.items()}})


def unregister() -> None:
    """Take them back."""
    bpy.app.translations.unregister(__package__)
