"""A formula: parsed by the grammar of triggers into a tree, within its bounds; what its quantities are comes later.

At most NODES nodes, and windows within each other as long as the subject allows, LONGEST_S of a flight or a recording:
the memory of a formula is bounded by them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf
from typing import Final

from rig.core.frame import FLIGHT_INDEX, INDEX
from rig.core.renamed import formula_now, now_called
from rig.core.text import choices, quoted
from rig.world.faults.grammar import Grammar, Op, Refused, Step, Steps, Window, parse

NODES: Final = 200
LONGEST_S: Final = 60.0  # of windows within each other, on a flight or a recording
LONGEST: Final = 8_000  # characters
OF_SIGNALS: Final = ("truth", "true", "voted", "reference", "error", "threshold", "level")  # NAME.X
OF_CHANNELS: Final = ("channel", "count", "failed", "healthy")  # NAME.X.N
CHANNEL_ERROR: Final = "channel error"  # error.X.N
OTHERS: Final = ("departure", "acting", "onset", "lost", "unit.late")  # of no signal
YES_NO: Final = ("failed", "healthy", *OTHERS[1:])
BASELINE: Final = "baseline."
SIGNAL: Final = "{signal}"
CHANNEL: Final = "{channel}"  # of a signal; a formula holds for each that is fitted
_WINDOWS: Final = (Op.ALWAYS, Op.EVENTUALLY, Op.ONCE, Op.UNTIL)
COMPARISONS: Final = (Op.LESS, Op.LESS_EQUAL, Op.GREATER, Op.GREATER_EQUAL, Op.EQUAL, Op.NOT_EQUAL)
_UNARY: Final = (Op.NEGATE, Op.ABS, Op.NOT, Op.ALWAYS, Op.EVENTUALLY, Op.ONCE, Op.STATE)


@dataclass(frozen=True, slots=True)
class Node:
    """One node: ``place`` of its quantity among the names, or of a comparison among those; ``sign`` -1 under a not."""

    op: Op
    parts: tuple[Node, ...] = ()
    place: int = 0
    value: float = 0.0
    window: Window = (0.0, 0.0)  # s
    sign: int = 1

    def walk(self) -> Iterator[Node]:
        """Yield this node and all below it."""
        yield self
        for part in self.parts:
            yield from part.walk()


@dataclass(frozen=True, slots=True)
class Formula:
    """A tree, and the names of the quantities in it."""

    root: Node
    names: tuple[str, ...]
    comparisons: int


Known = Callable[[str], bool]


def read_formula(
    text: str, number: Known, condition: Known, unknown: Callable[[str], str], longest_s: float = LONGEST_S
) -> Formula:
    """Return the tree of ``text``; Refused, one line with its column, states what is not allowed.

    number, condition : whether a name is a quantity, or a yes or no; unknown : the error text for any other name
    longest_s : of windows within each other
    """
    names: list[str] = []

    def step(op: Op, known: Known, name: str) -> Step | None:
        if not known(name):
            return None
        if name not in names:
            names.append(name)
        return op, names.index(name), 0.0

    grammar = Grammar(
        lambda name: step(Op.QUANTITY, number, name),
        lambda name: step(Op.HOLDS, condition, name),
        unknown,
        windows=True,
        longest=LONGEST,
        called="'always[0, 5] abs(error.pitch_rate) <= 0.05'",
    )
    parsed = parse(text, grammar)
    if len(parsed.steps) > NODES:
        raise Refused(f"has {len(parsed.steps)} nodes, at most {NODES} are allowed")
    root = _signed(_tree(parsed.steps, parsed.windows), 1)
    if (long_s := sum(reach(root))) > longest_s * (1.0 + 1e-9):
        raise Refused(f"has windows of {long_s:g} s, at most {longest_s:g} s are allowed")
    return Formula(root, tuple(names), sum(node.op in COMPARISONS for node in root.walk()))


def _tree(steps: Steps, windows: list[Window]) -> Node:
    stack: list[Node] = []
    comparisons = 0
    for op, place, value in steps:
        if op in (Op.NUMBER, Op.QUANTITY, Op.HOLDS):
            stack.append(Node(op, (), place, value))
            continue
        count = 1 if op in _UNARY else 2
        parts = tuple(stack[-count:])
        del stack[-count:]
        if op in COMPARISONS:
            place, comparisons = comparisons, comparisons + 1
        stack.append(Node(op, parts, place, value, windows[place] if op in _WINDOWS else (0.0, 0.0)))
    return stack[0]


def _signed(node: Node, sign: int) -> Node:
    """Return the tree with the sign of each node: -1 below an odd number of ``not``."""
    below = -sign if node.op == Op.NOT else sign
    parts = tuple(_signed(part, below) for part in node.parts)
    return Node(node.op, parts, node.place, node.value, node.window, sign)


def reach(node: Node) -> tuple[float, float]:
    """Return how far a formula looks back and ahead, s."""
    below = [reach(part) for part in node.parts]
    back_s, ahead_s = (max((each[i] for each in below), default=0.0) for i in (0, 1))
    if node.op == Op.ONCE:
        return back_s + node.window[1], ahead_s
    return back_s, ahead_s + (node.window[1] if node.op in _WINDOWS else 0.0)


def body(node: Node) -> Node:
    """Return the robustness of each frame by a formula without the windows around it."""
    while node.op in (Op.ALWAYS, Op.EVENTUALLY):
        node = node.parts[0]
    return node


@dataclass(frozen=True, slots=True)
class Name:
    """The parts of a quantity's name: ``baseline.failed.X.N`` is family failed, of X, channel N of the baseline."""

    family: str  # of OF_SIGNALS, OF_CHANNELS, OTHERS; surface; flight
    of: str = ""
    channel: int = 0
    baseline: bool = False


def split(name: str) -> Name | None:
    """Return the parts of a quantity's name, None of one that is none whatever the signals are."""
    baseline = name.startswith(BASELINE)
    inner = name.removeprefix(BASELINE)
    family, _, rest = inner.partition(".")
    if inner in OTHERS:
        return Name(inner, baseline=baseline)
    if inner in FLIGHT_INDEX:
        return Name("flight", inner, baseline=baseline)
    of, _, channel = rest.rpartition(".")
    if family in OF_CHANNELS:
        return Name(family, of, int(channel), baseline) if of and channel.isdigit() else None
    if family == "error" and of and channel.isdigit():
        return Name(CHANNEL_ERROR, of, int(channel), baseline)
    if (family not in OF_SIGNALS and family != "surface") or not rest:
        return None
    if family in ("truth", "true") and rest in FLIGHT_INDEX:
        return Name("flight", rest, baseline=baseline)
    return Name("truth" if family == "true" else family, rest, baseline=baseline)


def may_hold(name: str) -> bool:
    """Return True if a name may be a yes or no, whatever the signals are."""
    parts = split(name)
    return parts is not None and (
        parts.family in YES_NO or (parts.family in ("truth", "voted") and not _is_signal(parts))
    )


def _is_signal(name: Name) -> bool:
    return name.of in INDEX


def unknown_family(name: str) -> str:
    """Return the error text for a name that is no quantity of any signal."""
    if (new := formula_now(name)) != name:
        return now_called(name, new)
    forms = [*(f"{family}.<signal>" for family in OF_SIGNALS), *(f"{family}.<signal>.<N>" for family in OF_CHANNELS)]
    accepted = [
        *forms,
        "error.<signal>.<N>",
        *OTHERS,
        "surface.<name>",
        "baseline.<quantity>",
        *(f"truth.{name}" for name in FLIGHT_INDEX),
    ]
    return f"unknown quantity {quoted(name)}, {choices(name, accepted, 'docs/how-to/requirements-and-ci.md')}"


def check_grammar(text: str) -> None:
    """Refuse a formula that no subject could be measured by, whatever its names are: Refused, with its column."""
    if CHANNEL in text and SIGNAL not in text:
        raise Refused(f"{CHANNEL} goes with {SIGNAL}", text.index(CHANNEL) + 1)
    anything = lambda name: True  # noqa: E731
    read_formula(_named(text), anything, anything, str, inf)


def check_names(text: str) -> None:
    """Refuse a formula that no flight or recording could be measured by: Refused, with its column."""
    read_formula(_named(text), lambda name: split(name) is not None, may_hold, unknown_family)


def _named(text: str) -> str:
    return text.replace(SIGNAL, "signal").replace(CHANNEL, "1")
