"""The list of commands, in the order in which help shows them."""

from __future__ import annotations

import typer


def add_commands(app: typer.Typer) -> None:
    """Register every command with the application."""
