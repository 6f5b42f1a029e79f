"""Names that others chose, as they may be shown and as they may be called in a folder."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

_LONGEST_NAME = 120  # bytes of a file's name, which most disks hold 255 of
_NOT_TEXT = {"Cc", "Cf", "Cs", "Zl", "Zp", "Co", "Cn"}
"""What moves a terminal's cursor, turns its text round or is no letter at all."""


def shown(text: object) -> str:
    """Return a text in which nothing but letters is left: what is none stands as an escape.

    Names in a recording may hold commands to a terminal, and line breaks that begin a line of the
    namer's choosing; names of files may hold bytes that are no text.
    """
    words = str(text)
    if words.isprintable():
        return words
    return "".join(c if unicodedata.category(c) not in _NOT_TEXT else _escape(c) for c in words)


def shortened(text: str, *, most: int = 200) -> str:
    """Return a text as it is, or the begin of a long one."""
    return text if len(text) <= most else f"{text[:most]}..."


def shown_path(path: str) -> str:
    """Return a path as it is where it is text, else with its other bytes as escapes."""
    try:
        path.encode()
    except UnicodeEncodeError:
        return shown(path)
    return path


def shown_lines(text: object) -> str:
    """Return a text of several lines, each as `shown` does it."""
    return "\n".join(map(shown, str(text).split("\n")))


def counted(number: int, thing: str, things: str | None = None) -> str:
    """Return a number with what it counts: ``1 view``, ``2 views``; ``things``: the plural."""
    return f"{number} {thing if number == 1 else things or thing + 's'}"


def known_name(given: str, known: Iterable[str]) -> str:
    """Return the known name that is the given one in any case; without one the given name."""
    return next((name for name in known if name.lower() == given.lower()), given)


def safe_name(name: str) -> str:
    """Return what a folder is called after a name: no way out of its place, and nothing hidden."""
    safe = re.sub(r"[/\\]", "_", shown(name)).strip()
    safe = re.sub(r"^\.+", lambda dots: "_" * len(dots[0]), safe)
    while len(safe.encode()) > _LONGEST_NAME:
        safe = safe[:-1]
    return safe or "_"


def escape(text: str) -> str:
    """Return a text for HTML and XML, attributes too, without what is no letter."""
    import html

    return html.escape(shown(text))


def _escape(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file's name that is no text
        return f"\\x{code - 0xDC00:02x}"
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
