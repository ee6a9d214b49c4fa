"""After set-up no kernel is left to be compiled."""

from __future__ import annotations

import subprocess
import sys

# a process of its own: kernels that other tests have called would be taken for compiled by the set-up
LEFT = """
import importlib, pkgutil
from numba.core.registry import CPUDispatcher
from pipeline import core
from pipeline.core import warm

warm.main()
for module in pkgutil.walk_packages(core.__path__, core.__name__ + "."):
    for name, value in vars(importlib.import_module(module.name)).items():
        # only those that Python calls: what they call is part of their own cached machine code
        if isinstance(value, CPUDispatcher) and value.targetoptions.get("parallel"):
            print(module.name, name, "compiled" if value.signatures else "left")
"""


def test_every_kernel_is_compiled() -> None:
    told = subprocess.run([sys.executable, "-c", LEFT], capture_output=True, text=True, check=True).stdout
    kernels = told.splitlines()
    assert [line for line in kernels if not line.endswith("compiled")] == []
    assert len(kernels) > 4
