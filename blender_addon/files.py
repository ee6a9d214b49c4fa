"""File > Import and drag and drop: photographs, captures and scanned meshes."""

from pathlib import Path

import bpy
from bpy_extras.io_utils import ImportHelper

from . import results, stages
from .operators import allowed

PHOTOGRAPHS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr")
LISTS = (".lp", ".npz", ".npy")
SCANS = (".ply", ".obj", ".glb", ".gltf", ".usd", ".usdc", ".usda")


class LIGHTSPHERE_OT_open_photographs(bpy.types.Operator, ImportHelper):
    """Import the photographs of a folder: one light at a time, with a list of lights, a mirror ball or neither"""

    bl_idname = "lightsphere.open_photographs"
    bl_label = "Import Photographs to Recover From"
    bl_options = {"UNDO"}

    directory: bpy.props.StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE"})
    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(
        default=";".join(f"*{end}" for end in (*PHOTOGRAPHS, *LISTS)), options={"HIDDEN"}
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the files, unless some were dropped."""
        return self.execute(context) if self.filepath or self.directory else super().invoke(context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Import what was chosen: a list of lights or a stack itself, of photographs their whole folder."""
        path = Path(self.filepath) if self.filepath else Path(self.directory)
        is_list = path.is_file() and path.suffix.lower() in LISTS
        folder = path if path.is_dir() else path.parent
        context.scene.lightsphere.photographs = str(path if is_list else folder)
        return run(context, "import_photographs")

    def draw(self, context: bpy.types.Context) -> None:
        """Show the import's settings beside the files."""
        self.layout.use_property_split = True
        for name in context.scene.lightsphere.import_photographs.__annotations__:
            self.layout.prop(context.scene.lightsphere.import_photographs, name)


class LIGHTSPHERE_OT_open_capture(bpy.types.Operator, ImportHelper):
    """Open a capture that was made before: choose the capture.json in its folder"""

    bl_idname = "lightsphere.open_capture"
    bl_label = "Open Capture"
    bl_options = {"UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="capture.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file, unless it was dropped."""
        return self.execute(context) if self.filepath else super().invoke(context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Open it."""
        path = Path(self.filepath)
        folder = path if path.is_dir() else path.parent
        if not results.finished(folder):
            self.report({"ERROR"}, f"{folder} holds no finished capture; choose the capture.json of one")
            return {"CANCELLED"}
        self.report({"INFO"}, stages.bring_pictures(context.scene, folder))
        return {"FINISHED"}


class LIGHTSPHERE_OT_open_scan(bpy.types.Operator, ImportHelper):
    """Take the shape from a scanned mesh of the captured object: it keeps its triangles, the material is recovered"""

    bl_idname = "lightsphere.open_scan"
    bl_label = "Use Scanned Mesh"
    bl_options = {"UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default=";".join(f"*{end}" for end in SCANS), options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, stages.lacks_capture(context.scene))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Find what the capture's camera sees of it."""
        context.scene.lightsphere.scan = self.filepath
        return run(context, "shape")


class LIGHTSPHERE_FH_photographs(bpy.types.FileHandler):
    """Photographs and lists of lights that are dropped on a viewport."""

    bl_idname = "LIGHTSPHERE_FH_photographs"
    bl_label = "Photographs to Recover From"
    bl_import_operator = "lightsphere.open_photographs"
    bl_file_extensions = ";".join((*PHOTOGRAPHS, *LISTS))

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


class LIGHTSPHERE_FH_capture(bpy.types.FileHandler):
    """A capture.json that is dropped on a viewport."""

    bl_idname = "LIGHTSPHERE_FH_capture"
    bl_label = "Lightsphere Capture"
    bl_import_operator = "lightsphere.open_capture"
    bl_file_extensions = ".json"

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


def run(context: bpy.types.Context, stage: str) -> set[str]:
    """Run a stage beside the window, or to its end where there is none."""
    operator = getattr(bpy.ops.lightsphere, stage)
    state: set[str] = operator("EXEC_DEFAULT" if bpy.app.background or not context.window else "INVOKE_DEFAULT")
    return {"FINISHED"} if state & {"FINISHED", "RUNNING_MODAL"} else {"CANCELLED"}


def draw_menu(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Add to File > Import."""
    self.layout.separator()
    self.layout.operator("lightsphere.open_photographs", text="Lightsphere Photographs (folder, .lp, .npz)")
    self.layout.operator("lightsphere.open_capture", text="Lightsphere Capture (capture.json)")
    self.layout.operator("lightsphere.open_scan", text="Lightsphere Scanned Mesh (.ply, .obj, .glb, .usd)")


CLASSES = (
    LIGHTSPHERE_OT_open_photographs,
    LIGHTSPHERE_OT_open_capture,
    LIGHTSPHERE_OT_open_scan,
    LIGHTSPHERE_FH_photographs,
    LIGHTSPHERE_FH_capture,
)


def register() -> None:
    """Add the menu's entries."""
    bpy.types.TOPBAR_MT_file_import.append(draw_menu)


def unregister() -> None:
    """Take them back."""
    bpy.types.TOPBAR_MT_file_import.remove(draw_menu)
