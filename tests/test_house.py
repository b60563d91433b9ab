"""How the house is kept: sizes of files and functions, words of the field, one way of imports without exceptions."""

import ast
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any, NamedTuple

import grimp
import pytest
import rooms
import words

import rig

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "rig").rglob("*.py"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
LONGEST_FILE, LONGEST_FUNCTION = 350, 50
# Words for which the field has others (CONTRIBUTING.md, 'Words'), as identifiers and in prose.
WORDS = (
    *("inclination", "pressure_table", "spoil", "spoils", "spoiled", "obey", "obeys", "witness", "witnesses"),
    *("judge", "judges", "judged", "vouch", "convict", "acquit", "hand_back", "wander", "wanders", "felt", "rhythm"),
    *("anew", "likewise", "what came of", "stands in for", "foreseeable"),
)


class Parsed(NamedTuple):
    """The lines of each function of all sources by its file and name, and the packages that are imported."""

    functions: dict[str, int]
    imported: set[str]


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements below a node."""
    for name in ("body", "orelse", "handlers", "finalbody", "cases"):
        of = getattr(node, name, ())
        for each in of if isinstance(of, list) else ():  # not the parts of an expression
            yield each
            yield from statements(each)


@cache
def parsed() -> Parsed:
    """Read all sources once; no node is kept, which every later garbage collection would visit."""
    found = Parsed({}, set())
    for path in SOURCES:
        for node in statements(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                found.functions[f"{path}:{node.name}"] = (node.end_lineno or 0) - node.lineno + 1
            elif isinstance(node, ast.Import):
                found.imported.update(alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                found.imported.add(node.module.partition(".")[0])
    return found


def test_no_file_and_no_function_is_too_long():
    files = {str(path): len(path.read_text().splitlines()) for path in SOURCES}
    assert {name: lines for name, lines in files.items() if lines > LONGEST_FILE} == {}
    functions = parsed().functions
    assert len(functions) > 1000
    assert {name: lines for name, lines in functions.items() if lines > LONGEST_FUNCTION} == {}


def test_the_words_are_those_of_the_field():
    """Whole words, and parts of an identifier between underscores."""
    wrong = re.compile(r"(?<![a-z])(" + "|".join(WORDS) + r")(?![a-z])", re.IGNORECASE)
    found = {
        f"{path.relative_to(ROOT)}:{number}: {match[0]}"
        for path in (*SOURCES, *PAGES)
        for number, line in enumerate(path.read_text().splitlines(), 1)
        for match in wrong.finditer(line)
        if "| say |" not in line and not line.startswith("| not ")
    }
    assert found == set()


def test_no_text_uses_a_word_for_which_the_field_has_another():
    found = [
        f"{path.relative_to(ROOT)}:{line}: {word} -> {use}"
        for path, line, text in words.texts(words.everything())
        for word, use in words.wrong(text)
    ]
    assert found == []


# Sentences of each forbidden kind, as words.FORBIDDEN has them; then openings, and a term outside its one meaning.
DIALECT = (
    *(
        "The monitor blames nobody.",
        "It fails everybody.",
        "The sensor says 3.",
        "It accuses channel 2.",
        "The link lied.",
    ),
    *("an honest sensor", "found rightly", "off for so long", "rules for what lasts", "managers at one price"),
    *("Ours isolates more.", "a voter of your own", "a league of rivals", "the resolver decided", "a singular pattern"),
    *(
        "a known loss",
        "the flight's twin",
        "the least margin",
        "the carrier of a unit",
        "the demand",
        "a box that dies",
    ),
    *("The flight goes on.", "Channel 3 was failed.", "the value, else 3"),
    *("Of four channels two are good.", "What is told of it.", "Whether it flies.", "Who needs more adds it."),
    *("the margin of a requirement",),
)


def test_each_forbidden_word_has_a_sentence_that_shows_it():
    uses = {use for sentence in DIALECT for _, use in words.wrong(sentence)}
    assert [use for _, use in words.FORBIDDEN if use not in uses] == []


@pytest.mark.parametrize("sentence", DIALECT)
def test_a_page_with_a_forbidden_word_is_found(sentence: str, tmp_path: Path):
    page, source = tmp_path / "page.md", tmp_path / "source.py"
    page.write_text(f"# Title\n\n{sentence}\n")
    source.write_text(f'def public():\n    """{sentence}"""\n    print("{sentence} ")\n')
    for path in (page, source):
        assert any(list(words.wrong(text)) for _, _, text in words.texts([path])), path.name


@pytest.mark.parametrize(
    "sentence",
    [
        "The manager isolates channel 3 after eight frames.",
        "What is a frame?",
        "The gain margin is 6 dB.",
        "a singular fault, as Zhang calls it",
        "`league` is now `benchmark`",
        "It counts failed channels.",
    ],
)
def test_a_plain_sentence_is_left_alone(sentence: str, tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text(f"{sentence}\n\n```sh\nrig league  # code is not prose: ours\n```\n")
    assert [list(words.wrong(text)) for _, _, text in words.texts([page]) if list(words.wrong(text))] == []


def test_contributing_describes_every_room():
    rooms = {path.parent.name for path in (ROOT / "rig").glob("*/__init__.py")}
    table = (ROOT / "CONTRIBUTING.md").read_text().partition("| room | holds |")[2].partition("\n\n")[0]
    described = set(re.findall(r"`(\w+)/`", "\n".join(line.split("|")[1] for line in table.splitlines()[2:])))
    assert described == rooms


def contracts() -> list[dict[str, Any]]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]


def test_the_import_contract_has_no_exception():
    assert contracts() and not any("ignore_imports" in one for one in contracts())


def test_the_package_has_thirteen_rooms_and_nothing_else():
    rooms = {path.name for path in (ROOT / "rig").iterdir() if any(path.glob("**/*.py"))}  # not what a move left
    (layers,) = (one["layers"] for one in contracts() if one.get("containers") == ["rig"])
    assert rooms == set(layers) and len(rooms) == 13
    assert {path.name for path in (ROOT / "rig").glob("*.py")} == {"__init__.py", "__main__.py", "errors.py"}


def test_no_name_is_used_for_two_files():
    """But a command's file is named like what it runs, and public names stand in rig/ itself."""
    names = [path.stem for path in SOURCES if path.parent.name not in ("cli", "rig") and path.stem != "__init__"]
    assert sorted(name for name, count in Counter(names).items() if count > 1) == []


def test_the_picture_of_the_rooms_is_that_of_the_imports():
    text = rooms.PAGE.read_text()
    assert text == rooms.page_with(text, rooms.picture())


def test_the_files_that_contributing_names_are_there_and_hold_what_to_look_for():
    page = (ROOT / "CONTRIBUTING.md").read_text()
    asked = re.findall(r"^\| [^|]*\? \| `(\S+)` \| `([^`]+)`", page, re.MULTILINE)
    assert len(asked) >= 25
    assert [(name, text) for name, text in asked if text not in (ROOT / name).read_text()] == []
    named = set(re.findall(r"`((?:rig|tests|docs|aircraft|faults)/[\w/.]+)`", page))
    assert [name for name in sorted(named) if not (ROOT / name).exists()] == []


def test_feet_pounds_and_slugs_stay_in_the_plant_each_with_one_value():
    """A contract on imports does not see JSBSim when another module hands it on."""
    imperial = re.compile(
        r"\b0\.3048|47\.88|14\.59|[-_](fps|psf|ft_sec2)\b|jsbsim\.FG|per_foot|per_slug", re.IGNORECASE
    )
    found = {path.relative_to(ROOT / "rig"): imperial.findall(path.read_text()) for path in SOURCES}
    assert {str(path) for path, words in found.items() if words and path.parts[:2] != ("world", "plant")} == set()
    values = re.compile(r"\b0\.3048|47\.88|14\.59")
    assert [path.name for path in SOURCES if values.search(path.read_text())] == ["imperial.py"]


def test_no_room_has_a_circle_inside():
    """Nor has the house: no module imports, however indirectly, one that imports it, for types or late."""
    graph = grimp.build_graph("rig", cache_dir=None)
    circles = {
        module: graph.find_shortest_chain(imported, module)
        for module in graph.modules
        for imported in graph.find_modules_directly_imported_by(module)
        if graph.chain_exists(imported, module)
    }
    assert len(graph.modules) > 200
    assert circles == {}


def test_every_package_that_is_needed_at_run_time_is_imported():
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    providers = packages_distributions()
    used = {name.lower().replace("_", "-") for module in parsed().imported for name in providers.get(module, [])}
    assert {re.split("[>=<~!]", name)[0] for name in needed} - used == set()


def test_the_package_shows_its_public_names():
    assert set(rig.__all__) <= set(dir(rig))
