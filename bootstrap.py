"""Set Lightsphere up in this folder, once, and run it.

    python3 bootstrap.py demo -o demo_out    run the main job (any other lightsphere command works alike)
    python3 bootstrap.py test                run the tests; further words go to pytest

Needs Python 3.11 (then Blender 4.5 LTS is installed) or 3.13 (Blender 5.2 LTS), about 2 GB of disk and, the first
time, the network. Everything goes into .venv-3.11 or .venv-3.13 in this folder; delete that to undo it.
"""

# Written so that an old Python, too, can read it and say what is wrong: no future imports, no new syntax.

import ctypes
import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VERSIONS = ((3, 13), (3, 11))  # Blender 5.2 LTS and 4.5 LTS
SUPPORTED = " or ".join(f"{major}.{minor}" for major, minor in sorted(VERSIONS))
THIS = f"{sys.version_info[0]}.{sys.version_info[1]}"

# What a bare machine lacks for `import bpy`: library -> package of Debian and Ubuntu, of Fedora.
SYSTEM_LIBRARIES = {
    "libX11.so.6": ("libx11-6", "libX11"),
    "libXrender.so.1": ("libxrender1", "libXrender"),
    "libXfixes.so.3": ("libxfixes3", "libXfixes"),
    "libXi.so.6": ("libxi6", "libXi"),
    "libxkbcommon.so.0": ("libxkbcommon0", "libxkbcommon"),
    "libSM.so.6": ("libsm6", "libSM"),
    "libICE.so.6": ("libice6", "libICE"),
    "libGL.so.1": ("libgl1", "libglvnd-glx"),
}


class SetupError(Exception):
    """Set-up cannot go on; the message says why and what to do."""


def main(arguments):
    """Set up if need be, then become the command; return the exit status."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(__doc__)
        return 0
    try:
        if sys.version_info[:2] not in VERSIONS:
            return run([find_interpreter(), str(ROOT / "bootstrap.py"), *arguments])
        environment = set_up()
    except SetupError as error:
        print(f"lightsphere: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("lightsphere: interrupted; the same command goes on with the set-up", file=sys.stderr)
        return 130
    if arguments[0] == "test":
        os.chdir(str(ROOT))
        return run([str(program(environment, "python")), "-m", "pytest", *arguments[1:]])
    return run([str(program(environment, "lightsphere")), *arguments])


def run(command):
    """Become the command, so that signals and exit status are its own; where that cannot be, wait for it."""
    sys.stdout.flush()
    if os.name == "posix":
        os.execv(command[0], command)
    return subprocess.call(command)


def find_interpreter():
    """Return the path of a supported Python that really runs (a version manager's shim may exist and fail)."""
    pyenv = Path(os.environ.get("PYENV_ROOT", str(Path.home() / ".pyenv"))) / "versions"
    for major, minor in VERSIONS:
        name = f"python{major}.{minor}"
        managed = sorted(pyenv.glob(f"{major}.{minor}.*/bin/{name}"))
        for candidate in [shutil.which(name), *map(str, managed)]:
            if candidate and runs([candidate, "-c", "pass"]):
                return candidate
    raise SetupError(
        f"Blender's Python module needs Python {SUPPORTED}; this is {THIS}, and none of them was found. Install one:\n"
        "  Debian 12:    sudo apt-get install python3.11 python3.11-venv\n"
        "  Fedora:       sudo dnf install python3.13\n"
        "  macOS:        brew install python@3.13\n"
        "  Windows:      winget install Python.Python.3.13\n"
        "then run the same command again."
    )


def set_up():
    """Return the virtual environment's folder, made and filled when it is missing, half made or out of date."""
    environment = ROOT / f".venv-{THIS}"
    stamp, wanted = environment / "lightsphere.stamp", fingerprint()
    python = str(program(environment, "python"))
    if read(stamp) == wanted and runs([python, "-c", "pass"]):
        return environment
    say(f"Setting up in {environment.name}: once, about 2 GB and a few minutes.")
    if not runs([python, "-m", "pip", "--version"]):
        create(environment)
    say("Installing Blender as a Python module, and what else is needed ...")
    step(
        [python, "-m", "pip", "install", "--disable-pip-version-check", "--editable", f"{ROOT}[test]"],
        "the packages could not be installed; the lines above say why (network? disk?). The same command tries again",
    )
    say("Starting Blender's module ...")
    check_blender(python)
    if (ROOT / "pipeline" / "core" / "warm.py").is_file():
        say("Compiling the solvers' kernels ...")
        step([python, "-m", "pipeline.core.warm"], "the kernels could not be compiled; the lines above say why")
    stamp.write_text(wanted)
    say("Set-up is done.")
    return environment


def fingerprint():
    """Return what an environment is made from, as text: a stamp that differs means set it up again."""
    return f"{hashlib.sha256((ROOT / 'pyproject.toml').read_bytes()).hexdigest()} {ROOT}"


def create(environment):
    """Make an empty virtual environment in place of whatever is there."""
    try:
        import ensurepip  # noqa: F401 - Debian keeps it in a package of its own
    except ImportError:
        raise SetupError(
            "this Python cannot make virtual environments; install that part of it (Debian, Ubuntu: "
            f"sudo apt-get install python{THIS}-venv), then run the same command again"
        ) from None
    shutil.rmtree(str(environment), ignore_errors=True)
    step(
        [sys.executable, "-m", "venv", str(environment)],
        "the virtual environment could not be made; the lines above say why",
    )


def check_blender(python):
    """Raise SetupError with the remedy when Blender's module does not load."""
    found = subprocess.run([python, "-c", "import bpy"], stderr=subprocess.PIPE, encoding="utf-8")
    if found.returncode:
        raise SetupError(explain_import_error(found.stderr, missing_libraries()))


def missing_libraries():
    """Return which of the system libraries that Blender needs this machine does not have."""
    missing = []
    for name in SYSTEM_LIBRARIES if sys.platform.startswith("linux") else ():
        try:
            ctypes.CDLL(name)
        except OSError:
            missing.append(name)
    return missing


def explain_import_error(text, also_missing=()):
    """Return what to install, from the error text of `import bpy` and other libraries known to be missing.

    The loader names only the first library that it misses; the others are added so that one installation is enough.
    """
    named = re.findall(r"(lib[\w.+-]+\.so[.\d]*): cannot open shared object file", text)
    if not named:
        return f"Blender's Python module does not load:\n{text.strip()}"
    missing = sorted({*named, *also_missing})
    known = [SYSTEM_LIBRARIES[name] for name in missing if name in SYSTEM_LIBRARIES]
    unknown = [name for name in missing if name not in SYSTEM_LIBRARIES]
    lines = [f"Blender needs system libraries that are not installed: {', '.join(missing)}. Install them:"]
    if known:
        lines.append(f"  Debian, Ubuntu:  sudo apt-get install {' '.join(debian for debian, _ in known)}")
        lines.append(f"  Fedora:          sudo dnf install {' '.join(fedora for _, fedora in known)}")
    for name in unknown:
        lines.append(f"  the package with {name} (apt-file search {name}, or dnf provides '*/{name}')")
    return "\n".join([*lines, "then run the same command again."])


def program(environment, name):
    """Return the path of a program inside a virtual environment."""
    return environment / "Scripts" / (name + ".exe") if os.name == "nt" else environment / "bin" / name


def runs(command):
    """Return whether a command starts and succeeds."""
    try:
        return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0
    except OSError:
        return False


def step(command, failure):
    """Run one step of the set-up in the checkout with its output shown, or raise SetupError."""
    if subprocess.call(command, cwd=str(ROOT)):
        raise SetupError(failure)


def read(path):
    """Return a file's text, empty when there is none."""
    return path.read_text() if path.is_file() else ""


def say(line):
    """Print a line of progress at once."""
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
