"""``tablemap config`` says what every setting, and every property of the files, is."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from typer.testing import CliRunner

from tablemap.cli.app import app
from tablemap.config import Config, dump_config, load_config
from tests.making.command import tablemap_here
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run


def printed(*arguments: object) -> str:
    """Run ``tablemap config`` in this process and return what it prints."""
    done = CliRunner().invoke(app, ["config", *map(str, arguments)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_config_prints_what_would_be_used(tmp_path: Path) -> None:
    """Defaults, a file, and settings; what it prints is read back as the same."""
    file = tmp_path / "mine.toml"
    file.write_text("seed = 3\n[topics]\nlaser = '/a'\n")
    text = printed("--config", file, "--set", "topics.laser=/b")
    assert tomllib.loads(text)["topics"]["laser"] == "/b"
    (tmp_path / "again.toml").write_text(text)
    again = load_config(tmp_path / "again.toml")
    assert again == load_config(file, overrides=["topics.laser=/b"])
    assert json.loads(printed("--json"))["seed"] == 0


@pytest.fixture(scope="module")
def schemas() -> dict[str, Any]:
    """What ``config --schema`` prints."""
    return dict(json.loads(printed("--schema")))


def properties(schema: Any, path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield every property in a schema, however deep, with its path."""
    if isinstance(schema, dict):
        for name, value in schema.items():
            if name == "properties":
                yield from ((f"{path}.{key}", each) for key, each in value.items())
            yield from properties(value, f"{path}.{name}")
    elif isinstance(schema, list):
        for each in schema:
            yield from properties(each, path)


def test_the_schemas_accept_what_is_written_and_nothing_else(schemas: dict[str, Any]) -> None:
    """By a validator that we did not write."""
    for schema in schemas.values():
        jsonschema.Draft202012Validator.check_schema(schema)
    settings = jsonschema.Draft202012Validator(schemas["config"])
    assert settings.is_valid(tomllib.loads(dump_config(Config())))
    assert not settings.is_valid({"seed": -1})
    assert not settings.is_valid({"nonsense": 1})
    table = jsonschema.Draft202012Validator(schemas["table"])
    document = json.loads(rectangle_model().to_json())
    assert table.is_valid(document)
    assert not table.is_valid({**document, "surface": None})
    assert not table.is_valid({**document, "schema": "tablemap/table/2"})


@pytest.mark.parametrize("document", ["table", "truth", "manifest", "config"])
def test_every_property_has_a_description(schemas: dict[str, Any], document: str) -> None:
    """A section of settings says it itself; all else beside its name."""
    found = dict(properties(schemas[document], document))
    silent = [
        path for path, each in found.items() if not each.get("description") and "$ref" not in each
    ]
    assert len(found) > 10
    assert silent == []
    if document != "config":
        assert all("description" in each for each in found.values())


def test_the_schema_of_a_truth_accepts_one(schemas: dict[str, Any], demo_recording: Path) -> None:
    """The simulator writes more than is asked for; what is not known may be left out."""
    truth = json.loads(demo_recording.with_suffix(".truth.json").read_text())
    checked = jsonschema.Draft202012Validator(schemas["truth"])
    assert checked.is_valid(truth)
    assert checked.is_valid({"schema": truth["schema"], "surface": {"shape": "circle"}})
    assert not checked.is_valid({**truth, "schema": "tablemap/truth/2"})
    assert not checked.is_valid({**truth, "legs": 4})


def test_the_schema_of_a_manifest_accepts_one(schemas: dict[str, Any], tmp_path: Path) -> None:
    """As a run writes it."""
    manifest = json.loads((make_run(tmp_path, "lap/a", None).path / "manifest.json").read_text())
    checked = jsonschema.Draft202012Validator(schemas["manifest"])
    assert checked.is_valid(manifest)
    assert not checked.is_valid({**manifest, "seed": "0"})


def test_settings_are_printed_with_what_they_are() -> None:
    """As comments, with the values that are allowed; without them it is a run's config.toml."""
    text = printed("--set", "registration.gates=[0.3, 0.1]")
    lines = text.splitlines()
    at = lines.index("stop_seconds = 0.5")
    assert lines[at - 1] == "# seconds; a shorter rest is no stop. Higher: fewer stops (> 0)"
    assert "# standard: the images and thinned clouds" in text
    assert "(standard | full | off)" in text
    assert max(map(len, lines)) <= 100
    config = load_config(overrides=["registration.gates=[0.3, 0.1]"])
    assert tomllib.loads(text) == tomllib.loads(dump_config(config))
    assert "#" not in dump_config(Config())


def test_schema_explains_every_field_of_a_document() -> None:
    """Its path, its type and what it is; in Markdown as a table of three columns."""
    rows = tablemap_here("schema").stdout.splitlines()
    told = {row.split()[0]: row for row in rows}
    assert "metres above the floor" in told["surface.height"]
    assert told["surface.dimensions.*.status"].split()[1:6] == [
        "measured",
        "|",
        "inferred",
        "|",
        "unseen",
    ]
    assert "legs[].dimensions.*.value" in told
    page = tablemap_here("schema", "Manifest", "--markdown").stdout.splitlines()
    assert page[:2] == ["| field | type | what it is |", "|---|---|---|"]
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in page} == {4}
    assert any(line.startswith("| recording.sha256 | string or null |") for line in page)


@pytest.mark.parametrize("name", ["table", "truth", "manifest", "config"])
def test_schema_misses_no_field(name: str, schemas: dict[str, Any]) -> None:
    """What the JSON Schema names has a row with a meaning."""
    schema = json.loads(tablemap_here("schema", name, "--json").stdout)
    assert schema == schemas[name]
    page = tablemap_here("schema", name, "--markdown").stdout.splitlines()[2:]
    cells = [re.split(r" (?<!\\)\| ", line.strip("| ")) for line in page]
    last = {row[0].replace("[]", "").replace(".*", "").rpartition(".")[2] for row in cells}
    assert last == {path.rpartition(".")[2] for path, _ in properties(schema, "")}
