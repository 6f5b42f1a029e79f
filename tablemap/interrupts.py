"""Signals that end the program: each is told once, as a KeyboardInterrupt, wherever it is met."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
"""Ctrl-C, `kill`, and a terminal that is closed."""


_told: list[int] = []


def told_to_stop() -> bool:
    """Tell whether a signal that ends the program has come.

    Compiled code may make another error of the interruption, such as a failed import.
    """
    return bool(_told)


class Interrupts:
    """Listens to the signals that end a program; ``received`` are the numbers of those that came.

    The first raises KeyboardInterrupt in the main thread. Others count for nothing for so many
    seconds, for they would disturb what the first has begun.
    """

    def __init__(self, *, grace_seconds: float) -> None:
        self.received: list[int] = []
        self._grace = grace_seconds
        self._raised = -float("inf")
        self._was_swallowed = False

    def listen(self) -> None:
        """Take the signals over, but for those that whoever began us told us to ignore."""
        for each in SIGNALS:
            if signal.getsignal(each) is not signal.SIG_IGN:
                signal.signal(each, self._hear)
        sys.unraisablehook = self._unraisable

    def _hear(self, number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if not self._was_swallowed:
            self.received.append(number)
            _told.append(number)
            if now - self._raised < self._grace:
                return
        self._was_swallowed, self._raised = False, now
        raise KeyboardInterrupt

    def _unraisable(self, what: sys.UnraisableHookArgs) -> None:
        """Tell an interruption again that came where Python passes errors over, as in a callback.

        That is also where it would print a traceback.
        """
        if what.exc_type is not KeyboardInterrupt:
            sys.__unraisablehook__(what)
        elif self.received:
            self._was_swallowed = True
            os.kill(os.getpid(), self.received[0])


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let no signal end the program within the context: what it does takes a moment."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def wait_for_the_end(_signal: int, _frame: FrameType | None) -> None:
        """Do nothing: to ignore a signal that has arrived is an error to Python."""

    before = [(each, signal.getsignal(each)) for each in SIGNALS]
    taken = [(each, handler) for each, handler in before if handler not in (signal.SIG_IGN, None)]
    for each, _ in taken:
        signal.signal(each, wait_for_the_end)
    try:
        yield
    finally:
        for each, handler in taken:
            signal.signal(each, handler)


@contextmanager
def held_back() -> Iterator[None]:
    """Let signals wait, for us and for processes that are begun within the context.

    In these they wait until `let_through`: before they are listened to, they would end in a
    traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_through() -> None:
    """Hear the signals that were held back when this process was begun."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
