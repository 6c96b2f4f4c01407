"""The states of a connection, and its transitions as tables.

Theory of operation. Three numbers do double duty: 0, 1 and 2 are SYNC0, SYNC1
and SYNC2 while the two ends find each other, and PULSE, OPEN and CLOSE once the
session is open. The robot (server) echoes SYNC0 and SYNC1 and answers SYNC2 with
its identity; SYNC0 restarts it at any time before OPEN, a sync out of order gets
no answer, and a sync repeated (because its echo was lost) is answered again. Once
open, SYNC0 *is* a PULSE: a client that finds the robot streaming has to stop it
and CLOSE first.

Source: Pioneer 2/3 H8 manual, pages 42 and 43; Pioneer 3 manual, page 33.
"""

from collections.abc import Mapping
from enum import Enum

SYNC0, SYNC1, SYNC2 = 0, 1, 2


class Role(Enum):
    """Which end of the line a connection is."""

    CLIENT = "client"
    SERVER = "server"


class ConnectionState(Enum):
    """Where a connection stands."""

    #: Nothing is under way; a server waits for SYNC0.
    CLOSED = "closed"
    #: Server: SYNC0 was echoed. Client: SYNC0 is out.
    SYNC0 = "sync0"
    #: Server: SYNC1 was echoed. Client: SYNC1 is out.
    SYNC1 = "sync1"
    #: Client: SYNC2 is out.
    SYNC2 = "sync2"
    #: The identity was said; OPEN is next.
    SYNCED = "synced"
    #: Packets flow.
    OPEN = "open"
    #: Client: CLOSE was sent to a robot that streams; SYNC0 follows.
    RECOVERING = "recovering"
    #: Client: the session went silent.
    LOST = "lost"
    #: Client: nobody answered.
    FAILED = "failed"


class Reply(Enum):
    """What a server does beside changing its state."""

    #: Send the frame back.
    ECHO = "echo"
    #: Say name, class and subclass.
    IDENTIFY = "identify"
    #: Tell the owner that the session is open.
    OPEN = "open"
    #: Tell the owner that it is closed.
    CLOSE = "close"
    #: Hand the command to the owner.
    COMMAND = "command"


_S = ConnectionState

#: Server: (state, bare number) → (next state, reply). What is not here is ignored and counted.
SERVER_TABLE: Mapping[tuple[ConnectionState, int], tuple[ConnectionState, Reply]] = {
    (_S.CLOSED, SYNC0): (_S.SYNC0, Reply.ECHO),
    (_S.SYNC0, SYNC0): (_S.SYNC0, Reply.ECHO),
    (_S.SYNC1, SYNC0): (_S.SYNC0, Reply.ECHO),
    (_S.SYNCED, SYNC0): (_S.SYNC0, Reply.ECHO),
    (_S.SYNC0, SYNC1): (_S.SYNC1, Reply.ECHO),
    (_S.SYNC1, SYNC1): (_S.SYNC1, Reply.ECHO),
    (_S.SYNC1, SYNC2): (_S.SYNCED, Reply.IDENTIFY),
    (_S.SYNCED, SYNC2): (_S.SYNCED, Reply.IDENTIFY),
    (_S.SYNCED, SYNC1): (_S.OPEN, Reply.OPEN),
    (_S.OPEN, SYNC0): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC1): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC2): (_S.CLOSED, Reply.CLOSE),
}

#: Server: the same numbers with an argument, as ARIA sends OPEN and CLOSE.
SERVER_ARGUMENT_TABLE: Mapping[tuple[ConnectionState, int], tuple[ConnectionState, Reply]] = {
    (_S.SYNCED, SYNC1): (_S.OPEN, Reply.OPEN),
    (_S.SYNC0, SYNC2): (_S.CLOSED, Reply.CLOSE),
    (_S.SYNC1, SYNC2): (_S.CLOSED, Reply.CLOSE),
    (_S.SYNCED, SYNC2): (_S.CLOSED, Reply.CLOSE),
    (_S.OPEN, SYNC0): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC1): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC2): (_S.CLOSED, Reply.CLOSE),
}

#: Server that answers syncs in any order before OPEN, as AMRISim does, which follows its client's number.
LENIENT_TABLE: Mapping[tuple[ConnectionState, int], tuple[ConnectionState, Reply]] = {
    **{(state, SYNC0): (_S.SYNC0, Reply.ECHO) for state in (_S.CLOSED, _S.SYNC0, _S.SYNC1, _S.SYNCED)},
    **{(state, SYNC1): (_S.SYNC1, Reply.ECHO) for state in (_S.CLOSED, _S.SYNC0, _S.SYNC1)},
    **{(state, SYNC2): (_S.SYNCED, Reply.IDENTIFY) for state in (_S.CLOSED, _S.SYNC0, _S.SYNC1, _S.SYNCED)},
    (_S.SYNCED, SYNC1): (_S.OPEN, Reply.OPEN),
    (_S.OPEN, SYNC0): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC1): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC2): (_S.CLOSED, Reply.CLOSE),
}

#: Client: (state, packet type) → next state while synchronising; a late echo of an earlier sync is no news.
CLIENT_TABLE: Mapping[tuple[ConnectionState, int], ConnectionState] = {
    (_S.SYNC0, SYNC0): _S.SYNC1,
    (_S.SYNC1, SYNC1): _S.SYNC2,
    (_S.SYNC2, SYNC2): _S.SYNCED,
}

#: Client: the sync that is out in each state.
SYNC_OF_STATE: Mapping[ConnectionState, int] = {_S.SYNC0: SYNC0, _S.SYNC1: SYNC1, _S.SYNC2: SYNC2}
