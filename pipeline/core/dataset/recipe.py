"""A recipe: what the samples of a dataset may be, as a TOML file with one table per dataclass below."""

from __future__ import annotations

import dataclasses
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import images
from ..errors import LightsphereError
from ..settings import check, limits_of, setting

MOST_BYTES = 1_000_000  # of a recipe
SPLITS = ("train", "validation", "test")
SHAPES = ("blob", "vase", "superquadric")  # made by code
MESHES = (".ply", ".obj", ".gltf", ".glb", ".usd", ".usda", ".usdc", ".usdz")
OWN, PRINCIPLED = "own", "principled"
FILES = ("shape", "material")  # the tables whose sources may be files
CAPTURE, SHARDS = "capture", "webdataset"
FORMATS = (CAPTURE, "diligent", "near", "hdf5", SHARDS)

Range = tuple[float, float]
Words = tuple[str, ...]


@dataclass(frozen=True)
class ShapeRecipe:
    """What is captured."""

    source: tuple[str, ...] = setting(
        SHAPES,
        f"what is drawn, each as often: {', '.join(SHAPES)}, a built-in scene, a .blend file, a mesh file, a folder "
        "of meshes or a pattern such as meshes/*.ply",
    )
    detail: tuple[float, float] = setting((0.2, 1.0), "how rough a made shape is, 0: a ball", low=0, high=1)
    extent: tuple[float, float] = setting(
        (1.0, 1.0), "largest extent of a made shape or a mesh", unit="m", low=1e-3, high=1e4
    )
    ground: bool = setting(False, "whether made shapes and meshes stand on a matt disk")


@dataclass(frozen=True)
class MaterialRecipe:
    """What it is made of."""

    source: tuple[str, ...] = setting(
        (PRINCIPLED,),
        f"what is drawn, each as often: {PRINCIPLED}, {OWN} (what a scene or mesh brings), a BRDF file (.binary, "
        ".npz), an .npz with many tables, a folder or a pattern of such files",
    )
    count: tuple[float, float] = setting((1, 3), "Principled materials that are mixed over the surface", low=1, high=3)
    base_color: tuple[float, float] = setting((0.05, 0.9), "red, green and blue of the base colour", low=0, high=1)
    metal: float = setting(0.3, "share of the Principled materials that are metals", low=0, high=1)
    roughness: tuple[float, float] = setting((0.15, 0.8), "roughness", low=0, high=1)
    specular: tuple[float, float] = setting((0.2, 0.8), "specular level", low=0, high=1)
    coat: tuple[float, float] = setting((0.0, 0.0), "weight of a clear coat", low=0, high=1)
    patches: tuple[float, float] = setting(
        (0.2, 0.6), "size of the patches of a mixture over the object's extent", low=0.01, high=10
    )
    lobes: int = setting(4, "most glossy closures of a BRDF file", low=1, high=8)


@dataclass(frozen=True)
class LightsRecipe:
    """Under which light it is seen."""

    layout: str = setting(
        "distant",
        "distant or near lights about the view, or two nested spheres of near ones",
        choices=("distant", "near", "double-sphere"),
    )
    spread: str = setting(
        "random", "whether lights of the first two layouts are drawn or even", choices=("random", "even")
    )
    count: tuple[float, float] = setting((20, 50), "lights; of two spheres those on both", low=1, high=100_000)
    angle: tuple[float, float] = setting(
        (0.0, 70.0), "angle to the view; to the vertical where a ground is", unit="deg", low=0, high=180
    )
    distance: tuple[float, float] = setting(
        (2.0, 4.0), "distance of near lights, in radii of the object", low=1.05, high=1000
    )
    strength: tuple[float, float] = setting(
        (1.0, 1.0), "strength of a light over that of a usual one", low=1e-6, high=1e6
    )


@dataclass(frozen=True)
class CameraRecipe:
    """From where."""

    resolution: int = setting(128, "width and height of the pictures", unit="px", low=4, high=16_384)
    model: str = setting("pinhole", "projection", choices=("pinhole", "orthographic"))
    field_of_view: tuple[float, float] = setting((15.0, 45.0), "of a pinhole", unit="deg", low=1, high=120)
    azimuth: tuple[float, float] = setting((0.0, 360.0), "of the camera", unit="deg", low=-360, high=720)
    elevation: tuple[float, float] = setting((0.0, 40.0), "of the camera", unit="deg", low=-89, high=89)
    margin: tuple[float, float] = setting(
        (1.05, 1.3), "width of the picture over that of a ball about the object", low=0.1, high=100
    )


@dataclass(frozen=True)
class RenderRecipe:
    """Which paths of light are simulated."""

    bounces: int = setting(
        2, "bounces of light, of the kinds that the materials can show; 0: direct light, free of noise", low=0, high=64
    )
    probe: bool = setting(
        False, "let trial renders of every sample choose effects and bounces instead, for seconds each"
    )
    error: float = setting(3.0, "error that a probe may leave", unit="%", low=0, high=100)
    samples: int = setting(32, "samples a pixel where light bounces", low=1, high=1_000_000)
    pixel_type: str = setting("half", "numbers in the pictures", choices=("float", "half"))


@dataclass(frozen=True)
class SensorRecipe:
    """What a camera makes of the light; as it stands, pictures are the rendered radiance."""

    bits: int = setting(0, "bits a number, 0: not quantised", low=0, high=16)
    white: tuple[float, float] = setting(
        (100.0, 100.0),
        "percentile of the object's values that saturates; only with bits or noise",
        unit="%",
        low=50,
        high=100,
    )
    full_well: tuple[float, float] = setting((0.0, 0.0), "electrons at white, for shot noise; 0: none", low=0, high=1e9)
    read_noise: tuple[float, float] = setting(
        (0.0, 0.0), "deviation of the noise of reading, electrons", low=0, high=1e6
    )
    response: str = setting(
        "linear", "curve that is applied before quantisation, and undone after", choices=("linear", "srgb")
    )


@dataclass(frozen=True)
class TruthRecipe:
    """What is known of every sample beside depth, normal, position and material."""

    layers: bool = setting(True, "write layers.exr: diffuse and glossy colour, and roughness and weights if known")
    direct: bool = setting(False, "render direct light alone, too, so that what bounces is the difference")


@dataclass(frozen=True)
class OutputRecipe:
    """What is written."""

    formats: tuple[str, ...] = setting(("capture",), f"layouts of the samples: {', '.join(FORMATS)}")
    shard: int = setting(100, "samples in a WebDataset shard", low=1, high=1_000_000)
    train: float = setting(0.8, "share of the samples for training", low=0, high=1)
    validation: float = setting(0.1, "share for validation; what is left over is for tests", low=0, high=1)


@dataclass(frozen=True)
class Recipe:
    """What the samples of a dataset may be.

    A pair of numbers is a range that is drawn from evenly; one number instead stands for a range of no width.
    """

    name: str = setting("dataset", "of the dataset")
    description: str = setting("", "what it is for; into the data sheet")
    licence: str = setting("", "under which it is given away; into the data sheet")
    seed: int = setting(0, "of everything that is drawn", low=0, high=2**63 - 1)
    count: int = setting(100, "samples", low=1, high=100_000_000)
    shape: ShapeRecipe = field(default_factory=ShapeRecipe)
    material: MaterialRecipe = field(default_factory=MaterialRecipe)
    lights: LightsRecipe = field(default_factory=LightsRecipe)
    camera: CameraRecipe = field(default_factory=CameraRecipe)
    render: RenderRecipe = field(default_factory=RenderRecipe)
    sensor: SensorRecipe = field(default_factory=SensorRecipe)
    truth: TruthRecipe = field(default_factory=TruthRecipe)
    output: OutputRecipe = field(default_factory=OutputRecipe)

    @classmethod
    def read(cls, path: Path) -> Recipe:
        """Read a recipe.

        Paths in it are taken from its own folder.

        Raises
        ------
        LightsphereError
            When the file is missing, too large, no TOML, or holds a word or value that no recipe has; the message
            names it.
        """
        if not path.is_file():
            raise LightsphereError(f"{path} is missing; give a recipe, lightsphere dataset --template prints one")
        if path.stat().st_size > MOST_BYTES:
            raise LightsphereError(f"{path} has more than {MOST_BYTES} bytes; it is no recipe")
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError) as error:
            raise LightsphereError(f"{path} is no TOML ({error}); correct it") from error
        try:
            return cls.of(values).at(path.resolve().parent)
        except LightsphereError as error:
            raise LightsphereError(f"{path}: {error}") from error

    @classmethod
    def of(cls, values: dict[str, Any]) -> Recipe:
        """Make a recipe from the values of a TOML or JSON file; raise LightsphereError naming what is wrong."""
        made: Recipe = _section(cls, values, "")
        made._check()
        return made

    def as_json(self) -> dict[str, Any]:
        """Return the values as :meth:`of` takes them."""
        return dataclasses.asdict(self)

    def at(self, folder: Path) -> Recipe:
        """Return the recipe with what it names in a folder as whole paths, folders and patterns as sorted files."""
        shape = dataclasses.replace(self.shape, source=_found(self.shape.source, folder, (".blend", *MESHES)))
        material = dataclasses.replace(self.material, source=_found(self.material.source, folder, (".binary", ".npz")))
        return dataclasses.replace(self, shape=shape, material=material)

    def identity(self) -> dict[str, Any]:
        """Return what the samples depend on, files by their names and content: equal in every folder and machine."""
        value = self.as_json()
        for section in FILES:
            value[section]["source"] = [
                f"{Path(word).name} {images.checksum(Path(word))}" if Path(word).is_file() else word
                for word in value[section]["source"]
            ]
        return value

    def _check(self) -> None:
        if self.output.train + self.output.validation > 1 + 1e-9:
            raise LightsphereError("output.train and output.validation are more than 1 together; lower one")
        if unknown := [word for word in self.output.formats if word not in FORMATS]:
            raise LightsphereError(f"output.formats has {unknown[0]!r}; choose among {', '.join(FORMATS)}")
        for section, words in (("shape", self.shape.source), ("material", self.material.source)):
            if not words:
                raise LightsphereError(f"{section}.source is empty; name what is to be drawn")
        if OWN in self.material.source and (made := [word for word in self.shape.source if word in SHAPES]):
            raise LightsphereError(
                f"a {made[0]} may be drawn with its own material, which a made shape has not; take {OWN!r} out of "
                "material.source, or made shapes out of shape.source"
            )
        if self.lights.layout == "double-sphere" and self.lights.count[0] < 8:
            raise LightsphereError(f"lights.count is {self.lights.count[0]:g}; two spheres need 8 lights at least")
        if self.lights.layout == "double-sphere" and not self.lights.distance[0] < self.lights.distance[1]:
            raise LightsphereError("lights.distance needs two numbers, the radii of inner and outer sphere")
        if self.sensor.read_noise[1] > 0 and self.sensor.full_well[0] == 0:
            raise LightsphereError("sensor.read_noise is in electrons; say by sensor.full_well how many white has")
        wanted = {"diligent": "distant", "near": "near"}
        for name, kind in wanted.items():
            if name in self.output.formats and (self.lights.layout == "distant") != (kind == "distant"):
                raise LightsphereError(
                    f"output.formats has {name!r}, a layout for {kind} lights, and lights.layout is "
                    f"{self.lights.layout!r}; change one"
                )
        if SHARDS in self.output.formats and CAPTURE not in self.output.formats:
            raise LightsphereError("output.formats has 'webdataset', which packs captures; add 'capture'")
        if "near" in self.output.formats and self.camera.model != "pinhole":
            raise LightsphereError("output.formats has 'near', a layout for pinhole cameras; change camera.model")


def template() -> str:
    """Return a recipe with everything that one may say, its defaults and what they mean."""
    lines = ["# A recipe of lightsphere dataset. Leave out what may stay as it is."]
    for item in dataclasses.fields(Recipe):
        if "limits" in item.metadata:
            lines += _explained(item)
    for item in dataclasses.fields(Recipe):
        if "limits" not in item.metadata:
            section: Any = item.default_factory()  # type: ignore[operator]
            lines += ["", f"[{item.name}]  # {section.__doc__}"]
            for part in dataclasses.fields(section):
                lines += _explained(part)
    return "\n".join(lines) + "\n"


def _explained(item: dataclasses.Field[Any]) -> list[str]:
    limits = limits_of(item)
    words = limits.help + (f" [{limits.unit}]" if limits.unit else "")
    if limits.choices:
        words += f": {', '.join(limits.choices)}"
    if limits.low is not None:
        words += f"; from {limits.low:g} to {limits.high:g}"
    return [f"# {words}", f"{item.name} = {_toml(item.default)}"]


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(part) for part in value)}]"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _section(kind: type[Any], values: Any, name: str) -> Any:
    if not isinstance(values, dict):
        raise LightsphereError(f"{name} is no table; write [{name}] and its values below")
    items = {item.name: item for item in dataclasses.fields(kind)}
    if unknown := [key for key in values if key not in items]:
        raise LightsphereError(f"{_joined(name, unknown[0])} is unknown; choose among {', '.join(items)}")
    chosen = {}
    for key, value in values.items():
        where, item = _joined(name, key), items[key]
        if "limits" in item.metadata:
            chosen[key] = _value(where, item.default, value)
            _in_limits(where, item, chosen[key])
        else:
            chosen[key] = _section(item.default_factory, value, where)  # type: ignore[arg-type]
    try:
        return check(kind(**chosen)) if name else kind(**chosen)
    except LightsphereError as error:
        raise LightsphereError(f"{name}.{error}") from error


def _value(where: str, usual: Any, value: Any) -> Any:
    """Return a value of the kind of the usual one; raise LightsphereError where it is of another."""
    if isinstance(usual, tuple) and isinstance(usual[0], str):
        words = [value] if isinstance(value, str) else value
        if isinstance(words, list | tuple) and all(isinstance(word, str) for word in words):
            return tuple(words)
        raise LightsphereError(f"{where} is {value!r}; give a word or a list of words")
    if isinstance(usual, tuple):
        pair = [value, value] if _is_number(value) else value
        if isinstance(pair, list | tuple) and len(pair) == 2 and all(map(_is_number, pair)) and pair[0] <= pair[1]:
            return tuple(pair)
        raise LightsphereError(f"{where} is {value!r}; give a number, or two as [low, high]")
    if isinstance(usual, bool) != isinstance(value, bool) or (
        not (isinstance(usual, float) and _is_number(value)) and not isinstance(value, type(usual))
    ):
        raise LightsphereError(f"{where} is {value!r}; give a value such as {_toml(usual)}")
    return float(value) if isinstance(usual, float) else value


def _in_limits(where: str, item: dataclasses.Field[Any], value: Any) -> None:
    limits = limits_of(item)
    for number in value if isinstance(value, tuple) else (value,):
        known = _is_number(number) and limits.low is not None and limits.high is not None
        if known and not limits.low <= number <= limits.high:
            raise LightsphereError(f"{where} is {number}; it must be from {limits.low:g} to {limits.high:g}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _joined(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key


def _found(words: Words, folder: Path, kinds: Words) -> Words:
    """Return words with paths made whole; folders and patterns become their files, sorted by name."""
    found: list[str] = []
    for word in words:
        if any(letter in word for letter in "*?["):
            files = sorted(path for path in folder.glob(word) if path.suffix.lower() in kinds)
        elif (folder / word).is_dir():
            files = sorted(path for path in (folder / word).iterdir() if path.suffix.lower() in kinds)
        elif (folder / word).is_file():
            files = [folder / word]
        elif Path(word).suffix:
            raise LightsphereError(f"{folder / word} is missing; correct the recipe's source")
        else:
            found.append(word)
            continue
        if not files:
            raise LightsphereError(f"{word!r} names no file of the kinds {', '.join(kinds)} in {folder}; correct it")
        found.extend(map(str, files))
    return tuple(found)
