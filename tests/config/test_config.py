"""Settings end in one validated tree, whatever they come from."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import FieldInfo

import tablemap
from tablemap.config import Config, Tables, dump_config, load_config
from tablemap.config.loading import REMOVED, RENAMED
from tablemap.config.section import Section, is_section, meant
from tablemap.errors import ConfigError
from tablemap.structs import fields_of


def settings(section: type[Section], prefix: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Yield all settings with their dotted names."""
    for name, field in fields_of(section).items():
        if is_section(field.type):
            yield from settings(field.type, f"{prefix}{name}.")
        else:
            yield prefix + name, field


SETTINGS = dict(settings(Config))


@pytest.mark.parametrize("name", SETTINGS)
def test_a_setting_says_what_it_is_and_what_raising_it_does(name: str) -> None:
    """Its unit comes first; a seed is neither high nor low."""
    description = meant(SETTINGS[name]).description
    assert description
    assert not description.endswith(".")
    if name != "seed" and not isinstance(SETTINGS[name].default, str):
        assert ". Higher" in description


def reads(package: Path) -> tuple[set[tuple[str, str]], set[str]]:
    """Return what a package's code reads, its config left out.

    These are the attributes, each with the last name before it (``config.legs.margin`` reads
    ``margin`` of ``legs``), and the texts, as limits are also named by.
    """
    attributes, texts = set(), set()
    for file in package.rglob("*.py"):
        if file.is_relative_to(package / "config"):
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
                owner = ast.unparse(node.value).rpartition(".")[2].lstrip("_")
                attributes.add((owner, node.attr))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.add(node.value)
    return attributes, texts


ATTRIBUTES, TEXTS = reads(Path(tablemap.__file__).parent)


@pytest.mark.parametrize("setting", SETTINGS)
def test_a_setting_is_read_by_the_code(setting: str) -> None:
    """One that nothing reads changes nothing, and who sets it is misled."""
    section, _, name = setting.rpartition(".")
    is_read = any((owner, name) in ATTRIBUTES for owner in ("config", section))
    assert is_read or (section == "limits" and name in TEXTS)


def test_settings_override_the_file_which_overrides_defaults(tmp_path: Path) -> None:
    """Defaults < TOML < --set."""
    file = tmp_path / "settings.toml"
    file.write_text('seed = 3\n[topics]\ndepth = "/a"\nlaser = "/scan"\n')
    config = load_config(file, overrides=["topics.depth=/b"])
    assert (config.seed, config.topics.depth, config.topics.laser) == (3, "/b", "/scan")
    assert config.snapshots == Config().snapshots


def test_a_dumped_config_loads_as_the_same_tree(tmp_path: Path) -> None:
    """config.toml reproduces a run's settings."""
    config = load_config(overrides=["seed=7", "topics.fixed_frame=world", "snapshots.maximum=9"])
    file = tmp_path / "config.toml"
    file.write_text(dump_config(config))
    assert load_config(file) == config


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("snapshots.maximun=7", "'snapshots.maximum'"),
        ("snapshot.maximum=7", "'snapshots'"),
        ("snapshots.maximum=-1", "greater than or equal to 1"),
        ("seed=1.5", "valid integer"),
        ("seed=true", "valid integer"),
        ("export.padding=nan", "greater than or equal to 0"),
        ("export.padding=inf", "a finite number"),
        ("topics.clock_offset=nan", "a finite number"),
        ("topics.laser_clock_offset=1e400", "a finite number"),
        ("surface.normal_cosine=2", "greater than 0 and less than 1"),
        ("review.level=of", "'standard', 'full' or 'off'"),
        ("sensors.depth_camera=kinect", "'oak', 'zed' or ''"),
        ("registration.gates=[]", "a list of 1 or more"),
        ("registration.gates=[1, 'a']", "a list of valid numbers"),
        ("topics.depth=5", "a valid string"),
        ("snapshots=3", "a section"),
        ("seed", "section.key=value"),
        ("seed.deeper=1", "seed"),
    ],
)
def test_a_wrong_setting_is_refused_in_one_sentence(setting: str, words: str) -> None:
    """An unknown name comes with the nearest one."""
    with pytest.raises(ConfigError) as caught:
        load_config(overrides=[setting])
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_setting_with_a_new_name_says_it(tmp_path: Path) -> None:
    """On the command line and in a file, as a config.toml of an older run."""
    with pytest.raises(ConfigError) as caught:
        load_config(overrides=["surface.laser_scale_sigma=0.002"])
    sentence = "surface.laser_scale_sigma is now sensors.laser_range_scale_sigma"
    assert str(caught.value) == f"{sentence}."
    file = tmp_path / "config.toml"
    file.write_text("[surface]\nlaser_scale_sigma = 0.002\nrim_set_back = 0.01\n")
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    assert str(caught.value).startswith(f"{sentence} (old names in the file: 2); ")
    assert str(caught.value).endswith(f": {file}")
    assert "\n" not in str(caught.value)


def test_a_setting_that_became_a_constant_says_where() -> None:
    """Who has changed it finds it."""
    with pytest.raises(ConfigError) as caught:
        load_config(overrides=["crosscheck.reach=0.1"])
    place = "_REACH in tablemap/stages/crosscheck/edges.py"
    assert str(caught.value) == f"crosscheck.reach is a constant now: {place}."


SECTIONS = [name for name, field in fields_of(Config).items() if is_section(field.type)]


@pytest.mark.parametrize("section", SECTIONS)
def test_a_section_is_frozen_and_closed(section: str) -> None:
    """What decides a run's result does not change under it, nor is a wrong name passed over."""
    settings = getattr(Config(), section)
    name = next(iter(fields_of(type(settings))))
    with pytest.raises(AttributeError, match="immutable"):
        setattr(settings, name, getattr(settings, name))
    with pytest.raises(ConfigError, match=r"no setting '.*nonsense'"):
        load_config(overrides=[f"{section}.nonsense=1"])
    with pytest.raises(ConfigError, match="no setting 'nonsense'"):
        type(settings)(nonsense=1)


def test_no_setting_has_an_old_name() -> None:
    """Else it could not be set."""
    assert SETTINGS.keys().isdisjoint([*RENAMED, *REMOVED])


@pytest.mark.parametrize("old", REMOVED)
def test_a_setting_without_a_successor_says_what_to_use_instead(old: str, tmp_path: Path) -> None:
    """On the command line and in a file; each setting that the sentence names can be set."""
    with pytest.raises(ConfigError) as caught:
        load_config(overrides=[f"{old}=0.5"])
    sentence = str(caught.value)
    assert sentence.startswith(f"{old} is gone: ")
    named = re.findall(r"[a-z]+\.[a-z_]+", sentence.removeprefix(old))
    assert named or sentence.endswith("nothing replaces it.")
    assert SETTINGS.keys() >= set(named)
    file = tmp_path / "config.toml"
    section, _, key = old.partition(".")
    file.write_text(f"[{section}]\n{key} = 0.5\n")
    with pytest.raises(ConfigError, match=f"{re.escape(old)} is gone: "):
        load_config(file)


@pytest.mark.parametrize("old", RENAMED)
def test_what_an_old_name_points_to_is_there(old: str) -> None:
    """A setting, or a constant of a module."""
    file, is_constant, name = RENAMED[old].partition(":")
    if is_constant:
        module = importlib.import_module(f"tablemap.{file.removesuffix('.py').replace('/', '.')}")
        assert hasattr(module, name)
    else:
        assert file in SETTINGS


@pytest.mark.parametrize("text", ["seed = ", "[topics", "\xff"])
def test_a_file_that_is_no_toml_is_refused(tmp_path: Path, text: str) -> None:
    """Also one that is not even text."""
    file = tmp_path / "settings.toml"
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(ConfigError, match=r"settings\.toml"):
        load_config(file)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    """The path is named."""
    with pytest.raises(ConfigError, match=r"none\.toml"):
        load_config(tmp_path / "none.toml")


@pytest.mark.parametrize("tables", ["best", "all", (1.5, -2.0)])
def test_a_config_holds_which_table_and_which_method(tables: Tables, tmp_path: Path) -> None:
    """What is written is read back as the same."""
    config = Config(method="report", tables=tables)
    file = tmp_path / "config.toml"
    file.write_text(dump_config(config))
    assert load_config(file) == config


@pytest.mark.parametrize("setting", ["tables=two", "tables=[1]", "tables=[nan, 0]", "tables=7"])
def test_what_names_no_tables_is_refused(setting: str) -> None:
    """One sentence that says what may be."""
    with pytest.raises(ConfigError, match="expected best, all or a place"):
        load_config(overrides=[setting])
