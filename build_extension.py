"""Build the Blender extension: one zip per platform and Blender line, with the wheels it needs inside.

    python build_extension.py                                  for this machine and this Python's Blender
    python build_extension.py --line 5.2 --platform macos-arm64
    python build_extension.py --all                            every platform and line
    python build_extension.py --python 3.14                    for a Blender that a distribution built with that Python

Wheels are downloaded by pip into wheels/, the zips come to dist/ and their weight is printed. Run it with the
Python of an environment that bootstrap.py made: the builder is the one inside Blender's module.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import platform
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent
CONTENT = ("__init__.py", "LICENSE", "blender_addon", "pipeline", "scenes")
OF_BLENDER = ("bpy", "numpy")  # Blender brings its own
# Its wheels want a newer macOS than the oldest that Blender runs on; without it Cycles renders everything.
NOT_FOR = {"macos-arm64": ("embreex",)}

# Tags of wheels that were built on a machine like the one at hand, for a distribution's Blender alone.
BUILT_HERE = {"linux-x64": ("linux_x86_64",)}


@dataclass(frozen=True)
class Line:
    """A Blender line: the Python and numpy inside it, and the versions a zip with such wheels is for."""

    name: str
    python: str
    numpy: str
    first: str
    beyond: str | None


LINES = {
    "4.5": Line("4.5", "3.11", "1.26.*", "4.5.0", "5.0.0"),
    "5.2": Line("5.2", "3.13", "2.*", "5.2.0", None),
}

# Blender's name for a platform -> the wheel tags that its oldest supported system can load.
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_12_0_arm64", "macosx_11_0_arm64", "macosx_10_13_universal2", "macosx_10_9_universal2"),
}


def main() -> None:
    """Build what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--line", choices=LINES, default=this_line())
    parser.add_argument("--platform", choices=PLATFORMS, default=this_platform())
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--python", help="of a Blender that was not built by blender.org", metavar="VERSION")
    chosen = parser.parse_args()
    line = LINES[chosen.line]
    pairs = [(dataclasses.replace(line, python=chosen.python or line.python), chosen.platform)]
    if chosen.all:
        pairs = [(line, name) for line in LINES.values() for name in PLATFORMS]
    run_builder("validate", str(ROOT))
    for line, name in pairs:
        wheels = download(line, name)
        archive = build(line, name, wheels)
        weight = sum(wheel.stat().st_size for wheel in wheels)
        print(
            f"{archive.relative_to(ROOT)}: {archive.stat().st_size / 1e6:.0f} MB, "
            f"of which {len(wheels)} wheels {weight / 1e6:.0f} MB"
        )


def this_line() -> str:
    """Return the Blender line of the running Python."""
    running = f"{sys.version_info[0]}.{sys.version_info[1]}"
    return next((name for name, line in LINES.items() if line.python == running), "5.2")


def this_platform() -> str:
    """Return Blender's name for the machine this runs on."""
    system = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}[platform.system()]
    machine = "arm64" if platform.machine().lower() in ("arm64", "aarch64") else "x64"
    return f"{system}-{machine}"


def requirements(line: Line, name: str) -> list[str]:
    """Return what the extension needs, as pip reads it: the dependencies of the project without Blender's own."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    needed = [d for d in declared if not d.startswith(OF_BLENDER + NOT_FOR.get(name, ()))]
    needed.append(f"numpy=={line.numpy}")  # so that wheels are chosen that work with Blender's
    if name.startswith("windows"):
        needed.append("colorama")  # typer's on Windows only, which pip does not see from elsewhere
    return needed


def download(line: Line, name: str) -> list[Path]:
    """Fetch the wheels for a Blender line and platform; return them without those that Blender brings."""
    folder = ROOT / "wheels" / f"{line.name}-{line.python}-{name}"
    shutil.rmtree(folder, ignore_errors=True)
    local = () if line in LINES.values() else BUILT_HERE.get(name, ())
    tags = [word for tag in PLATFORMS[name] + local for word in ("--platform", tag)]
    only = ["--only-binary=:all:", "--implementation", "cp", "--python-version", line.python]
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--dest", str(folder)]
    subprocess.run([*command, *only, *tags, *requirements(line, name)], check=True)
    return sorted(wheel for wheel in folder.glob("*.whl") if not wheel.name.lower().startswith(OF_BLENDER))


def build(line: Line, name: str, wheels: Iterable[Path]) -> Path:
    """Stage the extension with its wheels and let Blender's builder make the zip; return it."""
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))["version"]
    own = "" if line in LINES.values() else f"-python{line.python}"
    archive = ROOT / "dist" / f"lightsphere-{version}-blender{line.name}{own}-{name}.zip"
    archive.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        stage = Path(temporary)
        for content in CONTENT:
            copy(ROOT / content, stage / content)
        (stage / "wheels").mkdir()
        for wheel in wheels:
            shutil.copy(wheel, stage / "wheels")
        (stage / "blender_manifest.toml").write_text(manifest(line, name, wheels), encoding="utf-8")
        run_builder("build", "--source-dir", str(stage), "--output-filepath", str(archive))
    run_builder("validate", str(archive))
    return archive


def copy(source: Path, target: Path) -> None:
    """Copy a file or a folder without compiled leftovers."""
    if source.is_dir():
        shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", ".*"))
    else:
        shutil.copy(source, target)


def manifest(line: Line, name: str, wheels: Iterable[Path]) -> str:
    """Return the manifest of one zip: the project's, narrowed to a platform and Blender line, with its wheels."""
    lines = []
    for text in (ROOT / "blender_manifest.toml").read_text(encoding="utf-8").splitlines():
        if text.startswith("#"):
            continue
        if text.startswith("platforms"):
            text = f'platforms = ["{name}"]\nwheels = [\n' + "".join(f'  "./wheels/{w.name}",\n' for w in wheels) + "]"
        elif text.startswith("blender_version_min"):
            text = f'blender_version_min = "{line.first}"'
            if line.beyond:
                text += f'\nblender_version_max = "{line.beyond}"'
        lines.append(text)
    return "\n".join(lines) + "\n"


def run_builder(*words: str) -> None:
    """Run the extension tool inside Blender's Python module, without loading Blender."""
    found = importlib.util.find_spec("bpy")
    if found is None or found.origin is None:
        sys.exit("this Python has no bpy; run build_extension.py with the Python of .venv-3.11 or .venv-3.13")
    (tool,) = Path(found.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    subprocess.run([sys.executable, str(tool), *words], check=True)


if __name__ == "__main__":
    main()
