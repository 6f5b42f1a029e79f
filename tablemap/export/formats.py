"""The registry of formats, and how a model or a run is written in some of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tablemap.config import ExportConfig
from tablemap.errors import ConfigError, ProcessWarning, TablemapError
from tablemap.export import (
    gazebo,
    geojson,
    glb,
    moveit,
    nav2,
    obj,
    ply,
    sdf,
    svg,
    urdf,
)
from tablemap.export.building import build
from tablemap.export.files import write_files
from tablemap.export.solid import Solid
from tablemap.model import TableModel

Writer = Callable[[Solid, ExportConfig], dict[str, bytes]]
"""Returns the files of a table by their names under the format's folder; writes nothing."""

FORMATS: dict[str, Writer] = {
    "sdf": sdf.write,
    "gazebo": gazebo.write,
    "urdf": urdf.write,
    "moveit": moveit.write,
    "nav2": nav2.write,
    "glb": glb.write,
    "obj": obj.write,
    "ply": ply.write,
    "geojson": geojson.write,
    "svg": svg.write,
}

SINGLE_FILE = ("urdf", "glb", "obj", "ply", "geojson", "svg")
"""Formats that are one file, whatever lies beside it."""


@dataclass(frozen=True)
class Exported:
    """The files that were written, and what their reader must know."""

    files: tuple[Path, ...]
    warnings: tuple[ProcessWarning, ...]


def check_formats(formats: Sequence[str]) -> None:
    """Raise `ConfigError` where a format is not known."""
    for name in formats:
        if name not in FORMATS:
            raise ConfigError(f"expected a format of {', '.join(FORMATS)}; found {name!r}.")


def is_file_of(output: Path, formats: Sequence[str]) -> bool:
    """Return whether ``output`` names the file of the one format asked for: ``table.glb``."""
    return list(formats) == [output.suffix[1:]] and formats[0] in SINGLE_FILE


def export_model(
    model: TableModel,
    formats: Sequence[str],
    *,
    output: Path,
    config: ExportConfig | None = None,
    name: str = "table",
) -> Exported:
    """Write a model in each format to ``output/<format>/``; all files whole, or none of them.

    ``name`` is what the object and its files are called. ``output`` may also be the file itself,
    where it ends as the one format does. Raises `ConfigError` for an unknown format and
    `TablemapError` where the model cannot be exported or a file not be written.
    """
    check_formats(formats)
    settings = config or ExportConfig()
    if is_file_of(output, formats):
        solid, warnings = build(model, settings, name=output.stem)
        return Exported(write_files(output.parent, FORMATS[formats[0]](solid, settings)), warnings)
    solid, warnings = build(model, settings, name=name)
    files = {
        f"{chosen}/{file}": content
        for chosen in dict.fromkeys(formats)
        for file, content in FORMATS[chosen](solid, settings).items()
    }
    return Exported(write_files(output, files), warnings)


def export_run(
    run: Path,
    formats: Sequence[str],
    *,
    output: Path | None = None,
    config: ExportConfig | None = None,
) -> Exported:
    """Write every table of a run folder, or one ``table.json``, in each format.

    The chosen table is called ``table``, the others ``table_NN``; ``output`` is the run's
    ``exports/`` unless given, and a file there takes the chosen table alone. Raises as
    `export_model`, and where the run left no model.
    """
    check_formats(formats)
    folder, tables = _tables(run)
    target = output or folder / "exports"
    if is_file_of(target, formats):
        tables = dict(list(tables.items())[:1])
    models = {name: TableModel.load(file) for name, file in tables.items()}
    written = [
        export_model(model, formats, output=target, config=config, name=name)
        for name, model in models.items()
    ]
    return Exported(
        tuple(file for exported in written for file in exported.files),
        tuple(dict.fromkeys(w for exported in written for w in exported.warnings)),
    )


def _tables(run: Path) -> tuple[Path, dict[str, Path]]:
    """Return the folder that ``exports/`` goes to, and the files of models by their names."""
    from tablemap.archive import load_run

    if run.is_file() and run.suffix == ".json" and run.name != "manifest.json":
        if run.parent.name == "tables":
            return run.parent.parent, {f"table_{run.stem}": run}
        return run.parent, {"table": run}
    loaded = load_run(run)
    if not (loaded.path / "table.json").is_file():
        status, error = loaded.manifest.status, loaded.manifest.error
        raise TablemapError(
            f"expected a run with a table.json, found one that left no model ({status}"
            f"{': ' + error if error else ''}); choose another run: {run}"
        )
    others = sorted((loaded.path / "tables").glob("*.json"))
    return loaded.path, {
        "table": loaded.path / "table.json",
        **{f"table_{file.stem}": file for file in others},
    }
