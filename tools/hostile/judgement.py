"""What has to hold under each attack, and afterwards."""

import random
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

from tools.hostile import kernel, packets
from tools.hostile.attacks import ATTACKS, Attack
from tools.hostile.browser import MissingProgramError
from tools.hostile.robots import CLIENTS, ROBOTS, faults_of
from tools.hostile.targets import HELD, TARGETS, AttackedVerb, answers_gdb
from tools.hostile.watched import LIMIT_S, KernelWatch, Lateness, SteadyClient, until

#: STOP leaves so soon, beside what this machine is late by itself.
MOST_STOP_S = 0.05
#: The robot sends each 100 ms; a client of good will waits so long at most, beside what the machine is late.
MOST_GAP_S = 0.5
MOST_GROWTH_KB = 64 * 1024
#: Speed that the client of good will asks for, mm/s.
SPEED = 200
#: What no program of ours prints, whatever comes.
NEVER_PRINTED = ("Traceback", "this is a bug")


@dataclass(frozen=True)
class AttackOutcome:
    """What one attack on one target came to."""

    target: str
    phase: str
    attack: str
    faults: list[str]
    #: Nothing was tried: why.
    skipped: str = ""
    #: How long STOP took, seconds.
    stopped_s: float | None = None


def outcomes(
    p2os: str, targets: list[str], attacks: list[str], *, lasts_s: float, seed: int
) -> Iterator[AttackOutcome]:
    """Attack each target, free and held, in each way; be each robot to each client."""
    for name in targets:
        if name in CLIENTS:
            for attack in filter(ROBOTS.get, attacks):
                faults = [*faults_of(p2os, name, attack, random.Random(f"{seed} {name} {attack}"))]
                yield AttackOutcome(name, "robot", attack, faults)
            continue
        for phase in ("free", "held") if name in HELD else ("free",):
            for attack in filter(ATTACKS.get, attacks):
                if ATTACKS[attack].drives and phase == "free" and name in HELD:
                    continue  # who drives a robot that nobody has is its client
                yield _attacked(p2os, name, phase, attack, lasts_s, seed)


def _attacked(p2os: str, name: str, phase: str, attack: str, lasts_s: float, seed: int) -> AttackOutcome:
    try:
        with TARGETS[name](p2os, is_held=phase == "held") as target:
            return _judged(
                target, (name, phase, attack), ATTACKS[attack], lasts_s, random.Random(f"{seed} {name} {attack}")
            )
    except MissingProgramError as error:
        return AttackOutcome(name, phase, attack, [], skipped=str(error))
    except RuntimeError as error:
        return AttackOutcome(name, phase, attack, [str(error)])


def _judged(
    target: AttackedVerb, row: tuple[str, str, str], attack: Attack, lasts_s: float, draw: random.Random
) -> AttackOutcome:
    pid = target.program.pid
    sockets = [each for each in kernel.sockets_of(pid) if each.is_tcp != attack.datagrams]
    if not sockets:
        return AttackOutcome(*row, [], skipped="it has no such socket")
    failed: list[BaseException] = []

    def run() -> None:
        try:
            attack.run(sockets, draw, lasts_s)
        except BaseException as error:  # noqa: BLE001 - raised where it is seen
            failed.append(error)

    since = time.monotonic()
    with KernelWatch(pid) as watch, Lateness() as lateness:
        thread = threading.Thread(target=run)
        thread.start()
        thread.join(lasts_s * 0.6)
        faults = target.turned(since)
        stopped_s = _stopped(target, faults)
        thread.join()
        if failed:
            raise failed[0]
        faults += _served(target)
    if target.client is not None:
        if target.client.is_lost:
            faults.append("the client lost its session")
        elif (gap_s := target.client.longest_gap_s(since)) > MOST_GAP_S + lateness.worst_s:
            faults.append(f"the client heard nothing for {gap_s:.2f} s")
    faults += [f"{each} is reached from other machines" for each in sorted(watch.reached)]
    if watch.grown_kb > MOST_GROWTH_KB:
        faults.append(f"its memory grew by {watch.grown_kb // 1024} MiB")
    if stopped_s is not None and stopped_s > MOST_STOP_S + lateness.worst_s:
        faults.append(f"STOP took {stopped_s * 1000:.0f} ms, this machine was late by {lateness.worst_s * 1000:.0f} ms")
    faults += _ended(target)
    return AttackOutcome(*row, faults, stopped_s=stopped_s)


def _stopped(target: AttackedVerb, faults: list[str]) -> float | None:
    """Have whoever may do so drive and stop, meanwhile; return how long STOP took to the robot, in seconds."""
    if target.client is not None:
        driven = target.client.say(packets.VEL, SPEED)
        seen = target.client.motions
        if not until(lambda: any(at > driven and each.turns for at, each in tuple(seen)), LIMIT_S / 3):
            faults.append("the client's speed moved nothing")
        stopped = target.client.say(packets.STOP)
        if not until(lambda: seen[-1][0] > stopped and not seen[-1][1].turns, LIMIT_S / 3):
            faults.append("the client's STOP did not stop the robot")
    elif target.asking is not None:
        stopped = time.monotonic()
        target.program.process.terminate()
    else:
        return None
    if target.line is None:
        return None
    line = target.line
    until(lambda: line.first(packets.STOP, stopped) is not None, LIMIT_S / 3)
    if (at := line.first(packets.STOP, stopped)) is None:
        faults.append("STOP did not reach the robot")
        return None
    return at - stopped


def _served(target: AttackedVerb) -> list[str]:
    """Return what is wrong once it is over: who comes now is served as ever."""
    faults, program = [], target.program
    if target.ends and not until(lambda: not program.runs or target.ends in program.printed):
        faults.append(f"it did not come to {target.ends}")
    if not program.runs and not target.ends and target.asking is None:
        faults.append(f"it ended with {program.process.returncode}: {program.printed.strip()[-200:]}")
    if program.runs and target.client is None and target.robot is not None:
        try:
            SteadyClient(target.robot).close()
        except (OSError, RuntimeError) as error:
            faults.append(f"afterwards {error}")
    if program.runs and target.debugger is not None and not answers_gdb(target.debugger):
        faults.append("afterwards GDB gets no answer")
    return faults


def _ended(target: AttackedVerb) -> list[str]:
    """Return what is wrong with how it ends, and with what it has printed."""
    program, faults = target.program, []
    if program.runs and (code := program.interrupt()) != 130:
        faults.append(f"a signal ended it with {code}")
    return faults + [f"it printed {each!r}" for each in NEVER_PRINTED if each in program.printed]
