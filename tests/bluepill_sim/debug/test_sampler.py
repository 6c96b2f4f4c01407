"""Variables are looked at once a period, whatever the slices, and told where they are others."""

from bluepill_sim.debug.sampler import VariableSampler
from bluepill_sim.program.variables import NumberForm, Variable


class Memory:
    """A board of four bytes."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.data = bytes(4)

    def read_memory(self, address: int, size: int) -> bytes | None:
        return self.data[address : address + size] if address + size <= len(self.data) else None


def variable(name: str, address: int) -> Variable:
    return Variable(name=name, type_name="", address=address, size=1, encoding=NumberForm.UNSIGNED)


def test_a_look_a_period_tells_what_has_changed_and_after_a_step_back_all() -> None:
    board, looks = Memory(), list[object]()
    sampler = VariableSampler(board, lambda *look: looks.append(look), period_ns=10)
    assert (sampler.look(3), looks) == (7, [])  # nothing is watched
    board.now_ns = 4
    sampler.watch([variable("a", 0), variable("b", 1), variable("nowhere", 4)])
    assert looks.pop() == (4, True, [("a", 0.0), ("b", 0.0)])
    board.data = b"\1\0\0\0"
    assert (sampler.look(9), looks) == (1, [])  # one tick before the next period
    assert sampler.look(10) == 10
    assert looks.pop() == (10, False, [("a", 1.0)])
    assert (sampler.look(19), looks) == (1, [])
    assert (sampler.look(31), looks.pop()) == (9, (31, False, []))
    assert (sampler.look(30), looks.pop()) == (10, (30, True, [("a", 1.0), ("b", 0.0)]))
    sampler.watch([])
    looks.clear()
    assert (sampler.look(99), looks) == (1, [])
