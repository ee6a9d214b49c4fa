"""The scene whose reflectances are looked for: models shown by Cycles, rendered, counted."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import LightsphereError
from ...core.inverse import MOST, POWER, Model, grey, moved
from ...core.inverse.photograph import Photograph
from .. import cycles, exr
from ..camera import camera_of
from ..unwrap import PROJECTED, unwrap
from . import closures
from .groups import EMISSION, Group
from .shining import lamps_of

MOST_BOUNCES = 1024  # what matters ends before, by chance, as its light fades
STEADY_BOUNCES = (6, 64)
LEFT_OUT = 0.02  # share of the light that steady pictures may leave out: the shapes of lobes are found by them
# blue noise differs by the numbers of samples that were rendered before, as long as a scene is kept
SAME_NOISE = {"sampling_pattern": "TABULATED_SOBOL"}
GLOW = "Lightsphere "  # of a light group's name
BOX = {"pixel_filter_type": "BOX", "filter_width": 1.0}
Array = NDArray[np.float64]
OFFSET = 1000  # of the numbers of surfaces in a render, which are not negative
Texture = NDArray[np.float32]
Window = tuple[slice, slice]  # rows and columns


@dataclass(frozen=True)
class State:
    """What groups and lamps show at a time."""

    models: tuple[Model, ...]
    textures: tuple[Texture | None, ...]
    powers: tuple[float, ...]


class Room:
    """A scene of groups, each of which shows a model.

    Attributes
    ----------
    groups : list of Group
        Those whose reflectance is looked for.
    models : list of Model
        What they show.
    textures : list of (H, W, 3) float32 or None
        What their diffuse reflectances are multiplied with.
    lamps : list of Lamp
        What shines.
    powers : list of float
        By what their power in the scene is multiplied now.
    free_lamps : list of int
        Those whose power is looked for.
    known : dict of int to (3,) float64
        Groups whose reflectance is known.
    layers, directions : list of str
        Layers of texture coordinates that groups have, and that their brushing follows; empty where there is none.
    own : dict
        The scene's render settings that are others as long as the room is rendered.
    renders, samples, seconds
        What rendering has cost: pictures, samples of light in all, time.
    """

    def __init__(self, scene: bpy.types.Scene, groups: list[Group], photograph: Photograph) -> None:
        """Give every group that is looked for a grey material; the scene's other materials stay."""
        self.lamps = lamps_of(scene, groups)
        if not self.lamps and scene.world is None and not any(group.kept == EMISSION for group in groups):
            raise LightsphereError(f"the scene {scene.name!r} has no light; add the lights of the photograph")
        self.scene = scene
        self.own = {"use_persistent_data": scene.render.use_persistent_data}
        scene.render.use_persistent_data = True  # between renders, too: a heavy scene is built once
        self.powers = [1.0] * len(self.lamps)
        self.free_lamps: list[int] = []
        self.known: dict[int, Array] = {}
        self.groups = [group for group in groups if not group.kept]
        self.render_like(photograph)
        self.renders, self.samples, self.seconds = 0, 0.0, 0.0
        self.original = [[item.material_slots[n].material for item, n in group.slots] for group in self.groups]
        for group in self.groups:
            unwrap(scene, _without_uvs(group))
        self.layers = [_uv_layer(group) for group in self.groups]
        self.areas = [_area(group) for group in self.groups]
        self.steady_bounces = STEADY_BOUNCES[0]
        self.materials = []
        self.directions = ["" if layer == PROJECTED else layer for layer in self.layers]
        for number, group in enumerate(self.groups):
            self.materials.append(closures.group_material(group.name, self.directions[number]))
            for item, slot in group.slots:
                item.material_slots[slot].material = self.materials[-1]
        self.models: list[Model] = [grey()] * len(self.groups)
        self.textures: list[Texture | None] = [None] * len(self.groups)
        for number in range(len(self.groups)):
            self.show(number, grey())

    def render_like(self, photograph: Photograph) -> None:
        """Let pictures have a photograph's size and pixels.

        These have the scene's own filter where they are not means over squares: by another filter, edges and highlights
        differ by more than a wrong reflectance does.
        """
        height, width = photograph.trusted.shape
        self.camera = camera_of(self.scene, width, height)
        own = {name: getattr(self.scene.cycles, name) for name in BOX}
        self.filter: dict[str, Any] = BOX if photograph.averaged else own

    def show(self, number: int, model: Model) -> None:
        """Let a group show a model."""
        self.models[number] = model
        closures.show(self.materials[number], model, self.directions[number])

    def power(self, number: int, factor: float) -> None:
        """Let a lamp shine by a factor of what it does in the scene."""
        self.powers[number] = factor
        self.lamps[number].shine(factor)

    def move(self, number: int, kind: str, by: Array | float) -> None:
        """Move a group's parameter, see :func:`pipeline.core.inverse.moved`, or a lamp's power by a factor exp(by)."""
        if kind == POWER:
            self.power(number, self.powers[number] * float(np.exp(np.mean(by))))
        else:
            self.show(number, moved(self.models[number], kind, by))

    @contextlib.contextmanager
    def trying(self, number: int, model: Model) -> Iterator[None]:
        """Let a group show another model for a while."""
        before = self.models[number]
        self.show(number, model)
        try:
            yield
        finally:
            self.show(number, before)

    @contextlib.contextmanager
    def shining(self, powers: Sequence[float]) -> Iterator[None]:
        """Let the lamps have other powers for a while."""
        before = list(self.powers)
        try:
            for number, factor in enumerate(powers):
                self.power(number, factor)
            yield
        finally:
            for number, factor in enumerate(before):
                self.power(number, factor)

    def moving(self, number: int, kind: str, by: float) -> contextlib.AbstractContextManager[None]:
        """Move a parameter for a while."""
        if kind == POWER:
            powers = list(self.powers)
            powers[number] *= float(np.exp(by))
            return self.shining(powers)
        return self.trying(number, moved(self.models[number], kind, by))

    def alone(self, number: int | None, samples: int, seed: int) -> Array:
        """Render with no lamp but one, or none: what else shines stays."""
        with self.shining([float(other == number) for other in range(len(self.lamps))]):
            return self.render(samples, seed)

    def state(self) -> State:
        """Return what all groups and lamps show now."""
        return State(tuple(self.models), tuple(self.textures), tuple(self.powers))

    def set(self, state: State) -> None:
        """Show an earlier state."""
        for number, (model, texture) in enumerate(zip(state.models, state.textures, strict=True)):
            self.show(number, model)
            if texture is not self.textures[number]:
                self.paint(number, texture)
        for number, factor in enumerate(state.powers):
            self.power(number, factor)

    def restore(self, numbers: Sequence[int]) -> None:
        """Give groups the materials back that they had."""
        for number in numbers:
            for (item, slot), material in zip(self.groups[number].slots, self.original[number], strict=True):
                item.material_slots[slot].material = material

    def paint(self, number: int, texture: Texture | None) -> None:
        """Give a group a texture (H, W, 3) of diffuse reflectances, or take it away."""
        self.textures[number] = texture
        closures.paint(self.materials[number], self.groups[number].name, texture, self.layers[number])
        self.show(number, self.models[number])
        cycles.forget(self.scene)

    def render(
        self, samples: int, seed: int, steady: bool = False, window: Window | None = None, denoised: bool = False
    ) -> Array:
        """Render, (H, W, 3) or a window of it; denoised is for the eye alone.

        In steady pictures no path ends by chance, so that those of one seed differ by what was changed alone; they
        leave late bounces out, see :meth:`count_bounces`. The others have all light.
        """
        channels = self._rendered(samples, seed, steady, window, denoised)
        return np.stack([channels[letter] for letter in "RGB"], axis=-1).astype(np.float64)

    def glowing(self, radiances: Mapping[int, Array], samples: int, seed: int) -> dict[int, Array]:
        """Render the room without its lamps, each of some groups glowing by itself; return its light, (H, W, 3).

        One picture serves all that share no object: Cycles' light groups keep their light apart, and are of objects.
        """
        shown = {}
        with self.shining([0.0] * len(self.lamps)):
            for together in _apart({number: self.groups[number] for number in radiances}):
                with contextlib.ExitStack() as stack:
                    for number in together:
                        stack.enter_context(closures.glowing(self.materials[number], radiances[number]))
                        stack.enter_context(_light_group(self.scene, f"{GLOW}{number}", self.groups[number]))
                    channels = self._rendered(samples, seed, layers=True)
                shown |= {number: _layer(channels, f"Combined_{GLOW}{number}", "RGB") for number in together}
        return shown

    def _rendered(
        self,
        samples: int,
        seed: int,
        steady: bool = False,
        window: Window | None = None,
        denoised: bool = False,
        layers: bool = False,
    ) -> dict[str, NDArray[np.float32]]:
        """Render and count; return the picture's channels, or those of all its passes."""
        start = time.perf_counter()
        transport = cycles.Transport(self.steady_bounces if steady else MOST_BOUNCES, samples=samples)
        with (
            self._measuring(transport, seed, steady),
            cycles.cropped(self.scene, self.camera, window),
            cycles.changed(self.scene.cycles, {"use_denoising": denoised}),
            cycles.openexr(self.scene, layers),
            tempfile.TemporaryDirectory() as folder,
        ):
            path = Path(folder) / "room.exr"
            cycles.render(self.scene, path)
            channels = exr.read(path)
        self.renders += 1
        self.samples += samples * next(iter(channels.values())).size
        self.seconds += time.perf_counter() - start
        return channels

    @contextlib.contextmanager
    def counted(self, cost: dict[str, float]) -> Iterator[None]:
        """Add the ``renders`` made meanwhile and their ``seconds`` to a cost."""
        renders, seconds = self.renders, self.seconds
        try:
            yield
        finally:
            cost["renders"] += self.renders - renders
            cost["seconds"] += self.seconds - seconds

    def pixels(
        self, mask: NDArray[np.bool_], samples: int, seed: int, steady: bool = False, denoised: bool = False
    ) -> Array:
        """Render no more than holds a mask; return its pixels (P, 3)."""
        rows, columns = (np.nonzero(mask.any(axis=axis))[0] for axis in (1, 0))
        window = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
        return self.render(samples, seed, steady, window, denoised)[mask[window]]

    def layers_of_pixels(self) -> tuple[NDArray[np.int64], Array, Array]:
        """Return what each pixel shows, (H, W), its texture coordinates, (H, W, 2), and its place, (H, W, 3).

        The number of a group, -1 for nothing but the world, -2 for a surface that is kept, and -3 - n for one of those
        by which lamp n shines.
        """
        shown = {material: number for number, material in enumerate(self.materials)}
        shown |= {lamp.material: -3 - number for number, lamp in enumerate(self.lamps) if lamp.material}
        layer = self.scene.view_layers[0]
        wanted = dict.fromkeys(("use_pass_material_index", "use_pass_uv", "use_pass_position"), True)
        with (
            cycles.measuring(self.scene, self.camera, cycles.DIRECT),
            cycles.openexr(self.scene, layers=True),
            cycles.changed(layer, wanted),
            tempfile.TemporaryDirectory() as folder,
            contextlib.ExitStack() as stack,
        ):
            for material in bpy.data.materials:
                stack.enter_context(cycles.changed(material, {"pass_index": shown.get(material, -2) + OFFSET}))
            path = Path(folder) / "layers.exr"
            cycles.render(self.scene, path)
            channels = exr.read(path)
        index = _named(channels, "IndexMA.X", "Material Index.X")
        numbers = index.round().astype(np.int64)
        shows = np.where(numbers == 0, -1, numbers - OFFSET)
        return shows, _layer(channels, "UV", "UV"), _layer(channels, "Position", "XYZ")

    def count_bounces(self) -> None:
        """Let steady pictures follow light until the usual path has lost enough of it, as the groups are now."""
        returns = [min(model.diffuse.mean() + model.specular.mean(), MOST) for model in self.models]
        returned = np.average(returns, weights=self.areas)
        needed = np.ceil(np.log(LEFT_OUT) / np.log(max(returned, 0.01)))
        self.steady_bounces = int(np.clip(needed, *STEADY_BOUNCES))

    @contextlib.contextmanager
    def _measuring(self, transport: cycles.Transport, seed: int, steady: bool) -> Iterator[None]:
        """Set Cycles up: the scene's own world and lights, and the pixels of the photograph."""
        own: dict[str, Any] = {"min_light_bounces": transport.bounces if steady else 3, **self.filter, **SAME_NOISE}
        with (
            cycles.measuring(self.scene, self.camera, transport, seed, world=self.scene.world),
            cycles.changed(self.scene.cycles, own),
        ):
            yield


def _apart(groups: Mapping[int, Group]) -> list[list[int]]:
    """Return groups by number in as few lists as taking each in turn makes: in none do two share an object."""
    lists: list[tuple[list[int], set[bpy.types.Object]]] = []
    for number, group in groups.items():
        items = {item for item, _ in group.slots}
        numbers, taken = next((one for one in lists if not one[1] & items), ([], set()))
        if not numbers:
            lists.append((numbers, taken))
        numbers.append(number)
        taken |= items
    return [numbers for numbers, _ in lists]


@contextlib.contextmanager
def _light_group(scene: bpy.types.Scene, name: str, group: Group) -> Iterator[None]:
    """Have the light of a group's objects written apart for a while."""
    layer = scene.view_layers[0]
    own = layer.lightgroups.add(name=name)
    try:
        with contextlib.ExitStack() as stack:
            for item in {item for item, _ in group.slots}:
                stack.callback(item.update_tag)
                stack.enter_context(cycles.changed(item, {"lightgroup": name}))
                item.update_tag()  # an object that is shown by instances alone is not by itself
            yield
    finally:
        layer.lightgroups.remove(own)


def _area(group: Group) -> float:
    """Return the area of a group's surfaces, about [m^2]; what is no mesh counts little."""
    total = 1e-9
    for item, slot in group.slots:
        if item.type == "MESH":
            scale = abs(item.matrix_world.determinant()) ** (2 / 3)
            total += scale * sum(part.area for part in item.data.polygons if part.material_index == slot)
    return total


def _without_uvs(group: Group) -> list[bpy.types.Mesh]:
    """Return the meshes of a group that is made of nothing else, if none of them has UVs."""
    meshes = {item.data.name: item.data for item, _ in group.slots if item.type == "MESH"}
    bare = [mesh for mesh in meshes.values() if mesh.polygons and not mesh.uv_layers]
    return bare if len(bare) == len({item.data.name for item, _ in group.slots}) else []


def _uv_layer(group: Group) -> str:
    """Return the layer of texture coordinates that all meshes of a group have, empty where there is none."""
    names = [
        item.data.uv_layers.active.name if item.type == "MESH" and item.data.uv_layers.active else ""
        for item, _ in group.slots
    ]
    return names[0] if len(set(names)) == 1 else ""


def _layer(channels: dict[str, NDArray[np.float32]], name: str, axes: str) -> Array:
    return np.stack([_named(channels, f"{name}.{axis}") for axis in axes], axis=-1).astype(np.float64)


def _named(channels: dict[str, NDArray[np.float32]], *ends: str) -> NDArray[np.float32]:
    return next(values for name, values in channels.items() if name.endswith(ends))
