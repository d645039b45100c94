"""The wire: frames that lie, who may speak, clocks that jump, floods, rovers that restart in mid-plan."""

from __future__ import annotations

import contextlib
import socket
import stat
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from executive.errors import WireError
from executive.ports import Command, CommandId, Event, Product, Result, Update
from executive.runtime.journal import JournalFile
from executive.runtime.live import LiveRuntime, LiveSettings
from executive.runtime.wire import Address, Keys, WireOptions, WireRover
from executive.runtime.wire.address import dial, listen
from executive.runtime.wire.frames import LIMIT, FrameReader, frame
from executive.runtime.wire.kept import MERGE_FROM, Kept, first_number
from executive.runtime.wire.messages import event_of
from executive.runtime.wire.round_trips import RoundTrips
from executive.runtime.wire.stop import stop_rover
from tests.executive.wire.servers import JumpingClock, Waiter, served
from tests.waiting import until

QUICK = WireOptions(retry_s=0.1, beat_s=0.05, dead_s=2.0, pause_s=0.02, longest_pause_s=0.1, patience_s=3.0)
DAY = """(plan :id day :library ((alternate :id safe :node (task :id beacon :action wait)))
 :node (block :id root :node-list ((task :id long :action wait :parameters (duration_s = {}))
   (task :id after :action wait :parameters (duration_s = 0.1)))))"""


@contextlib.contextmanager
def line_to(address: Address, run: str = "run", **more: object) -> Iterator[WireRover]:
    rover = WireRover(address, run=run, options=QUICK, **more)  # type: ignore[arg-type]
    try:
        yield rover
    finally:
        rover.close()


def hear(rover: WireRover, count: int, seconds: float = 5.0) -> list[Event]:
    found: list[Event] = []
    end = time.monotonic() + seconds
    while len(found) < count and time.monotonic() < end:
        event = rover.next_event(0)
        if event is not None:
            found.append(event)
    return found


# ---- frames


def test_frames_come_through_whole_however_they_are_cut() -> None:
    messages = [{"m": "beat", "t": n, "text": "ß" * n} for n in range(50)]
    data = b"".join(frame(m) for m in messages)
    for size in (1, 3, 7, 1000, len(data)):
        reader, found = FrameReader(), []
        for at in range(0, len(data), size):
            found += reader.feed(data[at : at + size])
        assert found == messages


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\x00\x00\x00\x00", "0 bytes"),
        ((LIMIT + 1).to_bytes(4, "big"), f"{LIMIT + 1} bytes"),
        (b"\x00\x00\x00\x02hi", "not JSON"),
        (b"\x00\x00\x00\x02[]", "not an object"),
        (b"\x00\x00\x00\x03\xff\xfe\xfd", "not JSON"),
        (len(b"[" * 60000).to_bytes(4, "big") + b"[" * 60000, "not JSON"),
        (b"GET / HTTP/1.1\r\n", "bytes"),
    ],
)
def test_a_frame_that_lies_ends_the_line_with_a_sentence(data: bytes, said: str) -> None:
    with pytest.raises(WireError, match=said):
        FrameReader().feed(data)


@pytest.mark.parametrize(
    "document",
    [
        {},
        {"e": "operator", "t": 1},
        {"e": "update"},
        {"e": "update", "t": -1, "values": {}},
        {"e": "update", "t": True, "values": {}},
        {"e": "update", "t": 1e300, "values": {}},
        {"e": "update", "t": 1, "values": [1]},
        {"e": "update", "t": 1, "number": "7", "values": {}},
        {"e": "update", "t": 1, "number": -7, "values": {}},
        {"e": "result", "t": 1},
        {"e": "result", "t": 1, "command": ["r", "a"]},
        {"e": "result", "t": 1, "command": ["r", "a", "1"], "success": True},
        {"e": "result", "t": 1, "command": ["r", "a", 1], "updates": "none"},
        {"e": "product", "t": 1, "command": ["r", "a", 1], "kind": 3, "path": "p", "sha256": ""},
        {"e": ["update"], "t": 1},
    ],
)
def test_an_event_that_is_none_is_refused_with_a_sentence(document: dict[str, object]) -> None:
    with pytest.raises(WireError, match=r"^[a-z]"):
        event_of(document)


# ---- who may speak


def test_a_unix_socket_is_its_owners_alone(tmp_path: Path) -> None:
    path = tmp_path / ("deep" * 30) / "rover.sock"  # longer than a socket's name may be
    path.parent.mkdir()
    with contextlib.closing(listen(Address(path))):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        dial(Address(path)).close()
        with pytest.raises(WireError, match="in use by another process"):
            listen(Address(path))
    with contextlib.closing(listen(Address(path))):  # its process is gone: the place is free
        pass


def test_a_door_is_opened_without_a_word_to_the_rest_of_the_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two doors opened at once once left umask 0177 behind, and every later folder without its x."""
    monkeypatch.setattr("os.umask", lambda _: pytest.fail("the umask is the whole process's"))
    doors: list[socket.socket] = []
    threads = [
        threading.Thread(target=lambda i=i: doors.append(listen(Address(tmp_path / f"{i}.sock"))))
        for i in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(doors) == 8
    assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.glob("*.sock")} == {0o600}
    for door in doors:
        door.close()


@pytest.mark.parametrize(
    "text", ["", "unix:", "tcp://host", "tcp://:1", "tcp://h:99999", "http://h:1", "h:1"]
)
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(WireError, match=r"not an address|a port is"):
        Address.parse(text)


def test_tcp_off_the_machine_refuses_to_start_without_keys() -> None:
    for text in ("tcp://0.0.0.0:0", "tcp://192.0.2.1:7411", "tcp://rover.example:7411", "tcp://[::]:0"):
        with pytest.raises(WireError, match="mutual TLS"):
            listen(Address.parse(text))
        with pytest.raises(WireError, match="mutual TLS"):
            WireRover(Address.parse(text), run="r")
    for text in ("tcp://127.0.0.1:1", "tcp://[::1]:1", "tcp://localhost:1", "unix:/tmp/x"):
        Address.parse(text).require_keys(None)


def authority(folder: Path, name: str, *, of: Path | None = None) -> Keys:
    """Write a certificate, signed by the authority in `of` or a new one."""
    import datetime
    import ipaddress

    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    def subject(text: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])

    def write(path: Path, key: ec.EllipticCurvePrivateKey, certificate: x509.Certificate) -> None:
        path.with_suffix(".key").write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM,
                serialization.PrivateFormat.PKCS8,
                serialization.NoEncryption(),
            )
        )
        path.with_suffix(".pem").write_bytes(certificate.public_bytes(serialization.Encoding.PEM))

    now = datetime.datetime.now(datetime.UTC)
    root = folder / "ca" if of is None else of
    if not root.with_suffix(".pem").exists():
        key = ec.generate_private_key(ec.SECP256R1())
        builder = x509.CertificateBuilder().subject_name(subject("ca")).issuer_name(subject("ca"))
        builder = builder.public_key(key.public_key()).serial_number(x509.random_serial_number())
        builder = builder.not_valid_before(now).not_valid_after(now + datetime.timedelta(days=1))
        ca = builder.add_extension(x509.BasicConstraints(True, None), critical=True)
        ca = ca.add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        usage = x509.KeyUsage(True, False, False, False, False, True, True, False, False)
        write(root, key, ca.add_extension(usage, critical=True).sign(key, hashes.SHA256()))
    ca_key = serialization.load_pem_private_key(root.with_suffix(".key").read_bytes(), None)
    ca_cert = x509.load_pem_x509_certificate(root.with_suffix(".pem").read_bytes())
    key = ec.generate_private_key(ec.SECP256R1())
    builder = x509.CertificateBuilder().subject_name(subject(name)).issuer_name(ca_cert.subject)
    builder = builder.public_key(key.public_key()).serial_number(x509.random_serial_number())
    builder = builder.not_valid_before(now).not_valid_after(now + datetime.timedelta(days=1))
    names = [x509.IPAddress(ipaddress.ip_address("127.0.0.1")), x509.DNSName("localhost")]
    builder = builder.add_extension(x509.SubjectAlternativeName(names), critical=False)
    issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(ca_cert.public_key())
    builder = builder.add_extension(issuer, critical=False)
    write(folder / name, key, builder.sign(ca_key, hashes.SHA256()))  # type: ignore[arg-type]
    return Keys(folder / f"{name}.pem", folder / f"{name}.key", root.with_suffix(".pem"))


def test_with_keys_both_ends_show_a_certificate_and_strangers_are_refused(tmp_path: Path) -> None:
    from executive.runtime.wire import About, RoverServer
    from executive.runtime.wire.address import bound_address

    ours = authority(tmp_path, "executive")
    rovers = authority(tmp_path, "rover", of=tmp_path / "ca")
    (tmp_path / "foreign").mkdir()
    foreign = authority(tmp_path / "foreign", "stranger")
    stranger = Keys(foreign.certificate, foreign.key, ours.authority)
    clock = JumpingClock()
    door = listen(Address.parse("tcp://127.0.0.1:0"), rovers)
    address = bound_address(Address.parse("tcp://127.0.0.1:0"), door)
    server = RoverServer(Waiter(clock), About("tls"), clock)
    thread = threading.Thread(target=server.serve, args=(door, rovers), daemon=True)
    thread.start()
    try:
        with line_to(address, keys=ours) as rover:
            assert rover.wait_ready(5).rover == "tls"
            rover.send(Command(CommandId("run", "a", 1), "wait", {}))
            assert any(isinstance(e, Result) for e in hear(rover, 2))
        for keys in (None, stranger):
            with line_to(address, keys=keys) as rover, pytest.raises(WireError, match="no rover answers"):
                rover.wait_ready(0.7)
    finally:
        server.stop_serving()
        thread.join(5)
        door.close()


def test_half_of_the_keys_are_none(tmp_path: Path) -> None:
    with pytest.raises(WireError, match="all three"):
        Keys.of(tmp_path, None, None)
    assert Keys.of(None, None, None) is None


def test_a_rover_serves_one_run_at_a_time_and_a_stop_from_anybody(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address, "one") as first:
        first.wait_ready(5)
        first.send(Command(CommandId("one", "a", 1), "wait", {"duration_s": 100.0}))
        until(lambda: first.link().commands and first.link().commands[0][1] == "running")
        with line_to(address, "two") as second, pytest.raises(WireError, match="busy with the run one"):
            second.wait_ready(2)
        stop_rover(address)
        assert any(type(e).__name__ == "Acknowledgement" for e in hear(first, 2))
        with line_to(address, "two") as second:
            second.wait_ready(5)


def test_the_newest_executive_of_a_run_takes_over(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address) as first:
        first.wait_ready(5)
        with line_to(address) as second:
            second.wait_ready(5)
            until(lambda: not first.link().up)
            second.send(Command(CommandId("run", "a", 1), "wait", {}))
            assert len(hear(second, 2)) == 2
            assert not first.link().up


def test_a_stop_is_the_last_word_on_a_command_that_was_lost(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(5)
        line.stop()
        line.send(Command(CommandId("run", "after", 1), "wait", {}))  # safing may follow a stop
        until(lambda: CommandId("run", "after", 1) in rover.done)
        late = CommandId("run", "late", 1)
        line.abort(late)
        until(lambda: not line.link().commands)
        line.send(Command(late, "wait", {}))
        until(lambda: not line.link().commands)
        assert late not in rover.carried_out


# ---- clocks


@pytest.mark.parametrize("jump_s", [7200.0, -7200.0])
def test_a_rovers_clock_that_jumps_by_hours_is_noted_and_harms_nothing(jump_s: float, tmp_path: Path) -> None:
    clock = JumpingClock(10_000_000)
    with served(Waiter(clock), tmp_path / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(5)
        run = LiveRuntime(DAY.format(1.0), line, run_id="run", settings=LiveSettings(silence_ms=5_000))
        timer = threading.Timer(0.5, lambda: setattr(clock, "offset_ms", 10_000_000 + int(1000 * jump_s)))
        timer.start()
        outcome = run.run()
        timer.join()
    assert outcome.outcome == "SUCCEEDED"
    assert outcome.end_ms is not None
    assert 1000 < outcome.end_ms < 3000
    assert any("the rover's clock jumped by" in note.text for note in outcome.notes)


def test_the_age_of_a_word_does_not_depend_on_what_the_rovers_clock_shows() -> None:
    said: list[str] = []
    times = RoundTrips(lambda _kind, text: said.append(text))
    times.show(90_000_000, time.monotonic())
    age = times.age_s(90_000_000 - 3000)
    assert age == pytest.approx(3.0, abs=0.2)
    assert times.age_s(99_000_000) == 0.0  # of the future: said now
    mark = times.begin(time.monotonic())
    times.end(mark, 5, time.monotonic())
    assert "jumped by" in said[0]
    assert times.age_s(5) == pytest.approx(0.0, abs=0.2)


# ---- garbage and floods


def test_garbage_in_telemetry_is_noted_once_and_the_plan_goes_on(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    door = listen(Address(tmp_path / "mad.sock"))
    with served(rover, tmp_path / "r.sock") as (address, _), contextlib.closing(door):
        bad = b'{"m":"event","event":{"e":"update","t":1,"values":{"k":NaN,"list":[1],"deep":{"x":1}}}}'
        words = [
            bad,
            b'{"m":"event","event":{"e":"update","t":"late"}}',
            b'{"m":"dance"}',
            b'{"m":[1]}',
            b"{}",
        ]

        def go_between() -> None:
            near, _ = door.accept()
            far = dial(address)
            for word in words * 50:
                near.sendall(len(word).to_bytes(4, "big") + word)
            far.settimeout(None)
            for a, b in ((near, far), (far, near)):
                threading.Thread(target=pump, args=(a, b), daemon=True).start()

        threading.Thread(target=go_between, daemon=True).start()
        with line_to(Address(tmp_path / "mad.sock")) as line:
            line.wait_ready(5)
            journal = tmp_path / "journal"
            outcome = LiveRuntime(DAY.format(0.2), line, run_id="run", journal=journal).run()
    assert outcome.outcome == "SUCCEEDED"
    texts = [note.text for note in outcome.notes]
    assert any("'k'" in text and "not a value" in text for text in texts)
    assert any("malformed" in text and "'late'" in text for text in texts), "said before the run listened"
    assert len(JournalFile(journal).records) > 5


def pump(source: socket.socket, sink: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(65536):
            sink.sendall(data)


def test_ten_thousand_updates_a_second_neither_stop_a_plan_nor_fill_memory(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    with served(rover, tmp_path / "r.sock") as (address, server), line_to(address) as line:
        line.wait_ready(5)
        over = threading.Event()

        def flood() -> None:
            count = 0
            while not over.wait(0.01):
                rover.events += [Update(0, {"noise": float(count + n)}) for n in range(100)]
                count += 100

        thread = threading.Thread(target=flood)
        thread.start()
        run = LiveRuntime(DAY.format(1.0), line, run_id="run", journal=tmp_path / "journal")
        outcome = run.run()
        over.set()
        thread.join()
        assert outcome.outcome == "SUCCEEDED"
        assert outcome.end_ms is not None
        assert outcome.end_ms < 6000
        assert len(server._kept._events) < 4 * MERGE_FROM


def test_what_nobody_takes_is_merged_and_no_result_is_lost() -> None:
    kept = Kept(0)
    for n in range(5 * MERGE_FROM):
        kept.say(Update(n, {"k": float(n), f"only{n % 7}": True}))
    kept.say(Result(1, CommandId("r", "a", 1), True))
    kept.say(Update(2, {"k": -1.0}))
    events = kept.fresh(10 * MERGE_FROM)
    assert len(events) <= MERGE_FROM + 3
    assert [getattr(e, "number", 0) for e in events] == list(range(1, len(events) + 1))
    assert sum(isinstance(e, Result) for e in events) == 1
    values: dict[str, object] = {}
    for event in events[:-1]:
        values.update(getattr(event, "values", {}))
    assert values["k"] == 5 * MERGE_FROM - 1
    kept.commit(events[-1].number)  # type: ignore[union-attr]
    assert kept.first == kept.last + 1


# ---- rovers that restart


def test_what_a_rover_that_restarted_does_not_know_has_failed_and_is_not_done_again(tmp_path: Path) -> None:
    first, second = Waiter(JumpingClock()), Waiter(JumpingClock())
    plan = DAY.format(100.0)
    with line_to(Address(tmp_path / "r.sock")) as line:
        with served(first, tmp_path / "r.sock"):
            line.wait_ready(5)
            run = LiveRuntime(plan, line, run_id="run", settings=LiveSettings(monitor_ms=300))
            thread = threading.Thread(target=run.run)
            thread.start()
            until(lambda: first.carried_out)
        time.sleep(1.1)  # its life is counted in seconds
        with served(second, tmp_path / "r.sock"):
            thread.join(timeout=15)
            assert not thread.is_alive()
    outcome = run.session.result()
    events = [" ".join((r.event, *r.arguments)) for r in outcome.trace]
    assert "end long FAILED action-failed" in events
    assert "alternate safe" in events
    assert [c.task for c in second.carried_out] == ["beacon"]
    assert any("the rover has restarted" in note.text for note in outcome.notes)


def test_both_ends_begun_anew_do_nothing_again_though_products_are_fetched_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    where, command = tmp_path / "r.sock", CommandId("run", "long", 1)
    first, second = Waiter(JumpingClock()), Waiter(JumpingClock())
    with served(first, where) as (address, _), line_to(address, out=tmp_path / "run") as line:
        line.wait_ready(5)
        line.send(Command(command, "wait", {"duration_s": 60.0}))
        until(lambda: first.carried_out)
        (heard,) = (event.number for event in hear(line, 1) if isinstance(event, Update))
    monkeypatch.setattr("executive.runtime.wire.lead.first_number", lambda _now: heard + 1000)
    with served(second, where) as (address, _), line_to(address, out=tmp_path / "run") as line:
        line.fetch([Product(0, CommandId("run", "image", 1), "image", "products/1.bin", "0" * 64)])
        line.since(heard)
        known = line.status(command).result
    assert isinstance(known, Result)
    assert known.reason == "the rover restarted and knows nothing of it"
    assert second.carried_out == []


def test_lives_within_one_second_have_numbers_of_their_own_above_what_was_said() -> None:
    lives = [first_number(1_790_000_000.0 + step / 1000) for step in range(1000)]
    assert all(later - earlier >= 1000 for earlier, later in pairwise(lives))
    assert lives[-1] < 2**53  # whole in every JSON


def test_a_rover_whose_clock_was_set_back_while_it_was_off_is_still_heard() -> None:
    kept = Kept(100)
    kept.say(Update(0, {"a": 1.0}))
    kept.move_behind(5000)
    assert [getattr(e, "number", 0) for e in kept.fresh(10)] == [5001]
    assert kept.boot == 5000


# ---- products and long absences


def test_products_come_down_in_pieces_and_whole(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock(), tmp_path / "made")
    out = tmp_path / "run"
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address, out=out) as line:
        line.wait_ready(5)
        line.send(Command(CommandId("run", "pic", 1), "image", {}))
        events = hear(line, 3)
        product = next(e for e in events if isinstance(e, Product))
        until(lambda: line.wait_for_products(1) == 0)
        assert (out / product.path).read_bytes() == (tmp_path / "made" / product.path).read_bytes()
        assert not list(out.rglob("*.part"))


def test_an_executive_that_finds_no_rover_says_what_it_tried(tmp_path: Path) -> None:
    said = r"none.sock: no rover answers within 0.3 s \(.*does not answer"
    with line_to(Address(tmp_path / "none.sock")) as line, pytest.raises(WireError, match=said):
        line.wait_ready(0.3)


def test_silence_of_the_rover_makes_it_safe_but_a_line_that_answers_is_no_silence(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(5)
        settings = LiveSettings(silence_ms=700, grace_ms=300)
        outcome = LiveRuntime(DAY.format(2.0), line, run_id="run", settings=settings).run()
        assert outcome.outcome == "SUCCEEDED"  # 2 s without an event, and the rover was there
    with line_to(Address(tmp_path / "q.sock"), "q") as line:
        with served(rover, tmp_path / "q.sock") as (address, _):
            line.wait_ready(5)
            run = LiveRuntime(DAY.format(60.0), line, run_id="q", settings=settings)
            thread = threading.Thread(target=run.run)
            thread.start()
            until(lambda: rover.running)
        until(lambda: any("no word from the rover" in n.text for n in run.session.notes))
        run.shut_down()
        thread.join(5)


def test_what_was_stopped_before_the_rover_came_to_it_is_never_begun(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    with served(rover, tmp_path / "r.sock") as (address, server), line_to(address) as line:
        line.wait_ready(5)
        begun, busy = threading.Event(), threading.Event()

        def computing() -> None:
            begun.set()
            busy.wait(60)

        server._lead.do(computing)
        assert begun.wait(5)
        late = CommandId("run", "late", 1)
        line.send(Command(late, "wait", {"duration_s": 100.0}))
        until(lambda: line.link().commands[0][1] == "accepted")
        line.stop()
        until(lambda: len(server._lead._tasks) >= 2)
        busy.set()
        assert any(type(e).__name__ == "Acknowledgement" for e in hear(line, 2))
        time.sleep(0.05)
        assert late not in rover.carried_out
