"""Who holds a run at a halt, the page or GDB: time goes on while neither does, and GDB is told of each halt once."""

from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from robot_bench.cli.debugging.holds import Holds


class HoldsMachine(RuleBasedStateMachine):
    """Two people at one run, as a set of names that hold it."""

    def __init__(self) -> None:
        super().__init__()
        self.holds = Holds(waits_for_gdb=True)
        #: Who holds; GDB that is not there holds as "nobody".
        self.holders = {"nobody"}
        self.is_there = False

    @rule()
    def page_runs(self) -> None:
        self.holds.page_runs()
        self.holders -= {"page", "nobody"}

    @rule()
    def page_holds(self) -> None:
        self.holds.page_holds()
        self.holders |= {"page"}

    @precondition(lambda self: not self.is_there)
    @rule()
    def gdb_comes(self) -> None:
        self.holds.gdb_comes()
        self.is_there, self.holders = True, self.holders - {"nobody"} | {"gdb"}

    @precondition(lambda self: "gdb" in self.holders)
    @rule()
    def gdb_continues(self) -> None:
        self.holds.gdb_continues()
        self.holders -= {"gdb"}

    @rule()
    def the_run_stands(self) -> None:
        is_notified = self.is_there and "gdb" not in self.holders
        assert self.holds.stands() is is_notified
        assert not self.holds.stands(), "once"
        self.holders |= {"gdb"} if self.is_there else set()

    @precondition(lambda self: self.is_there)
    @rule()
    def gdb_detaches(self) -> None:
        self.holds.gdb_leaves(is_lost=False)
        self.is_there, self.holders = False, self.holders - {"gdb"}

    @precondition(lambda self: self.is_there)
    @rule()
    def gdb_is_lost(self) -> None:
        self.holds.gdb_leaves(is_lost=True)
        self.is_there, self.holders = False, self.holders - {"gdb"} | {"nobody"}

    @invariant()
    def time_goes_on_where_nobody_holds(self) -> None:
        assert self.holds.is_free is (not self.holders)
        assert self.holds.by_page is ("page" in self.holders)
        assert self.holds.is_shown_to_gdb is ("gdb" in self.holders)
        assert self.holds.gdb_goes is (self.is_there and "gdb" not in self.holders)


TestHolds = HoldsMachine.TestCase
TestHolds.settings = settings(max_examples=30, stateful_step_count=20)
