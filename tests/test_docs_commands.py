"""The code of every page works as written, and prints and draws what the page shows: tests/tools/pages.py."""

import re
import shutil
from pathlib import Path

import page_outputs
import page_pictures
import pages
import pytest

from rig.core.notes import note

ROOT = Path(__file__).parents[1]
PAGES = [name for name in pages.names() if pages.steps((ROOT / name).read_text()) and name not in pages.NOT_RUN]
PAGE = """# A page

```console
$ cat a.txt # a file
one
...
three
$ ls nothing; echo "exit code $?"
```

```python title="mine.py"
VALUE = 3
```

<!-- python
import mine
-->

```python
print(mine.VALUE)
```

```text
4
```

```sh
# a comment
cp a.txt \\
   b.txt
rig fly --seed 3
```
"""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] if name in pages.LONG else []) for name in PAGES]
)
def test_the_code_of_a_page_does_what_the_page_shows(name: str):
    if re.search(r"^(\$ )?(make -C|cc )", (ROOT / name).read_text(), re.MULTILINE) and not shutil.which("cc"):
        pytest.skip("no C compiler")
    _, _, wrong = pages.run(name)
    assert not wrong, "\n".join(wrong)


def test_every_exception_is_of_something_that_a_page_shows():
    shown = {(step.code, name) for name in pages.names() for step in pages.steps((ROOT / name).read_text())}
    assert pages.EXCEPTIONS.keys() == {key for key in (pages.excepted(*one) for one in shown) if key}
    assert [name for name in (*pages.NOT_RUN, *pages.LONG) if not (ROOT / name).exists()] == []
    assert "README.md" not in pages.LONG  # what is read first is run each time
    assert all(pages.EXCEPTIONS.values()) and all(pages.NOT_RUN.values()) and all(pages.LONG.values())


def test_every_tutorial_runs():
    tutorials = {name for name in pages.names() if "/tutorials/" in name}
    assert len(tutorials) >= 5 and tutorials - pages.NOT_RUN.keys() <= set(PAGES)


def test_what_a_page_runs_is_read_in_its_order():
    read = [(step.kind, step.code.strip(), step.line, step.shown) for step in pages.steps(PAGE)]
    assert read == [
        ("command", "cat a.txt", 4, ["one", "...", "three"]),
        ("command", 'ls nothing; echo "exit code $?"', 8, []),
        ("file mine.py", "VALUE = 3", 12, None),
        ("python", "import mine", 16, None),
        ("python", "print(mine.VALUE)", 20, ["4"]),
        ("command", "cp a.txt b.txt", 29, []),
        ("command", "rig fly --seed 3", 31, []),
    ]


def test_a_page_that_shows_something_else_is_named_with_its_line_and_rewritten():
    page = PAGE.replace("cat a.txt", "cat docs/examples/mine.toml").replace(
        "a.txt", "faults/f16_pitch_rate_hardover.toml"
    )
    page = page.replace("rig fly --seed 3", "rig --version").replace(
        "one\n...\nthree\n", '...\naircraft = "f15"\n...\n'
    )
    text, pictures, wrong = pages.run("page.md", text=page)
    assert pictures == {} and len(wrong) == 2
    assert wrong[0].startswith("page.md:4: cat docs/examples/mine.toml: prints\n") and '+ aircraft = "f16"' in wrong[0]
    assert wrong[1].startswith("page.md:20: print(mine.VALUE): prints\n") and "    - 4\n    + 3" in wrong[1]
    assert text == page.replace("f15", "f16").replace("text\n4\n", "text\n3\n")
    assert pages.run("page.md", text=text)[2] == []


def test_commands_without_output_are_filled_where_that_is_asked():
    text, _, _ = pages.run("page.md", text="```console\n$ cat faults/suites/none; echo $?\n```\n", fill=True)
    assert (
        text
        == "```console\n$ cat faults/suites/none; echo $?\ncat: faults/suites/none: No such file or directory\n1\n```\n"
    )


@pytest.mark.parametrize(
    ("code", "error"),
    [
        ("```sh\nrig fly --sede 3\n```", r"page.md:2: rig fly --sede 3: ValueError: exit code 2: .*--sede"),
        ("```sh\nfrobnicate\n```", r"page.md:2: frobnicate: ValueError: not run: add 'frobnicate'"),
        ("```sh\nrig view --screenshoot a.png\n```", r"page.md:2: .*no option --screenshoot"),
        ("```python\n1 / 0\n```", r"page.md:2: 1 / 0: ZeroDivisionError"),
        ("```toml\na = \n```", r"page.md:2: a = : TOMLDecodeError"),
    ],
)
def test_code_that_does_not_work_is_named_with_its_page_and_line(code: str, error: str):
    with pytest.raises(pages.PageError, match=re.compile(error, re.DOTALL)):
        pages.run("page.md", text=code)


def test_a_note_is_printed_by_every_command():
    note("once")
    assert note.cache_info().currsize
    pages.run("page.md", text="```sh\nrig --version\n```")
    assert not note.cache_info().currsize


@pytest.mark.parametrize(
    ("shown", "matched"),
    [
        (["a", "b", "c", "d"], True),
        (["a", "b", "c"], False),
        (["a", "...", "d"], True),
        (["...", "c", "d"], True),
        (["a", "..."], True),
        (["...", "c"], False),
        (["c", "..."], False),
        (["...", "b", "...", "d"], True),
        (["...", "b", "d"], False),
        (["...", "d", "...", "b", "..."], False),
        (["a", "b", "...", "b", "c", "d"], False),
        (["..."], True),
        ([], False),
    ],
)
def test_a_gap_stands_for_any_lines(shown: list[str], matched: bool):
    assert page_outputs.matches(shown, ["a", "b", "c", "d"]) is matched


def test_a_rewrite_keeps_gaps_and_takes_over_new_words():
    shown = ["20.00 s  channel failed  pitch_rate.3 failed by comparison", "...", "log  logs/a.mcap"]
    printed = [
        "a title",
        "20.01 s  channel isolated  pitch_rate.3 isolated by comparison",
        "more",
        "a digest",
        "log  logs/b.mcap",
    ]
    new = page_outputs.rewritten(shown, printed)
    assert new == ["a title", printed[1], "...", printed[4]] and page_outputs.matches(new, printed)
    assert page_outputs.rewritten(["...", *shown], printed) == ["...", printed[1], "...", printed[4]]
    assert page_outputs.rewritten(["of another command"], printed) == printed


def test_what_varies_is_not_shown(tmp_path: Path):
    lines = ["run time 228.8 us per frame, 44 x real time", "compiling kernels", "read 0.1 s, vote 0.25 s"]
    lines += [
        "20 of 200 runs, 16.6 per second, about 11 s left",
        "40 of 200 runs, 2 lost, 9 per second, about 1 min left",
    ]
    printed = "\n".join([*lines, f"log {tmp_path}/logs/a.mcap  ", "", ""])
    assert page_outputs.normal(printed, tmp_path) == [
        "run time ... us per frame, ... x real time",
        "read ... s, vote ... s",
        "log logs/a.mcap",
    ]


def test_a_picture_has_a_title_and_colours_for_a_dark_page(tmp_path: Path):
    code = "from matplotlib.figure import Figure\nfigure = Figure()\nfigure.subplots().plot([1, 2], [1.0, 2.5])\n"
    page = f"```python\n{code}figure.savefig('line.svg')\n```\n![A line: it rises](line.svg)\n"
    (drawn,) = pages.run("docs/page.md", text=page)[1].items()
    assert drawn[0] == ROOT / "docs" / "line.svg"
    assert '<title id="line-title">A line</title>' in drawn[1] and ">A line: it rises</desc>" in drawn[1]
    assert "prefers-color-scheme: dark" in drawn[1] and 'viewBox="0 0 700 280"' in drawn[1]
    assert "date" not in drawn[1] and drawn[1] == pages.run("docs/page.md", text=page)[1][drawn[0]]
    assert page_pictures.finished(drawn[1], "line", "other") == drawn[1]


def test_the_recording_is_what_its_script_writes():
    import example_channels

    assert example_channels.recorded().write_csv() == example_channels.FILE.read_text()
    assert example_channels.FILE.stat().st_size < 100_000
