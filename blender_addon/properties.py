"""What a scene remembers: the settings of every stage, the folders of their results, what they took and found."""

from typing import Any

import bpy

from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.compare import CompareSettings
from ..pipeline.core.inverse import InverseSettings
from ..pipeline.core.material import MaterialSettings
from ..pipeline.core.photographs.settings import ImportSettings
from ..pipeline.core.reflectance import ReflectanceSettings
from ..pipeline.core.relight import RelightSettings
from ..pipeline.core.shape.settings import ShapeSettings
from . import comparison, layers, plan, results, settings

OF_RIG = ("inner", "outer", "radius_inner", "radius_outer", "power")  # settings that the scene's rig follows

LIGHTSPHERE_PG_capture = settings.group(
    CaptureSettings, "LIGHTSPHERE_PG_capture", dict.fromkeys(OF_RIG, results.follow)
)
LIGHTSPHERE_PG_import_photographs = settings.group(ImportSettings, "LIGHTSPHERE_PG_import_photographs")
LIGHTSPHERE_PG_shape = settings.group(ShapeSettings, "LIGHTSPHERE_PG_shape")
LIGHTSPHERE_PG_reflectance = settings.group(ReflectanceSettings, "LIGHTSPHERE_PG_reflectance")
LIGHTSPHERE_PG_material = settings.group(MaterialSettings, "LIGHTSPHERE_PG_material")
LIGHTSPHERE_PG_relight = settings.group(RelightSettings, "LIGHTSPHERE_PG_relight")
LIGHTSPHERE_PG_inverse = settings.group(InverseSettings, "LIGHTSPHERE_PG_inverse")
LIGHTSPHERE_PG_compare = settings.group(CompareSettings, "LIGHTSPHERE_PG_compare")


def _folder(name: str, what: str) -> Any:
    return bpy.props.StringProperty(name=name, description=what, subtype="DIR_PATH", **settings.RELATIVE)


def _file(name: str, what: str) -> Any:
    return bpy.props.StringProperty(name=name, description=what, subtype="FILE_PATH", **settings.RELATIVE)


class LIGHTSPHERE_PG_slot(bpy.types.PropertyGroup):
    """A material slot of a group, and what was in it."""

    object: bpy.props.PointerProperty(type=bpy.types.Object)
    number: bpy.props.IntProperty()
    original: bpy.props.PointerProperty(type=bpy.types.Material)


class LIGHTSPHERE_PG_group(bpy.types.PropertyGroup):
    """Surfaces that share a reflectance, and what was found of it."""

    slots: bpy.props.CollectionProperty(type=LIGHTSPHERE_PG_slot)
    told: bpy.props.StringProperty()
    recovered: bpy.props.PointerProperty(type=bpy.types.Material)
    is_applied: bpy.props.BoolProperty()


class LIGHTSPHERE_PG_scene(bpy.types.PropertyGroup):
    """Lightsphere's part of a scene."""

    capture: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_capture)
    import_photographs: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_import_photographs)
    shape: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_shape)
    reflectance: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_reflectance)
    material: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_material)
    relight: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_relight)
    inverse: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_inverse)
    compare: bpy.props.PointerProperty(type=LIGHTSPHERE_PG_compare)

    photographs: _file("Photographs", "Folder of photographs, one per light, or list of lights (.lp), or stack (.npz)")
    scan: _file("Scan", "A mesh that was scanned (PLY, OBJ, glTF, USD): the shape is taken from it. Empty: recovered")
    scan_unit: bpy.props.FloatProperty(
        name="Scan Unit", description="Length of the scan's unit", default=1.0, min=1e-9, subtype="DISTANCE"
    )
    photograph: _file("Photograph", "The picture of the real thing, seen by the scene's camera")
    capture_folder: _folder("Capture", "Folder of the capture that the next stage opens")
    shape_folder: _folder("Shape", "Folder of the shape that the next stage opens")
    reflectance_folder: _folder(
        "Reflectance", "Folder of the reflectance that becomes a material. Empty: the material is fitted to the shape"
    )
    comparison_folder: _folder("Comparison", "Folder of the comparison that is shown")

    plan: bpy.props.CollectionProperty(type=plan.LIGHTSPHERE_PG_effect)
    groups: bpy.props.CollectionProperty(type=LIGHTSPHERE_PG_group)
    group: bpy.props.IntProperty(name="Group", description="The group that is chosen in the list")
    pixel: bpy.props.IntVectorProperty(name="Pixel", description="Row and column of the pixel that is plotted", size=2)
    costs: bpy.props.StringProperty(options={"HIDDEN"})  # see costs.py

    layer: bpy.props.EnumProperty(
        name="Layer",
        description="What the recovered mesh shows",
        items=layers.ITEMS,
        update=lambda self, context: layers.show(context.scene),
    )
    view: bpy.props.EnumProperty(
        name="View", description="How two pictures are compared", items=comparison.VIEWS, update=comparison.refresh
    )
    view_kind: bpy.props.EnumProperty(
        name="Pictures", description="Which pictures are compared", items=comparison.items, update=comparison.refresh
    )
    view_light: bpy.props.IntProperty(
        name="Light", description="Number of the light", default=1, min=1, update=comparison.refresh
    )
    view_split: bpy.props.FloatProperty(
        name="Split",
        description="Where the line stands: the capture to its left, the asset to its right",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=comparison.refresh,
    )


CLASSES = (
    *plan.CLASSES,
    LIGHTSPHERE_PG_capture,
    LIGHTSPHERE_PG_import_photographs,
    LIGHTSPHERE_PG_shape,
    LIGHTSPHERE_PG_reflectance,
    LIGHTSPHERE_PG_material,
    LIGHTSPHERE_PG_relight,
    LIGHTSPHERE_PG_inverse,
    LIGHTSPHERE_PG_compare,
    LIGHTSPHERE_PG_slot,
    LIGHTSPHERE_PG_group,
    LIGHTSPHERE_PG_scene,
)


def attach() -> None:
    """Give every scene its settings."""
    bpy.types.Scene.lightsphere = bpy.props.PointerProperty(type=LIGHTSPHERE_PG_scene)


def detach() -> None:
    """Take the settings away from the scenes."""
    del bpy.types.Scene.lightsphere
