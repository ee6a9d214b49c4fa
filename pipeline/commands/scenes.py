"""`lightsphere scenes`: list the built-in scenes with the effects that each contains."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table


def scenes() -> None:
    """List the built-in scenes with the effects that each contains."""
    from ..blender.scene import library

    table = Table("scene", "what it shows", "effects")
    for name, entry in library().items():
        table.add_row(name, entry.description, ", ".join(entry.effects))
    Console().print(table)
