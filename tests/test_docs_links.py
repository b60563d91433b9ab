"""Every relative link of README, CONTRIBUTING and docs/ leads to a file that is there, and its anchor to a heading."""

import re
from pathlib import Path

import measured
import pytest

ROOT = Path(__file__).parent.parent
BESIDE = {
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
}  # pages of the site that are beside docs/
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)


def slug(heading: str) -> str:
    """The anchor of a heading, as GitHub and the site make it."""
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", plain).strip().lower())


def anchors(page: Path) -> set[str]:
    return {slug(heading) for heading in re.findall(r"^#+ (.*)$", FENCE.sub("", page.read_text()), re.MULTILINE)}


def broken(page: Path) -> list[str]:
    """The links of ``page`` that lead nowhere."""
    found = []
    for link in re.findall(r"\]\(([^)\s]+)\)", FENCE.sub("", page.read_text())):
        target, _, anchor = link.partition("#")
        file = (page.parent / target) if target else page
        if file.parent.name == "project" and file.name in BESIDE:
            file = ROOT / BESIDE[file.name]
        if "://" not in link and (not file.exists() or (anchor and anchor not in anchors(file))):
            found.append(link)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_link_and_anchor_resolves(page: Path):
    assert broken(page) == []


def test_a_link_to_no_file_and_one_to_no_heading_are_found(tmp_path: Path):
    (tmp_path / "there.md").write_text("# A `heading`, here\n")
    page = tmp_path / "page.md"
    page.write_text("# Top\n[a](there.md#a-heading-here) [b](#top) [c](gone.md) [d](there.md#gone) [e](https://x.y)\n")
    assert broken(page) == ["gone.md", "there.md#gone"]


PICTURES = sorted((ROOT / "docs").rglob("*.svg"))


@pytest.mark.parametrize("picture", PICTURES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_link_of_a_picture_resolves(picture: Path):
    links = re.findall(r"href=[\"']([^\"'#]+)[^\"']*[\"']", picture.read_text())
    assert [link for link in links if "://" not in link and not (picture.parent / link).exists()] == []


def test_what_the_pages_link_to_is_on_the_site():
    """Of the folder of examples the site has what mkdocs.yml names."""
    rules = (ROOT / "mkdocs.yml").read_text().partition("exclude_docs: |\n")[2].partition("hooks:")[0].split()
    assert rules[0] == "examples/*"
    kept = {rule.removeprefix("!") for rule in rules[1:]}
    linked = {
        (page.parent / link).resolve().relative_to(ROOT / "docs").as_posix()
        for page in PAGES
        for link in re.findall(r"\]\(([^)\s#]+)[^)]*\)", FENCE.sub("", page.read_text()))
        if "examples/" in link and "://" not in link
    }
    assert linked == kept


def test_the_site_shows_every_page_once():
    nav = (ROOT / "mkdocs.yml").read_text().partition("nav:")[2]
    shown = re.findall(r": ([\w/.-]+\.md)", nav)
    pages = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert sorted(shown) == sorted(pages | {"project/contributing.md", "project/changelog.md"})


def test_measured_pages_are_few_and_short():
    lines = {
        path.name: len(path.read_text().splitlines()) for path in (ROOT / "docs" / "results" / "measured").glob("*.md")
    }
    assert {name.removesuffix(".md") for name in lines} == {*measured.PAGES, "index", "worst"}
    tables = {"worst.md", "reliability.md"}  # a row for each search; managers, signals and rates
    assert len(lines) <= 13 and max(count for name, count in lines.items() if name not in tables) <= 80
    assert lines["reliability.md"] <= 150
