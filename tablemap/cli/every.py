"""Every command, in the order of the help."""

from __future__ import annotations

from tablemap.cli.app import app
from tablemap.cli.config import config
from tablemap.cli.convert import convert
from tablemap.cli.evaluate import evaluate
from tablemap.cli.export import ListsFormats, export
from tablemap.cli.info import info
from tablemap.cli.process import process
from tablemap.cli.runs import runs_app
from tablemap.cli.schema import schema
from tablemap.cli.simulate import simulate
from tablemap.cli.view import view

__all__ = ["app"]

for command in (process, info, convert, view, export, simulate, evaluate, config, schema):
    app.command(cls=ListsFormats if command in (export, process) else None)(command)
app.add_typer(
    runs_app, name="runs", help="List, compare, check, repeat, remove, move and serve runs."
)
