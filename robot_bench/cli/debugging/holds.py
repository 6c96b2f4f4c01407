"""Who holds a run at a halt: its page, GDB, or both. Passive: whoever runs it asks.

Theory of operation. Each of the two lets the run go, or holds it; time goes on while neither holds. GDB cannot be told
that what it was shown is no more: while it stands at its prompt, nothing but its own commands may move the run. Once it
has said `continue` or a step, it hears nothing until the run, let go, stands still again.

    what happens         the page     GDB, attached      GDB, not attached
    page runs            goes         as it was          goes
    page holds           holds        as it was          as it was
    GDB comes            as it was    holds              -
    GDB continues        as it was    goes               -
    run stands again     as it was    holds              as it was
    GDB detaches         as it was    not attached, goes -
    GDB's line is lost   as it was    not attached, holds, until the page runs

Invariant: `is_free` is that neither holds.
"""


class Holds:
    """Who holds a run.

    Args:
        waits_for_gdb: Whether it stands until GDB comes, or the page lets it go.
    """

    def __init__(self, *, waits_for_gdb: bool = False) -> None:
        self.by_page = False
        self.by_gdb = waits_for_gdb
        self.is_attached = False

    @property
    def is_free(self) -> bool:
        """Whether time goes on."""
        return not self.by_page and not self.by_gdb

    @property
    def is_shown_to_gdb(self) -> bool:
        """Whether GDB stands at its prompt: what it was shown has to stay."""
        return self.is_attached and self.by_gdb

    @property
    def gdb_goes(self) -> bool:
        """Whether GDB waits for a halt."""
        return self.is_attached and not self.by_gdb

    def page_runs(self) -> None:
        """Take that the page lets go; nobody else can where GDB is not there."""
        self.by_page = False
        self.by_gdb = self.by_gdb and self.is_attached

    def page_holds(self) -> None:
        """Take that the page holds."""
        self.by_page = True

    def gdb_comes(self) -> None:
        """Take that GDB is there: it begins at a halt."""
        self.is_attached = self.by_gdb = True

    def gdb_continues(self) -> None:
        """Take that GDB lets go."""
        self.by_gdb = False

    def stands(self) -> bool:
        """Take that the run stands still; return whether GDB is to be told."""
        is_notified = self.gdb_goes
        self.by_gdb = self.by_gdb or is_notified
        return is_notified

    def gdb_leaves(self, *, is_lost: bool) -> None:
        """Take that GDB is there no more: it has detached, or its line is lost, which lets nothing go."""
        self.is_attached, self.by_gdb = False, is_lost
