"""What a scene remembers: the settings of every stage and the folders of their results."""

from typing import Any

import bpy

from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.compare import CompareSettings
from ..pipeline.core.material import MaterialSettings
from ..pipeline.core.photographs.settings import ImportSettings
from ..pipeline.core.shape.settings import ShapeSettings
from . import settings

LIGHTSPHERE_PG_capture = settings.group(CaptureSettings, "LIGHTSPHERE_PG_capture")
LIGHTSPHERE_PG_import_photographs = settings.group(ImportSettings, "LIGHTSPHERE_PG_import_photographs")
LIGHTSPHERE_PG_shape = settings.group(ShapeSettings, "LIGHTSPHERE_PG_shape")
LIGHTSPHERE_PG_material = settings.group(MaterialSettings, "LIGHTSPHERE_PG_material")
LIGHTSPHERE_PG_compare = settings.group(CompareSettings, "LIGHTSPHERE_PG_compare")


class LIGHTSPHERE_PG_scene(bpy.types.PropertyGroup):
    """Lightsphere's part of a scene."""

    capture: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_capture)
    import_photographs: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_import_photographs)
    shape: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_shape)
    material: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_material)
    compare: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_compare)
    photographs: bpy.props.StringProperty(
        name="Photographs",
        description="Folder of photographs, one per light, or a list of lights (.lp), or a stack (.npz)",
        subtype="FILE_PATH",
        **settings.RELATIVE,
    )
    capture_folder: bpy.props.StringProperty(
        name="Capture",
        description="Folder of the capture that the next stage opens",
        subtype="DIR_PATH",
        **settings.RELATIVE,
    )
    shape_folder: bpy.props.StringProperty(
        name="Shape",
        description="Folder of the shape that the next stage opens",
        subtype="DIR_PATH",
        **settings.RELATIVE,
    )


CLASSES = (
    LIGHTSPHERE_PG_capture,
    LIGHTSPHERE_PG_import_photographs,
    LIGHTSPHERE_PG_shape,
    LIGHTSPHERE_PG_material,
    LIGHTSPHERE_PG_compare,
    LIGHTSPHERE_PG_scene,
)


def attach() -> None:
    """Give every scene its settings."""
    bpy.types.Scene.lightsphere = bpy.props.PointerProperty(type=LIGHTSPHERE_PG_scene)


def detach() -> None:
    """Take the settings away from the scenes."""
    del bpy.types.Scene.lightsphere


def of(scene: bpy.types.Scene) -> Any:
    """Return a scene's settings."""
    return scene.lightsphere
