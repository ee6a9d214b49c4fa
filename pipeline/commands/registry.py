"""The list of commands, in the order in which help shows them."""

from __future__ import annotations

import typer

from .capture import capture
from .scenes import scenes


def add_commands(app: typer.Typer) -> None:
    """Register every command with the application."""
    app.command()(scenes)
    app.command()(capture)
