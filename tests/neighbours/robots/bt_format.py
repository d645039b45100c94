"""A checker of BehaviorTree.CPP 4 XML, written from the rules of the format, not from our exporter.

Rules: https://www.behaviortree.dev/docs/learn-the-basics/xml_format and the node catalogue of version 4.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

CONTROLS = {
    "Sequence": set(),
    "SequenceWithMemory": set(),
    "ReactiveSequence": set(),
    "Fallback": set(),
    "ReactiveFallback": set(),
    "IfThenElse": set(),
    "WhileDoElse": set(),
    "Parallel": {"failure_count", "success_count"},
}
DECORATORS = {
    "ForceSuccess": set(),
    "ForceFailure": set(),
    "Inverter": set(),
    "RetryUntilSuccessful": {"num_attempts"},
    "Repeat": {"num_cycles"},
    "Timeout": {"msec"},
    "Delay": {"delay_msec"},
    "Precondition": {"if", "else"},
}
LEAVES = {
    "AlwaysSuccess": set(),
    "AlwaysFailure": set(),
    "Script": {"code"},
    "ScriptCondition": {"code"},
    "Sleep": {"msec"},
}
SCRIPTS = {
    "_successIf",
    "_failureIf",
    "_skipIf",
    "_while",
    "_onSuccess",
    "_onFailure",
    "_onHalted",
    "_post",
}
STATUSES = {"SUCCESS", "FAILURE", "RUNNING", "SKIPPED"}
IDENTIFIER = r"[A-Za-z_@][A-Za-z0-9_]*"
TOKEN = re.compile(
    rf"\s*(?:({IDENTIFIER})|(-?\d+(?:\.\d+)?)|('[^']*')|(:=|==|!=|<=|>=|&&|\|\||[-+*/<>!?:();=]))"
)


def complaints(xml: str) -> list[str]:
    """Return what is wrong with a text as XML of BehaviorTree.CPP 4; nothing if it may be loaded."""
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        return [f"no XML: {error}"]
    found = []
    if root.tag != "root" or root.get("BTCPP_format") != "4":
        found.append('the root element must be <root BTCPP_format="4">')
    trees = {tree.get("ID"): tree for tree in root.findall("BehaviorTree")}
    if None in trees or not trees:
        found.append("a BehaviorTree needs an ID")
    if root.get("main_tree_to_execute") not in trees:
        found.append("main_tree_to_execute names no tree")
    models = root.findall("TreeNodesModel")
    if len(models) > 1:
        found.append("more than one TreeNodesModel")
    known = {}
    for model in models[0] if models else ():
        ports = {}
        for port in model.findall("input_port"):
            ports[port.get("name")] = port.get("type", "")
            found += port_complaints(port.get("name") or "")
        if model.get("ID") in known or model.get("ID") in {*CONTROLS, *DECORATORS, *LEAVES}:
            found.append(f"node type {model.get('ID')} is declared twice or built in")
        known[model.get("ID")] = (model.tag, ports)
    for extra in {child.tag for child in root} - {"BehaviorTree", "TreeNodesModel"}:
        found.append(f"unknown element {extra} below root")
    for tree in trees.values():
        if len(tree) != 1:
            found.append(f"tree {tree.get('ID')} must have exactly one child, has {len(tree)}")
        for node in tree.iter():
            if node is not tree:
                found += node_complaints(node, known)
    return found


def port_complaints(name: str) -> list[str]:
    if not name[:1].isalpha() or name in ("name", "ID"):
        return [f"{name!r} is not a name of a port"]
    return []


def node_complaints(node: ElementTree.Element, known: dict) -> list[str]:
    found, tag, below = [], node.tag, len(node)
    plain = {k: v for k, v in node.attrib.items() if k != "name" and k not in SCRIPTS}
    if tag in ("Action", "Condition", "Decorator", "Control"):
        name = plain.pop("ID", None)
        if name not in known or known[name][0] != tag:
            return [f"<{tag} ID={name!r}> is not in the TreeNodesModel"]
        allowed = set(known[name][1])
        least, most = {"Decorator": (1, 1), "Control": (1, 10**6)}.get(tag, (0, 0))
        for port, type_ in known[name][1].items():
            if type_ == "double" and port in plain:
                try:
                    float(plain[port])
                except ValueError:
                    found.append(f"{name}: port {port} is not a number: {plain[port]!r}")
    elif tag in CONTROLS:
        allowed, least, most = CONTROLS[tag], 1, 10**6
        if tag == "IfThenElse":
            least, most = 2, 3
    elif tag in DECORATORS:
        allowed, least, most = DECORATORS[tag], 1, 1
    elif tag in LEAVES:
        allowed, least, most = LEAVES[tag], 0, 0
    else:
        return [f"unknown element {tag}"]
    if not least <= below <= most:
        found.append(f"{tag} {node.get('name', '')} has {below} children, allowed {least}..{most}")
    return found + attribute_complaints(node, plain, allowed)


def attribute_complaints(node: ElementTree.Element, plain: dict[str, str], allowed: set[str]) -> list[str]:
    tag, below = node.tag, len(node)
    found: list[str] = []
    found += [f"{tag}: unknown attribute {extra}" for extra in plain.keys() - allowed]
    if tag not in ("Action", "Condition", "Decorator"):
        found += [f"{tag}: attribute {missing} is missing" for missing in allowed - plain.keys()]
    for port in ("msec", "delay_msec", "num_attempts"):
        if port in plain and tag in {**DECORATORS, **LEAVES} and not re.fullmatch(r"-1|\d+", plain[port]):
            found.append(f"{tag}: {port} must be a whole number, found {plain[port]!r}")
    if tag == "Parallel" and not (-below <= int(plain["success_count"]) <= below):
        found.append("Parallel: success_count over the number of children")
    if tag == "Precondition" and plain.get("else") not in STATUSES:
        found.append(f"Precondition: else is {plain.get('else')!r}")
    codes = [node.get(word) for word in SCRIPTS if node.get(word)] + [
        plain[word] for word in ("code", "if") if word in plain
    ]
    for code in codes:
        try:
            run_script(code, dict.fromkeys(re.findall(IDENTIFIER, code), 0.0))
        except ScriptError as error:
            found.append(f"{tag}: {error}")
    return found


# --- the scripting language ---------------------------------------------------------


class ScriptError(Exception):
    """A script that BehaviorTree.CPP would refuse."""


def run_script(code: str, board: dict) -> object:
    """Run statements separated by `;` on a blackboard and return the value of the last."""
    tokens, at = [], 0
    code = code.strip()
    while at < len(code):
        match = TOKEN.match(code, at)
        if match is None:
            raise ScriptError(f"illegal text at {code[at:]!r}")
        tokens.append(match)
        at = match.end()
    reader = _Script([(m.lastindex, m[m.lastindex]) for m in tokens], board)
    return reader.statements()


class _Script:
    """Recursive descent: assignment < ternary < or < and < comparison < sum < sign < value."""

    def __init__(self, tokens: list, board: dict) -> None:
        self.tokens, self.at, self.board = tokens, 0, board

    def peek(self) -> str:
        return self.tokens[self.at][1] if self.at < len(self.tokens) else ""

    def take(self, text: str) -> None:
        if self.peek() != text:
            raise ScriptError(f"expected {text!r}, found {self.peek()!r}")
        self.at += 1

    def statements(self) -> object:
        value = self.statement()
        while self.peek() == ";":
            self.at += 1
            value = self.statement()
        if self.at != len(self.tokens):
            raise ScriptError(f"left over: {self.peek()!r}")
        return value

    def statement(self) -> object:
        if (
            self.at + 1 < len(self.tokens)
            and self.tokens[self.at][0] == 1
            and self.tokens[self.at + 1][1] == ":="
        ):
            name = self.peek()
            self.at += 2
            self.board[name] = self.ternary()
            return self.board[name]
        return self.ternary()

    def ternary(self) -> object:
        value = self.either()
        if self.peek() == "?":
            self.at += 1
            yes = self.ternary()
            self.take(":")
            no = self.ternary()
            return yes if value else no
        return value

    def either(self) -> object:
        value = self.both()
        while self.peek() == "||":
            self.at += 1
            other = self.both()
            value = bool(value) or bool(other)
        return value

    def both(self) -> object:
        value = self.compared()
        while self.peek() == "&&":
            self.at += 1
            other = self.compared()
            value = bool(value) and bool(other)
        return value

    def compared(self) -> object:
        value = self.sum()
        if self.peek() in ("==", "!=", "<", "<=", ">", ">="):
            operator = self.peek()
            self.at += 1
            other = self.sum()
            if operator in ("==", "!="):
                return (value == other) is (operator == "==")
            if isinstance(value, str) or isinstance(other, str):
                if all(isinstance(v, str) or v == 0.0 for v in (value, other)):
                    return False
                raise ScriptError("order of texts")
            return {"<": value < other, "<=": value <= other, ">": value > other, ">=": value >= other}[
                operator
            ]
        return value

    def sum(self) -> object:
        value = self.value()
        while self.peek() in ("+", "-"):
            operator = self.peek()
            self.at += 1
            other = self.value()
            value = value + other if operator == "+" else value - other
        return value

    def value(self) -> object:
        if self.at >= len(self.tokens):
            raise ScriptError("ends too early")
        kind, text = self.tokens[self.at]
        self.at += 1
        if kind == 1:
            if text not in self.board:
                raise ScriptError(f"variable not found: {text}")
            return self.board[text]
        if kind == 2:
            return float(text)
        if kind == 3:
            return text[1:-1]
        if text == "(":
            value = self.ternary()
            self.take(")")
            return value
        if text == "-":
            return -self.value()
        raise ScriptError(f"unexpected {text!r}")
