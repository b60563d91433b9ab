"""Public names as their source declares them: signatures, parameters, fields and methods, for docs/reference/api.md."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
_PARAMETER: Final = re.compile(r"^(\w+(?:, \w+)*) : (.*)")
_ERRORS: Final = re.compile(r"^(?:BadInput|BadLog|RigError)\b")
_MEMBERS: Final = (ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a table: a parameter, a field or a method."""

    name: str
    type: str
    default: str
    meaning: str


@dataclass(slots=True)
class Documented:
    """A function or a class: its first line, its further text, its rows and its errors."""

    name: str
    first: str
    signature: str = ""
    more: list[str] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    methods: list[Row] = field(default_factory=list)
    errors: str = ""


@cache
def _tree(path: str) -> ast.Module:
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


@cache
def _lines(path: str) -> list[str]:
    return (ROOT / path).read_text(encoding="utf-8").splitlines()


def _node(path: str, name: str) -> ast.FunctionDef | ast.ClassDef:
    for node in _tree(path).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return node
    raise KeyError(f"{path}: {name}")


def function(path: str, name: str, shown: str) -> Documented:
    """Return the function ``name`` of a source under the name ``shown``; KeyError: a parameter without a meaning."""
    node = _node(path, name)
    assert isinstance(node, ast.FunctionDef)
    return _of_function(node, shown)


def _of_function(node: ast.FunctionDef, shown: str) -> Documented:
    first, more, meanings, errors = _docstring(node)
    found = Documented(shown, first, _signature(node, shown), more, errors=errors)
    for argument, default in _arguments(node.args):
        kind = "" if argument.annotation is None else _type(argument.annotation)
        text = "required" if default is None else ast.unparse(default)
        if argument.arg not in meanings:
            raise KeyError(f"{shown}: {argument.arg} has no meaning in the docstring")
        found.rows.append(Row(argument.arg, kind, text, meanings[argument.arg]))
    for rest in (node.args.vararg, node.args.kwarg):
        if rest is not None:
            kind = "" if rest.annotation is None else _type(rest.annotation)
            found.rows.append(Row(rest.arg, kind, "", meanings.get(rest.arg, "")))
    return found


def _arguments(arguments: ast.arguments) -> Iterator[tuple[ast.arg, ast.expr | None]]:
    """Yield arguments and defaults, those without a default first; ``self`` and ``cls`` are left out."""
    plain = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(plain) - len(arguments.defaults)) + list(arguments.defaults)
    for argument, default in zip(plain, defaults, strict=True):
        if argument.arg not in ("self", "cls"):
            yield argument, default
    yield from zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)


def _signature(node: ast.FunctionDef, shown: str) -> str:
    """Return the call: names and defaults, without types, which are in the table."""
    parts = []
    for argument, default in _arguments(node.args):
        if node.args.kwonlyargs and argument is node.args.kwonlyargs[0]:
            parts.append("*" if node.args.vararg is None else f"*{node.args.vararg.arg}")
        parts.append(argument.arg if default is None else f"{argument.arg}={ast.unparse(default)}")
    if node.args.vararg is not None and not node.args.kwonlyargs:
        parts.append(f"*{node.args.vararg.arg}")
    if node.args.kwarg is not None:
        parts.append(f"**{node.args.kwarg.arg}")
    result = "" if node.returns is None else f" -> {_type(node.returns)}"
    return f"{shown}({', '.join(parts)}){result}"


def _docstring(node: ast.FunctionDef | ast.ClassDef) -> tuple[str, list[str], dict[str, str], str]:
    """Return first line, further sentences, meanings by parameter, errors."""
    lines = (ast.get_docstring(node) or "").splitlines()
    first = lines[0] if lines else ""
    more, meanings, errors, current = list[str](), dict[str, str](), "", list[str]()
    for line in lines[1:]:
        parameter = _PARAMETER.match(line)
        if parameter:
            current = parameter[1].split(", ")
            meanings |= dict.fromkeys(current, parameter[2])
        elif line.startswith("    ") and current:
            meanings |= {name: f"{meanings[name]} {line.strip()}" for name in current}
        elif _ERRORS.match(line) or (errors and line):
            errors, current = f"{errors} {line}".strip(), []
        elif line:
            more.append(line.strip())
            current = []
    return first, more, meanings, errors


def _type(annotation: ast.expr) -> str:
    text = ast.unparse(annotation)
    for pattern, plain in (
        (r"NDArray\[np\.(\w+)\]", r"array of \1"),
        (r"NDArray\[Any\]|\bBlock\b", "array of rows"),
        (r"\bAbstractContextManager\[object\]", "context manager"),
        (r"\bpl\.DataFrame\b", "polars.DataFrame"),
        (r"\bGiven\b", "str | Path | Mapping | Scenario | None"),
        (r"\bOverrides\b", "Sequence[str] | Mapping[str, Any]"),
        (r"\bProgress\b", "Callable[[int, int], None]"),
        (r"\bWatch\b", "Callable"),
    ):
        text = re.sub(pattern, plain, text)
    return text


def class_of(sources: list[tuple[str, str]], shown: str, hidden: frozenset[str] = frozenset()) -> Documented:
    """Return a class and its bases, the bases first, without private and ``hidden`` members.

    KeyError: a field without a meaning.
    """
    last = _node(*sources[-1])
    first, more, _, _ = _docstring(last)
    found = Documented(shown, first, "", more)
    fields, methods = dict[str, Row](), dict[str, Row]()
    for path, name in sources:
        node = _node(path, name)
        for member in node.body:
            if isinstance(member, ast.AnnAssign) and isinstance(member.target, ast.Name):
                named, kind = member.target.id, _type(member.annotation)
                if not named.startswith("_") and not kind.startswith("ClassVar") and named not in hidden:
                    fields[named] = Row(named, kind, "", _comment(path, member, shown))
            elif isinstance(member, _MEMBERS) and not member.name.startswith("_") and member.name not in hidden:
                assert isinstance(member, ast.FunctionDef)
                decorators = {ast.unparse(decorator) for decorator in member.decorator_list}
                if not decorators & {"property", "cached_property"}:
                    methods[member.name] = _method(member)
                elif member.name not in fields:
                    kind = "" if member.returns is None else _type(member.returns)
                    fields[member.name] = Row(member.name, kind, "", _docstring(member)[0].rstrip("."))
    found.rows, found.methods = list(fields.values()), list(methods.values())
    return found


def _method(node: ast.FunctionDef) -> Row:
    first, _, meanings, _ = _docstring(node)
    texts = [first, *(f"`{name}`: {meaning}." for name, meaning in meanings.items())]
    return Row(_signature(node, node.name), "", "", " ".join(texts))


def _comment(path: str, member: ast.AnnAssign, shown: str) -> str:
    """Return the comment behind a field, or the lines of comment above it."""
    lines = _lines(path)
    behind = [lines[n - 1].partition("  # ")[2] for n in range(member.lineno, (member.end_lineno or member.lineno) + 1)]
    text = " ".join(part for part in behind if part)
    if text.startswith("pyright:"):
        text = text.partition("  # ")[2]
    above, at = list[str](), member.lineno - 2
    while not text and lines[at].lstrip().startswith("# "):
        above.insert(0, lines[at].strip().removeprefix("# "))
        at -= 1
    text = text or " ".join(above)
    if not text:
        raise KeyError(f"{shown}: {ast.unparse(member.target)} has no comment")
    return re.sub(r"``", "`", text).rstrip(".")
