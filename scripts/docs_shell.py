"""One shell in which the commands of a page are run, one by one."""

from __future__ import annotations

import codecs
import contextlib
import os
import re
import select
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

MARK, LEFT = "@@ended", "@@left"
SETTLES_S = 5.0
"""So long is waited for the first word of a command in the background."""
OVER = re.compile(rf"\n{MARK} (\d+)\n")


def _mind_interrupts() -> None:
    """Let SIGINT end a program again: one started in the background ignores it, as do its children."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Shell:
    """A bash that works in a folder; what it started ends with it.

    Commands read `typed` from their standard input: a person who answers every question with one line.
    """

    def __init__(self, folder: Path, environment: dict[str, str], typed: str, limit_s: float) -> None:
        self._own = tempfile.TemporaryDirectory()
        self._step, self._typed = (Path(self._own.name, name) for name in ("step", "typed"))
        self._typed.write_text(typed, encoding="utf-8")
        self._end = time.monotonic() + limit_s
        self._served: int | None = None
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._bash = subprocess.Popen(
            ["bash", "--norc"],
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=_mind_interrupts,
        )
        self._send("set -u")

    def __enter__(self) -> Shell:
        """Give the shell."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the shell and what runs in it or in its background."""
        for group in (self._served, self._bash.pid):
            with contextlib.suppress(ProcessLookupError):
                if group is not None:
                    os.killpg(group, signal.SIGTERM)
        assert self._bash.stdin is not None
        assert self._bash.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._bash.stdin.close()
        try:
            self._bash.wait(20)
        except subprocess.TimeoutExpired:
            os.killpg(self._bash.pid, signal.SIGKILL)
            self._bash.wait()
        self._bash.stdout.close()
        self._own.cleanup()

    def run(self, command: str) -> tuple[int, str]:
        """Return how a command ended and what was printed meanwhile."""
        self._step.write_text(command + "\n", encoding="utf-8")
        self._send(f". {self._step} <{self._typed}; printf '\\n{MARK} %s\\n' $?")
        code, printed = self._answer()
        if command.partition(" #")[0].rstrip().endswith("&"):  # what comes next may need what it starts
            end = time.monotonic() + SETTLES_S
            while time.monotonic() < end and ((more := self._read(0.3)) or not printed.strip()):
                printed += more
        return code, printed

    def serve(self, command: str, ready: Callable[[str], bool], limit_s: float) -> tuple[int, str]:
        """Return what a command printed until it was ready, was interrupted and ended; and how it ended.

        The status is 0 if it was ready and then ended by the interrupt or because of it, in an orderly way.
        """
        self._step.write_text(command + "\n", encoding="utf-8")
        told = self._step.with_name("pid")
        told.unlink(missing_ok=True)
        inner = f"((. {self._step} <{self._typed}); printf '\\n{LEFT} %s\\n' $?)"
        self._send(f"set -m; {inner} & set +m; echo $! >{told}.new; mv {told}.new {told}")
        while not told.exists():
            time.sleep(0.01)
        self._served = int(told.read_text())
        printed, end = "", min(self._end, time.monotonic() + limit_s)
        while not ready(printed):
            if left := re.search(rf"\n{LEFT} (\d+)\n", printed):
                return int(left[1]) or 125, f"{printed[: left.start()]}\n(ended by itself)"
            if time.monotonic() > end:
                return 124, f"{printed}\n(not within {limit_s:g} s)"
            printed += self._read(0.1)
        while more := self._read(0.5):  # it may be on its way still
            printed += more
        os.killpg(self._served, signal.SIGINT)
        code, rest = self.run(f"wait {self._served}")
        self._served = None
        return (0 if code in {0, 128 + signal.SIGINT} else code), printed + rest

    def _send(self, line: str) -> None:
        assert self._bash.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._bash.stdin.write(f"{line}\n".encode())
            self._bash.stdin.flush()

    def _read(self, patience_s: float) -> str:
        assert self._bash.stdout is not None
        if not select.select([self._bash.stdout], [], [], patience_s)[0]:
            return ""
        return self._decoder.decode(os.read(self._bash.stdout.fileno(), 65536))

    def _answer(self) -> tuple[int, str]:
        """Return the status and the text of the command that runs."""
        printed = ""
        while not (ended := OVER.search(printed)):
            if time.monotonic() > self._end:
                return 124, f"{printed}\n(the page takes too long)"
            more = self._read(1.0)
            printed += more
            if not more and self._bash.poll() is not None:
                return self._bash.returncode, printed
        return int(ended[1]), printed[: ended.start()] + printed[ended.end() :]
