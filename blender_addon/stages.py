"""The stages as the add-on sees them: what each lacks to run, the words of its command, what its result brings."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path
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
from . import comparison, groups, plan, results, settings

SCENE_COPY = "scene.blend"
PLOT = "profile.png"
PLAN = "plan.json"
KEPT_RATE = "20"


class Stage:
    """A stage.

    Attributes
    ----------
    name : str
    doing : str
        What is told while it runs.
    settings : type
        Its settings dataclass.
    opens : str
        The scene's property that names what it opens.
    varied : tuple of str
        Settings that presets choose by trials; empty where the stage makes none.
    """

    name: str
    doing: str
    settings: type[Any]
    opens = ""
    varied: tuple[str, ...] = ()

    def lacks(self, scene: bpy.types.Scene) -> str:
        """Return why the stage cannot run, empty when it can."""
        raise NotImplementedError

    def foretells(self, scene: bpy.types.Scene) -> bool:
        """Return whether trials can tell what the stage would take and give."""
        return bool(self.varied)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        """Return the command's words; the result goes into the folder."""
        raise NotImplementedError

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        """Put the result into the scene; return what to tell the artist."""
        raise NotImplementedError

    def left(self, scene: bpy.types.Scene, folder: Path) -> str:
        """Put what a stopped run left into the scene; return what to tell, empty where only files are left."""
        return ""

    def chosen(self, scene: bpy.types.Scene) -> Any:
        """Return the settings that the scene shows."""
        return settings.absolute(settings.values(getattr(scene.lightsphere, self.name), self.settings))

    def options(self, scene: bpy.types.Scene) -> list[str]:
        """Return the settings as words of the command."""
        return settings.options(self.chosen(scene))

    def opened(self, scene: bpy.types.Scene) -> str:
        """Return the path of what the stage opens, or the scene's name."""
        return str(given(scene, self.opens)) if self.opens else scene.name


class Capture(Stage):
    """Render the scene under one light at a time."""

    name = "capture"
    doing = "Capturing"
    settings = CaptureSettings
    varied = ("samples",)

    def lacks(self, scene: bpy.types.Scene) -> str:
        if scene.lightsphere.capture.rig == results.OWN_RIG and not results.rigs(scene):
            return "The scene has no rig: add one"
        return lacks_rig(scene)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        return ["capture", saved_copy(folder), "-o", str(folder), *self.options(scene)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        return bring_pictures(scene, folder)


class Plan(Stage):
    """Find out which effects of light the capture needs."""

    name = "plan"
    doing = "Planning"

    def lacks(self, scene: bpy.types.Scene) -> str:
        return STAGES["capture"].lacks(scene)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        chosen = dataclasses.replace(STAGES["capture"].chosen(scene), simulate="", leave_out="")
        figures = ["--lights=rig", "--json", str(folder / PLAN)]
        return ["plan", saved_copy(folder), *figures, *settings.options(chosen)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        planned = json.loads((folder / PLAN).read_text(encoding="utf-8"))["effects"]
        plan.bring(scene, planned)
        shutil.rmtree(folder)  # the scene keeps it
        return f"The pictures need {', '.join(one['effect'] for one in planned if one['simulated'])}"

    def left(self, scene: bpy.types.Scene, folder: Path) -> str:
        shutil.rmtree(folder)
        return "nothing was planned"


class Import(Stage):
    """Make a capture from photographs."""

    name = "import_photographs"
    doing = "Importing"
    settings = ImportSettings
    opens = "photographs"

    def lacks(self, scene: bpy.types.Scene) -> str:
        if not scene.lightsphere.photographs:
            return "No photographs are chosen yet"
        return "" if given(scene, "photographs").exists() else "No photographs are there"

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        return ["import", str(given(scene, "photographs")), "-o", str(folder), *self.options(scene)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        return bring_pictures(scene, folder)


class Shape(Stage):
    """Recover depth and mesh from a capture."""

    name = "shape"
    doing = "Recovering the shape"
    settings = ShapeSettings
    opens = "capture_folder"
    varied = ("pictures", "bases")

    def lacks(self, scene: bpy.types.Scene) -> str:
        return lacks_capture(scene)

    def foretells(self, scene: bpy.types.Scene) -> bool:
        return scene.lightsphere.shape.method != "uncalibrated" and not scene.lightsphere.scan

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        shown = scene.lightsphere
        scan = ["--mesh", str(given(scene, "scan")), f"--mesh-unit={shown.scan_unit}"] if shown.scan else []
        return ["shape", str(given(scene, "capture_folder")), "-o", str(folder), *scan, *self.options(scene)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        shown = scene.lightsphere
        shown.shape_folder = kept_as(folder)
        shown.reflectance_folder = kept_as(folder / "reflectance") if (folder / "reflectance").is_dir() else ""
        return f"The mesh {results.mesh(scene, folder).name!r} is in the scene"


class Profile(Stage):
    """Plot what the pictures say about the depth of one pixel."""

    name = "profile"
    doing = "Plotting"

    def lacks(self, scene: bpy.types.Scene) -> str:
        return lacks_capture(scene)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        row, column = scene.lightsphere.pixel
        place = [f"--row={row}", f"--column={column}"]
        return ["profile", str(given(scene, "capture_folder")), *place, "-o", str(folder / PLOT)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        image = results.picture(folder / PLOT, folder.name)
        image.pack()
        results.show_image(image)
        return f"The plot {image.name!r} is among the images"


class Reflectance(Stage):
    """Fit what the recovered shape reflects."""

    name = "reflectance"
    doing = "Fitting the reflectance"
    settings = ReflectanceSettings
    opens = "shape_folder"
    varied = ("model", "bases", "clusters")

    def lacks(self, scene: bpy.types.Scene) -> str:
        return lacks_shape(scene)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        return ["reflectance", str(given(scene, "shape_folder")), "-o", str(folder), *self.options(scene)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        scene.lightsphere.reflectance_folder = kept_as(folder)
        return f"The reflectance explains lights held out but for {results.reflectance_error(folder):.2g} %"


class Material(Stage):
    """Give the recovered shape a material that Cycles renders."""

    name = "material"
    doing = "Fitting the material"
    settings = MaterialSettings
    opens = "reflectance_folder"
    varied = ("lobes",)

    def lacks(self, scene: bpy.types.Scene) -> str:
        return lacks_shape(scene)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        source = "reflectance_folder" if scene.lightsphere.reflectance_folder else "shape_folder"
        return ["material", str(given(scene, source)), "-o", str(folder / results.ASSET), *self.options(scene)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        made = results.asset(scene, folder / results.ASSET)
        return f"The asset {made.name!r} is in the scene, its material among the assets of this file"


class Relight(Stage):
    """Make the captured picture anew under the scene's lights."""

    name = "relight"
    doing = "Relighting"
    settings = RelightSettings
    opens = "shape_folder"
    varied = ("pictures", "interpolation")

    def lacks(self, scene: bpy.types.Scene) -> str:
        lacking = "" if results.shining(scene) else "The scene has no light: add one"
        return lacks_shape(scene) or lacking

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        shape = str(given(scene, "shape_folder"))
        return ["relight", shape, "-o", str(folder), "--scene", saved_copy(folder), *self.options(scene)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        image = results.picture(folder / "relit.exr", folder.name)
        results.show_image(image)
        return f"The picture {image.name!r} is among the images"


class Keep(Stage):
    """Keep capture and shape in one small file, and in a map for RTI viewers."""

    name = "keep"
    doing = "Writing the small file"

    def lacks(self, scene: bpy.types.Scene) -> str:
        return lacks_shape(scene)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        return ["relight", str(given(scene, "shape_folder")), "-o", str(folder), "--compact", KEPT_RATE, "--ptm"]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        return f"The capture in 1/{KEPT_RATE} of its bytes, and a map for RTI viewers, are in {folder}"


class Inverse(Stage):
    """Recover what every group of surfaces reflects from one photograph of the scene."""

    name = "inverse"
    doing = "Recovering reflectances"
    settings = InverseSettings
    opens = "photograph"
    varied = ("budget",)

    def lacks(self, scene: bpy.types.Scene) -> str:
        if not scene.lightsphere.photograph:
            return "No photograph is chosen yet"
        if not given(scene, "photograph").is_file():
            return "No photograph is there"
        return "" if scene.camera else "The scene has no camera"

    def foretells(self, scene: bpy.types.Scene) -> bool:
        return scene.lightsphere.inverse.method == "joint"

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        figures = ["--json", str(folder / groups.FIGURES)]
        picture = str(given(scene, "photograph"))
        return ["inverse", saved_copy(folder), picture, "-o", str(folder), *figures, *self.options(scene)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        told = groups.bring(scene, folder)
        results.show_image(results.picture(folder / "rerendered.exr", f"{folder.name} rendered"))
        return told

    def left(self, scene: bpy.types.Scene, folder: Path) -> str:
        return self.bring(scene, folder) if (folder / groups.FIGURES).is_file() else ""


class Compare(Stage):
    """Render the asset beside its capture."""

    name = "compare"
    doing = "Comparing"
    settings = CompareSettings
    opens = "capture_folder"

    def lacks(self, scene: bpy.types.Scene) -> str:
        lacking = "" if results.assets(scene) else "The scene has no asset: make one"
        return lacks_capture(scene) or lacking

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        capture = str(given(scene, "capture_folder"))
        figures = ["--json", str(folder / comparison.FIGURES)]
        return ["compare", saved_copy(folder), capture, "-o", str(folder), *figures, *self.options(scene)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        results.error_maps(folder)
        scene.lightsphere.comparison_folder = kept_as(folder)
        comparison.show(scene)
        found = comparison.errors(folder).items()
        words = ", ".join(f"{name.replace('_', ' ')} {100 * error:.2g} %" for name, error in found)
        return f"Relative RMSE: {words}. Pictures are in the Image Editor, a page is in {folder}"


STAGES: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        Capture(),
        Plan(),
        Import(),
        Shape(),
        Profile(),
        Reflectance(),
        Material(),
        Relight(),
        Keep(),
        Inverse(),
        Compare(),
    )
}


def lacks_rig(scene: bpy.types.Scene) -> str:
    """Return why no rig can stand in a scene, empty when it can."""
    if scene.camera is None:
        return "The scene has no camera"
    if not any(item.type == "MESH" and not item.hide_render for item in scene.objects):
        return "The scene has no mesh to capture"
    return ""


def lacks_capture(scene: bpy.types.Scene) -> str:
    """Return why a scene's capture cannot be opened, empty when it can."""
    if not scene.lightsphere.capture_folder:
        return "No capture is chosen yet"
    return "" if results.finished(given(scene, "capture_folder")) else "No finished capture is there"


def lacks_shape(scene: bpy.types.Scene) -> str:
    """Return why a scene's shape cannot be opened, empty when it can."""
    if not scene.lightsphere.shape_folder:
        return "No shape is chosen yet"
    return "" if (given(scene, "shape_folder") / "shape.json").is_file() else "No recovered shape is there"


def bring_pictures(scene: bpy.types.Scene, folder: Path) -> str:
    """Let the next stage open a capture, by the method that suits it, and show its pictures as a sequence."""
    scene.lightsphere.capture_folder = kept_as(folder)
    scene.lightsphere.shape.method = results.suited_method(folder)
    scene.lightsphere.shape_folder = scene.lightsphere.reflectance_folder = ""
    return f"{results.pictures(folder)} pictures in {folder}, as an image of a frame for every light"


def given(scene: bpy.types.Scene, name: str) -> Path:
    """Return a path that the scene names, absolute."""
    return Path(bpy.path.abspath(getattr(scene.lightsphere, name)))


def kept_as(folder: Path) -> str:
    """Return a result's folder as the scene keeps it: relative to a saved file, so that both can move together."""
    return bpy.path.relpath(str(folder)) if bpy.data.filepath else str(folder)


def saved_copy(folder: Path) -> str:
    """Save a copy of the file as it is now into a folder, for a worker to open; return its path."""
    path = str(folder / SCENE_COPY)
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True, check_existing=False)
    return path
