"""Find words and sentence openings for which the field has others, in all text that a user reads.

python tests/tools/words.py [PATH ...]    # prints path:line: what is wrong -> what to write; without PATH: everything
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).parents[2]
# Pattern of the word, and what to write in its place. A word stands alone; case does not matter.
FORBIDDEN: Final = (
    (r"nobody|whoever", "no channel, no one, the user"),
    (r"everybody|anybody|somebody", "every channel, any user"),
    (r"says?|said|speaks?|spoken?", "a device measures, transmits, reports; a page states"),
    (r"believes?|believed|blames?|blamed|accuses?|accused|owes?", "a device compares, exceeds, isolates"),
    (r"lies?|lied|lying|liars?", "sensor fault, Byzantine; of a place: is"),
    (r"honest|honestly", "unbiased, healthy"),
    (r"rightly", "correctly"),
    (r"(?:for )?so long(?: after)?|so many|so few|so often", "a number"),
    (r"what lasts|lasting", "slow fault"),
    (r"(?:at )?(?:one|same|the) price|pays", "at one false-isolation rate"),
    (r"of ours|ours", "built-in"),
    (r"of (?:its|one's|their|your|his|our) own|one's own", "its own ..., your ..."),
    (r"leagues?|rivals?", "benchmark, baseline manager"),
    (r"resolvers?", "tie-break rule, decided by"),
    (r"singular(?! (?:value|matri|fault))", "split; once, as Zhang's word: singular fault"),
    (r"known loss(?:es)?|bad votes?", "annunciated loss, undetected error"),
    (r"twins?", "fault-free baseline; of two channels: stuck together"),
    (r"least margin|median margin", "robustness"),
    (r"carriers?|seams?", "transport, interface"),
    (r"demands?|demanded", "command"),
    (r"dies|died", "fails, stops"),
    (r"heed|goes on|go on with|gone on with|begun", "continues, resumes, unfinished"),
    (r"(?:is|was|are|were|be|been|being) failed", "isolated"),
    (r"(?<=[,;] )else(?! if)", "otherwise, if not given"),
)
# A sentence does not begin so, unless it is a question.
OPENINGS: Final = ("Of", "What", "Whether", "Who", "Whose", "Whatever")
# A term of the glossary in its one meaning: the word, and what must stand in the same sentence.
ONE_MEANING: Final = {
    r"margins?": (r"gain|phase|delay|stability|dB|deg|loop|control|crossover", "robustness, false-isolation rate"),
}
_WORD: Final = re.compile(r"(?<![\w`])(?:" + "|".join(f"({pattern})" for pattern, _ in FORBIDDEN) + r")(?![\w`])", re.I)
_MEANT: Final = [
    (re.compile(rf"\b(?:{word})\b", re.I), re.compile(near, re.I), use) for word, (near, use) in ONE_MEANING.items()
]
_TAGS: Final = re.compile(r"<style.*?</style>|<script.*?</script>|\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}|<[^>]*>", re.S)


class Text(NamedTuple):
    """A piece of text that a user reads, and where it is."""

    path: Path
    line: int
    text: str


def of_page(path: Path) -> Iterator[Text]:
    """Yield the lines of a Markdown page outside its code."""
    code = False
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if line.lstrip().startswith("```"):
            code = not code
        elif not code and not line.startswith("    "):
            yield Text(path, number, re.sub(r"`[^`]*`|\]\([^)]*\)|<[^>]*>", "``", line))


def of_template(path: Path) -> Iterator[Text]:
    """Yield the lines of a page's template without tags, styles and expressions."""
    text = re.sub(
        r"<style.*?</style>|<script.*?</script>|\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}|<[^>]*>",
        _blank,
        path.read_text(),
        flags=re.S,
    )
    for number, line in enumerate(text.splitlines(), 1):
        yield Text(path, number, line.strip())


def _blank(match: re.Match[str]) -> str:
    return "\n" * match[0].count("\n")


def of_source(path: Path) -> Iterator[Text]:
    """Yield the strings of a source that hold a sentence, and the docstrings of its public names."""
    found = nodes(ast.parse(path.read_text()))
    docs: set[int] = set()
    for node in found:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                docs.add(id(first.value))
                if not getattr(node, "name", "").startswith("_"):
                    yield from _lines(path, first.value.lineno, first.value.value)
    parts = {id(value) for node in found if isinstance(node, ast.JoinedStr) for value in node.values}
    for node in found:
        if isinstance(node, ast.JoinedStr):
            text = "".join(str(value.value) if isinstance(value, ast.Constant) else "{}" for value in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (docs | parts):
            text = node.value
        else:
            continue
        if " " in text.strip():
            yield from _lines(path, node.lineno, text)


def nodes(tree: ast.AST) -> list[ast.AST]:
    """Return all nodes in the order of ``ast.walk``, without the contexts of names: in a third of the time."""
    found = [tree]
    for node in found:  # grows meanwhile
        for name in node._fields:
            of = getattr(node, name, None)
            if isinstance(of, list):
                found += [each for each in of if isinstance(each, ast.AST)]
            elif isinstance(of, ast.AST) and name != "ctx":
                found.append(of)
    return found


def of_settings(path: Path) -> Iterator[Text]:
    """Yield the comments and descriptions of a TOML file."""
    for number, line in enumerate(path.read_text().splitlines(), 1):
        described = re.match(r'\s*(?:description|title|source|about|text|why)\s*=\s*"(.*)"', line)
        text = described[1] if described else line.partition("# ")[2]
        if text:
            yield Text(path, number, re.sub(r"`[^`]*`", "``", text))


def _lines(path: Path, start: int, text: str) -> Iterator[Text]:
    for number, line in enumerate(re.sub(r"`+[^`]*`+", "``", text).splitlines(), start):
        yield Text(path, number, line.strip())


def texts(paths: Iterable[Path]) -> Iterator[Text]:
    """Yield all text of ``paths`` that a user reads."""
    for path in paths:
        kinds = {".md": of_page, ".html": of_template, ".py": of_source, ".toml": of_settings}
        yield from kinds[path.suffix](path)


def everything() -> list[Path]:
    """Return all files whose text a user reads."""
    return [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *sorted((ROOT / "docs").rglob("*.md")),
        *sorted(
            path for path in (ROOT / "rig").rglob("*") if path.suffix in {".py", ".html"} and path.name != "renamed.py"
        ),
        *sorted(path for folder in ("aircraft", "faults", "docs/examples") for path in (ROOT / folder).rglob("*.toml")),
    ]


def wrong(text: str) -> Iterator[tuple[str, str]]:
    """Yield (what is wrong, what to write) of a line of text."""
    for match in _WORD.finditer(text):
        if match[0] == "else" and re.search(r"\bif\b", text[: match.start()]):
            continue  # "1 if the fault acts, else 0"
        yield match[0], FORBIDDEN[(match.lastindex or 1) - 1][1]
    for sentence in re.split(r"(?<=[.!?:|]) +", text):
        bare = sentence.strip("|#*-> 0123456789.")
        opening = bare.split(" ")[0]
        if opening in OPENINGS and "?" not in sentence and not text.startswith("#"):
            yield f"begins with '{opening}'", "subject, verb, object"
        for word, near, use in _MEANT:
            if (match := word.search(sentence)) and not near.search(text):
                yield match[0], use


def main(arguments: list[str]) -> int:
    """Print what is wrong in ``arguments``, or in all text; return 1 if anything is."""
    paths = [Path(one).resolve() for one in arguments]
    files = (
        [path for one in paths for path in (sorted(one.rglob("*")) if one.is_dir() else [one])]
        if paths
        else everything()
    )
    found = 0
    for path, line, text in texts(path for path in files if path.suffix in {".md", ".html", ".py", ".toml"}):
        for word, use in wrong(text):
            found += 1
            print(f"{path.relative_to(ROOT)}:{line}: {word} -> {use}\n    {text[:160]}")
    print(f"{found} found", file=sys.stderr)
    return int(found > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
