"""Whom the interpreter tells of what: hooks at the bounds of their ranges, one beside another, and full of them."""

import ctypes
from functools import partial

import pytest

from bluepill_sim.core.unicorn_core import Reg, UnicornCore
from bluepill_sim.extension.library import library
from bluepill_sim.native.interpreter_core import InterpreterCore

FLASH, SRAM, BYTES = 0x0800_0000, 0x2000_0000, 0x400
#: LDRB R0, [R1]; STRB R0, [R1]; BKPT.
LOAD, STORE, BKPT = "0878", "0870", "00be"
#: chosen, as in C: how many regions and hooks there is room for.
REGIONS, HOOKS = 64, 512


def core_of(kind: type[UnicornCore], code: str) -> tuple[UnicornCore, "ctypes.Array[ctypes.c_char]"]:
    """Return a core with a memory of code and one of data, which a BKPT stops."""
    core = kind(_raise)
    data = ctypes.create_string_buffer(bytes(range(256)) * 4, BYTES)
    core.map_memory(FLASH, ctypes.create_string_buffer(bytes.fromhex(code).ljust(BYTES, b"\0"), BYTES), "rx")
    core.map_memory(SRAM, data, "rwx")
    core.on_interrupt(lambda _number: core.stop())
    core.registers[Reg.CPSR] = core.registers[Reg.CPSR] | 0x20
    return core, data


def _raise(error: BaseException) -> None:
    raise error


both = pytest.mark.parametrize("kind", [UnicornCore, InterpreterCore])


@both
@pytest.mark.parametrize("access", [LOAD, STORE])
def test_an_access_is_reported_to_the_hooks_in_whose_range_it_begins(kind: type[UnicornCore], access: str) -> None:
    core, _ = core_of(kind, access + BKPT)
    heard: list[tuple[str, int, int, int, int]] = []
    core.on_access(SRAM + 0x10, SRAM + 0x13, lambda *seen: heard.append(("a", *seen)) or True)
    core.on_access(SRAM + 0x13, SRAM + 0x13, lambda *seen: heard.append(("b", *seen)) or True)
    reported, value = (16, 0) if access == LOAD else (17, 0xA5)
    for offset, names in ((0x0F, ""), (0x10, "a"), (0x12, "a"), (0x13, "ab"), (0x14, "")):
        heard.clear()
        core.registers[Reg.R0], core.registers[Reg.R1] = 0x9FA5, SRAM + offset
        core.start(FLASH | 1)
        assert heard == [(name, reported, SRAM + offset, 1, value) for name in names], offset


@both
def test_a_failed_access_is_reported_to_the_hooks_in_whose_range_it_is(kind: type[UnicornCore]) -> None:
    core, _ = core_of(kind, LOAD + BKPT)
    nothing = 0x3000_0000
    heard: list[str] = []
    hook = core.on_bad_access(lambda *_: heard.append("a") is not None, nothing + 0x10, nothing + 0x13)
    core.on_bad_access(lambda *_: heard.append("b") is not None, nothing + 0x13, nothing + 0x13)
    for offset, names in ((0x0F, ""), (0x10, "a"), (0x12, "a"), (0x13, "ab"), (0x14, "")):
        heard.clear()
        core.registers[Reg.R1] = nothing + offset
        core.registers[Reg.R0] = 7
        assert core.start(FLASH | 1) == 6
        assert "".join(heard) == names, offset
        assert core.registers[Reg.R0] == 7
        assert core.registers[Reg.PC] == FLASH
    core.remove_hook(hook)
    heard.clear()
    core.registers[Reg.R1] = nothing + 0x13
    core.start(FLASH | 1)
    assert heard == ["b"], "what was taken away is not asked, and the other is"


@both
def test_an_access_that_a_hook_lets_pass_is_made_where_something_is_by_then(kind: type[UnicornCore]) -> None:
    """The first that lets it pass is the last that is asked; without memory it fails all the same."""
    core, _ = core_of(kind, LOAD + BKPT)
    heard: list[str] = []
    memory = ctypes.create_string_buffer(b"\x5a" * BYTES, BYTES)
    makes = True

    def first(_kind: int, address: int, _size: int, _value: int) -> bool:
        heard.append("a")
        if makes:
            core.map_memory(address & ~(BYTES - 1), memory, "rw")
        return makes

    core.on_bad_access(first)
    core.on_bad_access(lambda *_: heard.append("b") is not None)
    core.registers[Reg.R1] = 0x3000_0010
    assert core.start(FLASH | 1) == 0
    assert (core.registers[Reg.R0], heard) == (0x5A, ["a"])
    makes = False
    heard.clear()
    core.registers[Reg.R1] = 0x3001_0010
    assert core.start(FLASH | 1) == 6
    assert heard == ["a", "b"]


@both
def test_an_instruction_is_reported_to_the_hooks_in_whose_range_it_begins(kind: type[UnicornCore]) -> None:
    """ADDS R0, #1 five times, of which the second has 32 bits; and a stop is before the instruction."""
    core, _ = core_of(kind, "0130 10f10100 0130 0130 0130" + BKPT)
    heard: list[tuple[str, int, int]] = []
    places = [FLASH + at for at in (0, 2, 6, 8, 10)]

    def hear(name: str) -> ctypes.c_void_p:
        return core.instruction_callback(lambda address: heard.append((name, address, core.registers[Reg.R0])))

    core.hook_instructions(hear("a"), places[1], places[2])
    core.hook_instructions(hear("b"), places[2], places[2])
    core.hook_instructions(hear("c"), 1, 0)
    core.registers[Reg.R0] = 0
    core.start(FLASH | 1)
    expected = [("c",), ("a", "c"), ("a", "b", "c"), ("c",), ("c",)]
    reported = [
        (name, place, n) for n, (place, names) in enumerate(zip(places, expected, strict=True)) for name in names
    ]
    assert heard[:-1] == reported
    assert heard[-1] == ("c", FLASH + 12, 5), "the BKPT"
    core.drop_all_code()
    core.hook_instructions(core.instruction_callback(lambda _address: core.stop()), places[3], places[3])
    heard.clear()
    core.registers[Reg.R0] = 0
    core.start(FLASH | 1)
    assert (core.registers[Reg.R0], core.registers[Reg.PC]) == (3, places[3])


def test_the_size_of_an_instruction_is_reported() -> None:
    core, _ = core_of(InterpreterCore, "0130 10f10100" + BKPT)
    sizes: list[tuple[int, int]] = []
    callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint32, ctypes.c_void_p)(
        lambda _uc, address, size, _user: sizes.append((address - FLASH, size))
    )
    core.hook_instructions(ctypes.cast(callback, ctypes.c_void_p), 1, 0)
    core.start(FLASH | 1)
    assert sizes == [(0, 2), (2, 4), (6, 2)]


def test_the_hooks_behind_one_that_stops_the_run_are_not_called() -> None:
    """Of two hooks of a kind, the only ones that there are, the first hears of it, and the second does not."""
    for add in ("on_block", "on_interrupt", "on_invalid", "on_bad_access", "instruction", "access"):
        core = InterpreterCore(_raise)
        code = bytes.fromhex("00de" if add == "on_invalid" else LOAD + BKPT)  # UDF
        core.map_memory(FLASH, ctypes.create_string_buffer(code.ljust(BYTES, b"\0"), BYTES), "rx")
        core.map_memory(SRAM, ctypes.create_string_buffer(BYTES), "rwx")
        core.registers[Reg.R1] = SRAM
        heard: list[int] = []

        def hear(n: int, *_: int, core: InterpreterCore = core, heard: list[int] = heard) -> bool:
            heard.append(n)
            core.stop()
            return True

        for n in range(2):
            call = partial(hear, n)
            if add == "instruction":
                core.hook_instructions(core.instruction_callback(call), FLASH, FLASH)
            elif add == "access":
                core.on_access(SRAM, SRAM, call)
            elif add == "on_bad_access":
                core.registers[Reg.R1] = 0x3000_0000
                core.on_bad_access(call)
            else:
                getattr(core, add)(call)
        core.start(FLASH | 1)
        assert heard == [0], add


def test_there_is_room_for_so_many_hooks_and_regions_and_no_more() -> None:
    core = InterpreterCore(_raise)
    hooks = [core.on_bad_access(lambda *_: False) for _ in range(HOOKS)]
    assert len({*hooks}) == HOOKS
    assert 0 not in hooks
    with pytest.raises(RuntimeError, match="no room"):
        core.on_bad_access(lambda *_: False)
    core.remove_hook(hooks[5])
    assert core.on_bad_access(lambda *_: False) not in hooks
    pages = [ctypes.create_string_buffer(bytes([n]) * BYTES, BYTES) for n in range(REGIONS)]
    for n, page in enumerate(pages[:-1]):  # the core has mapped one itself
        core.map_memory(SRAM + BYTES * n, page, "rwx")
    with pytest.raises(Exception, match="map 0x"):
        core.map_memory(SRAM + BYTES * REGIONS, pages[-1], "rwx")
    core._unmap(0x4000_0000, BYTES)  # nothing is there: nothing goes
    with pytest.raises(Exception, match="map 0x"):
        core.map_memory(SRAM + BYTES * REGIONS, pages[-1], "rwx")
    core._unmap(SRAM + BYTES * 3, BYTES)
    core.map_memory(SRAM + BYTES * REGIONS, pages[-1], "rwx")
    core.remove_hook(max(hooks) + 1000)  # nor does a hook that there is not
    with pytest.raises(RuntimeError, match="no room"):
        core.on_bad_access(lambda *_: False)


@both
def test_what_was_mapped_last_hides_what_is_below(kind: type[UnicornCore]) -> None:
    core, data = core_of(kind, LOAD + BKPT)
    core.registers[Reg.R1] = SRAM + 0x33
    core.start(FLASH | 1)
    assert core.registers[Reg.R0] == 0x33
    if kind is InterpreterCore:
        over = ctypes.create_string_buffer(b"\x77" * BYTES, BYTES)
        core.map_memory(SRAM, over, "rx")
        core.on_access(SRAM + 0x100, SRAM + 0x100, lambda *_: True)  # no access at once
        core.start(FLASH | 1)
        assert core.registers[Reg.R0] == 0x77
        core._unmap(SRAM, BYTES)
    assert data.raw[0x33] == 0x33


#: UDIV, SDIV R0, R1, R2; LDM, STM, LDRD, STRD of R3 and R4 at R5; and what tells of each: alignment, and which value.
TRAPS = {
    "b1fbf2f0": (False, 0), "91fbf2f0": (False, 0), "95e81800": (True, SRAM + 2), "85e81800": (True, SRAM + 2),
    "d5e90034": (True, SRAM + 2), "c5e90034": (True, SRAM + 2),
}  # fmt: skip


@pytest.mark.parametrize("code", TRAPS)
@pytest.mark.parametrize("stops", [True, False])
def test_a_trap_is_reported_before_its_instruction_which_is_done_where_nobody_stops_it(
    code: str, *, stops: bool
) -> None:
    core, data = core_of(InterpreterCore, "013f" + code + "013e" + BKPT)  # SUBS R7, #1; SUBS R6, #1
    before = data.raw
    reported: list[tuple[bool, int, int]] = []

    def trapped(_user: int, is_alignment: bool, pc: int, value: int) -> None:
        reported.append((is_alignment, pc, value))
        if stops:
            core.stop()

    callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_bool, ctypes.c_uint32, ctypes.c_uint32)(trapped)
    library().interpreter_set_trap(core.handle, ctypes.cast(callback, ctypes.c_void_p), None)
    names = {Reg.R0: 9, Reg.R1: 8, Reg.R2: 0, Reg.R3: 3, Reg.R4: 4, Reg.R5: SRAM + 2, Reg.R6: 6, Reg.R7: 7}
    for name, value in names.items():
        core.registers[name] = value
    core.start(FLASH | 1)
    is_alignment, value = TRAPS[code]
    assert reported == [(is_alignment, FLASH + 2, value)]
    left = {name: core.registers[name] for name in names}
    if stops:
        assert left == names | {Reg.R7: 6}
        assert core.registers[Reg.PC] == FLASH + 2
        assert data.raw == before
    else:
        assert (left[Reg.R6], left[Reg.R7]) == (5, 6)
        assert left[Reg.R0] == (9 if is_alignment else 0)
        if code[0] in "9d" and is_alignment:
            assert left[Reg.R3].to_bytes(4, "little") + left[Reg.R4].to_bytes(4, "little") == before[2:10]
        elif is_alignment:
            assert data.raw[2:10] == b"\3\0\0\0\4\0\0\0"


@pytest.mark.parametrize("code", TRAPS)
def test_no_trap_is_reported_where_there_is_none(code: str) -> None:
    core, _ = core_of(InterpreterCore, code + BKPT)
    reported: list[int] = []
    callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_bool, ctypes.c_uint32, ctypes.c_uint32)(
        lambda *_: reported.append(1)
    )
    library().interpreter_set_trap(core.handle, ctypes.cast(callback, ctypes.c_void_p), None)
    core.registers[Reg.R1], core.registers[Reg.R2], core.registers[Reg.R5] = 0, 1, SRAM + 4
    core.start(FLASH | 1)
    assert reported == []
