"""The list of commands, in the order in which help shows them."""

from __future__ import annotations

import typer

from .capture import capture, capture_worker
from .compare import compare
from .dataset import dataset, dataset_worker, verify
from .demo import demo
from .export import export_worker
from .import_ import import_photographs
from .inverse import inverse
from .material import material
from .plan import plan
from .profile import profile
from .reflectance import reflectance
from .relight import relight, relight_worker
from .scenes import scenes
from .shape import mesh_worker, shape
from .tradeoff import tradeoff


def add_commands(app: typer.Typer) -> None:
    """Register every command with the application."""
    app.command()(demo)
    app.command()(scenes)
    app.command()(plan)
    app.command()(capture)
    app.command("capture-worker", hidden=True)(capture_worker)
    app.command("import")(import_photographs)
    app.command()(shape)
    app.command("mesh-worker", hidden=True)(mesh_worker)
    app.command()(profile)
    app.command()(reflectance)
    app.command()(material)
    app.command("export-worker", hidden=True)(export_worker)
    app.command()(relight)
    app.command("relight-worker", hidden=True)(relight_worker)
    app.command()(inverse)
    app.command()(compare)
    app.command()(tradeoff)
    app.command()(dataset)
    app.command("dataset-worker", hidden=True)(dataset_worker)
    app.command()(verify)
