"""The buttons of the stages: each runs in a worker; Esc stops it and what is finished is kept."""

import time

import bpy

from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.errors import LightsphereError
from . import costs, layers, results, runs, settings, stages, windows
from .stages import STAGES

INTERVAL = 0.1  # [s] between two looks at the worker
SHOWN_AGAIN = 0.5  # [s] between two times that the window shows how far it is: drawing it may be slow


class Refusing:
    """Operators that tell the artist what is wrong in place of an error's trace."""

    def refuse(self, error: LightsphereError) -> set[str]:
        """Tell what is wrong."""
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


class Acting(Refusing):
    """Operators that do one thing at once."""

    def act(self, context: bpy.types.Context) -> None:
        """Do it."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do it, or tell what is wrong."""
        try:
            self.act(context)
        except LightsphereError as error:
            return self.refuse(error)
        return {"FINISHED"}


class LIGHTSPHERE_OT_add_rig(Acting, bpy.types.Operator):
    """Add the lights of the settings as an object that you can move and scale; the capture then uses it"""

    bl_idname = "lightsphere.add_rig"
    bl_label = "Add Light Rig"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, stages.lacks_rig(context.scene))

    def act(self, context: bpy.types.Context) -> None:
        """Add the rig about the object."""
        shown = context.scene.lightsphere.capture
        item = results.add_rig(context.scene, settings.values(shown, CaptureSettings))
        shown.rig = results.OWN_RIG
        self.report({"INFO"}, f"{item.name!r} holds {len(item.data.vertices)} lights")


class Running(Refusing):
    """Operators that run a worker beside the window, or, for scripts and without a window, to its end."""

    def start(self, context: bpy.types.Context) -> runs.Run:
        """Start the worker."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run to the end."""
        try:
            run = self.start(context)
            run.wait()
            return self.bring(run)
        except LightsphereError as error:
            return self.refuse(error)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Run beside the window."""
        state = self.begin(context)
        if state == {"RUNNING_MODAL"}:
            context.window_manager.modal_handler_add(self)
        return state

    def begin(self, context: bpy.types.Context) -> set[str]:
        """Start the worker and the clock by which it is looked at."""
        try:
            self.run = self.start(context)
        except LightsphereError as error:
            return self.refuse(error)
        self.timer = context.window_manager.event_timer_add(INTERVAL, window=context.window)
        self.shown_at = 0.0
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look at the worker on every tick, stop it on Esc; everything else passes through."""
        if event.type not in ("TIMER", "ESC"):
            return {"PASS_THROUGH"}
        state = self.run.event(event.type)
        if state != "running":
            show(context, None)
        elif time.monotonic() > self.shown_at + SHOWN_AGAIN or event.type == "ESC":
            show(context, self.run)
            self.shown_at = time.monotonic()
        if state == "running":
            return {"RUNNING_MODAL" if event.type == "ESC" else "PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        if state == "stopped":
            self.report({"INFO"}, self.run.stopped())
            return {"CANCELLED"}
        try:
            return self.bring(self.run)
        except LightsphereError as error:
            return self.refuse(error)

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the worker when Blender ends the operator, as on opening another file."""
        self.run.stop()
        show(context, None)

    def bring(self, run: runs.Run) -> set[str]:
        """Put the result into the file."""
        self.report({"INFO"}, run.bring())
        return {"FINISHED"}


class StageOperator(Running):
    """What the operators of all stages do alike."""

    stage = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, runs.lacks(cls.stage, context.scene))

    def start(self, context: bpy.types.Context) -> runs.Run:
        return runs.Run(STAGES[self.stage], context.scene)


class LIGHTSPHERE_OT_capture(StageOperator, bpy.types.Operator):
    """Render one picture per light of the rig with Cycles, on a saved copy of this file. Esc stops"""

    bl_idname = "lightsphere.capture"
    bl_label = "Capture"
    bl_options = {"UNDO"}
    stage = "capture"

    resume: bpy.props.BoolProperty(
        name="Continue", description="Go on with the capture that was stopped, as the scene was then"
    )

    def start(self, context: bpy.types.Context) -> runs.Run:
        stopped = runs.stopped_capture() if self.resume else None
        return runs.Run(STAGES[self.stage], context.scene, stopped)


class LIGHTSPHERE_OT_plan(StageOperator, bpy.types.Operator):
    """Try which effects of light the pictures need, what each adds and takes; the capture does so, too. Esc stops"""

    bl_idname = "lightsphere.plan"
    bl_label = "Plan Effects"
    bl_options = {"UNDO"}
    stage = "plan"


class LIGHTSPHERE_OT_import_photographs(StageOperator, bpy.types.Operator):
    """Make a capture from photographs of an object under one light at a time. Esc stops"""

    bl_idname = "lightsphere.import_photographs"
    bl_label = "Import Photographs"
    bl_options = {"UNDO"}
    stage = "import_photographs"


class LIGHTSPHERE_OT_shape(StageOperator, bpy.types.Operator):
    """Recover depth, normals and a mesh from the capture. Esc stops"""

    bl_idname = "lightsphere.shape"
    bl_label = "Recover Shape"
    bl_options = {"UNDO"}
    stage = "shape"


class LIGHTSPHERE_OT_reflectance(StageOperator, bpy.types.Operator):
    """Find the materials that the recovered surface is mixed of, whatever they are, and where each is. Esc stops"""

    bl_idname = "lightsphere.reflectance"
    bl_label = "Recover Reflectance"
    bl_options = {"UNDO"}
    stage = "reflectance"


class LIGHTSPHERE_OT_material(StageOperator, bpy.types.Operator):
    """Make a node material of what was recovered and add the asset to the scene. Esc stops"""

    bl_idname = "lightsphere.material"
    bl_label = "Make Material"
    bl_options = {"UNDO"}
    stage = "material"


class LIGHTSPHERE_OT_relight(StageOperator, bpy.types.Operator):
    """Make the captured picture under the lights of this scene, without tracing a ray. Esc stops"""

    bl_idname = "lightsphere.relight"
    bl_label = "Relight"
    bl_options = {"UNDO"}
    stage = "relight"


class LIGHTSPHERE_OT_keep(StageOperator, bpy.types.Operator):
    """Keep capture and shape in one small file to relight from anywhere, and a map for RTI viewers. Esc stops"""

    bl_idname = "lightsphere.keep"
    bl_label = "Keep in a Small File"
    bl_options = {"UNDO"}
    stage = "keep"


class LIGHTSPHERE_OT_inverse(StageOperator, bpy.types.Operator):
    """Recover what every group of surfaces of this scene reflects from one photograph of it. Esc stops"""

    bl_idname = "lightsphere.inverse"
    bl_label = "Recover from Photograph"
    bl_options = {"UNDO"}
    stage = "inverse"


class LIGHTSPHERE_OT_compare(StageOperator, bpy.types.Operator):
    """Render the asset as it is now under captured and new lights, and show where they differ. Esc stops"""

    bl_idname = "lightsphere.compare"
    bl_label = "Compare with the Capture"
    bl_options = {"UNDO"}
    stage = "compare"


class LIGHTSPHERE_OT_profile(StageOperator, bpy.types.Operator):
    """Click on the recovered mesh: a plot shows what the pictures say about the depth there, and how sure it is"""

    bl_idname = "lightsphere.profile"
    bl_label = "Why This Depth"
    bl_options = {"UNDO"}
    stage = "profile"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Wait for the click."""
        self.is_picking = True
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set("Click on the recovered mesh   Esc leaves")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Take the pixel under a click, then plot it."""
        if not self.is_picking:
            return super().modal(context, event)
        if event.type == "ESC":
            self.end_picking(context)
            return {"CANCELLED"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}
        pixel = None
        if context.area is not None:
            region = next(region for region in context.area.regions if region.type == "WINDOW")
            with context.temp_override(region=region):
                pixel = layers.pixel_at(context, event.mouse_x - region.x, event.mouse_y - region.y)
        if pixel is None:
            self.report({"WARNING"}, "No recovered mesh is there; click on one")
            return {"RUNNING_MODAL"}
        self.end_picking(context)
        context.scene.lightsphere.pixel = pixel
        return self.begin(context)

    def end_picking(self, context: bpy.types.Context) -> None:
        """Give the pointer back."""
        self.is_picking = False
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)

    def cancel(self, context: bpy.types.Context) -> None:
        if self.is_picking:
            self.end_picking(context)
        else:
            super().cancel(context)


class LIGHTSPHERE_OT_estimate(Running, bpy.types.Operator):
    """Try the stage on a part of its input: what Draft, Standard and Final would take and give. Esc stops"""

    bl_idname = "lightsphere.estimate"
    bl_label = "Estimate Time and Error"

    stage: bpy.props.EnumProperty(
        name="Stage", items=[(name, name.title(), "") for name, stage in STAGES.items() if stage.varied]
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, runs.busy())

    def start(self, context: bpy.types.Context) -> runs.Run:
        lacking = STAGES[self.stage].lacks(context.scene)
        if lacking:
            raise LightsphereError(lacking)
        return runs.Estimate(STAGES[self.stage], context.scene)


class LIGHTSPHERE_OT_preset(Acting, bpy.types.Operator):
    """Use these settings: the quickest that are expected to have an error as small as is said"""

    bl_idname = "lightsphere.preset"
    bl_label = "Use Preset"
    bl_options = {"UNDO"}

    stage: bpy.props.StringProperty(name="Stage")
    preset: bpy.props.StringProperty(name="Preset")

    def act(self, context: bpy.types.Context) -> None:
        """Set the stage's settings."""
        stage = STAGES.get(self.stage)
        if stage is None or self.preset not in costs.presets(stage, context.scene):
            raise LightsphereError("no estimate is there for these settings; estimate time and error first")
        costs.apply(stage, context.scene, self.preset)


def allowed(operator: type, reason: str) -> bool:
    """Return whether a button can be pressed; where not, its tooltip says why."""
    if reason:
        operator.poll_message_set(reason)
    return not reason


def show(context: bpy.types.Context, run: runs.Run | None) -> None:
    """Show how far a run is in the status bar and the panels; the viewports themselves are not drawn anew."""
    words = f"{run.stage.doing}: {runs.told(run.task)[1]}   Esc stops" if run else None
    context.workspace.status_text_set(words)
    for _, area in windows.areas("VIEW_3D"):
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()


CLASSES = (
    LIGHTSPHERE_OT_add_rig,
    LIGHTSPHERE_OT_capture,
    LIGHTSPHERE_OT_plan,
    LIGHTSPHERE_OT_import_photographs,
    LIGHTSPHERE_OT_shape,
    LIGHTSPHERE_OT_profile,
    LIGHTSPHERE_OT_reflectance,
    LIGHTSPHERE_OT_material,
    LIGHTSPHERE_OT_relight,
    LIGHTSPHERE_OT_keep,
    LIGHTSPHERE_OT_inverse,
    LIGHTSPHERE_OT_compare,
    LIGHTSPHERE_OT_estimate,
    LIGHTSPHERE_OT_preset,
)
