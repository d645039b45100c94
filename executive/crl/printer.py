"""Plan to text: the canonical form, which the digest is taken of, and a readable one.

Both are built from the same pieces, so they differ in white space alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping

from executive.crl.declaration import Syntax
from executive.crl.nodes import FORMS, KIND_OF, Alternate, FloatingContingency, Node, Option, Plan, walk
from executive.crl.syntax import codec
from executive.crl.trees import Tree, condition_tree, temporal_tree
from executive.crl.values import Conditions, Temporal

WIDTH = 100


def canonical_text(plan: Plan) -> str:
    """Return the one text of a plan: fields in grammar order, single spaces, defaults left out."""
    return flat(_plan(plan))


def digest(plan: Plan) -> str:
    """Return the SHA-256 of the canonical text in hexadecimal, the identity of a plan."""
    return hashlib.sha256(canonical_text(plan).encode()).hexdigest()


def canonical_node(node: Node) -> str:
    """Return the canonical text of one node; two tasks are identical iff these are equal."""
    done: dict[int, list[Tree]] = {}
    _nodes(node, done)
    return flat(done[id(node)])


def readable_text(plan: Plan) -> str:
    """Return the text for people: one field a line where a form does not fit into a line."""
    return _pretty(_plan(plan)) + "\n"


def temporal_text(temporal: Temporal) -> str:
    """Return a temporal condition as it stands in a plan."""
    return flat(temporal_tree(temporal))


def conditions_text(conditions: Conditions) -> str:
    """Return a list of conditions as it stands in a plan."""
    return flat([condition_tree(c) for c in conditions])


# --- forms ------------------------------------------------------------------------


def _plan(plan: Plan) -> list[Tree]:
    done: dict[int, list[Tree]] = {}
    for tree in plan.trees():
        _nodes(tree, done)
    return _form(plan, done)


def _nodes(root: Node, done: dict[int, list[Tree]]) -> None:
    """Make the trees of a node and of all below it, children before parents, without recursion."""
    for node in reversed(list(walk(root))):
        done[id(node)] = _form(node, done)


def _form(
    value: Plan | Node | Option | FloatingContingency | Alternate, done: Mapping[int, list[Tree]]
) -> list[Tree]:
    kind = KIND_OF[type(value)]
    out: list[Tree] = [kind]
    for declared in FORMS[kind].fields.values():
        held = getattr(value, declared.attribute)
        if not declared.required and held == declared.default:
            continue
        out.append(f":{declared.word}")
        match declared.syntax:
            case Syntax.NODE:
                out.append(done[id(held)])
            case Syntax.NODE_LIST:
                out.append([done[id(child)] for child in held])
            case Syntax.FORM_LIST:
                out.append([_form(form, done) for form in held])
            case syntax:
                out.append(codec(syntax).tree(held))
    return out


# --- layout ---------------------------------------------------------------------


def flat(tree: Tree) -> str:
    """Return a tree in one line, without recursion."""
    pieces: list[str] = []
    stack: list[Iterator[Tree]] = [iter([tree])]
    space = False
    while stack:
        for item in stack[-1]:
            if space:
                pieces.append(" ")
            if isinstance(item, str):
                pieces.append(item)
                space = True
            else:
                pieces.append("(")
                space = False
                stack.append(iter(item))
                break
        else:
            stack.pop()
            if stack:
                pieces.append(")")
                space = True
    return "".join(pieces)


def _pretty(tree: list[Tree]) -> str:
    """Return a tree broken into lines of about `WIDTH` characters; each form's fields are aligned."""
    sizes: dict[int, int] = {}
    _measure(tree, sizes)
    out: list[str] = []
    stack: list[tuple[Tree | str, int]] = [(tree, 0)]
    # Entries are trees to be laid out at an indent, or, with indent -1, text to be written as it is.
    while stack:
        item, indent = stack.pop()
        if isinstance(item, str):
            out.append(item)
            continue
        if indent + sizes[id(item)] <= WIDTH or not _is_long(item):
            out.append(flat(item))
            continue
        out.append("(")
        parts: list[tuple[Tree | str, int]] = []
        inner = indent + 1
        start = 0
        if isinstance(item[0], str):
            # A form: its head, `:id x` beside it, then a field a line.
            head = [item[0]]
            start = 1
            if len(item) > 2 and item[1] == ":id" and isinstance(item[2], str):
                head += (item[1], item[2])
                start = 3
            parts.append((" ".join(map(str, head)), -1))
            inner = indent + 2
        at = start
        while at < len(item):
            name = item[at]
            if parts:
                parts.append(("\n" + " " * inner, -1))
            if isinstance(name, str) and name.startswith(":") and at + 1 < len(item):
                value = item[at + 1]
                parts.append((name + " ", -1))
                size = 0 if isinstance(value, str) else sizes[id(value)]
                if inner + len(name) + 1 + size > WIDTH and _is_long(value):
                    parts.append(("\n" + " " * inner, -1))
                    parts[-2] = (name, -1)
                    parts.append((value, inner))
                else:
                    parts.append((value, inner + len(name) + 1))
                at += 2
            else:
                parts.append((name, inner))
                at += 1
        parts.append((")", -1))
        stack.extend(reversed(parts))
    return "".join(out)


def _is_long(tree: Tree) -> bool:
    """Tell whether a tree is worth breaking: a form with fields, or a list of lists."""
    if isinstance(tree, str) or not tree:
        return False
    return any(isinstance(item, list) for item in tree)


def _measure(tree: Tree, sizes: dict[int, int]) -> None:
    order: list[list[Tree]] = []
    stack: list[Tree] = [tree]
    while stack:
        top = stack.pop()
        if not isinstance(top, str):
            order.append(top)
            stack.extend(top)
    for item in reversed(order):
        inside = sum(len(part) if isinstance(part, str) else sizes[id(part)] for part in item)
        sizes[id(item)] = inside + max(len(item) - 1, 0) + 2
