"""Runs are verified, packed, unpacked and pruned without losing or inventing anything."""

from __future__ import annotations

import io
import json
import resource
import tarfile
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import zstandard
from msgspec import structs

from tablemap.archive import RunFolder, load_run
from tablemap.archive.index import list_runs
from tablemap.archive.liveness import Writer
from tablemap.archive.packing import pack, unpack
from tablemap.archive.pruning import named_latest, prune, to_prune
from tablemap.archive.verification import find_input
from tablemap.errors import ConfigError, RecordingError, TablemapError
from tablemap.runs.verification import verify
from tests.making.command import tablemap_here
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A file that stands for a recording; nothing here reads it as one."""
    file = tmp_path / "lap.mcap"
    file.write_bytes(bytes(range(256)) * 100)
    return file


@pytest.fixture
def run(recording: Path, tmp_path: Path) -> RunFolder:
    """A finished run of it."""
    return make_run(tmp_path / "runs", "lap/a", rectangle_model(), recording=recording)


def outcomes(run: RunFolder) -> dict[str, str]:
    """Return what `verify` says of each thing."""
    return {check.name: check.outcome for check in verify(run)}


def test_the_manifest_names_every_file_of_the_run(run: RunFolder) -> None:
    """But for itself and what is added later."""
    (run.path / "exports").mkdir()
    (run.path / "exports" / "model.sdf").write_text("<sdf/>")
    assert set(run.manifest.files) == {"config.toml", "table.json", "trajectory.tum"}
    assert outcomes(run) == {
        "config.toml": "ok",
        "table.json": "ok",
        "trajectory.tum": "ok",
        "schema of table.json": "ok",
        "settings": "ok",
        "review": "missing",
        "recording": "ok",
    }


def test_what_changed_is_found(run: RunFolder, recording: Path) -> None:
    """A model, settings, a lost file, a broken review, another recording of the same size."""
    (run.path / "table.json").write_text("{}")
    (run.path / "config.toml").write_text("seed = -1\n")
    (run.path / "trajectory.tum").unlink()
    (run.path / "run.rrd").write_bytes(b"RRF2 and then nothing of that kind")
    recording.write_bytes(bytes(256) * 100)
    found = outcomes(load_run(run.path))
    assert found == {
        "config.toml": "changed",
        "table.json": "changed",
        "trajectory.tum": "missing",
        "run.rrd": "unchecked",
        "schema of table.json": "damaged",
        "settings": "damaged",
        "review": "damaged",
        "recording": "changed",
    }
    (review,) = (check for check in verify(load_run(run.path)) if check.name == "review")
    assert "`tablemap runs redraw` makes it anew" in (review.detail or "")


def test_a_recording_that_is_not_here_is_no_fault_of_the_run(
    run: RunFolder, recording: Path
) -> None:
    """But nothing is processed again in its stead."""
    recording.unlink()
    assert outcomes(run)["recording"] == "unchecked"
    with pytest.raises(RecordingError, match="gone"):
        find_input(run)


def test_another_recording_is_refused(run: RunFolder, recording: Path) -> None:
    """By its size and by its hash."""
    recording.write_bytes(bytes(256) * 100)
    with pytest.raises(RecordingError, match="SHA-256"):
        find_input(run)
    recording.write_bytes(b"short")
    with pytest.raises(RecordingError, match="25600 bytes, found 5"):
        find_input(run)


def test_a_run_comes_back_as_it_was(run: RunFolder, tmp_path: Path) -> None:
    """Every byte; the same file from the same run; ``latest`` names it."""
    file = pack(run, tmp_path / "a.tar.zst", with_input=False)
    again = pack(run, tmp_path / "b.tar.zst", with_input=False)
    assert file.read_bytes() == again.read_bytes()
    back = unpack(file, tmp_path / "elsewhere")
    assert back.path == tmp_path / "elsewhere" / "lap" / "a"
    for original in run.path.iterdir():
        assert (back.path / original.name).read_bytes() == original.read_bytes()
    assert load_run(tmp_path / "elsewhere" / "lap").path == back.path
    assert [path.name for path in (tmp_path / "elsewhere").iterdir()] == ["lap"]


def test_the_recording_goes_along_on_demand(
    run: RunFolder, recording: Path, tmp_path: Path
) -> None:
    """And is found in the unpacked run, where the original is gone."""
    content = recording.read_bytes()
    file = pack(run, tmp_path / "a.tar.zst", with_input=True)
    recording.unlink()
    back = unpack(file, tmp_path / "elsewhere")
    assert find_input(back).path.read_bytes() == content
    assert outcomes(back)["recording"] == "ok"
    repacked = unpack(pack(back, tmp_path / "b.tar.zst", with_input=True), tmp_path / "third")
    assert find_input(repacked).path.read_bytes() == content


@pytest.mark.parametrize("size", [None, 7, 6])
def test_a_file_that_no_hash_confirms_is_not_packed(
    run: RunFolder, tmp_path: Path, size: int | None
) -> None:
    """A run from elsewhere may name any file of this machine."""
    secret = tmp_path / "secret.txt"
    secret.write_text("secret\n")
    entry = structs.replace(run.manifest.recording, path=str(secret), size=size, sha256=None)
    run.update(recording=entry)
    with pytest.raises(RecordingError, match=r"no SHA-256.*secret\.txt"):
        pack(run.path, tmp_path / "a.tar.zst", with_input=True)
    run.update(recording=structs.replace(entry, sha256="0" * 64))
    with pytest.raises(RecordingError, match=r"is another one: .*secret\.txt"):
        pack(run.path, tmp_path / "a.tar.zst", with_input=True)
    assert not (tmp_path / "a.tar.zst").exists()


def test_a_run_is_never_overwritten(run: RunFolder, tmp_path: Path) -> None:
    """By itself neither."""
    file = pack(run, tmp_path / "a.tar.zst", with_input=False)
    with pytest.raises(TablemapError, match="there already"):
        unpack(file, tmp_path / "runs")
    assert run.model.to_json() == rectangle_model().to_json()


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.6, 0.9, 0.999])
def test_a_packed_run_that_was_cut_off_leaves_nothing(
    run: RunFolder, tmp_path: Path, share: float
) -> None:
    """Wherever it was cut."""
    file = pack(run, tmp_path / "a.tar.zst", with_input=True)
    data = file.read_bytes()
    file.write_bytes(data[: int(share * len(data))])
    try:
        back = unpack(file, tmp_path / "elsewhere")
    except TablemapError as error:
        assert "a.tar.zst" in str(error)
        assert list((tmp_path / "elsewhere").iterdir()) == []
    else:  # the cut took no more than the padding
        assert find_input(back).size() == 25600
        assert share > 0.9


def test_one_flipped_byte_is_noticed(run: RunFolder, tmp_path: Path) -> None:
    """In the middle of the packed file."""
    file = pack(run, tmp_path / "a.tar.zst", with_input=False)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0x40
    file.write_bytes(data)
    with pytest.raises(TablemapError):
        unpack(file, tmp_path / "elsewhere")


def test_packing_that_is_cut_off_leaves_no_file(
    run: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And an earlier one stays as it was."""
    target = tmp_path / "a.tar.zst"
    target.write_bytes(b"an earlier one")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tarfile.TarFile, "addfile", full)
    with pytest.raises(TablemapError, match="No space left"):
        pack(run, target, with_input=False)
    assert target.read_bytes() == b"an earlier one"
    assert not list(tmp_path.glob(".*"))


def test_a_changed_or_unfinished_run_is_not_packed(run: RunFolder, tmp_path: Path) -> None:
    """What is packed is what was written."""
    (run.path / "table.json").write_text("{}")
    with pytest.raises(TablemapError, match=r"table\.json is changed"):
        pack(run, tmp_path / "a.tar.zst", with_input=False)
    running = make_run(tmp_path / "runs", "lap/b", None, status="running")
    with pytest.raises(TablemapError, match="running"):
        pack(running, tmp_path / "a.tar.zst", with_input=False)
    assert not (tmp_path / "a.tar.zst").exists()


def entry(name: str, kind: bytes = tarfile.REGTYPE) -> tarfile.TarInfo:
    """Return a member of that name, one byte long if it is a file."""
    member = tarfile.TarInfo(name)
    member.type, member.linkname = kind, "/etc/passwd"
    member.size = 1 if kind == tarfile.REGTYPE else 0
    return member


@pytest.mark.parametrize(
    "member",
    [
        entry("../lap/a/table.json"),
        entry("lap/a/../../../table.json"),
        entry("/lap/a/table.json"),
        entry("lap\\a/b/table.json"),
        entry("table.json"),
        entry("lap/a/.bashrc"),
        entry("lap/a/table.json", tarfile.SYMTYPE),
        entry("lap/a/table.json", tarfile.LNKTYPE),
        entry("lap/a/table.json", tarfile.FIFOTYPE),
    ],
    ids=lambda member: f"{member.name} {member.type!r}",
)
def test_members_that_lead_elsewhere_are_refused(member: tarfile.TarInfo, tmp_path: Path) -> None:
    """Nothing is written, in the folder or beside it."""
    plain = io.BytesIO()
    with tarfile.open(fileobj=plain, mode="w") as tar:
        tar.addfile(member, io.BytesIO(b"x"))
    file = tmp_path / "bad.tar.zst"
    file.write_bytes(zstandard.compress(plain.getvalue()))
    with pytest.raises(TablemapError, match="expected files of one run"):
        unpack(file, tmp_path / "room" / "runs")
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["bad.tar.zst", "room", "runs"]


def header_of(name: str, *, size: int = 0, kind: bytes = tarfile.REGTYPE) -> bytes:
    """Return a bare header of a tar, which may declare what does not follow."""
    member = tarfile.TarInfo(name)
    member.type, member.size = kind, size
    return member.tobuf(tarfile.GNU_FORMAT)


def with_pax(fields: dict[str, str], *, data: bytes = b"x") -> bytes:
    """Return a tar of one file of a run whose header has further fields."""
    plain = io.BytesIO()
    with tarfile.open(fileobj=plain, mode="w", format=tarfile.PAX_FORMAT) as tar:
        member = entry("lap/a/table.json")
        member.size = len(data)
        member.pax_headers = fields
        tar.addfile(member, io.BytesIO(data))
    return plain.getvalue()


def packed_with_zeros(head: bytes, size: int) -> bytes:
    """Return a frame of ``head`` and so many zeros after it."""
    packer = zstandard.ZstdCompressor(level=1).compressobj()
    packed = packer.compress(head)
    piece = bytes(2**20)
    return packed + b"".join(packer.compress(piece) for _ in range(size >> 20)) + packer.flush()


GIB = 2**30
SPARSE = {"GNU.sparse.major": "1", "GNU.sparse.minor": "0", "GNU.sparse.name": "lap/a/x"}
HOSTILE = {
    "a header of gigabytes": lambda: packed_with_zeros(
        header_of("x", size=4 * GIB, kind=tarfile.XHDTYPE), GIB
    ),
    "a name of gigabytes": lambda: packed_with_zeros(
        header_of("x", size=4 * GIB, kind=tarfile.GNUTYPE_LONGNAME), GIB
    ),
    "zeros after the end": lambda: packed_with_zeros(bytes(2 * tarfile.RECORDSIZE), GIB),
    "nothing but zeros": lambda: packed_with_zeros(b"", GIB),
    "more than is there": lambda: zstandard.compress(header_of("lap/a/x", size=8 * GIB)),
    "a file above the limit": lambda: packed_with_zeros(header_of("lap/a/x", size=GIB), GIB),
    "files above the limit": lambda: zstandard.compress(
        b"".join(header_of(f"lap/a/{n}", size=2**20) + bytes(2**20) for n in range(5))
    ),
    "files without number": lambda: zstandard.compress(
        b"".join(header_of(f"lap/a/{n}") for n in range(1200))
    ),
    "headers of headers": lambda: zstandard.compress(header_of("x", kind=tarfile.XHDTYPE) * 5000),
    "a negative size": lambda: zstandard.compress(with_pax({"size": "-512"})),
    "a size that is no number": lambda: zstandard.compress(with_pax({"size": "1e3"})),
    "a time that is none": lambda: zstandard.compress(with_pax({"mtime": "nan"})),
    "a time without end": lambda: zstandard.compress(with_pax({"mtime": "inf"})),
    "a time before all": lambda: zstandard.compress(with_pax({"mtime": "-1e300"})),
    "an empty character": lambda: zstandard.compress(with_pax({"path": "lap/a/b\0c"})),
    "1500 levels": lambda: zstandard.compress(with_pax({"path": "lap/a/" + "d/" * 1500 + "x"})),
    "a long name": lambda: zstandard.compress(with_pax({"path": "lap/a/" + "x" * 5000})),
    "a half surrogate": lambda: zstandard.compress(with_pax({"path": "lap/a/\udc80"})),
    "sparse, no map": lambda: zstandard.compress(with_pax(SPARSE, data=b"no map")),
    "sparse, a map of words": lambda: zstandard.compress(with_pax(SPARSE, data=b"a\nb\n" * 200)),
    "sparse, a map without end": lambda: zstandard.compress(
        with_pax(SPARSE, data=b"99999999\n" + b"0\n" * 2**20)
    ),
    "sparse, of old": lambda: zstandard.compress(
        with_pax({"GNU.sparse.size": "x", "GNU.sparse.map": "0,1,a"})
    ),
    "sparse, mostly holes": lambda: zstandard.compress(
        with_pax({"GNU.sparse.size": str(10**13), "GNU.sparse.map": "0,1"})
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_what_claims_more_than_it_is_unpacks_to_nothing(name: str, tmp_path: Path) -> None:
    """It is refused in one sentence, within 64 MiB more of memory, and nothing is left."""
    file = tmp_path / "bad.tar.zst"
    file.write_bytes(HOSTILE[name]())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(TablemapError) as caught:
        unpack(file, tmp_path / "runs", most_bytes=4 * 2**20)
    said = str(caught.value)
    assert said.endswith(str(file))
    assert said.isprintable()
    assert len(said) < 500 + len(str(file))
    assert list((tmp_path / "runs").iterdir()) == []
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 64 * 1024


def test_the_limit_of_what_unpacks_is_named_and_can_be_raised(
    run: RunFolder, tmp_path: Path
) -> None:
    """By the option of the command."""
    file = pack(run, tmp_path / "a.tar.zst")
    refused = tablemap_here("runs", "unpack", file, "-o", tmp_path / "x", "--limit", "0.000001")
    assert refused.returncode == 1
    assert "--limit" in refused.stderr
    assert tablemap_here("runs", "unpack", file, "-o", tmp_path / "x").returncode == 0


def test_a_run_under_a_false_name_is_refused(run: RunFolder, tmp_path: Path) -> None:
    """The folder is named as the manifest says."""
    run.path.rename(run.path.with_name("other"))
    renamed = load_run(run.path.with_name("other"))
    file = pack(renamed, tmp_path / "a.tar.zst", with_input=False)
    with pytest.raises(TablemapError, match="another name"):
        unpack(file, tmp_path / "elsewhere")


NOW = datetime(2026, 5, 10, tzinfo=UTC)


@pytest.fixture
def many(tmp_path: Path) -> Path:
    """Runs of two recordings on the days of May that they are named after."""
    folder = tmp_path / "runs"
    for name, status in (
        ("hall/01", "ok"),
        ("hall/02", "failed"),
        ("hall/03", "ok"),
        ("lab/04", "running"),
        ("lab/09", "ok"),
        ("yard/02", "running"),
    ):
        model = rectangle_model() if status == "ok" else None
        started = f"2026-05-{name[-2:]}T00:00:00+00:00"
        writer = Writer.this()
        if name == "lab/04":
            writer = structs.replace(writer, began=1)
        make_run(folder, name, model, status=status, started=started, writer=writer)  # type: ignore[arg-type]
    return folder


@pytest.mark.parametrize(
    ("criteria", "expected"),
    [
        ({"older_than": timedelta(days=7)}, ["hall/01", "hall/02"]),
        ({"older_than": timedelta(days=7), "keep": 1}, ["hall/01", "hall/02"]),
        ({"keep": 1}, ["hall/01", "hall/02", "lab/04"]),
        ({"keep": 2}, ["hall/02", "lab/04"]),
        ({"keep": 0}, ["hall/01", "hall/02", "lab/04"]),
        ({"status": ("ok",)}, ["hall/01"]),
        ({"status": ("failed",)}, ["hall/02"]),
        ({"status": ("dead",), "older_than": timedelta(days=1)}, ["lab/04"]),
        ({"status": ("running",), "older_than": timedelta(days=1)}, []),
        ({"keep": 9}, ["hall/02", "lab/04"]),
    ],
)
def test_each_criterion_holds_what_it_must(
    many: Path, criteria: dict[str, object], expected: list[str]
) -> None:
    """Together they let go what all of them let go, and never what ``latest`` names.

    ``keep`` counts the runs with a model: the failed one takes no good one's place.
    """
    rows, latest = list_runs(many), named_latest(many)
    going = to_prune(rows, now=NOW, latest=latest, **criteria)  # type: ignore[arg-type]
    assert [row.path for row in going] == expected


def test_an_older_run_that_latest_names_stays(many: Path) -> None:
    """Where a person made it so."""
    load_run(many / "hall/01").become_latest()
    assert named_latest(many) == {"hall/01", "lab/09"}
    going = to_prune(list_runs(many), now=NOW, keep=1, latest=named_latest(many))
    assert [row.path for row in going] == ["hall/02", "lab/04"]


def test_a_clock_that_was_set_back_offers_no_fresh_run(many: Path) -> None:
    """Runs from the future are kept, and take no place of those that are kept."""
    started = "2027-01-01T00:00:00+00:00"
    make_run(many, "hall/99", rectangle_model(), status="ok", started=started)
    going = to_prune(list_runs(many), now=NOW, keep=1)
    assert [row.path for row in going] == ["hall/01", "hall/02", "lab/04"]


def test_a_run_that_goes_on_is_not_removed(many: Path) -> None:
    """Neither when it began after it was listed as dead."""
    row = next(row for row in list_runs(many) if row.path == "yard/02")
    assert row.status == "running"
    with pytest.raises(TablemapError, match="goes on"):
        prune(many, [row._replace(status="dead")])
    assert (many / "yard/02/manifest.json").is_file()


def test_pruning_without_a_criterion_is_wrong_usage(many: Path) -> None:
    """Not everything goes."""
    with pytest.raises(ConfigError, match="which runs"):
        to_prune(list_runs(many), now=NOW)


def test_pruned_runs_are_gone_and_latest_names_what_is_left(many: Path) -> None:
    """And a recording without runs leaves no folder."""
    rows = {row.path: row for row in list_runs(many)}
    prune(many, [rows["hall/03"]])
    assert load_run(many / "hall").path.name == "01"
    prune(many, [rows["lab/09"], rows["lab/04"]])
    assert not (many / "lab").exists()
    assert [row.path for row in list_runs(many)] == ["hall/01", "hall/02", "yard/02"]
    assert json.loads((many / "hall/01/manifest.json").read_text())["status"] == "ok"
