"""Runs BehaviorTree.CPP 4 XML over py_trees on a simulated clock, against the scripted world of a scenario.

Written from the node catalogue of BehaviorTree.CPP and from what the file's own `TreeNodesModel` promises; it
knows nothing of the exporter or of the executive's engine. The host ticks until nothing changes any more; an
operator's abort is its `haltTree`.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence

from executive.ports import Acknowledgement, Command, CommandId, Operation, Operator, Result, Update
from executive.runtime.scenario import Scenario
from executive.runtime.scripted_rover import ScriptedRover
from tests.neighbours.robots.bt_format import run_script

RUNNING, SUCCESS, FAILURE, INVALID = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class World:
    """Clock, blackboard, state values, rover and what was seen of the commands."""

    def __init__(self, scenario: Scenario) -> None:
        self.rover = ScriptedRover(scenario.initial, scenario.actions, scenario.script)
        self.t, self.deadline, self.expired, self.halted = 0, False, False, False
        self.board: dict = {"t_ms": 0.0}
        self.state: dict = {}
        self.results: dict = {}
        self.stopped: set = set()
        self.asking: list = []
        self.held: dict[str, float] = {}
        self.attempts: dict[str, int] = {}
        self.events: list[tuple] = []

    def take(self, until: int | None) -> bool:
        """Take in all events of the next time stamp up to `until`; tell whether there was one."""
        event = self.rover.next_event(until)
        if event is None:
            return False
        self.t = max(self.t, event.t_ms)
        while event is not None:
            if isinstance(event, Update):
                self.state.update(event.values)
            elif isinstance(event, (Result, Acknowledgement)):
                self.state.update(event.updates)
                if isinstance(event, Acknowledgement):
                    self.stopped.add(event.command)
                else:
                    self.results[event.command] = event.success
            elif isinstance(event, Operator):
                assert event.operation is Operation.ABORT
                self.halted = True
            event = self.rover.next_event(self.t)
        return True

    def stop(self, command: CommandId) -> None:
        """Stop an action and wait until it is stopped, as `halt` of an action of Nav2 does."""
        self.rover.abort(command)
        while command not in self.stopped and command not in self.results:
            assert self.take(None)
        self.board["t_ms"] = float(self.t)

    def lookup(self, key: str) -> object:
        if key == "time":
            return self.t / 1000
        if key.startswith("outcome "):
            name = re.sub(r"[^A-Za-z0-9_]", lambda m: f"_{ord(m[0]):x}_", key[8:])
            return self.board.get(f"outcome_{name}") or None
        return self.state.get(key)

    def holds(self, when: str) -> bool | None:
        """Return a conjunction of CRL conditions: True, False or None (unknown)."""
        if not when:
            return True
        tokens = re.findall(r'"(?:[^"\\]|\\.)*"|[()]|[<>]=?|/?=|[^\s()<>=/"]+', when)
        tree, _ = _parse(tokens, 0)
        return self._all([self._condition(c) for c in tree])

    def _all(self, answers: list) -> bool | None:
        return False if False in answers else None if None in answers else True

    def _condition(self, form: list) -> bool | None:
        head, *rest = form
        if head == "and":
            return self._all([self._condition(c) for c in rest])
        if head == "or":
            answers = [self._condition(c) for c in rest]
            return True if True in answers else None if None in answers else False
        if head == "not":
            answer = self._condition(rest[0])
            return None if answer is None else not answer
        if head == "known":
            return self.lookup(" ".join(map(_bare, rest[0]))) is not None
        *key, operator, wanted = rest[0]
        return _compare(self.lookup(" ".join(map(_bare, key))), operator, _value(wanted))


def _parse(tokens: list, at: int) -> tuple:
    if tokens[at] != "(":
        return tokens[at], at + 1
    out, at = [], at + 1
    while tokens[at] != ")":
        part, at = _parse(tokens, at)
        out.append(part)
    return out, at + 1


def _value(text: str) -> object:
    try:
        return float(text)
    except ValueError:
        return {"t": True, "true": True, "nil": False}.get(text, _bare(text))


def _bare(text: str) -> str:
    if text.startswith('"'):
        return re.sub(r"\\(.)", r"\1", text[1:-1])
    return text.removeprefix(":")


def _compare(left: object, operator: str, right: object) -> bool | None:
    if left is None:
        return None
    kinds = [
        ("truth" if isinstance(v, bool) else "text" if isinstance(v, str) else "number")
        for v in (left, right)
    ]
    if kinds[0] != kinds[1] or (operator not in ("=", "/=") and kinds[0] != "number"):
        return None
    return {
        "=": lambda: left == right,
        "/=": lambda: left != right,
        "<": lambda: left < right,
        "<=": lambda: left <= right,
        ">": lambda: left > right,
        ">=": lambda: left >= right,
    }[operator]()


class Node(Behaviour):
    """A node of BehaviorTree.CPP: its children are ticked by itself and halted with it."""

    def __init__(self, world: World, xml: ElementTree.Element, below: list[Behaviour]) -> None:
        super().__init__(xml.get("name", xml.tag))
        self.world, self.xml = world, xml
        self.children = below

    def run(self, child: Behaviour) -> Status:
        child.tick_once()
        return child.status

    def terminate(self, new_status: Status) -> None:
        for child in self.children:
            if child.status == RUNNING:
                child.stop(INVALID)

    def wakes(self) -> list[int]:
        """Return times at which a running node may have something new to say."""
        return []


class Leaf(Node):
    def update(self) -> Status:
        code = self.xml.get("code", "")
        match self.xml.tag:
            case "AlwaysSuccess":
                return SUCCESS
            case "AlwaysFailure":
                return FAILURE
            case "Script":
                run_script(code, self.world.board)
                return SUCCESS
            case "ScriptCondition":
                return SUCCESS if run_script(code, self.world.board) else FAILURE
        raise AssertionError(self.xml.tag)


class Condition(Node):
    def update(self) -> Status:
        answer = self.world.holds(self.xml.get("when", ""))
        good = answer is True if self.xml.get("ID") == "Holds" else answer is not False
        return SUCCESS if good else FAILURE


class Action(Node):
    def initialise(self) -> None:
        world, task = self.world, self.xml.get("name")
        world.attempts[task] = issue = world.attempts.get(task, 0) + 1
        self.command = Command(CommandId("bt", task, issue), self.xml.get("ID"), {}, {}, issue)
        world.events.append((world.t, "start" if issue == 1 else "retry", task))
        world.rover.send(self.command)

    def update(self) -> Status:
        result = self.world.results.get(self.command.id)
        return RUNNING if result is None else SUCCESS if result else FAILURE

    def terminate(self, new_status: Status) -> None:
        if new_status == INVALID and self.status == RUNNING:
            self.world.stop(self.command.id)


class Windows(Node):
    """What `WaitWindow` and `Deadline` share: their windows."""

    def windows(self) -> list[tuple[float, float | None, float | None]]:
        found = []
        for term in filter(None, self.xml.get("within", "").split("; ")):
            base, lo, hi = term.split(" ")
            at = 0.0 if base == "t_ms" else self.world.board[base]
            found.append((at, None if lo == "-" else float(lo), None if hi == "-" else float(hi)))
        return found

    def highest(self) -> float:
        return min(
            (at + hi for at, _, hi in self.windows() if at >= 0 and hi is not None), default=float("inf")
        )

    def wakes(self) -> list[int]:
        known = [w for w in self.windows() if w[0] >= 0]
        return [round(at + b) for at, lo, hi in known for b in (lo, hi) if b is not None]

    def overdue(self) -> bool:
        """Tell whether the upper bound takes effect now; one in a round of deadlines."""
        world = self.world
        if world.deadline and not world.expired and world.t >= self.highest():
            world.expired = True
            return True
        return False


class WaitWindow(Windows):
    def update(self) -> Status:
        t = self.world.t
        waiting = any(
            lo is not None and (at == -1 or (at >= 0 and t < at + lo)) for at, lo, _ in self.windows()
        )
        if not waiting and t <= self.highest() and self.world.holds(self.xml.get("when", "")) is True:
            return SUCCESS
        return FAILURE if self.overdue() else RUNNING


class Using(Windows):
    def initialise(self) -> None:
        self.granted, self.since = False, self.world.t

    def needs(self) -> list[tuple[str, float, float]]:
        terms = (term.split(" ") for term in self.xml.get("resources").split("; "))
        return [(name, float(amount), float(room)) for name, amount, room in terms]

    def free(self) -> bool:
        held = self.world.held
        return all(held.get(name, 0.0) + amount <= room for name, amount, room in self.needs())

    def hold(self, sign: int) -> None:
        for name, amount, _ in self.needs():
            self.world.held[name] = self.world.held.get(name, 0.0) + sign * amount

    def update(self) -> Status:
        t = self.world.t
        if self.granted:
            status = self.run(self.children[0])
            if status != RUNNING:
                self.granted = False
                self.hold(-1)
            return status
        waiting = any(
            lo is not None and (at == -1 or (at >= 0 and t < at + lo)) for at, lo, _ in self.windows()
        )
        if (
            not waiting
            and t <= self.highest()
            and self.world.holds(self.xml.get("when", "")) is True
            and self.free()
        ):
            self.world.asking.append(self)
            return RUNNING
        return FAILURE if self.overdue() else RUNNING

    def terminate(self, new_status: Status) -> None:
        super().terminate(new_status)
        if new_status == INVALID and self.status == RUNNING and self.granted:
            self.granted = False
            self.hold(-1)


class Deadline(Windows):
    def update(self) -> Status:
        if self.status == RUNNING and self.overdue():
            return FAILURE
        status = self.run(self.children[0])
        return FAILURE if status == SUCCESS and self.world.t > self.highest() else status


class Timeout(Windows):
    def initialise(self) -> None:
        self.since = self.world.t

    def windows(self) -> list:
        return [(float(self.since), None, float(self.xml.get("msec")))]

    def update(self) -> Status:
        if self.status == RUNNING and self.overdue():
            return FAILURE
        return self.run(self.children[0])


class Later(Node):
    """`Delay` and `Sleep`."""

    def initialise(self) -> None:
        self.until = self.world.t + int(self.xml.get("delay_msec") or self.xml.get("msec"))

    def wakes(self) -> list[int]:
        return [self.until]

    def update(self) -> Status:
        if self.world.t < self.until:
            return RUNNING
        return self.run(self.children[0]) if self.children else SUCCESS


class Precondition(Node):
    def wakes(self) -> list[int]:
        return [int(n) for n in re.findall(r"\d+", self.xml.get("if"))]

    def update(self) -> Status:
        if run_script(self.xml.get("if"), self.world.board):
            return self.run(self.children[0])
        return Status(self.xml.get("else"))


class ForceSuccess(Node):
    def update(self) -> Status:
        status = self.run(self.children[0])
        return RUNNING if status == RUNNING else SUCCESS


class Retry(Node):
    def initialise(self) -> None:
        self.tries = 0

    def update(self) -> Status:
        most = int(self.xml.get("num_attempts"))
        while True:
            status = self.run(self.children[0])
            if status != FAILURE:
                return status
            self.tries += 1
            if 0 <= most <= self.tries:
                return FAILURE


class IfThenElse(Node):
    def initialise(self) -> None:
        self.at = 0

    def update(self) -> Status:
        if self.at == 0:
            status = self.run(self.children[0])
            if status == RUNNING:
                return RUNNING
            self.at = 1 if status == SUCCESS else 2
        return self.run(self.children[self.at]) if self.at < len(self.children) else FAILURE


class ReactiveSequence(Node):
    def update(self) -> Status:
        for place, child in enumerate(self.children):
            status = self.run(child)
            if status != SUCCESS:
                for other in self.children[place + 1 :]:
                    if other.status == RUNNING:
                        other.stop(INVALID)
                return status
        return SUCCESS


class Parallel(Node):
    def initialise(self) -> None:
        self.done: dict[int, Status] = {}

    def update(self) -> Status:
        count = len(self.children)
        wanted, bad = (int(self.xml.get(word)) for word in ("success_count", "failure_count"))
        wanted, bad = (n if n >= 0 else count + n + 1 for n in (wanted, bad))
        for place, child in enumerate(self.children):
            if place not in self.done:
                status = self.run(child)
                if status != RUNNING:
                    self.done[place] = status
            ended = list(self.done.values())
            if ended.count(FAILURE) >= bad:
                return FAILURE
            if ended.count(SUCCESS) >= wanted:
                return SUCCESS
        return RUNNING


class Watched(Node):
    """A named node with its post scripts, and with the end of its task told."""

    def __init__(self, world: World, xml: ElementTree.Element, below: list[Behaviour], tells: bool) -> None:
        super().__init__(world, xml, below)
        self.tells = tells

    def _over(self, outcome: str, script: str) -> None:
        if self.tells:
            self.world.events.append((self.world.t, "end", self.xml.get("name"), outcome))
        if self.xml.get(script):
            run_script(self.xml.get(script), self.world.board)

    def update(self) -> Status:
        status = self.run(self.children[0])
        if status == SUCCESS:
            self._over("SUCCEEDED", "_onSuccess")
        elif status == FAILURE:
            self._over("FAILED", "_onFailure")
        return status

    def terminate(self, new_status: Status) -> None:
        super().terminate(new_status)
        if new_status == INVALID and self.status == RUNNING:
            if self.tells:  # one that waited has no end to tell
                self.tells = self.world.attempts.get(self.xml.get("name"), 0) > 0
            self._over("ABORTED", "_onHalted")


KINDS = {
    "IfThenElse": IfThenElse,
    "ReactiveSequence": ReactiveSequence,
    "Parallel": Parallel,
    "ForceSuccess": ForceSuccess,
    "RetryUntilSuccessful": Retry,
    "Timeout": Timeout,
    "Delay": Later,
    "Sleep": Later,
    "Precondition": Precondition,
    "Condition": Condition,
}


OWN = {"WaitWindow": WaitWindow, "Deadline": Deadline, "Using": Using}


def build(world: World, xml: ElementTree.Element, tasks: set[str], above: str = "") -> Behaviour:
    """Return the py_trees behaviour of an element."""
    name = xml.get("name", "")
    below = [build(world, child, tasks, name or above) for child in xml if isinstance(child.tag, str)]
    made: Behaviour
    if xml.tag in ("Sequence", "Fallback"):
        kind = Sequence if xml.tag == "Sequence" else Selector
        made = kind(name=name or xml.tag, memory=True, children=below)
    elif xml.get("ID") in OWN:
        made = OWN[xml.get("ID")](world, xml, below)
    elif xml.tag == "Action":
        made = Action(world, xml, below)
    else:
        made = KINDS.get(xml.tag, Leaf)(world, xml, below)
    if name and name != above:
        return Watched(world, xml, [made], name in tasks)
    return made


def everything(node: Behaviour) -> list[Behaviour]:
    return [node, *(n for child in node.children for n in everything(child))]


def run_tree(xml: str, scenario: Scenario) -> tuple[str | None, int | None, list[tuple]]:
    """Return the outcome of a tree, when it was over, and the starts, retries and ends of its commands."""
    world = World(scenario)
    root = ElementTree.fromstring(xml)
    tree = next(t for t in root.findall("BehaviorTree") if t.get("ID") == root.get("main_tree_to_execute"))
    tasks = {x.get("name") for x in tree.iter("Action") if x.get("name")}
    top = build(world, next(x for x in tree if isinstance(x.tag, str)), tasks)
    nodes = everything(top)
    instants = [
        float(n) * 1000
        for n in re.findall(r":time [<>=/]+ ([-+.\deE]+)", xml.replace("&lt;", "<").replace("&gt;", ">"))
    ]
    clock_wakes = [w for i in instants if abs(i) < 1e15 for w in (round(i), round(i) + 1)]

    def settle() -> None:
        world.board["t_ms"] = float(world.t)
        before = None
        while top.status in (RUNNING, INVALID):
            world.asking = []
            top.tick_once()
            asking = [u for u in world.asking if u.status == RUNNING and not u.granted and u.free()]
            if asking:
                first = min(asking, key=lambda u: (float(u.xml.get("priority")), u.since, nodes.index(u)))
                first.granted = True
                first.hold(1)
                continue
            now = ([n.status for n in nodes], dict(world.board))
            if now == before or world.deadline:
                return
            before = now

    world.take(0)
    for _ in range(100_000):
        if world.halted:
            top.stop(INVALID)
            return "ABORTED", world.t, world.events
        settle()
        if top.status != RUNNING:
            return {SUCCESS: "SUCCEEDED", FAILURE: "FAILED"}[top.status], world.t, world.events
        if world.take(world.t):
            continue
        world.deadline, world.expired = True, False
        settle()
        world.deadline = False
        if world.expired:
            continue
        wakes = [w for n in nodes if n.status == RUNNING and isinstance(n, Node) for w in n.wakes()]
        later = [w for w in (*wakes, *clock_wakes) if w > world.t]
        until = min(later, default=None)
        if not world.take(until):
            if until is None:
                return None, None, world.events
            world.t = until
    raise AssertionError("the tree does not end")
