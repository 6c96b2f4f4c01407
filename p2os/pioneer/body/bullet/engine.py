"""The one import of PyBullet, without the lines that its library prints, and the settings of its solver."""

import ctypes
import gc
import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from p2os.pioneer.body.contract import STEP_NS
from p2os.pioneer.body.physical import GRAVITY_MPS2
from simbase.timing import NS_PER_S

_STANDARD_OUTPUT, _STANDARD_ERROR = 1, 2
#: Added to the diagonal of the contact problem, which the direct solver needs.
SOFTNESS = 1e-6
#: The share of a depth that is taken back in a step: what was put into a robot does not fling it away.
EASED_OUT = 0.0005


@contextmanager
def _silence(descriptor: int) -> Iterator[None]:
    """Turn a stream of the process away for a moment; what its C library holds back goes the same way."""
    try:
        kept = os.dup(descriptor)
    except OSError:  # closed: nothing can be shown anyway
        yield
        return
    flush = ctypes.CDLL(None).fflush
    flush(None)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, descriptor)
        yield
        flush(None)
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)
        os.close(nowhere)


def _load() -> ModuleType:
    """Import PyBullet with the process's standard error turned away for that moment."""
    # PyBullet needs NumPy and does not report it: a missing one is named first.
    importlib.import_module("numpy")
    with _silence(_STANDARD_ERROR):
        return importlib.import_module("pybullet")


pybullet = _load()

#: Generations of Python's collector: what is not yet old, and all.
YOUNG, OLDEST = 1, 2
MOST_IDLE = 2  # chosen: each keeps 28 MB (measured)


class Clients:
    """The engine's clients, one for each scene: to open one takes 17 ms, and `start_anew` 1 ms.

    A scene and its robots know each other, so that one that nobody uses any more gives its client back when Python's
    collector comes by. To let it look at all there is takes 27 ms (measured, with all of robot_bench loaded; 140 ms in
    a test run), and 1 ms at what is young, as most such scenes are. So the young are looked at first, before more are
    open than can be idle, and nothing is looked at again before twice as many are open than were found in use.
    """

    def __init__(self) -> None:
        #: Clients that no scene uses.
        self._idle: list[int] = []
        self._open, self._most_open = 0, MOST_IDLE

    def take(self) -> int:
        """Return a client for a scene, opened where none is idle; `start_anew` empties it."""
        if not self._idle and self._open >= self._most_open:
            for generation in (YOUNG, OLDEST):
                if not self._idle:
                    gc.collect(generation)
            self._most_open = max(MOST_IDLE, 2 * (self._open - len(self._idle)))
        if self._idle:
            return self._idle.pop()
        self._open += 1
        client: int = pybullet.connect(pybullet.DIRECT)
        return client

    def give_back(self, client: int) -> None:
        """Take a client from a scene that needs it no more."""
        if len(self._idle) < MOST_IDLE:
            self._idle.append(client)
        else:
            self._open -= 1
            pybullet.disconnect(client)


clients = Clients()


def start_anew(client: int, *, robots: int) -> None:
    """Empty a client's world and set its solver, which Bullet announces on standard output.

    The direct solver: Bullet's own iteration ends early, so that wheels slip that need
    not (a line of 1 m 0.11 mm off, a standing robot turning by 74 urad a second), and
    carried on to the same exactness it takes three times as long (measured). Where a
    problem has no direct solution, Bullet falls back on the iteration by itself. Robots that
    do not touch each other are problems of their own: together they would cost the third power of their number.
    """
    apart = {"minimumSolverIslandSize": 1} if robots > 1 else {}
    pybullet.resetSimulation(physicsClientId=client)
    with _silence(_STANDARD_OUTPUT):
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP_NS / NS_PER_S, deterministicOverlappingPairs=1, enableFileCaching=0,
            constraintSolverType=pybullet.CONSTRAINT_SOLVER_LCP_DANTZIG, globalCFM=SOFTNESS, contactERP=EASED_OUT,
            physicsClientId=client, **apart,
        )  # fmt: skip
    pybullet.setGravity(0, 0, -GRAVITY_MPS2, physicsClientId=client)
