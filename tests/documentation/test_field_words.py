"""Words of our own that have gone from names and pages, and what to say in their place."""

import re
import subprocess
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

#: What is said of a thing of the field, by the word that nobody outside knows for it.
IN_PLACE = {
    "told": "reported, notified, commanded",
    "untold": "unexplained, unreported",
    "deed": "action",
    "deeds": "actions",
    "inquest": "analysis",
    "whens": "triggers",
    "hark": "listen, subscribe",
    "dearest": "costliest",
}
#: The same, of several words in a row that a page or a comment may have; alone each of them is English.
PHRASES = {
    r"\bdeeds?\b": "action", r"\binquests?\b": "analysis", r"\bwhens\b": "triggers", r"\bhark\w*\b": "listen",
    r"\bdearest\b": "costliest", r"\b(?:is|are|was|were|be) told of\b": "reported, notified of",
    r"\b(?:is|are|was|were) told (?:as|with|when|where|then|once|in|by)\b": "reported",
}  # fmt: skip
#: This page of words.
OWN = Path(__file__).relative_to(ROOT).as_posix()

#: What holds no names: strings and comments.
NO_NAMES = {
    ".py": re.compile(r'""".*?"""|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|#[^\n]*', re.DOTALL),
    ".c": re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"', re.DOTALL),
}


def tracked(*endings: str) -> list[str]:
    listed = subprocess.run(["git", "ls-files", *endings], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    return [name for name in listed.split("\n") if name and name != OWN and (ROOT / name).is_file()]


def names_of(name: str, text: str) -> set[str]:
    """Return the names in a source; those of tests are sentences."""
    names = re.findall(r"[A-Za-z_]\w*", NO_NAMES[".py" if name.endswith(".py") else ".c"].sub(" ", text))
    return {one for one in names if not one.startswith("test_")}


def words_of(name: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


def said(names: Iterable[str]) -> list[str]:
    return [f"{name}: {IN_PLACE[word]}" for name in sorted(names) for word in words_of(name) if word in IN_PLACE]


@pytest.fixture(scope="module")
def sources() -> dict[str, str]:
    if not tracked("*.py"):
        pytest.skip("no git checkout")
    return {name: (ROOT / name).read_text(encoding="utf-8")
            for name in tracked("*.py", "*.c", "*.h", "*.cpp", "*.hpp", "*.ino")}  # fmt: skip


def test_names_are_words_of_the_field(sources: dict[str, str]) -> None:
    ours = re.compile("|".join(IN_PLACE), re.IGNORECASE)
    found = {name: wrong for name, text in sources.items()
             if ours.search(text) and (wrong := said(names_of(name, text)))}  # fmt: skip
    assert found == {}


def test_pages_comments_and_messages_are_words_of_the_field(sources: dict[str, str]) -> None:
    any_of = re.compile("|".join(PHRASES))
    texts = sources | {name: (ROOT / name).read_text(encoding="utf-8") for name in tracked("*.md", "*.toml")}
    found = [f"{name}: {hit[0]!r}: {instead}" for name, text in texts.items() if not name.startswith("tests/")
             if any_of.search(text)
             for phrase, instead in PHRASES.items() for hit in re.finditer(phrase, text)]  # fmt: skip
    assert found == []


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.py", "def report(told): ..."), ("a.py", "self._is_told = 1"), ("a.py", "class ContactInquest: ..."),
        ("a.py", "MOST_TOLD = 1"), ("a.c", "static bool is_told;"),
    ],
)  # fmt: skip
def test_the_judge_sees_a_word_of_ours(name: str, text: str) -> None:
    assert said(names_of(name, text)) != []


def test_the_judge_passes_english() -> None:
    text = '"""Told apart."""\ndef test_who_asks_is_told(unfolded, toldo): ...  # told\n'
    assert said(names_of("a.py", text)) == []
