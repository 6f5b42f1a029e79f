"""The scenarios as TOML files: those that come with the package, by name and by suite."""

import difflib
import tomllib
from pathlib import Path

from tablemap.errors import ConfigError
from tablemap.files import read_text
from tablemap.model.documents import DocumentError
from tablemap.simulation.scenario import Scenario
from tablemap.words import known_name

SCENARIOS = Path(__file__).parent / "scenarios"
SUITES = ("report", "hard", "real_sensors")


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the package, sorted."""
    return sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Read a scenario by its name, in any case, or from a TOML file.

    Raises `ConfigError` where there is none of that name, or it has unknown or impossible settings.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = SCENARIOS / f"{known_name(str(name_or_path), scenario_names())}.toml"
        if not path.is_file():
            near = difflib.get_close_matches(str(name_or_path), scenario_names(), n=1, cutoff=0.0)
            raise ConfigError(
                f"there is no scenario {str(name_or_path)!r}; the nearest is {near[0]!r}, and "
                "`tablemap simulate --list` shows those that there are. A file's name must end "
                "in .toml."
            )
    try:
        settings = tomllib.loads(read_text(path))
        return Scenario.read({"name": path.stem, **settings}, "scenario")
    except OSError as error:
        raise ConfigError(f"The scenario cannot be read ({error.strerror}): {path}") from error
    except DocumentError as error:
        raise ConfigError(f"{str(error).removesuffix('.')}; correct it in {path}") from error
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"The scenario is no valid TOML ({error}): {path}") from error


def suite(name: str) -> list[str]:
    """Return the names of the scenarios of a suite, one of `SUITES` or ``all``, each once.

    Raises `ConfigError` where no scenario belongs to it.
    """
    if name == "all":
        return list(dict.fromkeys(each for name in SUITES for each in suite(name)))
    members = [each for each in scenario_names() if name in load_scenario(each).suites]
    if not members:
        raise ConfigError(
            f"There is no suite named {name!r}; there are {', '.join(SUITES)} and all."
        )
    return members
