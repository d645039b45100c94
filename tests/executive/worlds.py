"""Random plans with random worlds: small, and full of every feature of the language."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from executive.ports import Event, Operation, Operator, Update, Value
from executive.runtime.scripted_rover import Behaviour

KEYS = ("k0", "k1", "k2")
RESOURCES = "((arm :unit) (power :capacity 10) (energy :consumable :key :battery :floor 5))"


@dataclass
class Case:
    """A plan and the world in which it runs."""

    plan: str
    initial: dict[str, Value]
    actions: dict[str, tuple[Behaviour, ...]]
    script: tuple[Event, ...]
    tasks: list[str] = field(default_factory=list)


class Maker:
    """Draws one case."""

    def __init__(self, rng: random.Random, *, size: int = 12, temporal: bool = True) -> None:
        self.rng = rng
        self.left = size
        self.temporal = temporal
        self.count = 0
        self.tasks: list[str] = []
        self.ids: list[str] = []
        self.used: set[str] = set()

    def chance(self, p: float) -> bool:
        return self.rng.random() < p

    def half(self, hi: float) -> float:
        """Return a time on a grid of half seconds."""
        return self.rng.randint(0, int(hi * 2)) / 2

    def name(self, prefix: str) -> str:
        self.count += 1
        return f"{prefix}{self.count}"

    def condition(self, depth: int = 0) -> str:
        kind = self.rng.choice(["cmp", "cmp", "cmp", "known", "and", "or", "not", "time", "outcome"])
        if depth > 1 and kind in ("and", "or", "not"):
            kind = "cmp"
        match kind:
            case "known":
                return f"(known (:{self.rng.choice(KEYS)}))"
            case "and" | "or":
                parts = " ".join(self.condition(depth + 1) for _ in range(2))
                return f"({kind} {parts})"
            case "not":
                return f"(not {self.condition(depth + 1)})"
            case "time":
                return f"(database (:time {self.rng.choice(['<', '>=', '>', '<='])} {self.half(40)}))"
            case "outcome" if self.ids:
                wanted = self.rng.choice(["succeeded", "failed", "skipped"])
                return f"(database (:outcome {self.rng.choice(self.ids)} = {wanted}))"
        operator = self.rng.choice(["=", "/=", "<", ">=", "<=", ">"])
        return f"(database (:{self.rng.choice(KEYS)} {operator} {self.rng.randint(0, 4)}))"

    def interval(self, lo: float, width: float) -> str:
        a = self.half(lo)
        return f"({a} {a + self.half(width)})" if self.chance(0.8) else f"({a} :plus-infinity)"

    def common(self, kind: str, siblings: list[str], *, inside: bool) -> str:
        out = ""
        if self.chance(0.15):
            out += f" :wait-for-conditions ({self.condition()})"
            if self.chance(0.9):
                out += f" :start-temporal-conditions ((:relative (0 {self.half(15) + 1})))"
        elif self.temporal and self.chance(0.25):
            windows = []
            if siblings and self.chance(0.6):
                point = self.rng.choice(["start", "end"])
                lo = self.half(10) - (4 if self.chance(0.3) else 0)
                windows.append(f"({self.rng.choice(siblings)} {point} ({lo} {lo + self.half(15)}))")
            if not windows or self.chance(0.3):
                windows.append(self.interval(20, 30))
            out += f" :start-temporal-conditions ({' '.join(windows)})"
        if self.chance(0.1):
            out += f" :start-conditions ({self.condition()})"
        if self.chance(0.1):
            out += f" :maintain-conditions ({self.condition()})"
        if self.chance(0.05):
            out += f" :end-conditions ({self.condition()})"
        if self.temporal and self.chance(0.15):
            out += f" :end-temporal-conditions ({self.interval(30, 40)})"
        if self.chance(0.25):
            lo = self.half(4)
            out += f" :duration ({lo} {lo + self.half(20)})"
        if self.chance(0.5):
            out += " :continue-on-failure t"
        if kind == "task" and not inside and self.chance(0.4):
            out += (
                " :uses ("
                + self.rng.choice(["arm", f"(power {self.rng.randint(1, 10)})", "arm (power 4)"])
                + ")"
            )
        if self.chance(0.15):
            out += f" :requires ((energy {self.rng.randint(0, 40)}))"
        if self.chance(0.2):
            out += f" :priority {self.rng.randint(1, 99)}"
        return out

    def node(self, depth: int, siblings: list[str]) -> str:
        self.left -= 1
        kind = "task"
        if self.left > 0 and depth < 5:
            kind = self.rng.choice(["task", "task", "block", "concurrent-block", "branch"])
        name = self.name(kind[0])
        extra = self.common(kind, siblings, inside=False)
        if kind == "task":
            self.tasks.append(name)
            if self.chance(0.3):
                extra += f" :retries {self.rng.randint(1, 2)} :retry-delay {self.half(5)}"
            if self.chance(0.2):
                extra += " :interruptible nil"
            extra += f" :on-resume :{self.rng.choice(['reattach', 'restart', 'fail'])}"
            text = f"(task :id {name} :action act{extra})"
        elif kind == "branch":
            options = []
            for _ in range(self.rng.randint(1, 3)):
                eligible = f" :eligible-conditions ({self.condition()})" if self.chance(0.6) else ""
                requires = f" :requires ((energy {self.rng.randint(0, 60)}))" if self.chance(0.2) else ""
                utility = str(self.rng.randint(0, 9))
                if self.chance(0.3):
                    utility = f"((0 {self.rng.randint(0, 9)}) (20 {self.rng.randint(0, 9)}))"
                option = self.name("o")
                node = self.node(depth + 1, [])
                options.append(f"(option :id {option} :utility {utility}{eligible}{requires} :node {node})")
            none = self.rng.choice(["fail", "skip", "wait"])
            after = self.rng.choice(["fail", "next"])
            text = (
                f"(branch :id {name}{extra} :if-none :{none} :on-option-failure :{after} "
                f":options ({' '.join(options)}))"
            )
        else:
            children: list[str] = []
            names: list[str] = []
            for _ in range(self.rng.randint(1, 4)):
                before = self.count
                children.append(self.node(depth + 1, list(names)))
                names.append(self._first_after(before, children[-1]))
            text = f"({kind} :id {name}{extra} :node-list ({' '.join(children)}))"
        self.ids.append(name)
        return text

    @staticmethod
    def _first_after(before: int, text: str) -> str:
        return text.split(":id ", 1)[1].split()[0]

    def behaviour(self) -> Behaviour:
        duration = None if self.chance(0.06) else self.half(8)
        during = ()
        if self.chance(0.2):
            during = ((int(self.half(4) * 1000), self.values()),)
        return Behaviour(
            duration_ms=None if duration is None else int(duration * 1000),
            success=self.chance(0.8),
            updates=self.values() if self.chance(0.3) else {},
            abort_delay_ms=int(self.half(3) * 1000) if self.chance(0.5) else 0,
            during=during,
        )

    def values(self) -> dict[str, Value]:
        if self.chance(0.25):
            return {"battery": self.rng.randint(0, 100)}
        value: Value = self.rng.randint(0, 4)
        if self.chance(0.05):
            value = self.rng.choice(["text", True])
        return {self.rng.choice(KEYS): value}

    def plan(self) -> str:
        root = self.node(0, [])
        main = list(self.ids)
        floating = []
        for _ in range(self.rng.randint(0, 2)):
            self.left = 3
            scope = f" :scope {self.rng.choice(main)}" if self.chance(0.5) else ""
            mode = self.rng.choice(["between", "interrupt"])
            flag = self.rng.choice(["t", "nil"])
            floating.append(
                f"(floating-contingency :id {self.name('f')} :trigger-conditions ({self.condition()}) "
                f":utility {self.rng.randint(0, 5)} :mode :{mode}{scope} "
                f":max-insertions {self.rng.randint(1, 3)} :continue-on-failure {flag} "
                f":node {self.node(3, [])})"
            )
        library = []
        for _ in range(self.rng.randint(0, 2)):
            self.left = 2
            library.append(
                f"(alternate :id {self.name('l')} :utility {self.rng.randint(0, 5)} :node {self.node(3, [])})"
            )
        return (
            f"(plan :id p :resources {RESOURCES} :floating ({' '.join(floating)}) "
            f":library ({' '.join(library)}) :node {root})"
        )

    def case(self) -> Case:
        plan = self.plan()
        actions = {
            task: tuple(self.behaviour() for _ in range(self.rng.randint(1, 3))) for task in self.tasks
        }
        initial: dict[str, Value] = {"battery": self.rng.randint(0, 120)}
        for key in KEYS:
            if self.chance(0.7):
                initial[key] = self.rng.randint(0, 4)
        script: list[Event] = []
        for _ in range(self.rng.randint(0, 12)):
            t_ms = int(self.half(45) * 1000)
            if self.chance(0.85):
                script.append(Update(t_ms, self.values()))
            else:
                operation = self.rng.choice([Operation.PAUSE, Operation.RESUME, Operation.RESUME])
                if self.chance(0.15):
                    operation = Operation.ABORT
                script.append(Operator(t_ms, operation))
        script.append(Operator(60_000, Operation.RESUME))
        return Case(plan, initial, actions, tuple(script), list(self.tasks))


def random_case(seed: int, *, size: int = 12, temporal: bool = True) -> Case:
    """Return the case of a seed."""
    return Maker(random.Random(seed), size=size, temporal=temporal).case()
