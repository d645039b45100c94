"""A signer holds the key in a process of its own: who asks gets signatures of some forms, never the key."""

from __future__ import annotations

import socket
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from ground.errors import UnavailableError
from ground.uplink.audit_head import FORM, ROLE, read_head, write_head
from ground.uplink.keys import make_key, public_text
from ground.uplink.signer import LONGEST, RemoteKey, Signer
from ground.uplink.signing_key import open_key
from ground.uplink.verify import PACKAGE, message, public_key, signed_by


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    """Give the socket of a signer for heads of the audit."""
    path = tmp_path / "run" / "signer.sock"
    signer = Signer(make_key(tmp_path / "key"), path, frozenset({FORM}))
    thread = threading.Thread(target=signer.serve)
    thread.start()
    yield path
    signer.stop()
    thread.join()
    assert not path.exists()


def test_a_signature_over_the_socket_is_that_of_the_key(place: Path, tmp_path: Path) -> None:
    key = open_key(place)
    assert isinstance(key, RemoteKey)
    assert key.public_text() == open_key(tmp_path / "key").public_text()
    signature = key.sign(FORM, ROLE, b"heads")
    assert signed_by(public_key(key.public_text()), signature, message(FORM, ROLE, b"heads"))


def test_a_head_is_signed_by_a_signer_as_by_a_key(place: Path, tmp_path: Path) -> None:
    write_head(tmp_path / "head.json", {"msn-1": (3, "0" * 64)}, place)
    assert read_head(tmp_path / "head.json") == {"msn-1": (3, "0" * 64)}


def test_what_it_was_not_started_for_is_not_signed(place: Path) -> None:
    for form in (PACKAGE, "trust/1", "signing-key/1", ""):
        with pytest.raises(UnavailableError, match="this signer signs audit-head/1"):
            RemoteKey(place).sign(form, "author", b"a plan")


def test_the_socket_is_its_owners_alone(place: Path, tmp_path: Path) -> None:
    assert stat.S_IMODE(place.stat().st_mode) == 0o600
    place.chmod(0o666)
    with pytest.raises(UnavailableError, match="others may use the signer"):
        open_key(place)
    place.chmod(0o600)
    with pytest.raises(UnavailableError, match=r"answers at .* already"):
        Signer(make_key(tmp_path / "other"), place, frozenset({FORM}))


def test_the_socket_of_a_dead_signer_is_taken_over(tmp_path: Path) -> None:
    left = tmp_path / "left.sock"
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(left))
    Signer(make_key(tmp_path / "key"), left, frozenset({FORM})).stop()
    (tmp_path / "file").write_text("no socket")
    with pytest.raises(UnavailableError, match="is there and no socket"):
        Signer(make_key(tmp_path / "other"), tmp_path / "file", frozenset({FORM}))
    assert (tmp_path / "file").read_text() == "no socket"


@pytest.mark.parametrize(
    "line",
    [b"\n", b"{}\n", b"[1]\n", b"null\n", b"\xff\n", b'{"ask": "key"}\n', b'{"ask": "sign"}\n',
     b'{"ask": "sign", "form": "audit-head/1", "role": "x", "content": "!"}\n', b"[" * 100_000 + b"\n"],
)  # fmt: skip
def test_nonsense_is_answered_and_the_signer_goes_on(place: Path, line: bytes) -> None:
    with socket.socket(socket.AF_UNIX) as channel:
        channel.connect(str(place))
        channel.sendall(line)
        assert b"error" in channel.recv(65536)
    assert RemoteKey(place).public_text()


def test_a_question_without_end_is_cut_off(place: Path) -> None:
    with socket.socket(socket.AF_UNIX) as channel:
        channel.connect(str(place))
        try:
            for _ in range(LONGEST // 2**20 + 2):
                channel.sendall(b"x" * 2**20)
            assert b"error" in channel.recv(65536)
        except (BrokenPipeError, ConnectionResetError):
            pass
    assert RemoteKey(place).public_text()


def test_a_process_holds_the_key_and_ends_on_a_signal(tmp_path: Path) -> None:
    place, key = tmp_path / "s.sock", tmp_path / "signer.key"
    command = [
        sys.executable,
        "-m",
        "ground.cli",
        "keys",
        "serve",
        str(key),
        "--make",
        "--socket",
        str(place),
    ]
    process = subprocess.Popen([*command, "--form", FORM], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        said = process.stdout.readline() + process.stdout.readline()
        assert RemoteKey(place).public_text() in said
        key_bytes = key.read_bytes()
        key.unlink()  # who asks has no file to read
        write_head(tmp_path / "head.json", {}, place)
        assert b"PRIVATE" in key_bytes
        assert b"PRIVATE" not in (tmp_path / "head.json").read_bytes()
    finally:
        process.terminate()
        assert process.wait(60) == 0
    for _ in range(100):
        if not place.exists():
            break
        time.sleep(0.05)
    assert not place.exists()
    assert public_text(make_key(key)) not in said


SIGNAL_ELSEWHERE = """
import signal, sys, threading
from pathlib import Path
from ground.uplink.keys import make_key
from ground.uplink.signer import Signer

folder = Path(sys.argv[1])
signer = Signer(make_key(folder / "key"), folder / "s.sock", frozenset())
signal.signal(signal.SIGTERM, lambda *_: signer.stop())
threading.Timer(0.3, lambda: signal.pthread_kill(threading.get_ident(), signal.SIGTERM)).start()
signer.serve()
"""


def test_a_signal_that_does_not_wake_the_one_who_answers_ends_it_all_the_same(tmp_path: Path) -> None:
    """Taken by another thread, as by one that is about to listen, it interrupts no call."""
    subprocess.run([sys.executable, "-c", SIGNAL_ELSEWHERE, str(tmp_path)], check=True, timeout=30)
    assert not (tmp_path / "s.sock").exists()
