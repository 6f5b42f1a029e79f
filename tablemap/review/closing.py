"""What is closed at the end of a run, however the run ended."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self

from tablemap.errors import TablemapError


class Closing(ABC):
    """A context manager whose end closes it, and does not hide the error that ended the run."""

    @abstractmethod
    def close(self) -> None:
        """Complete the file; a second call does nothing. Raises `TablemapError` if it cannot."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except TablemapError:
            # The error that ended the run matters more than the error of the file.
            if error is None:
                raise
