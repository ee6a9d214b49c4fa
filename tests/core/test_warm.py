"""After set-up no kernel is left to be compiled."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from typing import Any

from numba.core.registry import CPUDispatcher

from pipeline import core
from pipeline.core import warm


def kernels() -> Iterator[tuple[str, Any]]:
    for module in pkgutil.walk_packages(core.__path__, core.__name__ + "."):
        for name, value in vars(importlib.import_module(module.name)).items():
            # only those that Python calls: what they call is part of their own cached machine code
            if isinstance(value, CPUDispatcher) and value.targetoptions.get("parallel"):
                yield f"{module.name}.{name}", value


def test_every_kernel_is_compiled() -> None:
    warm.main()
    found = dict(kernels())
    assert len(found) > 4
    assert [name for name, kernel in found.items() if not kernel.signatures] == []
