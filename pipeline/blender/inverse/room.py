"""The scene whose reflectances are looked for: models shown by Cycles, rendered, counted."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import LightsphereError
from ...core.inverse import MOST, Model, grey
from .. import cycles, exr
from ..camera import camera_of
from . import closures
from .groups import Group

MOST_BOUNCES = 1024  # what matters ends before, by chance, as its light fades
STEADY_BOUNCES = (6, 64)
LEFT_OUT = 0.25  # share of the light that steady pictures may leave out: they give derivatives alone
Array = NDArray[np.float64]
Crop = tuple[int, int, int, int]  # rows from, to, columns from, to


class Room:
    """A scene of groups, each of which shows a model.

    Attributes
    ----------
    groups : list of Group
        Those whose reflectance is looked for.
    models : list of Model
        What they show.
    renders, samples, seconds
        What rendering has cost: pictures, samples of light in all, time.
    """

    def __init__(self, scene: bpy.types.Scene, groups: list[Group], width: int, height: int) -> None:
        """Give every group that is looked for a grey material; the scene's other materials stay."""
        lamps = any(item.type == "LIGHT" and not item.hide_render for item in scene.objects)
        if not lamps and scene.world is None and not any(group.kept == "shines" for group in groups):
            raise LightsphereError(f"the scene {scene.name!r} has no light; add the lights of the photograph")
        self.scene = scene
        self.groups = [group for group in groups if not group.kept]
        self.camera = camera_of(scene, width, height)
        self.renders, self.samples, self.seconds = 0, 0.0, 0.0
        self.original = [[item.material_slots[n].material for item, n in group.slots] for group in self.groups]
        self.layers = [_uv_layer(group) for group in self.groups]
        self.areas = [_area(group) for group in self.groups]
        self.steady_bounces = STEADY_BOUNCES[0]
        self.materials = []
        for number, group in enumerate(self.groups):
            self.materials.append(closures.group_material(group.name, self.layers[number]))
            for item, slot in group.slots:
                item.material_slots[slot].material = self.materials[-1]
        self.models: list[Model] = [grey()] * len(self.groups)
        for number in range(len(self.groups)):
            self.show(number, grey())

    def show(self, number: int, model: Model) -> None:
        """Let a group show a model."""
        self.models[number] = model
        closures.show(self.materials[number], model)

    @contextlib.contextmanager
    def trying(self, number: int, model: Model) -> Iterator[None]:
        """Let a group show another model for a while."""
        before = self.models[number]
        self.show(number, model)
        try:
            yield
        finally:
            self.show(number, before)

    def restore(self, numbers: Sequence[int]) -> None:
        """Give groups the materials back that they had."""
        for number in numbers:
            for (item, slot), material in zip(self.groups[number].slots, self.original[number], strict=True):
                item.material_slots[slot].material = material

    def paint(self, number: int, texture: NDArray[np.float32] | None) -> None:
        """Give a group a texture (H, W, 3) of diffuse reflectances, or take it away."""
        closures.paint(self.materials[number], self.groups[number].name, texture, self.layers[number])
        self.show(number, self.models[number])

    def render(self, samples: int, seed: int, steady: bool = False, crop: Crop | None = None) -> Array:
        """Render, (H, W, 3) or the crop of it.

        In steady pictures no path ends by chance, so that those of one seed differ by what was changed alone; they
        leave late bounces out, see :meth:`count_bounces`. The others have all light.
        """
        start = time.perf_counter()
        transport = cycles.Transport(self.steady_bounces if steady else MOST_BOUNCES, samples=samples)
        with (
            self._measuring(transport, seed, steady, crop),
            cycles.openexr(self.scene),
            tempfile.TemporaryDirectory() as folder,
        ):
            path = Path(folder) / "room.exr"
            cycles.render(self.scene, path)
            picture = exr.read_rgb(path).astype(np.float64)
        self.renders += 1
        self.samples += samples * picture.shape[0] * picture.shape[1]
        self.seconds += time.perf_counter() - start
        return picture

    def pixels(self, mask: NDArray[np.bool_], samples: int, seed: int, steady: bool = False) -> Array:
        """Render no more than holds a mask; return its pixels (P, 3)."""
        rows, columns = (np.nonzero(mask.any(axis=axis))[0] for axis in (1, 0))
        top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
        return self.render(samples, seed, steady, (top, bottom, left, right))[mask[top:bottom, left:right]]

    def layers_of_pixels(self) -> tuple[NDArray[np.int64], Array]:
        """Return which group each pixel shows (H, W), -1 for none, and its texture coordinates (H, W, 2)."""
        layer = self.scene.view_layers[0]
        wanted = dict.fromkeys(("use_pass_material_index", "use_pass_uv"), True)
        with (
            cycles.measuring(self.scene, self.camera, cycles.DIRECT),
            cycles.openexr(self.scene, layers=True),
            cycles.changed(layer, wanted),
            tempfile.TemporaryDirectory() as folder,
            contextlib.ExitStack() as stack,
        ):
            for material in bpy.data.materials:
                number = self.materials.index(material) + 1 if material in self.materials else 0
                stack.enter_context(cycles.changed(material, {"pass_index": number}))
            path = Path(folder) / "layers.exr"
            cycles.render(self.scene, path)
            channels = exr.read(path)
        index = _named(channels, "IndexMA.X", "Material Index.X")
        uv = np.stack([_named(channels, f"UV.{axis}") for axis in "UV"], axis=-1)
        return index.round().astype(np.int64) - 1, uv.astype(np.float64)

    def count_bounces(self) -> None:
        """Let steady pictures follow light until the usual path has lost enough of it, as the groups are now."""
        returns = [min(model.diffuse.mean() + model.specular.mean(), MOST) for model in self.models]
        returned = np.average(returns, weights=self.areas)
        needed = np.ceil(np.log(LEFT_OUT) / np.log(max(returned, 0.01)))
        self.steady_bounces = int(np.clip(needed, *STEADY_BOUNCES))

    @contextlib.contextmanager
    def _measuring(self, transport: cycles.Transport, seed: int, steady: bool, crop: Crop | None) -> Iterator[None]:
        """Set Cycles up: the scene's own world and lights, every pixel the mean over its square."""
        own: dict[str, Any] = {
            "min_light_bounces": transport.bounces if steady else 3,
            "pixel_filter_type": "BOX",
            "filter_width": 1.0,
        }
        width, height = self.camera.resolution
        border: dict[str, Any] = {}
        if crop is not None:
            top, bottom, left, right = crop
            border = {"use_border": True, "use_crop_to_border": True}
            border |= {"border_min_x": left / width, "border_max_x": right / width}
            border |= {"border_min_y": 1 - bottom / height, "border_max_y": 1 - top / height}
        world = self.scene.world
        with (
            cycles.measuring(self.scene, self.camera, transport, seed),
            cycles.changed(self.scene, {"world": world}),
            cycles.changed(self.scene.cycles, own),
            cycles.changed(self.scene.render, border),
        ):
            yield


def _area(group: Group) -> float:
    """Return the area of a group's surfaces, about [m^2]; what is no mesh counts little."""
    total = 1e-9
    for item, slot in group.slots:
        if item.type == "MESH":
            scale = abs(item.matrix_world.determinant()) ** (2 / 3)
            total += scale * sum(part.area for part in item.data.polygons if part.material_index == slot)
    return total


def _uv_layer(group: Group) -> str:
    """Return the layer of texture coordinates that all meshes of a group have, empty where there is none."""
    names = [
        item.data.uv_layers.active.name if item.type == "MESH" and item.data.uv_layers.active else ""
        for item, _ in group.slots
    ]
    return names[0] if len(set(names)) == 1 else ""


def _named(channels: dict[str, NDArray[np.float32]], *ends: str) -> NDArray[np.float32]:
    return next(values for name, values in channels.items() if name.endswith(ends))
