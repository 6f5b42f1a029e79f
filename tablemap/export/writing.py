"""Export of a model or a run in several formats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from tablemap.errors import ConfigError, ProcessWarning, TablemapError
from tablemap.export.files import write_files
from tablemap.export.registry import Format, all_formats, check_formats
from tablemap.files import is_folder
from tablemap.paths import AnyPath, as_path

if TYPE_CHECKING:
    from tablemap.config import ExportConfig
    from tablemap.model import TableModel


@dataclass(frozen=True)
class Exported:
    """The files that were written, and warnings for their reader."""

    files: tuple[Path, ...]
    warnings: tuple[ProcessWarning, ...]


def export_model(
    model: TableModel,
    formats: Sequence[str],
    *,
    output: AnyPath,
    config: ExportConfig | None = None,
    name: str = "table",
) -> Exported:
    """Write a model in each format to ``output/<format>/``: all files, or none of them.

    ``name`` is the name of the object and its files. With one format, ``output`` may also be the
    file itself, if it has the format's suffix. Raises `ConfigError` for an unknown format, or a
    file's name that is not of the single format, and `TablemapError` if the model cannot be
    exported, a file cannot be written, or ``name`` is not a valid file name.
    """
    if name in ("", ".", "..") or as_path(name).name != name:
        raise TablemapError(f"expected a name for the table's files, found {name!r}.")
    return _export({name: model}, check_formats(formats), as_path(output), config)


def export_run(
    run: AnyPath,
    formats: Sequence[str],
    *,
    output: AnyPath | None = None,
    config: ExportConfig | None = None,
) -> Exported:
    """Write every table of a run folder, or one ``table.json``, in each format.

    The chosen table is called ``table``, the others ``table_NN``; Nav2's one mask ``table`` has all
    of them. ``output`` is by default the run's ``exports/``; if it is a file, only the chosen table
    is written. Raises the errors of `export_model`, and `TablemapError` if the run left no model.
    """
    from tablemap.archive.folder import check_writable
    from tablemap.model import TableModel

    chosen = check_formats(formats)
    if output is None:
        check_writable(run)
    folder, tables = _tables(run)
    target = folder / "exports" if output is None else as_path(output)
    if _is_file(target, chosen):
        tables = dict(list(tables.items())[:1])
    models = {name: TableModel.load(file) for name, file in tables.items()}
    return _export(models, chosen, target, config)


def _export(
    models: Mapping[str, TableModel],
    formats: tuple[Format, ...],
    output: Path,
    config: ExportConfig | None,
) -> Exported:
    """Write models by their names, the chosen table's first: all files, or none of them."""
    from tablemap.config import ExportConfig
    from tablemap.export.building import build

    settings = config or ExportConfig()
    if _is_file(output, formats):
        (model,) = models.values()
        solid, warnings = build(model, settings, name=output.stem)
        return Exported(write_files(output.parent, formats[0].write(solid, settings)), warnings)
    built = {name: build(model, settings, name=name) for name, model in models.items()}
    solids = [solid for solid, _ in built.values()]
    files = {
        f"{each.name}/{file}": content
        for each in formats
        for written in (
            [each.write_all(solids, settings)]
            if each.write_all
            else [each.write(solid, settings) for solid in solids]
        )
        for file, content in written.items()
    }
    warnings = tuple(
        warning if len(built) == 1 else replace(warning, message=f"{name}: {warning.message}")
        for name, (_, found) in built.items()
        for warning in found
    )
    return Exported(write_files(output, files), warnings)


def _is_file(output: Path, formats: tuple[Format, ...]) -> bool:
    """Tell whether ``output`` names the file of the single format, such as ``table.glb``.

    Raises `ConfigError` where it names a file of anything else: a folder of that name misleads.
    """
    of_one = len(formats) == 1 and formats[0].is_single_file
    if of_one and output.suffix == f".{formats[0].name}":
        return True
    if output.suffix in _suffixes() and not is_folder(output):
        wanted = f"FILE.{formats[0].name} or a folder" if of_one else "a folder"
        names = " and ".join(each.name for each in formats)
        raise ConfigError(f"expected {wanted} as output of {names}, found a file's name: {output}")
    return False


def _suffixes() -> set[str]:
    """Return how the names of exported files end."""
    return {Path(file).suffix for each in all_formats().values() for file in each.files}


def _tables(run: AnyPath) -> tuple[Path, dict[str, Path]]:
    """Return the folder in which ``exports/`` is made, and the files of models by their names."""
    from tablemap.archive.folder import load_run, names_model

    if names_model(run):
        file = as_path(run)
        folder = file.parent.parent if file.parent.name == "tables" else file.parent
        if (folder / "manifest.json").is_file():
            load_run(folder).check_ended()
        if file.parent.name == "tables":
            return file.parent.parent, {f"table_{file.stem}": file}
        return file.parent, {"table": file}
    loaded = load_run(run)
    loaded.check_model()
    first, *others = loaded.table_files
    return loaded.path, {"table": first, **{f"table_{file.stem}": file for file in others}}
