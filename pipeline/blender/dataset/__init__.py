"""The samples of a dataset, built and rendered by Blender: :mod:`.scene` builds what was drawn, :mod:`.sample` makes
the capture, :mod:`.layers` what is known beside it, :mod:`.formats` the layouts of others."""

from __future__ import annotations

import bpy

from .. import devices


def made_by() -> dict[str, str]:
    """Return what the bytes of samples depend on beside the recipe: Blender's version and the device."""
    return {"blender": bpy.app.version_string, "device": devices.chosen().kind}
