"""Where tests run Blender: apart from the user's own, and with this checkout among its extensions."""

from __future__ import annotations

import atexit
import os
import shutil
import signal
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]

# Blender reads this when bpy is first imported: no test sees or changes the user's own settings and extensions.
RESOURCES = Path(tempfile.mkdtemp(prefix="lightsphere-tests-"))
atexit.register(shutil.rmtree, RESOURCES, ignore_errors=True)
os.environ["BLENDER_USER_RESOURCES"] = str(RESOURCES)
# The extension keeps compiled kernels in Blender's folders, which are new here; empty means beside the source.
os.environ["NUMBA_CACHE_DIR"] = ""

# A script's background job ignores interrupts, and so would everything that the tests start and interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)

EXTENSIONS = RESOURCES / "extensions" / "user_default"
EXTENSIONS.mkdir(parents=True)
(EXTENSIONS / "lightsphere").symlink_to(ROOT, target_is_directory=True)
