"""The command line: one sentence for what is wrong, and the contract's exit codes."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tablemap.cli.printing import complain, named_rows
from tests.making.command import TABLEMAP, tablemap, tablemap_here
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run

README = Path(__file__).resolve().parents[2] / "README.md"
COMMANDS = [
    "process",
    "info",
    "convert",
    "export",
    "view",
    "simulate",
    "evaluate",
    "config",
    "schema",
    "runs",
]
RUNS = [
    "list",
    "show",
    "compare",
    "verify",
    "reprocess",
    "redraw",
    "prune",
    "pack",
    "unpack",
    "serve",
]


def test_help_names_every_command() -> None:
    """And this file knows them all."""
    for group, known in ((), COMMANDS), (("runs",), RUNS):
        text = tablemap_here(*group, "--help").stdout
        listed = re.findall(r"^  ([a-z]+)  ", text.split("Commands:")[1], flags=re.M)
        assert sorted(listed) == sorted(known)


def test_the_usage_is_what_a_shell_takes() -> None:
    """Braces would be expanded; what may be repeated has its dots."""
    for command, usage in (
        ("process", "process [OPTIONS] RECORDING..."),
        ("export", "export [OPTIONS] RUN"),
        ("runs compare", "runs compare [OPTIONS] A B..."),
        ("evaluate", "evaluate [OPTIONS] [PATH...]"),
    ):
        text = tablemap_here(*command.split(), "--help").stdout
        assert text.splitlines()[0].endswith(f"tablemap {usage}")


@pytest.mark.parametrize("command", [*COMMANDS, *(f"runs {name}" for name in RUNS)])
def test_the_readme_has_every_command_and_option(command: str) -> None:
    """What is not documented is not there."""
    readme = README.read_text(encoding="utf-8")
    assert f"`{command}" in readme or f"tablemap {command}" in readme
    options = set(
        re.findall(r"(?<![\w-])(--[a-z-]+)", tablemap_here(*command.split(), "--help").stdout)
    )
    assert options
    assert not {option for option in options if option not in readme}


def test_version() -> None:
    """As the package says."""
    from tablemap import __version__

    assert tablemap_here("--version").stdout == f"tablemap {__version__}\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"this is a text file\n" * 10, "MCAP"),
        (b"", "empty"),
    ],
)
def test_a_file_that_is_no_recording_is_one_sentence(
    content: bytes, words: str, tmp_path: Path
) -> None:
    """By ``process`` and by ``info``."""
    file = tmp_path / "lap.mcap"
    file.write_bytes(content)
    for arguments in (["process", file, "-o", tmp_path / "runs", "-q"], ["info", file]):
        done = tablemap_here(*arguments)
        assert done.returncode == 1, done.stderr
        assert done.stdout == ""
        assert words in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1


def test_a_recording_without_messages_cannot_be_processed(tmp_path: Path) -> None:
    """What is missing is named; ``info`` says the same and shows the rest."""
    file = tmp_path / "lap.mcap"
    file.write_bytes(b"\x89MCAP0\r\n")
    done = tablemap_here("process", file, "-o", tmp_path / "runs", "-q")
    assert done.returncode == 1
    assert "depth" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    shown = tablemap_here("info", file)
    assert shown.returncode == 0
    assert "missing: " in shown.stdout
    checked = tablemap_here("info", file, "--check")
    assert (checked.returncode, checked.stdout) == (1, shown.stdout)
    assert tablemap_here("info", file, "--check", "--json").returncode == 1


@pytest.mark.parametrize("command", ["process", "info"])
@pytest.mark.parametrize("name", ["missing.mcap", "."])
def test_a_missing_path_or_a_directory_is_one_sentence(
    command: str, name: str, tmp_path: Path
) -> None:
    """Exit 1, and nothing is made."""
    done = tablemap_here(command, tmp_path / name, cwd=tmp_path)
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("command", "code"), [("info missing.mcap", 1), ("config --set surface.nothing=1", 2)]
)
def test_debug_shows_where_an_error_was_raised(command: str, code: int, tmp_path: Path) -> None:
    """Before the sentence, and the exit code stays. It stands before the command or after it."""
    plain = tablemap(*command.split(), cwd=tmp_path)
    assert plain.returncode == code
    for given in ([*command.split(), "--debug"], ["--debug", *command.split()]):
        done = tablemap(*given, cwd=tmp_path)
        assert done.returncode == code
        assert done.stderr.startswith("Traceback (most recent call last):\n")
        assert done.stderr.endswith(plain.stderr)
    assert "Traceback" not in plain.stderr


def test_a_failed_recording_has_its_json_line(tmp_path: Path) -> None:
    """With null for what there is not."""
    done = tablemap_here("process", tmp_path / "none.mcap", "--json", cwd=tmp_path)
    line = json.loads(done.stdout)
    assert (line["run"], line["model"], line["status"]) == (None, None, "failed")
    assert "none.mcap" in line["error"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["process"],
        ["process", "a.mcap", "--set", "surface.nonsense=1"],
        ["process", "a.mcap", "--near", "1"],
        ["process", "a.mcap", "--near", "1", "2", "--all"],
        ["process", "a.mcap", "--method", "guess"],
        ["simulate", "demo"],
        ["nonsense"],
        ["view", "run", "--still", "out.jpg"],
        ["view", "run", "--still", "out.png", "--size", "1000"],
        ["view", "run", "--still", "out.png", "--size", "1x1"],
        ["view", "run", "--size", "1000x700"],
    ],
)
def test_wrong_usage_exits_with_2(arguments: list[str], tmp_path: Path) -> None:
    """Before anything is made."""
    done = tablemap_here(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_scenario_is_one_sentence(tmp_path: Path) -> None:
    """With the nearest name."""
    done = tablemap_here("simulate", "rectangl", "-o", tmp_path / "a.mcap")
    assert done.returncode == 2
    assert "rectangle" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def interrupted(
    folder: Path, number: signal.Signals, *arguments: str, failed: tuple[str, ...] = ()
) -> tuple[int, str]:
    """Send a signal once the demo's review is begun; the exit code, and what was printed.

    The runs of recordings that are to have ``failed`` by then are waited for.
    """

    def has_come() -> bool:
        manifests = (folder.glob(f"runs/{name}/*/manifest.json") for name in failed)
        ended = (any('"failed"' in one.read_text() for one in each) for each in manifests)
        return any(folder.glob("runs/demo/*/run.rrd")) and all(ended)

    running = subprocess.Popen(
        [*TABLEMAP, "process", *arguments, "-o", "runs"],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120
    while not has_come() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.5)
    running.send_signal(number)
    _, errors = running.communicate(timeout=120)
    return running.returncode, errors


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_run_says_so(
    number: signal.Signals, code: int, demo_recording: Path, tmp_path: Path
) -> None:
    """The folder keeps its review, has no model, and is marked."""
    ended, errors = interrupted(tmp_path, number, str(demo_recording))
    assert ended == code, errors
    assert "Traceback" not in errors
    (said,) = [line for line in errors.splitlines() if line.startswith("open it")]
    assert "tablemap view" in said
    (folder,) = (path for path in (tmp_path / "runs" / "demo").iterdir() if path.name != "latest")
    assert json.loads((folder / "manifest.json").read_text())["status"] == "interrupted"
    assert (folder / "run.rrd").stat().st_size > 0
    assert "interrupted during" in (folder / "report.html").read_text(encoding="utf-8")
    assert not (folder / "table.json").exists()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_an_interruption_of_several_says_what_each_left(
    jobs: str, demo_recording: Path, tmp_path: Path
) -> None:
    """The folders of all that were begun, how they ended, and the command that opens one."""
    (tmp_path / "text.mcap").write_text("no recording")
    (tmp_path / "runs" / "demo" / "20200101T000000-00000000").mkdir(parents=True)
    code, errors = interrupted(
        tmp_path,
        signal.SIGINT,
        *("text.mcap", str(demo_recording), "--jobs", jobs),
        failed=("text",),
    )
    assert code == 130, errors
    assert "Traceback" not in errors
    *_, first, second, last = errors.strip().splitlines()
    assert re.fullmatch(r"failed +\S*runs/text/[-\w]+", first)
    assert re.fullmatch(r"interrupted +\S*runs/demo/[-\w]+", second)
    assert last == "open one  tablemap view RUN"


@pytest.mark.skipif(sys.platform == "win32", reason="limits are POSIX's")
def test_a_disk_that_takes_no_more_fails_the_run_and_ends_it(
    demo_recording: Path, tmp_path: Path
) -> None:
    """Files may grow to 200 kB: the review cannot be written, and nothing waits for it."""
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000)); "
        "import tablemap.review.stream as stream; stream.STUCK_SECONDS = 3; "
        "from tablemap.cli import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "process", demo_recording, "-o", tmp_path, "--json", "-q"],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    line = json.loads(done.stdout)
    assert (done.returncode, line["status"], line["model"]) == (1, "failed", None)
    assert "the review file cannot be written" in line["error"]
    manifest = json.loads((Path(line["run"]) / "manifest.json").read_text())
    assert (manifest["status"], manifest["error"]) == ("failed", line["error"])


SEVERAL = (
    "tablemap: expected one run, found a folder of several recordings' runs; give one of them, "
    "such as several/lap (`tablemap runs list` has all): several"
)
WRONG = {
    "process text.mcap -q": (
        1,
        "tablemap: Expected a recording (an MCAP or a bag) and found text: text.mcap",
    ),
    "process text.mcap -o text.mcap": (1, None),
    "process text.mcap --config none.toml": (
        2,
        "tablemap: the config cannot be read (No such file or directory): none.toml",
    ),
    "process text.mcap --config bad.toml": (
        2,
        "tablemap: the config is not valid TOML (Invalid value (at end of document)): bad.toml",
    ),
    "process text.mcap --set seed": (
        2,
        "tablemap: expected --set section.key=value, found 'seed'.",
    ),
    "process text.mcap --set surfac.x=1": (
        2,
        "tablemap: there is no setting 'surfac'; the nearest is 'surface'.",
    ),
    "process text.mcap --export pdf": (
        2,
        "tablemap: expected a format of gazebo, geojson, glb, moveit, nav2, obj, ply, sdf, svg, "
        "urdf; found 'pdf'.",
    ),
    "process @none.txt": (2, None),
    "process none.mcap": (1, "tablemap: there is no such file: none.mcap"),
    "process .": (1, "tablemap: Expected a recording (an MCAP or a bag) and found text: text.mcap"),
    "info .": (1, None),
    "export none --to svg": (1, None),
    "export text.mcap --to svg": (1, None),
    "view none": (
        1,
        "tablemap: expected a run folder, an .rrd or a recording, found none of them: none",
    ),
    "runs list none": (1, None),
    "runs list text.mcap": (1, None),
    "runs show dangling": (
        1,
        "tablemap: the run that this link names is gone; give another of its runs: dangling/latest",
    ),
    "runs compare none none": (1, None),
    "runs verify none": (1, None),
    "runs reprocess none": (1, None),
    "runs prune runs": (
        2,
        "tablemap: say which runs may go: --older-than DAYS, --status STATUS, or all but --keep N.",
    ),
    "runs pack none": (1, None),
    "runs unpack text.mcap": (1, None),
    "runs serve none": (1, None),
    "runs list runs --where height~3": (
        2,
        "tablemap: expected a condition such as height<0.7, found 'height~3'.",
    ),
    "runs list runs --since yesterday": (
        2,
        "tablemap: expected a date such as 2026-05-31, or 2026-05-31T14:00; found 'yesterday'.",
    ),
    "evaluate text.mcap": (1, None),
    "evaluate --suite nonsense": (2, None),
    "simulate stols -o x.mcap": (
        2,
        "tablemap: there is no scenario 'stols'; the nearest is 'stool', and `tablemap simulate "
        "--list` shows those that there are. A file's name must end in .toml.",
    ),
    "simulate demo -o text.mcap/x.mcap": (1, None),
    "process s3://": (
        1,
        "tablemap: expected a place such as s3://BUCKET/lap.mcap, found 's3://'.",
    ),
    "process text.mcap --near nan 1": (
        2,
        "tablemap: expected best, all or a place (x, y) in metres; found [nan, 1.0].",
    ),
    "process text.mcap --start tomorrow": (
        2,
        "tablemap: topics.start = 'tomorrow' is not allowed: expected seconds, or a date and time "
        "such as 2026-11-22T08:59:56.",
    ),
    "process text.mcap --set seed=-1": (
        2,
        "tablemap: seed = -1 is not allowed: input should be greater than or equal to 0.",
    ),
    "process text.mcap --set review.level=loud": (2, None),
    "process text.mcap --set topics.depth=5": (2, None),
    "process text.mcap --scheduler nowhere": (1, None),
    "process @list.txt": (2, "tablemap: expected a recording a line, found none: list.txt"),
    "process @runs": (2, None),
    "process text.mcap none.mcap --together": (1, None),
    "process text.mcap --config runs": (2, None),
    "info text.mcap --set surface.x=1": (2, None),
    "info text.mcap --start x": (2, None),
    "convert text.mcap -o out.mcap": (1, None),
    "convert none.mcap -o out.mcap": (1, None),
    "export lap/run --to svg --set export.thickness=-1": (2, None),
    "export lap/run --to nav2 --set export.resolution=0": (2, None),
    "export lap/run --to svg -o text.mcap": (1, None),
    "export lap/run --to svg --to glb -o a.svg": (
        2,
        "tablemap: expected a folder as output of svg and glb, found a file's name: a.svg",
    ),
    "export lap/run --to nav2 -o a.pgm": (
        2,
        "tablemap: expected a folder as output of nav2, found a file's name: a.pgm",
    ),
    "export lap/run --to obj -o a.glb": (
        2,
        "tablemap: expected FILE.obj or a folder as output of obj, found a file's name: a.glb",
    ),
    "export lap/failed --to svg": (1, None),
    "export none.json --to svg": (1, None),
    "view runs": (1, None),
    "view text.mcap": (1, None),
    "view text.rrd": (1, "tablemap: expected an .rrd, found something else: text.rrd"),
    "view text.mcap --start x": (2, None),
    "simulate bad.toml -o a.mcap": (2, None),
    "simulate none.toml -o a.mcap": (2, None),
    "evaluate none": (1, "tablemap: there is no such file: none"),
    "evaluate lap/run": (
        1,
        "tablemap: expected a truth beside the run's recording, found none; give --truth FILE: "
        "/gone/lap.truth.json",
    ),
    "evaluate lap/run --truth none.json": (1, None),
    "evaluate lap/failed --truth text.mcap": (1, None),
    "config --config runs": (2, None),
    "config --set =1": (2, None),
    "runs list . --where depth<1": (2, None),
    "runs list runs --until 2026-13-01": (2, None),
    "runs show lap/none": (1, None),
    "runs compare lap/run lap/failed": (1, None),
    "runs verify runs": (1, None),
    "runs reprocess lap/run": (
        1,
        "tablemap: the run's recording is gone; put it back at /gone/lap.mcap",
    ),
    "runs prune none --keep 1": (1, None),
    "runs pack lap/run -o runs": (1, None),
    "runs unpack none.zst": (1, None),
    "runs unpack runs": (1, None),
    "runs show several": (1, SEVERAL),
    "export several --to svg": (1, SEVERAL),
    "view several --still top.png": (1, SEVERAL),
    "config --set a.b=1": (2, "tablemap: there is no setting 'a'; the nearest is 'surface'."),
}
"""What is wrong: the exit code and the whole of stderr (None: one line that begins so)."""


def test_every_error_is_one_sentence(tmp_path: Path) -> None:
    """Nothing on stdout, one line on stderr, no traceback and no defect."""
    (tmp_path / "text.mcap").write_text("this is text\n")
    (tmp_path / "bad.toml").write_text("a = [\n")
    (tmp_path / "list.txt").write_text("# none yet\n")
    (tmp_path / "text.rrd").write_text("no review")
    (tmp_path / "runs").mkdir()
    make_run(tmp_path, "lap/run", rectangle_model())
    make_run(tmp_path, "lap/failed", None, status="failed")
    make_run(tmp_path / "several", "lap/run", rectangle_model())
    (tmp_path / "dangling").mkdir()
    (tmp_path / "dangling" / "latest").symlink_to("gone")
    for command, (expected_code, sentence) in WRONG.items():
        done = tablemap_here(*command.split(), cwd=tmp_path)
        err = done.stderr
        assert (done.returncode, done.stdout) == (expected_code, ""), (command, err)
        assert err.startswith("tablemap: "), (command, err)
        assert err.count("\n") == 1, (command, err)
        assert "defect" not in err, (command, err)
        assert sentence is None or err == sentence + "\n", command


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a full disk as Linux has it")
def test_a_full_disk_is_said_with_the_next_step() -> None:
    """Also where the output of a command goes to a file on it."""
    code = "import sys; sys.argv[1:] = ['config']; from tablemap.cli import main; main()"
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 1
    assert done.stderr == (
        "tablemap: No space left on device; free some space, or write to another place.\n"
    )


def test_a_terminal_breaks_sentences_between_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Elsewhere an error is one line, for programs that read lines; a long path stays whole."""
    path = "/a/path/that/is/longer/than/the/line"
    sentence = f"there is no such file; look for it in the folder beside: {path}"
    complain(sentence)
    assert capsys.readouterr().err == f"tablemap: {sentence}\n"
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "30")
    complain(sentence)
    *lines, last = capsys.readouterr().err.splitlines()
    assert max(map(len, lines)) <= 30
    assert last == path
    assert " ".join([*lines, last]) == f"tablemap: {sentence}"


def test_long_texts_stay_in_their_column_on_a_terminal() -> None:
    """A model's doubts and notes are longer than a line."""
    rows = [("verdict", "doubtful"), ("because", "one of four sides was not seen")]
    assert named_rows(rows, None) == "verdict  doubtful\nbecause  one of four sides was not seen"
    assert named_rows(rows, 30).splitlines() == [
        "verdict  doubtful",
        "because  one of four sides was",
        "         not seen",
    ]


def test_piped_output_has_no_colour(tmp_path: Path) -> None:
    """Nor what fills a terminal's line; the listing is compared whole."""
    run = make_run(tmp_path / "runs", "demo/one", rectangle_model())
    for arguments in (
        ["runs", "list", tmp_path / "runs"],
        ["runs", "show", run.path],
        ["process", "none.mcap"],
    ):
        done = tablemap(*arguments, cwd=tmp_path, colours=True)
        assert "\x1b" not in done.stdout + done.stderr
    assert tablemap("runs", "list", tmp_path / "runs").stdout == (
        "started              status  verdict  shape      size           height  run\n"
        "2026-05-01 12:00:00  ok      good     rectangle  1.187 x 0.806  0.743   demo/one\n"
    )


def test_a_list_has_the_begin_of_a_long_error(tmp_path: Path) -> None:
    """So that a line stays one that is read; `runs show` and JSON have all of it."""
    run = make_run(tmp_path / "runs", "stairs/one", None)
    file = run.path / "manifest.json"
    error = "no surface gave a table: " + "--near 1.00 2.00 (0.74 m high), " * 12
    manifest = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps({**manifest, "status": "failed", "error": error}), encoding="utf-8")
    (_, line) = tablemap("runs", "list", tmp_path / "runs").stdout.splitlines()
    assert line.endswith("...")
    assert error[:60] in line
    assert error[:120] not in line
    (row,) = json.loads(tablemap("runs", "list", tmp_path / "runs", "--json").stdout)
    assert row["error"] == error
    assert error.strip() in tablemap("runs", "show", run.path).stdout


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("runs ", RUNS),
        ("process a.mcap --set Surface.minimum_i", ["Surface.minimum_inliers="]),
        ("info a.mcap --set l", []),
        ("info a.mcap --set topics.las", ["topics.laser=", "topics.laser_clock_offset="]),
        ("export a --to G", ["Gazebo", "Geojson", "Glb"]),
        ("process a.mcap --export nA", ["nAv2"]),
        ("view a --still b.png --tab sur", ["surface"]),
        ("simulate DEM", ["DEMo"]),
        ("evaluate --suite rep", ["report"]),
        ("runs list --verdict d", ["doubtful"]),
    ],
)
def test_a_shell_completes_names(words: str, offered: list[str]) -> None:
    """Of commands, settings, formats and so on; as they were begun, for case does not count."""
    asked = [*words.split(), *([""] if words.endswith(" ") else [])]
    code = "import sys; sys.argv = ['tablemap']; from tablemap.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env={
            **os.environ,
            "_TABLEMAP_COMPLETE": "complete_bash",
            "COMP_WORDS": f"tablemap {words}",
            "COMP_CWORD": str(len(asked)),
        },
    )
    assert sorted(done.stdout.split()) == sorted(offered), done.stderr


@pytest.mark.parametrize(
    "command",
    [
        "simulate Nonsense -o x.mcap",
        "runs list runs --shape hexagon",
        "runs list runs --status okay",
        "runs list runs --verdict fine",
        "runs prune runs --status okay --yes",
        "export runs --to stl",
    ],
)
def test_a_name_that_is_none_is_said_with_those_that_are(command: str, tmp_path: Path) -> None:
    """Instead of an empty list."""
    (tmp_path / "runs").mkdir()
    done = tablemap_here(*command.split(), cwd=tmp_path)
    assert done.returncode == 2
    assert re.search("expected a|there are", done.stderr), done.stderr
    assert done.stderr.count("\n") == 1


def test_the_case_of_a_name_does_not_count(tmp_path: Path) -> None:
    """Of a format, a status, a setting; the files are called by the real name."""
    run = make_run(tmp_path / "runs", "demo/one", rectangle_model())
    done = tablemap_here("export", run.path, "--to", "SVG", cwd=tmp_path)
    assert done.stdout.splitlines() == [str(run.path / "exports" / "svg" / "table.svg")]
    for chosen in (["--status", "OK"], ["--verdict", "Good"], ["--shape", "Rectangle"]):
        assert "demo/one" in tablemap_here("runs", "list", *chosen, cwd=tmp_path).stdout
    shown = tablemap_here("config", "--set", "SEED=7", "--set", "Review.Level=off").stdout
    assert "\nseed = 7\n" in shown
    assert '\nlevel = "off"\n' in shown


@pytest.mark.parametrize("command", ["--help", "runs --help", "process --help", "export --help"])
def test_help_loads_nothing_heavy(command: str) -> None:
    """It is there at once."""
    heavy = {"numpy", "rerun", "open3d", "scipy", "shapely", "mcap", "distributed"}
    code = (
        f"import sys; sys.argv = ['tablemap', *{command.split()!r}]\n"
        "from tablemap.cli.app import app\n"
        "app(standalone_mode=False)\n"
        f"print(sorted(set(sys.modules) & {heavy!r}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("module", ["typer", "tablemap.cli.app", "tablemap.cli.process"])
def test_an_interruption_before_any_command_is_no_traceback(module: str) -> None:
    """While the commands are still being imported, the exit code alone says it."""
    code = (
        "import sys\n"
        "class Interrupted:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {module!r}:\n"
        "            raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupted())\n"
        "from tablemap.cli import main; main()"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (130, "")
