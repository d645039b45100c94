"""An interpreter of CRL written from the specification alone: sections 3 to 8.

It shares with the engine the nodes of the language and the validator, nothing else. At every instant of a
fixed grid it looks at everything, in the order of the rules; it is slow and meant to be read beside CRL.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from executive.crl import Plan, check
from executive.crl import values as v
from executive.crl.nodes import Block, Branch, ConcurrentBlock, Node, Option, Task, children, end_temporals
from executive.crl.printer import canonical_node
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    Event,
    Operation,
    Operator,
    Result,
    Update,
    Value,
)
from executive.runtime.scripted_rover import ScriptedRover

INFINITY = 10**15
STARTED = ("EXECUTING", "ENDING", "SUSPENDING", "SUSPENDED")
HOLDING = ("EXECUTING", "ENDING", "SUSPENDING", "FAILING")


class N:
    """One copy of a node in a run."""

    def __init__(self, spec: Node, parent: N | None, order: int) -> None:
        self.spec, self.parent, self.order = spec, parent, order
        self.kids: list[N] = []
        self.guests: list[N] = []
        """Inserted trees, and nodes of a replaced plan that are still being stopped."""
        self.state, self.outcome, self.reason = "INACTIVE", "", ""
        self.activation = 0
        self.start: int | None = None
        self.end: int | None = None
        self.final = ("", "")
        self.chosen: Option | None = None
        self.tried: set[str] = set()
        self.command: CommandId | None = None
        self.abort_asked = False
        self.result: bool | None = None
        self.issues = self.failures = 0
        self.retry_at: int | None = None
        self.uses: dict[str, float] = {}

    @property
    def id(self) -> str:
        return self.spec.id

    def walk(self) -> Iterator[N]:
        yield self
        for kid in self.kids + self.guests:
            yield from kid.walk()

    def up(self) -> Iterator[N]:
        at: N | None = self
        while at is not None:
            yield at
            at = at.parent

    def top(self) -> N:
        return list(self.up())[-1]

    def fatal(self) -> bool:
        return self.outcome == "FAILED" and not self.spec.continue_on_failure

    def kid_of(self, option: Option | None) -> N | None:
        return next((k for k in self.kids if option is not None and k.id == option.node.id), None)


class Floating:
    def __init__(self, spec: object) -> None:
        self.spec = spec
        self.armed, self.count = True, 0


class Model:
    """One run against a scripted rover."""

    def __init__(self, plan: Plan, rover: ScriptedRover) -> None:
        self.rover = rover
        self.t = 0
        self.db: dict[str, Value] = {"time": 0.0}
        self.trace: list[tuple[int, tuple[str, ...]]] = []
        self.latest: dict[str, N] = {}
        self.old: list[N] = []
        self.orders = 0
        self.paused = self.aborted = self.over = False
        self.issued: dict[str, int] = {}
        self.plan = plan
        self.main = self.root = self.plant(plan.node, None)
        self.alternate = ""
        self.used: set[str] = set()
        self.floating = [Floating(c) for c in plan.floating]
        self.pending: tuple[Floating, N] | None = None
        self.active: tuple[Floating, N, N] | None = None

    # --- helpers ------------------------------------------------------------------

    def say(self, *words: str) -> None:
        self.trace.append((self.t, words))

    def plant(self, spec: Node, parent: N | None) -> N:
        node = self.fresh(spec, parent)
        node.kids = [self.plant(child, node) for child in children(spec)]
        return node

    def fresh(self, spec: Node, parent: N | None) -> N:
        self.orders += 1
        node = N(spec, parent, self.orders)
        for key in [k for k in self.db if k.split(" ")[0] in ("outcome", "reason", "result")]:
            if key.split(" ")[1] == spec.id:
                del self.db[key]
        self.db[f"attempts {spec.id}"] = 0
        self.latest[spec.id] = node
        return node

    def everyone(self) -> list[N]:
        found = {n: None for top in (*self.old, self.root) for n in top.walk()}
        return sorted(found, key=lambda n: n.order)

    def stopping(self) -> bool:
        return any(n.state != "FINISHED" for top in self.old for n in top.walk())

    def ask(self, conditions: Sequence[v.Condition]) -> bool | None:
        answers = [self.truth(c) for c in conditions]
        return False if False in answers else None if None in answers else True

    def truth(self, c: v.Condition) -> bool | None:
        if isinstance(c, v.And):
            return self.ask(c.parts)
        if isinstance(c, v.Or):
            answers = [self.truth(p) for p in c.parts]
            return True if True in answers else None if None in answers else False
        if isinstance(c, v.Not):
            answer = self.truth(c.part)
            return None if answer is None else not answer
        words = [a if isinstance(a, str) else f"{a:g}" for a in c.arguments]
        value = self.db.get(" ".join([c.key, *words]))
        if isinstance(c, v.Known):
            return value is not None
        if value is None:
            return None
        numbers = not isinstance(value, (str, bool)) and not isinstance(c.value, (str, bool))
        if c.operator in (v.Operator.EQ, v.Operator.NE):
            if not numbers and type(value) is not type(c.value):
                return None
            return (value == c.value) == (c.operator is v.Operator.EQ)
        if not numbers:
            return None
        a, b = float(value), float(c.value)
        return {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}[c.operator.value]

    def window(self, temporals: Sequence[v.Temporal], origin: int) -> tuple[int, int, bool]:
        """Own window (8.2), and whether a point with a lower bound >= 0 is awaited."""
        lo, hi, awaited = 0, INFINITY, False
        for temporal in temporals:
            base: int | None = 0
            if isinstance(temporal, v.Relative):
                base = origin
            elif isinstance(temporal, v.Reference):
                other = self.latest.get(temporal.node)
                base = None if other is None else other.start if temporal.point == "start" else other.end
                if base is None:
                    void = other is not None and other.state == "FINISHED" and other.start is None
                    low = temporal.interval.lo_ms
                    awaited |= not void and low is not None and low >= 0
                    continue
            if temporal.interval.lo_ms is not None:
                lo = max(lo, base + temporal.interval.lo_ms)
            if temporal.interval.hi_ms is not None:
                hi = min(hi, base + temporal.interval.hi_ms)
        return lo, hi, awaited

    def start_window(self, n: N) -> tuple[int, int, bool]:
        return self.window(n.spec.start_temporal_conditions, n.activation)

    def end_window(self, n: N) -> tuple[int, int, bool]:
        return self.window(end_temporals(n.spec), n.start or 0)

    # --- the network of section 8 -----------------------------------------------------

    def live(self) -> list[N]:
        """Nodes with points: not void, and not below an option that is not chosen (8.1)."""
        found: list[N] = []
        tops = [self.root, *(n for n in self.old if n.parent is None)]
        stack = list(reversed(tops))
        while stack:
            n = stack.pop()
            if n.state == "FINISHED" and n.start is None:
                continue
            found.append(n)
            kids = n.kids
            if isinstance(n.spec, Branch):
                kids = [k for k in kids if k is n.kid_of(n.chosen) or k.state != "INACTIVE"]
            stack.extend(reversed(kids + n.guests))
        return found

    def constraints(self) -> Iterator[tuple[object, object, float, float]]:
        """All `lo <= to - from <= hi` of 8.1; a point is (node, name), an executed one its time, Z is 0."""
        nodes = self.live()
        for n in nodes:
            yield 0, self.at(n, "start"), 0, INFINITY
            yield self.at(n, "start"), self.at(n, "end"), 0, INFINITY
            if n.parent is not None:
                yield self.at(n.parent, "start"), self.at(n, "start"), 0, INFINITY
                yield self.at(n, "end"), self.at(n.parent, "end"), 0, INFINITY
            before = self.before(n)
            if before is not None and before in nodes:
                yield self.at(before, "end"), self.at(n, "start"), 0, INFINITY
            for point, temporals in (
                ("start", n.spec.start_temporal_conditions),
                ("end", end_temporals(n.spec)),
            ):
                for temporal in temporals:
                    origin = self.origin(n, point, temporal, nodes)
                    if origin is not None:
                        lo, hi = temporal.interval.lo_ms, temporal.interval.hi_ms
                        low = -INFINITY if lo is None else lo
                        yield origin, self.at(n, point), low, INFINITY if hi is None else hi

    def at(self, n: N, point: str) -> object:
        time = n.start if point == "start" else n.end
        return (n, point) if time is None else time

    def before(self, n: N) -> N | None:
        """The previous sibling in a block."""
        if n.parent is None or not isinstance(n.parent.spec, Block) or n not in n.parent.kids:
            return None
        place = n.parent.kids.index(n)
        return n.parent.kids[place - 1] if place else None

    def origin(self, n: N, point: str, temporal: v.Temporal, nodes: list[N]) -> object:
        """From where a condition counts; None if that is void or not there."""
        if isinstance(temporal, v.Absolute):
            return 0
        if isinstance(temporal, v.Reference):
            other = self.latest.get(temporal.node)
            if other is not None and other.top() is not n.top():  # of a tree that has been replaced
                own = (m for m in reversed(nodes) if m.spec.id == temporal.node and m.top() is n.top())
                other = next(own, None)
            return self.at(other, temporal.point.value) if other is not None and other in nodes else None
        if point == "end":
            return self.at(n, "start")
        if n.state != "INACTIVE":
            return n.activation
        before = self.before(n)
        if before is not None:
            return self.at(before, "end") if before in nodes else None
        return self.at(n.parent, "start") if n.parent is not None else 0

    def bound(self, n: N) -> float:
        """Dispatch bound of a start (8.3): its lower bound in the network, 0 if that is inconsistent."""
        edges: list[tuple[object, object, float]] = []
        for a, b, lo, hi in self.constraints():
            if isinstance(a, int) and isinstance(b, int):
                continue
            if lo > -INFINITY:
                edges.append((a, b, lo))
            if hi < INFINITY:
                edges.append((b, a, -hi))
        fixed = {p: float(p) for edge in edges for p in edge[:2] if isinstance(p, int)}
        points = {p for edge in edges for p in edge[:2] if not isinstance(p, int)}
        earliest: dict[object, float] = fixed | dict.fromkeys(points, float(self.t))
        for _ in range(len(points) + 1):
            changed = False
            for a, b, gap in edges:
                if earliest[a] + gap > earliest[b]:
                    if isinstance(b, int):
                        return 0
                    earliest[b] = earliest[a] + gap
                    changed = True
            if not changed:
                return earliest.get((n, "start"), 0)
        return 0

    # --- resources ------------------------------------------------------------------

    def asked(self, n: N) -> dict[str, float]:
        total: dict[str, float] = {}
        for amount in n.spec.uses:
            total[amount.resource] = total.get(amount.resource, 0) + amount.amount
        return total

    def can_take(self, n: N) -> bool:
        capacity = {r.name: getattr(r, "capacity", 1) for r in self.plan.resources}
        for name, amount in self.asked(n).items():
            taken = sum(m.uses.get(name, 0) for m in self.everyone())
            if taken + amount > capacity.get(name, 1) + 1e-9:
                return False
        return True

    def met(self, requires: Sequence[v.Amount], asking: N | None) -> bool:
        exempt = set(asking.up()) if asking is not None else set()
        for amount in requires:
            resource = next((r for r in self.plan.resources if r.name == amount.resource), None)
            level = self.db.get(resource.key) if isinstance(resource, v.ConsumableResource) else None
            if level is None or isinstance(level, (str, bool)):
                return False
            others = sum(
                a.amount
                for n in self.everyone()
                if n.state in HOLDING and n not in exempt
                for a in n.spec.requires
                if a.resource == amount.resource
            )
            total = sum(a.amount for a in requires if a.resource == amount.resource)
            if level - resource.floor - others < total:
                return False
        return True

    # --- entries to states ------------------------------------------------------------

    def activate(self, n: N) -> None:
        if n.state == "INACTIVE":
            n.state, n.activation = "WAITING", self.t

    def finish(self, n: N, outcome: str, reason: str = "") -> None:
        n.end = self.t if n.start is not None else None
        self.say("end", n.id, outcome, *([reason] if outcome != "SUCCEEDED" else []))
        for kid in n.kids:
            self.skip(kid, "parent-ended")
        self.over_with(n, outcome, reason)

    def over_with(self, n: N, outcome: str, reason: str) -> None:
        n.state, n.outcome, n.reason, n.uses = "FINISHED", outcome, reason, {}
        if self.latest.get(n.id) is n:
            self.db[f"outcome {n.id}"] = outcome.lower()
            if reason:
                self.db[f"reason {n.id}"] = reason

    def skip(self, top: N, reason: str) -> None:
        for n in top.walk():
            if n.state in ("INACTIVE", "WAITING"):
                self.over_with(n, "SKIPPED", reason)

    def terminate(self, n: N, outcome: str, reason: str) -> None:
        """Rows 11 to 14 and section 4.7."""
        n.state, n.final, n.retry_at = "FAILING", (outcome, reason), None
        self.ask_abort(n)
        for kid in n.kids + n.guests:
            if kid.state in ("INACTIVE", "WAITING"):
                self.skip(kid, "parent-ended")
            elif kid.state in STARTED:
                self.terminate(kid, "ABORTED", "parent-failed")

    def ask_abort(self, n: N) -> None:
        if n.command is not None and not n.abort_asked:
            n.abort_asked = True
            self.rover.abort(n.command)

    def issue(self, n: N) -> None:
        assert isinstance(n.spec, Task)
        n.issues += 1
        self.issued[n.id] = self.issued.get(n.id, 0) + 1
        n.command = CommandId("run", n.id, self.issued[n.id])
        n.abort_asked, n.result, n.retry_at = False, None, None
        if self.latest.get(n.id) is n:
            self.db[f"attempts {n.id}"] = n.issues
        self.rover.send(Command(n.command, n.spec.action, n.spec.parameters, {}, n.issues))

    # --- phase E ------------------------------------------------------------------------

    def transition(self, n: N) -> bool:
        if n.state == "FAILING":  # 15
            if n.command is None and all(k.state == "FINISHED" for k in n.kids + n.guests):
                self.finish(n, *n.final)
                return True
            return False
        if n.state == "SUSPENDING" and n.command is None:  # 17
            self.suspended(n)
            return True
        if n.state not in ("EXECUTING", "ENDING"):
            return False
        if self.ask(n.spec.maintain_conditions) is False:  # 11
            self.terminate(n, "FAILED", "maintain-violated")
            return True
        if n.state == "EXECUTING" and self.progress(n):
            return True
        return n.state in ("EXECUTING", "ENDING") and self.complete(n) and self.close(n)

    def progress(self, n: N) -> bool:
        """Rows 6, 7, 16, 12 and 1."""
        if isinstance(n.spec, Task):
            if n.result is False:
                if n.failures >= n.spec.retries:
                    self.finish(n, "FAILED", "action-failed")
                else:
                    n.failures += 1
                    n.result, n.retry_at = None, self.t + n.spec.retry_delay_ms
                return True
            if n.retry_at is not None and n.retry_at <= self.t and not self.paused and not self.held(n):
                self.say("retry", n.id)
                self.issue(n)
                return True
            return False
        if isinstance(n.spec, Branch):
            return self.decide(n, n.spec)
        if any(k.fatal() for k in n.kids):
            self.terminate(n, "FAILED", "child-failed")
            return True
        following = next((k for k in n.kids if k.state != "FINISHED"), None)
        if isinstance(n.spec, Block) and following is not None and following.state == "INACTIVE":
            self.activate(following)
            return True
        return False

    def decide(self, n: N, spec: Branch) -> bool:
        if n.chosen is None:
            if self.choose(n, spec):
                return True
            if spec.if_none is v.IfNone.WAIT or self.awaits_others(n):
                return False
            outcome = "SKIPPED" if spec.if_none is v.IfNone.SKIP else "FAILED"
            self.finish(n, outcome, "no-eligible-option")
            return True
        kid = n.kid_of(n.chosen)
        if kid is not None and kid.fatal():
            following = spec.on_option_failure is v.OnOptionFailure.NEXT
            if not (following and self.choose(n, spec)):
                self.terminate(n, "FAILED", "child-failed")
            return True
        return False

    def choose(self, n: N, spec: Branch) -> bool:
        best: tuple[float, Option] | None = None
        for option in spec.options:
            if option.id in n.tried or self.ask(option.eligible_conditions) is not True:
                continue
            if not self.met(option.requires, n):
                continue
            utility = v.utility_at(option.utility, self.t)
            if best is None or utility > best[0]:
                best = (utility, option)
        if best is None:
            return False
        n.chosen = best[1]
        n.tried.add(n.chosen.id)
        self.say("choose", n.id, n.chosen.id)
        for kid in n.kids:
            if kid is n.kid_of(n.chosen):
                self.activate(kid)
            elif spec.on_option_failure is not v.OnOptionFailure.NEXT:
                self.skip(kid, "not-chosen")
        return True

    def complete(self, n: N) -> bool:
        return self.content_complete(n) and not self.awaits_others(n)

    def awaits_others(self, n: N) -> bool:
        """Whether a guest, or what runs below an option that is not the choice, is not over (7.1, 7.4)."""
        if any(g.state != "FINISHED" or g is self.inserted() for g in n.guests):
            return True
        aside = [k for k in n.kids if isinstance(n.spec, Branch) and k is not n.kid_of(n.chosen)]
        return any(k.state not in ("INACTIVE", "WAITING", "FINISHED") for k in aside)

    def content_complete(self, n: N) -> bool:
        """Section 4.6, of what the text gives the node."""
        if isinstance(n.spec, Task):
            return n.result is True
        if isinstance(n.spec, Branch):
            kid = n.kid_of(n.chosen)
            return kid is not None and kid.state == "FINISHED" and not kid.fatal()
        return all(k.state == "FINISHED" and not k.fatal() for k in n.kids)

    def close(self, n: N) -> bool:
        lo, hi, awaited = self.end_window(n)
        if self.t < lo or awaited:  # 8
            changed = n.state == "EXECUTING"
            n.state = "ENDING"
            return changed
        if self.ask(n.spec.end_conditions) is not True:  # 10
            self.finish(n, "FAILED", "end-condition")
        elif self.t > hi:
            self.finish(n, "FAILED", "end-window-missed")
        else:  # 9
            self.finish(n, "SUCCEEDED")
        return True

    def suspended(self, n: N) -> None:
        n.state, n.result, n.retry_at, n.uses = "SUSPENDED", None, None, {}
        self.say("suspend", n.id)

    # --- phases F, S, D -------------------------------------------------------------------

    def inserted(self) -> N | None:
        return self.active[2] if self.active is not None else None

    def held(self, n: N) -> bool:
        scope = self.pending[1] if self.pending else self.active[1] if self.active else None
        return scope is not None and scope in n.up() and self.inserted() not in n.up()

    def crossed(self, n: N) -> bool:
        """Whether something runs below another option of a branch by whose choice the node is there (7.4)."""
        for k in n.up():
            branch = k.parent
            if branch is None or branch.chosen is None or k is not branch.kid_of(branch.chosen):
                continue
            others = [o.state for o in branch.kids if o is not k]
            if any(state not in ("INACTIVE", "WAITING", "FINISHED") for state in others):
                return True
        return False

    def phase_f(self) -> bool:
        if not self.stopping():
            if self.root.state == "FINISHED":
                return self.next_alternate()
            if self.root.state == "INACTIVE":
                self.activate(self.root)
                return True
        if self.active is not None:
            floating, scope, root = self.active
            if root.state != "FINISHED":
                return False
            self.active = None
            scope.guests.remove(root)
            if root.outcome == "FAILED" and not floating.spec.continue_on_failure and scope.state in STARTED:
                self.terminate(scope, "FAILED", "contingency-failed")
            return True
        if self.pending is not None:
            floating, scope = self.pending
            if scope.state in ("FAILING", "FINISHED"):
                self.pending = None
                return True
            if any(
                isinstance(n.spec, Task) and n.state in ("EXECUTING", "SUSPENDING", "FAILING")
                for n in scope.walk()
            ):
                return False
            floating.count += 1
            self.say("insert", floating.spec.id)
            root = self.plant(floating.spec.node, scope)
            scope.guests.append(root)
            self.pending, self.active = None, (floating, scope, root)
            self.activate(root)
            return True
        return self.trigger()

    def trigger(self) -> bool:
        best: tuple[float, Floating, N] | None = None
        for floating in self.floating:
            spec = floating.spec
            if self.ask(spec.trigger_conditions) is not True:
                floating.armed = True
                continue
            scope = self.latest.get(spec.scope or self.plan.node.id)
            if self.paused or not floating.armed or floating.count >= spec.max_insertions:
                continue
            if scope is None or scope.state != "EXECUTING":
                continue
            utility = v.utility_at(spec.utility, self.t)
            if best is None or utility > best[0]:
                best = (utility, floating, scope)
        if best is None:
            return False
        _, floating, scope = best
        floating.armed, self.pending = False, (floating, scope)
        self.say("trigger", floating.spec.id)
        if floating.spec.mode is v.Mode.INTERRUPT:
            for n in sorted(scope.walk(), key=lambda n: n.order):
                if isinstance(n.spec, Task) and n.state == "EXECUTING" and n.spec.interruptible:
                    n.state = "SUSPENDING"
                    self.ask_abort(n)
                    if n.command is None:
                        self.suspended(n)
        return True

    def next_alternate(self) -> bool:
        best = None
        if self.root.outcome == "FAILED" and not self.aborted:
            for a in self.plan.library:
                if a.id in self.used or self.ask(a.eligible_conditions) is not True:
                    continue
                utility = v.utility_at(a.utility, self.t)
                if self.met(a.requires, None) and (best is None or utility > best[0]):
                    best = (utility, a)
        if best is None:
            self.over = True
            return False
        self.alternate = best[1].id
        self.used.add(self.alternate)
        self.say("alternate", self.alternate)
        self.pending = self.active = None
        self.root = self.plant(best[1].node, None)
        self.activate(self.root)
        return True

    def phase_s(self) -> bool:
        if self.paused or self.stopping():
            return False
        waiting = [n for n in self.everyone() if n.state in ("WAITING", "SUSPENDED")]
        ready = [n for n in waiting if not self.held(n) and not self.crossed(n)]
        for n in sorted(ready, key=lambda n: (n.spec.priority, n.activation, n.order)):
            if n.state == "SUSPENDED":
                if not self.can_take(n):
                    continue
                if self.ask(n.spec.maintain_conditions) is False:
                    self.terminate(n, "FAILED", "maintain-violated")
                    return True
                n.state, n.uses = "EXECUTING", self.asked(n)
                self.say("resume", n.id)
                self.issue(n)
                return True
            lo, hi, awaited = self.start_window(n)
            if awaited or not lo <= self.t <= hi or self.ask(n.spec.wait_for_conditions) is not True:
                continue
            if self.bound(n) > self.t:
                continue
            if not self.can_take(n):
                continue
            if self.ask(n.spec.start_conditions) is not True:
                self.finish(n, "FAILED", "start-condition")
            elif not self.met(n.spec.requires, n):
                self.finish(n, "FAILED", "resource")
            elif self.ask(n.spec.maintain_conditions) is False:
                self.finish(n, "FAILED", "maintain-violated")
            else:
                self.begin(n)
            return True
        return False

    def begin(self, n: N) -> None:
        n.state, n.start, n.uses = "EXECUTING", self.t, self.asked(n)
        self.say("start", n.id)
        if isinstance(n.spec, Task):
            self.issue(n)
        elif isinstance(n.spec, ConcurrentBlock):
            for kid in n.kids:
                self.activate(kid)

    def deadline(self) -> bool:
        for n in self.everyone():
            if n.state == "WAITING" and self.t >= self.start_window(n)[1]:
                self.finish(n, "FAILED", "start-window-missed")
                return True
            if n.state in STARTED and self.t >= self.end_window(n)[1]:
                self.terminate(n, "FAILED", "end-window-missed")
                return True
        return False

    # --- macro steps ------------------------------------------------------------------------

    def run(self, horizon_ms: int, grid_ms: int = 500) -> None:
        """Run to the horizon; everything must happen on the grid or one millisecond after."""
        instants = sorted({t + d for t in range(0, horizon_ms + 1, grid_ms) for d in (0, 1)})
        for t in instants:
            first = True
            while not self.over:
                events = self.collect(t)
                if not events and not first:
                    if not self.deadline():
                        break
                    self.quiesce()
                    continue
                self.t, self.db["time"] = t, t / 1000
                if first and t == 0:
                    self.activate(self.root)
                first = False
                self.ingest(events)
                self.quiesce()

    def collect(self, t: int) -> list[Event]:
        events: list[Event] = []
        event = self.rover.next_event(t)
        while event is not None:
            events.append(event)
            event = self.rover.next_event(event.t_ms)
        return events

    def ingest(self, events: Sequence[Event]) -> None:
        for event in events:
            if isinstance(event, Update):
                self.db.update(event.values)
            elif isinstance(event, Result | Acknowledgement):
                self.db.update(event.updates)
                n = next((n for n in self.everyone() if n.command == event.command), None)
                if n is not None:
                    n.command, n.abort_asked = None, False
                    if isinstance(event, Result) and n.state == "EXECUTING":
                        n.result = event.success
        for event in events:
            if isinstance(event, Operator) and not self.over:
                self.operate(event)

    def operate(self, event: Operator) -> None:
        match event.operation:
            case Operation.PAUSE:
                self.say("pause")
                self.paused = True
            case Operation.RESUME:
                self.say("resume-plan")
                self.paused = False
            case Operation.ABORT:
                self.say("abort")
                self.aborted = True
                if self.root.state in STARTED:
                    self.terminate(self.root, "ABORTED", "operator")
                elif self.root.state in ("INACTIVE", "WAITING"):
                    self.finish(self.root, "ABORTED", "operator")
            case Operation.REPLACE:
                self.replace(event.plan_text or "")

    def quiesce(self) -> None:
        while True:
            while any(self.transition(n) for n in self.everyone()):
                pass
            if self.phase_f():
                continue
            if self.over or not self.phase_s():
                return

    # --- section 7.4 --------------------------------------------------------------------------

    def replace(self, text: str) -> None:
        report = check(text)
        if report.plan is None or not report.valid or self.active is not None:
            return
        plan = report.plan
        before = {n.id: n for n in self.text_tree(self.main)}
        keeping: dict[str, N] = {}
        self.collect_kept(plan.node, None, before, keeping)
        if not self.alternate and self.out_of_order(plan.node, keeping):
            return
        self.say("replace")
        if self.alternate and self.root.state != "FINISHED":
            self.used.discard(self.alternate)
        gone = [n for top in (self.main, self.root) for n in top.walk() if n not in keeping.values()]
        tops = [n for n in gone if n.parent is None or n.parent not in gone]
        self.alternate, self.pending, self.plan = "", None, plan
        former = {f.spec.id: f for f in self.floating}
        self.floating = [Floating(c) for c in plan.floating]
        for f in self.floating:
            if f.spec.id in former:
                f.armed, f.count = former[f.spec.id].armed, former[f.spec.id].count
        for n in gone:
            n.kids = [k for k in n.kids if k in gone]
        self.main = self.root = self.rebuild(plan.node, None, keeping)
        for n in gone:
            if n.state in ("INACTIVE", "WAITING"):
                self.over_with(n, "SKIPPED", "replaced")
            elif n.state in STARTED:
                n.state, n.final, n.retry_at = "FAILING", ("ABORTED", "replaced"), None
                self.ask_abort(n)
        for n in tops:
            if n.state != "FINISHED":
                self.old.append(n)
                if n.parent is not None and n not in n.parent.guests:
                    n.parent.guests.append(n)
        self.open(self.root)

    def text_tree(self, top: N) -> Iterator[N]:
        yield top
        for kid in top.kids:
            yield from self.text_tree(kid)

    def collect_kept(self, spec: Node, above: N | None, before: dict[str, N], keeping: dict[str, N]) -> None:
        old = before.get(spec.id)
        if old is not None and not self.may_be_kept(spec, old):
            old = None
        closed = above is not None and above.state in ("FINISHED", "FAILING")
        if old is not None and closed and old.state != "FINISHED" and old.parent is not above:
            old = None
        if old is not None:
            keeping[spec.id] = old
        for child in children(spec):
            self.collect_kept(child, old, before, keeping)

    def may_be_kept(self, spec: Node, old: N) -> bool:
        if type(spec) is not type(old.spec):
            return False
        if not isinstance(spec, Task):
            return old.start is not None and not self.alternate
        if self.alternate and old.outcome != "SUCCEEDED":
            return False
        if old.state not in ("FINISHED", "ENDING", "EXECUTING") or old.outcome == "SKIPPED":
            return False
        return canonical_node(spec) == canonical_node(old.spec)

    def out_of_order(self, spec: Node, keeping: dict[str, N]) -> bool:
        below = [n for child in children(spec) for n in self.ids_below(child)]
        if spec.id not in keeping and any(n in keeping for n in below):
            return True
        waits = False
        for child in children(spec):
            if waits and isinstance(spec, Block) and any(n in keeping for n in self.ids_below(child)):
                return True
            waits |= child.id not in keeping
            if self.out_of_order(child, keeping):
                return True
        return False

    def ids_below(self, spec: Node) -> list[str]:
        return [spec.id, *(n for child in children(spec) for n in self.ids_below(child))]

    def rebuild(self, spec: Node, parent: N | None, keeping: dict[str, N]) -> N:
        node = keeping.get(spec.id)
        if node is None:
            node = self.fresh(spec, parent)
        else:
            self.orders += 1
            node.spec, node.parent, node.order = spec, parent, self.orders
            if isinstance(spec, Branch) and node.chosen is not None:
                node.chosen = next((o for o in spec.options if o.id == node.chosen.id), None)
        node.kids = [self.rebuild(child, node, keeping) for child in children(spec)]
        return node

    def open(self, n: N) -> None:
        if n.state in ("FINISHED", "FAILING"):
            for kid in n.kids:
                self.skip(kid, "parent-ended")
        elif n.state in STARTED:
            if n.state == "ENDING" and not self.content_complete(n):
                n.state = "EXECUTING"
            if isinstance(n.spec, ConcurrentBlock):
                for kid in n.kids:
                    self.activate(kid)
            elif isinstance(n.spec, Branch) and n.chosen is not None:
                for kid in n.kids:
                    if kid is n.kid_of(n.chosen):
                        self.activate(kid)
                    elif n.spec.on_option_failure is not v.OnOptionFailure.NEXT:
                        self.skip(kid, "not-chosen")
        for kid in n.kids:
            self.open(kid)
