"""What commands that take long show on a terminal, and how Ctrl-C ends them."""

from __future__ import annotations


class Interrupt:
    """Turns the first Ctrl-C into a wish to stop with what there is; the second ends the program."""

    def __init__(self) -> None:
        self._wanted = False

    def wanted(self) -> bool:
        return self._wanted

    def __enter__(self) -> Interrupt:
        import signal

        self._before = signal.getsignal(signal.SIGINT)

        def handler(_number: int, _frame: object) -> None:
            if self._wanted:
                raise KeyboardInterrupt
            self._wanted = True

        signal.signal(signal.SIGINT, handler)
        return self

    def __exit__(self, *_: object) -> None:
        import signal

        signal.signal(signal.SIGINT, self._before)


class ProgressLine:
    """One line of progress on stderr, rewritten in place; nothing where stderr is not a terminal."""

    def __init__(self) -> None:
        import sys

        self._stream = sys.stderr
        self._on = sys.stderr.isatty()

    def show(self, share: float, what: str) -> None:
        """Write how far the work is, and what it is at."""
        if self._on:
            self._stream.write(f"\r\x1b[K{100 * share:3.0f} %  {what}")
            self._stream.flush()

    def __enter__(self) -> ProgressLine:
        return self

    def __exit__(self, *_: object) -> None:
        if self._on:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
