"""Flash and stack of each function of the core stay within committed limits."""

from pathlib import Path

import pytest

from tests.adapter_fw.builds import load_script

SIZES = load_script("adapter_fw/selftest/function_sizes.py")
Size = SIZES.Size
LIMITS = {"core/a f()": Size(48, 32)}


@pytest.mark.slow
def test_the_committed_compiler_gives_no_size_beyond_its_limit() -> None:
    compiler, limits = SIZES.read_table()
    if SIZES.version() != compiler:
        pytest.skip(f"the limits are for {compiler}; here is {SIZES.version() or 'no such compiler'}")
    measured = SIZES.measure()
    assert SIZES.complaints(measured, limits) == []
    frames = [size.ram for name, size in measured.items() if name.startswith("adapter/adapter ")]
    assert max(frames) > 0, "frames are found by name"


@pytest.mark.parametrize(
    ("size", "is_beyond"),
    [(Size(48, 32), False), (Size(49, 32), True), (Size(48, 33), True), (Size(0, 0), False)],
)
def test_a_byte_beyond_a_limit_is_told(size: object, is_beyond: bool) -> None:
    assert bool(SIZES.complaints({"core/a f()": size}, LIMITS)) is is_beyond


def test_what_has_no_limit_and_a_limit_of_nothing_are_told() -> None:
    said = SIZES.complaints({"core/a g()": Size(4, 0)}, LIMITS)
    assert said == ["core/a g(): 4 of flash, 0 of RAM, and no limit", "core/a f(): a limit of what is not there"]


# A tenth above, up to the next 16.
@pytest.mark.parametrize(("measured", "limit"), [(0, 0), (1, 16), (14, 16), (15, 32), (160, 176), (161, 192)])
def test_a_limit_leaves_a_tenth(measured: int, limit: int) -> None:
    assert Size(measured, measured).limit == Size(limit, limit)


def test_a_function_that_grows_is_named(tmp_path: Path) -> None:
    if SIZES.version() is None:
        pytest.skip("gcc-xtensa-lx106 is not installed")
    source = tmp_path / "grown.cpp"
    body = "int sum(const int* v) { volatile int w[%d]; w[0] = v[0]; return w[0]; }\n"
    source.write_text(body % 2, encoding="utf-8")
    ((name, small),) = SIZES.measure((source,)).items()
    source.write_text(body % 80, encoding="utf-8")
    grown = SIZES.measure((source,))
    assert name.endswith("sum(int const*)")
    assert [line.partition(":")[0] for line in SIZES.complaints(grown, {name: small.limit})] == [name]
