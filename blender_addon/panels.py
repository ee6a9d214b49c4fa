"""The tab in the 3D viewport's sidebar: one panel per stage, in their order."""

from __future__ import annotations

import dataclasses
from typing import Any

import bpy

from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.compare import CompareSettings
from ..pipeline.core.material import MaterialSettings
from ..pipeline.core.photographs.settings import ImportSettings
from ..pipeline.core.shape.settings import ShapeSettings
from . import properties, stages


class StagePanel:
    """What all panels share."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Lightsphere"
    stage = ""
    opens = ""  # the scene's property that names what the stage opens
    settings_type: type[Any]

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what the stage opens, its button, why it is grey, and how far it is."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.draw_input(context)
        running = stages.running
        if running is not None and running.stage.name == self.stage:
            share, words = stages.told(running.task)
            self.layout.progress(factor=share, text=words)
        else:
            self.draw_button(context)
        self.draw_settings(context)

    def draw_input(self, context: bpy.types.Context) -> None:
        """Draw what the stage opens."""
        if self.opens:
            self.layout.prop(properties.of(context.scene), self.opens)

    def draw_button(self, context: bpy.types.Context) -> None:
        """Draw the stage's button, and below it why it is grey."""
        self.layout.operator(f"lightsphere.{self.stage}")
        explain(self.layout, stages.lacks(self.stage, context.scene))

    def draw_settings(self, context: bpy.types.Context) -> None:
        """Draw the stage's settings in a part that folds away."""
        header, body = self.layout.panel(f"LIGHTSPHERE_{self.stage}_settings", default_closed=True)
        header.label(text="Settings")
        if body is not None:
            for item in dataclasses.fields(self.settings_type):
                body.prop(getattr(properties.of(context.scene), self.stage), item.name)


class LIGHTSPHERE_PT_capture(StagePanel, bpy.types.Panel):
    """The rig and its pictures."""

    bl_idname = "LIGHTSPHERE_PT_capture"
    bl_label = "Capture"
    stage = "capture"
    settings_type = CaptureSettings

    def draw_input(self, context: bpy.types.Context) -> None:
        self.layout.operator("lightsphere.add_rig", icon="OUTLINER_OB_LIGHT")

    def draw_button(self, context: bpy.types.Context) -> None:
        self.layout.operator("lightsphere.capture", icon="RENDER_STILL").resume = False
        if stages.stopped_capture() is not None and stages.running is None:
            self.layout.operator("lightsphere.capture", text="Continue the Stopped Capture").resume = True
        explain(self.layout, stages.lacks(self.stage, context.scene))


class LIGHTSPHERE_PT_import_photographs(StagePanel, bpy.types.Panel):
    """Photographs in place of rendered pictures."""

    bl_idname = "LIGHTSPHERE_PT_import_photographs"
    bl_label = "Photographs"
    bl_options = {"DEFAULT_CLOSED"}
    stage = "import_photographs"
    opens = "photographs"
    settings_type = ImportSettings


class LIGHTSPHERE_PT_shape(StagePanel, bpy.types.Panel):
    """Depth and mesh."""

    bl_idname = "LIGHTSPHERE_PT_shape"
    bl_label = "Shape"
    stage = "shape"
    opens = "capture_folder"
    settings_type = ShapeSettings


class LIGHTSPHERE_PT_material(StagePanel, bpy.types.Panel):
    """The asset."""

    bl_idname = "LIGHTSPHERE_PT_material"
    bl_label = "Material"
    stage = "material"
    opens = "shape_folder"
    settings_type = MaterialSettings


class LIGHTSPHERE_PT_compare(StagePanel, bpy.types.Panel):
    """The asset beside its capture."""

    bl_idname = "LIGHTSPHERE_PT_compare"
    bl_label = "Compare"
    bl_options = {"DEFAULT_CLOSED"}
    stage = "compare"
    opens = "capture_folder"
    settings_type = CompareSettings


def explain(layout: bpy.types.UILayout, reason: str) -> None:
    """Say below a grey button why it is grey."""
    if reason:
        row = layout.row()
        row.active = False
        row.label(text=reason, icon="INFO")


CLASSES = (
    LIGHTSPHERE_PT_capture,
    LIGHTSPHERE_PT_import_photographs,
    LIGHTSPHERE_PT_shape,
    LIGHTSPHERE_PT_material,
    LIGHTSPHERE_PT_compare,
)
