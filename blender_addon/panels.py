"""The tab in the 3D viewport's sidebar: one panel per stage, in their order."""

from __future__ import annotations

import dataclasses

import bpy

from . import comparison, costs, layers, live, properties, results, rig_overlay, runs, stages
from .stages import STAGES


class StagePanel:
    """What all panels share."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Lightsphere"
    stage = ""

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what the stage opens, what it costs, its button, why it is grey, how far it is, and its results."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.draw_input(context)
        if runs.running is not None and runs.running.stage.name == self.stage:
            share, words = runs.told(runs.running.task)
            self.layout.progress(factor=share, text=words)
        else:
            self.draw_costs(context)
            self.draw_button(context)
            explain(self.layout, runs.lacks(self.stage, context.scene))
        self.draw_settings(context)
        self.draw_results(context)

    def draw_input(self, context: bpy.types.Context) -> None:
        """Draw what the stage opens."""
        if STAGES[self.stage].opens:
            self.layout.prop(context.scene.lightsphere, STAGES[self.stage].opens)

    def draw_costs(self, context: bpy.types.Context) -> None:
        """Draw the presets with what they are expected to take and give, and what the stage took last."""
        stage, scene = STAGES[self.stage], context.scene
        if stage.foretells(scene) and not stage.lacks(scene):
            column = self.layout.column(align=True)
            presets = costs.presets(stage, scene)
            for name, preset in presets.items():
                words = f"{bpy.app.translations.pgettext_iface(name.title())}: {costs.told(preset)}"
                pressed = costs.is_set(stage, scene, preset)
                button = column.operator("lightsphere.preset", text=words, translate=False, depress=pressed)
                button.stage, button.preset = stage.name, name
            if not presets:
                column.operator("lightsphere.estimate", icon="TIME").stage = stage.name
        seconds = costs.last_time(scene, stage.name)
        if seconds is not None:
            row = self.layout.row()
            row.active = False
            took = bpy.app.translations.pgettext_iface("Last time")
            row.label(text=f"{took}: {costs.duration(seconds)}", translate=False)

    def draw_button(self, context: bpy.types.Context) -> None:
        """Draw the stage's button."""
        self.layout.operator(f"lightsphere.{self.stage}")

    def draw_settings(self, context: bpy.types.Context) -> None:
        """Draw the stage's settings in a part that folds away."""
        header, body = self.layout.panel(f"LIGHTSPHERE_{self.stage}_settings", default_closed=True)
        header.label(text="Settings")
        if body is not None:
            for item in dataclasses.fields(STAGES[self.stage].settings):
                body.prop(getattr(context.scene.lightsphere, self.stage), item.name)

    def draw_results(self, context: bpy.types.Context) -> None:
        """Draw what can be looked at once the stage was done."""


class LIGHTSPHERE_PT_capture(StagePanel, bpy.types.Panel):
    """The rig and its pictures."""

    bl_idname = "LIGHTSPHERE_PT_capture"
    bl_label = "Capture"
    stage = "capture"

    def draw_input(self, context: bpy.types.Context) -> None:
        self.layout.operator("lightsphere.add_rig", icon="OUTLINER_OB_LIGHT")
        rigs = results.rigs(context.scene)
        if rigs:
            column = self.layout.column(align=True)
            for name in properties.OF_RIG:
                column.prop(context.scene.lightsphere.capture, name)
        if results.intersect(context.scene):
            explain(self.layout, "The surfaces intersect: enlarge the outer one", "ERROR")
        for item in rigs:
            explain(self.layout, rig_overlay.told(item), "ERROR")

    def draw_button(self, context: bpy.types.Context) -> None:
        self.layout.operator("lightsphere.capture", icon="RENDER_STILL").resume = False
        if runs.stopped_capture() is not None and runs.running is None:
            self.layout.operator("lightsphere.capture", text="Continue the Stopped Capture").resume = True

    def draw_results(self, context: bpy.types.Context) -> None:
        header, body = self.layout.panel("LIGHTSPHERE_capture_effects", default_closed=True)
        header.label(text="Effects of Light")
        if body is None:
            return
        body.operator("lightsphere.plan", icon="LIGHT")
        column = body.column(align=True)
        column.use_property_split = False
        for effect in context.scene.lightsphere.plan:
            row = column.split(factor=0.6)
            if effect.switch:
                row.prop(effect, "simulated", text=effect.name.capitalize())
            else:
                row.label(text=effect.name.capitalize(), icon="CHECKMARK" if effect.planned else "X")
            row.label(text=effect.adds, translate=False)


class LIGHTSPHERE_PT_import_photographs(StagePanel, bpy.types.Panel):
    """Photographs in place of rendered pictures."""

    bl_idname = "LIGHTSPHERE_PT_import_photographs"
    bl_label = "Photographs"
    bl_options = {"DEFAULT_CLOSED"}
    stage = "import_photographs"


class LIGHTSPHERE_PT_shape(StagePanel, bpy.types.Panel):
    """Depth and mesh."""

    bl_idname = "LIGHTSPHERE_PT_shape"
    bl_label = "Shape"
    stage = "shape"

    def draw_input(self, context: bpy.types.Context) -> None:
        super().draw_input(context)
        self.layout.prop(context.scene.lightsphere, "scan")
        if context.scene.lightsphere.scan:
            self.layout.prop(context.scene.lightsphere, "scan_unit")

    def draw_results(self, context: bpy.types.Context) -> None:
        if layers.shown(context.scene):
            self.layout.prop(context.scene.lightsphere, "layer", text="Show")
            self.layout.operator("lightsphere.profile", icon="EYEDROPPER")


class LIGHTSPHERE_PT_reflectance(StagePanel, bpy.types.Panel):
    """What the surface reflects."""

    bl_idname = "LIGHTSPHERE_PT_reflectance"
    bl_label = "Reflectance"
    bl_options = {"DEFAULT_CLOSED"}
    stage = "reflectance"


class LIGHTSPHERE_PT_material(StagePanel, bpy.types.Panel):
    """The asset."""

    bl_idname = "LIGHTSPHERE_PT_material"
    bl_label = "Material"
    stage = "material"

    def draw_results(self, context: bpy.types.Context) -> None:
        if results.assets(context.scene):
            self.layout.operator("lightsphere.show_bases", icon="MATERIAL")


class LIGHTSPHERE_PT_relight(StagePanel, bpy.types.Panel):
    """The captured picture under the scene's lights."""

    bl_idname = "LIGHTSPHERE_PT_relight"
    bl_label = "Relight"
    bl_options = {"DEFAULT_CLOSED"}
    stage = "relight"

    def draw_button(self, context: bpy.types.Context) -> None:
        super().draw_button(context)
        self.layout.operator("lightsphere.relight_live", icon="PLAY", depress=live.session is not None)
        if live.session is not None:
            explain(self.layout, live.session.told)
        self.layout.operator("lightsphere.keep", icon="FILE_ARCHIVE")


class LIGHTSPHERE_PT_inverse(StagePanel, bpy.types.Panel):
    """The reflectances of this scene from one photograph."""

    bl_idname = "LIGHTSPHERE_PT_inverse"
    bl_label = "Inverse Rendering"
    bl_options = {"DEFAULT_CLOSED"}
    stage = "inverse"

    def draw_results(self, context: bpy.types.Context) -> None:
        shown = context.scene.lightsphere
        row = self.layout.row(align=True)
        row.operator("lightsphere.list_groups")
        row.operator("lightsphere.assign_group")
        if not shown.groups:
            return
        self.layout.template_list("LIGHTSPHERE_UL_groups", "", shown, "groups", shown, "group", rows=3)
        chosen = shown.groups[min(shown.group, len(shown.groups) - 1)]
        for words in chosen.told.split(", "):
            explain(self.layout, words, "NONE")
        if any(item.recovered for item in shown.groups):
            row = self.layout.row(align=True)
            row.operator("lightsphere.apply_group", text="Apply All").revert = False
            row.operator("lightsphere.apply_group", text="Revert All").revert = True


class LIGHTSPHERE_UL_groups(bpy.types.UIList):
    """Groups of surfaces: name, what is known, apply or revert."""

    bl_idname = "LIGHTSPHERE_UL_groups"

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: bpy.types.AnyType,
        item: bpy.types.PropertyGroup,
        icon: int,
        active_data: bpy.types.AnyType,
        active_property: str,
        index: int,
    ) -> None:
        """Draw one group."""
        level = item.told.split(", ")[0]
        layout.label(text=f"{item.name}   {level}", icon="MATERIAL", translate=False)
        if item.recovered:
            icon_name = "LOOP_BACK" if item.is_applied else "CHECKMARK"
            button = layout.operator("lightsphere.apply_group", text="", icon=icon_name, emboss=False)
            button.index, button.revert = index, item.is_applied


class LIGHTSPHERE_PT_compare(StagePanel, bpy.types.Panel):
    """The asset beside its capture."""

    bl_idname = "LIGHTSPHERE_PT_compare"
    bl_label = "Compare"
    bl_options = {"DEFAULT_CLOSED"}
    stage = "compare"

    def draw_results(self, context: bpy.types.Context) -> None:
        if comparison.kinds(context.scene):
            draw_view(self.layout, context.scene)


class LIGHTSPHERE_PT_comparison(bpy.types.Panel):
    """The same choices beside the picture."""

    bl_idname = "LIGHTSPHERE_PT_comparison"
    bl_label = "Comparison"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Lightsphere"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(comparison.kinds(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the choices."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        draw_view(self.layout, context.scene)


def draw_view(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Draw which pictures of the comparison are shown, and how."""
    shown = scene.lightsphere
    layout.row().prop(shown, "view", expand=True)
    if shown.view == "split":
        layout.prop(shown, "view_split", slider=True)
    layout.prop(shown, "view_kind")
    layout.prop(shown, "view_light")
    layout.operator("lightsphere.view_comparison", icon="IMAGE")
    for kind, error in comparison.errors(stages.given(scene, "comparison_folder")).items():
        row = layout.row()
        row.label(text=kind.replace("_", " ").title())
        row.label(text=f"{100 * error:.2g} %", translate=False)
    for name, error in comparison.errors_of_bases(scene).items():
        row = layout.row()
        row.active = False
        row.label(text=name.capitalize(), translate=False)
        row.label(text=f"{100 * error:.2g} %", translate=False)


def explain(layout: bpy.types.UILayout, reason: str, icon: str = "INFO") -> None:
    """Say in a soft line why a button is grey, or what was found."""
    if reason:
        row = layout.row()
        row.active = icon == "ERROR"
        row.label(text=reason, icon=icon)


CLASSES = (
    LIGHTSPHERE_UL_groups,
    LIGHTSPHERE_PT_capture,
    LIGHTSPHERE_PT_import_photographs,
    LIGHTSPHERE_PT_shape,
    LIGHTSPHERE_PT_reflectance,
    LIGHTSPHERE_PT_material,
    LIGHTSPHERE_PT_relight,
    LIGHTSPHERE_PT_inverse,
    LIGHTSPHERE_PT_compare,
    LIGHTSPHERE_PT_comparison,
)
