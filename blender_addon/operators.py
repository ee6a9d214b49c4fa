"""The buttons: one operator per stage. A stage runs in a worker; Esc stops it and finished pictures are kept."""

import bpy

from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.errors import LightsphereError
from . import properties, results, settings, stages

INTERVAL = 0.2  # [s] between two looks at the worker


class LIGHTSPHERE_OT_add_rig(bpy.types.Operator):
    """Add the lights of the settings as an object that you can move and scale; the capture then uses it"""

    bl_idname = "lightsphere.add_rig"
    bl_label = "Add Light Rig"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, stages.lacks_rig(context.scene))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add the rig about the object."""
        shown = properties.of(context.scene).capture
        try:
            item = results.add_rig(context.scene, settings.values(shown, CaptureSettings))
        except LightsphereError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        shown.rig = results.OWN_RIG
        self.report({"INFO"}, f"{item.name!r} holds {len(item.data.vertices)} lights")
        return {"FINISHED"}


class StageOperator:
    """What the operators of all stages do alike."""

    stage = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, stages.lacks(cls.stage, context.scene))

    def start(self, context: bpy.types.Context) -> stages.Run:
        """Start the worker."""
        return stages.Run(stages.STAGES[self.stage], context.scene)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run the stage to its end, as scripts and Blender without a window do."""
        try:
            run = self.start(context)
            run.wait()
            return self.bring(run)
        except LightsphereError as error:
            return self.refuse(error)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Run the stage beside the window."""
        try:
            self.run = self.start(context)
        except LightsphereError as error:
            return self.refuse(error)
        manager = context.window_manager
        self.timer = manager.event_timer_add(INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look at the worker on every tick, stop it on Esc; everything else passes through."""
        if event.type not in ("TIMER", "ESC"):
            return {"PASS_THROUGH"}
        state = self.run.event(event.type)
        show(context, self.run if state == "running" else None)
        if state == "running":
            return {"RUNNING_MODAL" if event.type == "ESC" else "PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        if state == "stopped":
            self.report({"INFO"}, f"Stopped; what is finished is kept in {self.run.folder}")
            return {"CANCELLED"}
        try:
            return self.bring(self.run)
        except LightsphereError as error:
            return self.refuse(error)

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the worker when Blender ends the operator, as on opening another file."""
        self.run.stop()
        show(context, None)

    def bring(self, run: stages.Run) -> set[str]:
        """Put the result into the file."""
        self.report({"INFO"}, run.bring())
        return {"FINISHED"}

    def refuse(self, error: LightsphereError) -> set[str]:
        """Tell what is wrong."""
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


class LIGHTSPHERE_OT_capture(StageOperator, bpy.types.Operator):
    """Render one picture per light of the rig with Cycles, on a saved copy of this file. Esc stops"""

    bl_idname = "lightsphere.capture"
    bl_label = "Capture"
    bl_options = {"UNDO"}
    stage = "capture"

    resume: bpy.props.BoolProperty(
        name="Continue", description="Go on with the capture that was stopped, as the scene was then"
    )

    def start(self, context: bpy.types.Context) -> stages.Run:
        stopped = stages.stopped_capture() if self.resume else None
        return stages.Run(stages.STAGES[self.stage], context.scene, stopped)


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


class LIGHTSPHERE_OT_material(StageOperator, bpy.types.Operator):
    """Fit a material to the capture on the recovered shape and add the asset to the scene. Esc stops"""

    bl_idname = "lightsphere.material"
    bl_label = "Make Material"
    bl_options = {"UNDO"}
    stage = "material"


class LIGHTSPHERE_OT_compare(StageOperator, bpy.types.Operator):
    """Render the asset as it is now under captured and new lights, and open maps of its errors. Esc stops"""

    bl_idname = "lightsphere.compare"
    bl_label = "Compare with the Capture"
    bl_options = {"UNDO"}
    stage = "compare"


def allowed(operator: type, reason: str) -> bool:
    """Return whether a button can be pressed; where not, its tooltip says why."""
    if reason:
        operator.poll_message_set(reason)
    return not reason


def show(context: bpy.types.Context, run: stages.Run | None) -> None:
    """Show how far a run is in the status bar and the panels."""
    words = f"{run.stage.doing}: {stages.told(run.task)[1]}   Esc stops" if run else None
    context.workspace.status_text_set(words)
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


CLASSES = (
    LIGHTSPHERE_OT_add_rig,
    LIGHTSPHERE_OT_capture,
    LIGHTSPHERE_OT_import_photographs,
    LIGHTSPHERE_OT_shape,
    LIGHTSPHERE_OT_material,
    LIGHTSPHERE_OT_compare,
)
