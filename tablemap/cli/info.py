"""``tablemap info``: what a recording holds and lacks."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from tablemap.cli import completing
from tablemap.cli.commands import Commands
from tablemap.cli.options import End, Json, Start, window
from tablemap.cli.printing import hung, say, wide
from tablemap.words import counted, shown

if TYPE_CHECKING:
    from tablemap.recording import RecordingInfo

commands = Commands()


@commands.command()
def info(
    recording: Annotated[
        str, typer.Argument(help="An MCAP, a bag, or a bag's folder.", metavar="RECORDING")
    ],
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="A topics setting; repeatable.",
            metavar="TOPICS.KEY=NAME",
            autocompletion=completing.settings(below="topics."),
        ),
    ] = None,
    start: Start = None,
    end: End = None,
    check: Annotated[
        bool, typer.Option("--check", help="Exit with 1 if process could not work.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Show a RECORDING's topics, roles and frames, and what is missing for processing."""
    from tablemap.config import load_config
    from tablemap.readiness import inspect

    config = load_config(overrides=[*(settings or ()), *window(start, end)])
    found = inspect(recording, config=config)
    if as_json:
        say(json.dumps(found.to_dict(), indent=1))
    else:
        say("\n".join(map(shown, _info_lines(found, wide(sys.stdout)))))
    if check and found.missing:
        raise typer.Exit(1)


def _info_lines(found: RecordingInfo, columns: int | None) -> Iterator[str]:
    from datetime import UTC, datetime

    start = datetime.fromtimestamp(found.start_ns / 1e9, UTC)
    megabytes = found.size_bytes / 1e6
    yield f"{found.path}: {megabytes:.1f} MB, {counted(found.messages, 'message')}, {found.profile}"
    yield f"{start:%Y-%m-%d %H:%M:%S} UTC, {found.duration_s:.1f} s"
    yield ""
    yield "topics"
    for topic in sorted(found.topics, key=lambda topic: (topic.role is None, topic.name)):
        rate = "" if topic.rate_hz is None else f" at {topic.rate_hz:.1f} Hz"
        detail = f"; {topic.detail}" if topic.detail else ""
        yield f"  {topic.role or '-':<12} {topic.name}"
        yield from hung(f"  {'':<12} ", f"{topic.count}{rate}, {topic.schema}{detail}", columns)
        if topic.problem:
            yield from hung(f"  {'':<12} ", topic.problem, columns)
    yield ""
    yield "frames" + (" (sampled)" if found.frames_sampled else "")
    yield from (f"  {line}" for line in found.tree_lines())
    if roles := found.frame_roles:
        yield f"  fixed: {roles.fixed}, odometry: {roles.odom or 'none'}, base: {roles.base}"
        yield f"  camera: {roles.camera}, laser: {roles.laser or 'none'}"
    yield ""
    if found.fitness:
        yield "for processing"
        for each in found.fitness:
            yield from hung(f"  {each.state:<8} {each.role:<13} ", each.says, columns)
        yield ""
    for warning in found.warnings:
        yield from hung("", f"warning: {warning.code}: {warning.message}", columns)
    for missing in found.missing:
        yield from hung("", f"missing: {missing}", columns)
    if not found.missing:
        yield f"ready: tablemap process {found.path}"
