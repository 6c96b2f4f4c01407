"""The documentation is true: its examples run, its command lines exist, its links lead somewhere.

tests/documentation/session.py says how the blocks of a page are run, tests/documentation/page.py how a block
that cannot run here says so.
"""

import re
import runpy
import tomllib
from functools import cache

import pytest

from simbase.command_line.help_pages import PROGRAM
from tests.documentation import command_lines
from tests.documentation.page import ROOT, RUN, Page, pages
from tests.documentation.session import run_blocks

KEPT = {"", "text"}  # drawings, and what is no program
PAGES = pages()
#: What a fresh machine has not, so that a block may stand unexecuted.
REASONS = re.compile(r"needs (hardware|the network|an ESP32|an FTDI adapter|a game pad)\b")
#: The test that runs all blocks of a page, where some are slow.
LONG = "test_the_long_examples_of_a_page_run_among_the_others"
CHECKOUT = re.compile(r"(?:p2os|robot_bench|bluepill_sim|adapter_sim|adapter_fw|hardware|tests|tools|docs)/[\w./-]+")


@cache
def extras() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return set(project["optional-dependencies"])


def run(page: Page, pace: int) -> None:
    missing = run_blocks(page, pace)
    if missing:
        pytest.skip(f"all ran but what needs a program that is not installed: {missing}")


def runnable(pace: int) -> list[Page]:
    return [page for page in PAGES if any(block.is_run and block.pace == pace for block in page.blocks)]


@pytest.mark.parametrize("page", runnable(0), ids=str)
def test_the_examples_of_a_page_run(page: Page, request: pytest.FixtureRequest) -> None:
    if any(f"{LONG}[{page}]" == item.name for item in request.session.items):
        pytest.skip("they run among the long ones")
    run(page, 0)


@pytest.mark.slow
@pytest.mark.parametrize("page", runnable(1), ids=str)
def test_the_long_examples_of_a_page_run_among_the_others(page: Page) -> None:
    run(page, 1)


@pytest.mark.soak
@pytest.mark.parametrize("page", runnable(2), ids=str)
def test_all_examples_of_a_page_run(page: Page) -> None:
    run(page, 2)


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_a_block_has_a_language_that_is_run_and_only_hardware_or_the_network_keeps_it_from_running(page: Page) -> None:
    for block in page.blocks:
        place = f"{page}:{block.line}"
        assert block.language in RUN | KEPT, f"{place}: nothing runs a block of {block.language}"
        if block.language in KEPT:
            assert not re.search(r"(?m)^(\$ )?(p2os|python3?|make|pip|pytest) ", block.text), f"{place}: make it `sh`"
        reason = block.note("not run")
        assert reason is None or REASONS.match(reason), f"{place}: not run, and {reason!r} names no hardware or network"


def test_the_command_lines_of_all_pages_name_verbs_and_options_that_exist() -> None:
    group = command_lines.command_line()
    found = []
    for page in PAGES:
        blocks = [
            (block.line, line)
            for block in page.blocks if block.language in {"console", "sh"} for line, _ in block.entries
        ]  # fmt: skip
        for number, line in [*page.spans(), *blocks]:
            if line.startswith("p2os "):
                found += [f"{page}:{number}: {fault}" for fault in command_lines.faults(line, group)]
    assert not found, "\n".join(found)


def test_the_examples_in_the_help_of_each_verb_name_verbs_and_options_that_exist() -> None:
    group = command_lines.command_line()
    found = []
    for name, command in sorted(group.commands.items()):
        below = getattr(command, "commands", {}).values()
        for each in (command, *below):
            text = f"{each.help}\n{each.epilog}".replace(PROGRAM, f"p2os {name}")
            for line in re.findall(r"(?m)^ *(p2os .*?)(?: {2,}|$)", text):
                found += [f"{name}: {fault}" for fault in command_lines.faults(line, group)]
    assert not found, "\n".join(found)


def test_options_files_and_targets_that_pages_name_exist() -> None:
    known = command_lines.all_options(command_lines.command_line())
    sources = "".join(
        path.read_text(encoding="utf-8")
        for folder in ("tools", "hardware", "adapter_fw") for suffix in ("*.py", "*.cpp")
        for path in (ROOT / folder).rglob(suffix)
    )  # fmt: skip
    makefiles = (ROOT / "Makefile", ROOT / "robot_bench" / "cli" / "project" / "template" / "Makefile")
    targets = {name for file in makefiles for name in re.findall(r"(?m)^([a-z-]+):", file.read_text(encoding="utf-8"))}
    ignored = (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    found = []
    for page in PAGES:
        for number, span in page.spans():
            place = f"{page}:{number}: `{span}`"
            option = re.match(r"--[a-z-]+", span)
            if option and option[0] not in known and f'"{option[0]}' not in sources:
                found.append(f"{place}: no such option")
            target = re.fullmatch(r"make ([a-z-]+)", span)
            if target and target[1] not in targets:
                found.append(f"{place}: no such target")
            found += [f"{place}: no such extra" for extra in re.findall(r"\[(\w+)\]['\"]?$", span)
                      if span.startswith("pip ") and extra not in extras()]  # fmt: skip
            for path in re.findall(r"^\S+$|(?<=^python )\S+|(?<=^pytest )\S+", span):
                if CHECKOUT.fullmatch(path) and not (ROOT / path).exists() and path not in ignored:
                    found.append(f"{place}: no such file")
    assert not found, "\n".join(found)


def test_links_lead_to_files_and_headings_that_exist() -> None:
    anchors = {page.path: page.anchors for page in PAGES}
    found = []
    for page in PAGES:
        for number, name, anchor in page.links():
            target = (page.path.parent / name).resolve() if name else page.path
            if not target.exists():
                found.append(f"{page}:{number}: no {name}")
            elif anchor and anchor not in anchors.get(target, set()):
                found.append(f"{page}:{number}: no heading #{anchor} in {target.name}")
    assert not found, "\n".join(found)


def test_the_table_of_verbs_has_every_verb() -> None:
    table = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8").partition("\n## ")[0]
    rows = " ".join(line.split("|")[1] for line in table.splitlines() if line.startswith("| "))
    assert set(re.findall(r"`([a-z-]+)`", rows)) == set(command_lines.command_line().commands)


def test_the_ranges_in_the_pages_are_those_that_the_readers_check_by() -> None:
    generator = runpy.run_path(str(ROOT / "tools" / "generators" / "ranges.py"))
    texts = [path.read_text(encoding="utf-8") for path in generator["PAGES"]]
    assert sorted(re.findall(r"<!-- (?:ranges|table): ([a-z ]+) -->", "".join(texts))) == sorted(generator["tables"]())
    assert [generator["page"](text) for text in texts] == texts, "run `make generated`"
