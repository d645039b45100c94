"""The journal: durable before effects, replay byte for byte, time travel, clear words when it is broken."""

from __future__ import annotations

import errno
import json
import os
import threading
import zlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.engine.instance import Abort, Note, UtilityUsed
from executive.errors import JournalError
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    Operation,
    Operator,
    Product,
    Result,
    TraceRecord,
    Update,
)
from executive.runtime import run_plan
from executive.runtime.codec import Entry, Input, Json, effect_from_json, entry_to_json, trace_line
from executive.runtime.journal import FileJournal, JournalFile, MemoryJournal, record_of
from executive.runtime.lines import documents_of, line_of, lines_of
from executive.runtime.loading import load_plan
from executive.runtime.recovery import recorded_trace, recover_run, replay, state_at
from executive.runtime.scripted_rover import Behaviour, ScriptedRover
from executive.runtime.session import Session

PLAN = """
(plan :id p :resources ((arm :unit)) :node
 (block :id root :node-list
  ((task :id a :action image :uses (arm) :retries 1)
   (branch :id br :options
     ((option :id o1 :utility 1 :node (task :id b :action drive))
      (option :id o2 :utility 2 :node (task :id c :action drive :duration (0 5))))))))
"""
ACTIONS = {
    "a": (Behaviour(2_000, success=False), Behaviour(3_000)),
    "c": (Behaviour(60_000),),
}


class WatchedRover(ScriptedRover):
    """Looks into the journal whenever something reaches it."""

    def __init__(self, path: Path) -> None:
        super().__init__({"soc": 80}, ACTIONS)
        self.path = path
        self.unannounced: list[CommandId] = []

    def on_record(self, kind: str, command: CommandId) -> bool:
        wanted = [command.run, command.task, command.attempt]
        return any(r["k"] == kind and r["id"] == wanted for r in JournalFile(self.path).records)

    def send(self, command: Command) -> None:
        if not self.on_record("send", command.id):
            self.unannounced.append(command.id)
        super().send(command)

    def abort(self, command: CommandId) -> None:
        if not self.on_record("abort", command):
            self.unannounced.append(command)
        super().abort(command)


def written(tmp_path: Path) -> Path:
    path = tmp_path / "run.journal"
    run_plan(PLAN, ScriptedRover({"soc": 80}, ACTIONS), run_id="r", journal=path)
    return path


def test_every_command_is_in_the_journal_before_it_reaches_the_rover(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    rover = WatchedRover(path)
    outcome = run_plan(PLAN, rover, run_id="r", journal=path)
    assert outcome.outcome == "FAILED"
    assert rover.sent
    assert rover.aborted
    assert not rover.unannounced


def test_at_most_one_fsync_a_macro_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    real = os.fsync
    sink = FileJournal.create(tmp_path / "run.journal")
    monkeypatch.setattr(os, "fsync", lambda fd: (calls.append(fd), real(fd)))
    session = Session(PLAN, ScriptedRover({"soc": 80}, ACTIONS), journal=sink)
    session.run()
    steps = sum(r["k"] in ("step", "deadline") for r in JournalFile(sink.path).records)
    sink.close()
    assert 0 < len(calls) <= steps + 1  # the end of the run has its own


def test_replay_gives_the_trace_byte_for_byte(tmp_path: Path) -> None:
    records = JournalFile(written(tmp_path)).records
    again = "\n".join(json.dumps(trace_line(r)) for r in replay(records))
    assert again == "\n".join(json.dumps(trace_line(r)) for r in recorded_trace(records))
    assert again.count("\n") > 8


def test_state_at_any_record(tmp_path: Path) -> None:
    records = JournalFile(written(tmp_path)).records
    states = {
        seq: {n["id"]: n["state"] for n in state_at(records, seq)["nodes"]} for seq in range(1, len(records))
    }
    started = next(r["n"] for r in records if r["k"] == "trace" and r["e"] == "start" and r["a"] == ["a"])
    ended = next(r["n"] for r in records if r["k"] == "trace" and r["e"] == "end" and r["a"][0] == "a")
    assert states[started]["a"] == "EXECUTING"
    assert states[ended]["a"] == "FINISHED"
    assert states[len(records) - 1]["root"] == "FINISHED"
    assert state_at(records, 0)["nodes"][0]["state"] == "INACTIVE"


def test_state_at_a_record_that_is_not_there(tmp_path: Path) -> None:
    records = JournalFile(written(tmp_path)).records
    with pytest.raises(JournalError, match=f"records 0 to {len(records) - 1}, there is none of number 999"):
        state_at(records, 999)


def test_torn_last_record_is_left_out_and_the_run_goes_on(tmp_path: Path) -> None:
    path = written(tmp_path)
    lines = path.read_bytes().splitlines(keepends=True)
    for cut in (1, len(lines[12]) // 2, len(lines[12]) - 1):
        torn = tmp_path / f"torn-{cut}.journal"
        torn.write_bytes(b"".join(lines[:12]) + lines[12][:cut])
        file = JournalFile(torn)
        assert file.torn
        assert len(file.records) == 12
        session, sink = recover_run(torn, ScriptedRover({"soc": 80}, ACTIONS), now_ms=50_000)
        session.run()
        sink.close()
        whole = JournalFile(torn)
        assert not whole.torn
        assert replay(whole.records) == recorded_trace(whole.records)


def test_damage_before_the_last_record_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    data = path.read_bytes().replace(b'"a":["a"]', b'"a":["x"]', 1)
    path.write_bytes(data)
    with pytest.raises(JournalError, match=r"line \d+ is damaged and is not the last one"):
        JournalFile(path)


def test_a_missing_record_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:4] + lines[5:]))
    with pytest.raises(JournalError, match="line 5 has number 5, expected 4"):
        JournalFile(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "has no header: it is empty"),
        (b'{"n":0,"k":"head', "its header is torn"),
        (b"hello\nworld\n", "is not a journal: line 1 is not a record"),
        ((line_of(0, {"k": "header", "format": "journal/9"}) + "\n").encode(), "format 'journal/9'"),
        ((line_of(0, {"k": "trace"}) + "\n").encode(), "its first record has kind 'trace'"),
    ],
)
def test_foreign_files_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "foreign"
    path.write_bytes(content)
    with pytest.raises(JournalError, match=message):
        JournalFile(path)


def test_journal_of_another_run_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    with pytest.raises(JournalError, match="belongs to another run: its run is 'r', not 'q'"):
        recover_run(path, ScriptedRover(), now_ms=0, run_id="q")
    with pytest.raises(JournalError, match="its plan digest is"):
        recover_run(path, ScriptedRover(), now_ms=0, plan_digest="0" * 64)


def test_an_existing_journal_is_never_overwritten(tmp_path: Path) -> None:
    path = written(tmp_path)
    before = path.read_bytes()
    with pytest.raises(JournalError, match="exists already"):
        run_plan(PLAN, ScriptedRover(), run_id="r", journal=path)
    assert path.read_bytes() == before


def test_full_disk_lets_nothing_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.journal"
    sink = FileJournal.create(path)
    rover = ScriptedRover({"soc": 80}, ACTIONS)
    session = Session(PLAN, rover, run_id="r", journal=sink)
    session.step(2_500)
    sent, size = len(rover.sent), path.stat().st_size
    real = os.write

    def half(fd: int, data: memoryview) -> int:
        if len(data) > 30:
            return real(fd, data[:30])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", half)
    with pytest.raises(JournalError, match="cannot be written: No space left on device"):
        session.run()
    monkeypatch.undo()
    assert len(rover.sent) == sent
    assert path.stat().st_size == size
    with pytest.raises(JournalError, match="nothing after them has left"):
        sink.append([{"k": "note"}], durable=True)
    sink.close()
    resumed, second = recover_run(path, rover, now_ms=3_000)
    assert resumed.run().outcome == "FAILED"
    second.close()


def test_journal_in_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(JournalError, match="cannot be created"):
        FileJournal.create(tmp_path / "file" / "run.journal")


def test_a_record_comes_back_from_its_line_and_no_other_line_does() -> None:
    record: Json = {"k": "note", "text": 'quote " and , "crc":" inside', "n": 3}
    line = line_of(3, {k: v for k, v in record.items() if k != "n"})
    found = record_of(line)
    assert found is not None
    assert {k: v for k, v in found.items() if k != "crc"} == record
    assert record_of(line[:-1]) is None
    assert record_of(line.replace("inside", "outside")) is None


def test_what_utility_source_said_is_replayed_without_it() -> None:
    journal = MemoryJournal()

    def estimate(option: str, t_ms: int, database: object) -> float | None:
        return 9.5 if option == "o1" else None

    outcome = run_plan(load_plan(PLAN), ScriptedRover({}, ACTIONS), journal=journal, utility_source=estimate)
    assert outcome.outcomes["b"] == "SUCCEEDED"
    used = [(r["option"], r["value"]) for r in journal.records if r["k"] == "utility"]
    assert used == [("o1", 9.5)]
    assert tuple(replay(journal.records, load_plan(PLAN))) == outcome.trace


def test_a_journal_of_a_compiled_plan_can_be_replayed_by_itself() -> None:
    journal = MemoryJournal()
    outcome = run_plan(load_plan(PLAN), ScriptedRover({}, ACTIONS), journal=journal)
    assert tuple(replay(journal.records)) == outcome.trace


def test_nonsense_of_a_utility_source_is_noted_and_the_table_holds() -> None:
    outcome = run_plan(PLAN, ScriptedRover({}, ACTIONS), utility_source=lambda o, t, d: float("nan"))
    assert outcome.outcomes["c"] is not None
    assert [n.text for n in outcome.notes if n.kind == "ignored"] == ["the utility source gave nan"] * 2


def test_a_journal_in_memory_holds_what_was_said_not_what_became_of_it() -> None:
    journal, values = MemoryJournal(), {"soc": 80.0}
    journal.append([Input("step", 0, [Update(0, values)])], durable=True)
    values["soc"] = 3.0
    assert journal.records[0]["events"][0]["values"] == {"soc": 80.0}
    assert journal.durable == 1


def test_a_journal_in_memory_loses_nothing_to_whoever_reads_it() -> None:
    journal, over = MemoryJournal(), threading.Event()

    def read() -> None:
        while not over.is_set():
            _ = len(journal.records)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for n in range(3_000):
        journal.append([Input("step", n), Input("deadline", n)], durable=False)
    over.set()
    for reader in readers:
        reader.join()
    assert [r["n"] for r in journal.records] == list(range(6_000))
    assert [r["t"] for r in journal.records] == [n // 2 for n in range(6_000)]


words = st.text(max_size=6)
held = st.dictionaries(
    words, st.one_of(st.floats(allow_nan=False, allow_infinity=False), words, st.booleans()), max_size=3
)
whole = st.integers(0, 2**53)
ids = st.builds(CommandId, words, words, whole)
events = st.one_of(
    st.builds(Update, whole, held, whole),
    st.builds(Result, st.one_of(whole, st.floats(0, 9)), ids, st.booleans(), words, held, held, whole),
    st.builds(Acknowledgement, whole, ids, held, whole),
    st.builds(Product, whole, ids, words, words, words, held, whole),
    st.builds(Operator, whole, st.sampled_from(Operation), st.one_of(st.none(), words)),
)
entries = st.one_of(
    st.builds(TraceRecord, st.one_of(whole, st.floats(0, 9)), words, st.lists(words, max_size=3).map(tuple)),
    st.builds(Command, ids, words, held, held, whole),
    st.builds(Input, st.sampled_from(["step", "deadline", "restart"]), whole, st.lists(events, max_size=3)),
    st.builds(Abort, ids),
    st.builds(Note, whole, words, words, words),
    st.builds(UtilityUsed, whole, words, st.floats(0, 9)),
    st.fixed_dictionaries({"k": st.just("end"), "t": whole, "utility": st.floats(0, 9)}),
)


@given(number=st.integers(0, 10**6), records=st.lists(entries, min_size=1, max_size=4))
def test_the_text_of_a_record_is_what_json_makes_of_it(number: int, records: list[Entry]) -> None:
    """Lines are put together by hand for speed; their bytes are those of format journal/1."""
    expected = b""
    for n, entry in enumerate(records, number):
        text = json.dumps({"n": n, **entry_to_json(entry)}, separators=(",", ":"), ensure_ascii=False)
        body = text[:-1].encode("utf-8", "surrogatepass")
        expected += body + f',"crc":"{zlib.crc32(body):08x}"}}\n'.encode()
    assert lines_of(number, records) == expected
    assert [json.loads(d) for d in documents_of(number, records)] == [
        json.loads(line[: line.rindex(b',"crc"')] + b"}") for line in expected.splitlines()
    ]


@given(record=entries)
def test_an_effect_comes_back_from_its_record(record: Entry) -> None:
    written = json.loads(json.dumps(entry_to_json(record)))
    effect = not isinstance(record, dict | Input)
    assert effect_from_json(written) == (record if effect else None)
