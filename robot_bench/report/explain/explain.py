"""Explains a run: chooses what failed first, has its links looked at, and says what came of it.

A run without its firmware, or of a robot on own pins, is explained from its trace alone.

Invariant: the same run gives the same explanation, byte for byte.
"""

import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import cast

from adapter_sim.pinout import WireRole
from bluepill_sim.errors import BluePillError
from robot_bench.events.kinds import Contact, Verdict
from robot_bench.recording.run_record import RunRecord
from robot_bench.report.explain.against import compare
from robot_bench.report.explain.chain import ChainLink, Evidence, Explanation, Standing
from robot_bench.report.explain.contact import ContactAnalysis
from robot_bench.report.explain.findings import Finding, ended, numbers, obeyed
from robot_bench.report.explain.probing import NOTICE_NS, Prober
from robot_bench.report.explain.progress import ProgressAnalysis, fed, words_of
from robot_bench.report.explain.replay import ChipReplay, Hold
from robot_bench.report.explain.scene import Scene
from simbase.errors import P2osError
from simbase.files import sha256_of
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: Goals that a touch decides, and those that want way.
_TOUCH = ("no_collision", "clearance")
_WAY = ("min_distance", "cells", "reach")
#: chosen: inputs are read more seldom than this only by a program that is slow.
_SLOW_NS: Nanos = 60 * NS_PER_MS
#: chosen: a contact so long after a reset may come of it.
_AFTER_RESET_NS: Nanos = 3 * NS_PER_S


def explain(
    record: RunRecord, firmware: Path | None, *, failure: str = "", reference: Path | None = None
) -> Explanation:
    """Return why a run failed, or that it is not known.

    Args:
        record: The run.
        firmware: The program that ran; None where it is not to be had.
        failure: Which failure, a part of its text; empty takes the first.
        reference: A program that does what this one should, to be given the same inputs; None asks for no comparison.

    Raises:
        ImageError: A program cannot be read.
        MissingDependencyError: The emulator is not installed.
        UsageError: The firmware is another one than ran.
    """
    failures = [text for text in cast("Sequence[str]", record.end.get("failures") or ()) if failure in text]
    if not failures and record.contacts and not record.end.get("goals_met"):
        failures = [f"contact with {record.contacts[0]}"]
    limits: list[str] = []
    prober = _prober(record, firmware, limits)
    if not failures:
        says = f"nothing failed that has {failure!r} in it" if failure else "nothing failed"
        return Explanation(
            failure="", standing=Standing.NOTHING, summary=says, also=tuple(_odd(prober)), limits=tuple(limits)
        )
    scene, chosen = Scene(record), failures[0]
    finding, steps = _find(record, scene, prober, chosen)
    if reference is not None and prober is not None:
        steps += compare(prober, reference, _decided(record, chosen))
    return Explanation(
        failure=chosen, standing=Standing.CAUSE if finding.is_cause else Standing.UNKNOWN, summary=finding.says,
        steps=tuple(steps), also=tuple(_odd(prober)), limits=tuple(limits),
    )  # fmt: skip


def cause_in_a_line(record: RunRecord, firmware: Path | None) -> str:
    """Return why a run failed in one line; empty where no cause is found. The bench finds it by its entry point.

    Raises:
        ImageError, MissingDependencyError, UsageError: As `explain`.
    """
    found = explain(record, firmware)
    return found.line if found.standing is Standing.CAUSE else ""


def _prober(record: RunRecord, firmware: Path | None, limits: list[str]) -> Prober | None:
    if firmware is None:
        limits.append("what the program did: its file is not here (--firmware FILE)")
        return None
    wanted = record.meta.get("firmware_sha256")
    if wanted and sha256_of(firmware) != wanted:
        limits.append(f"what the program did: {firmware.name} is another file than the one that ran")
        return None
    try:
        replay = ChipReplay(firmware, record)
    except (P2osError, BluePillError) as error:
        limits.append(f"what the program did: {error}")
        return None
    if replay.exact_until < replay.end:
        limits.append(
            f"what the program did after {replay.exact_until / NS_PER_S:.3f} s: the replay of the chip parts from the "
            "run there, so something acted on it that the trace does not hold"
        )
        if replay.exact_until < NS_PER_S:
            return None
        replay.end = replay.exact_until
    return Prober(replay)


def _find(record: RunRecord, scene: Scene, prober: Prober | None, failure: str) -> tuple[Finding, list[ChainLink]]:
    at = _decided(record, failure)
    if (died := _died(record, prober, at)) is not None:
        return died
    hit = next(iter(record.contacts), None)
    if failure.startswith((*_TOUCH, "contact")) and hit is not None:
        return _contact(scene, prober, hit)
    if failure.partition(":")[0] in _WAY:
        progress = ProgressAnalysis(scene, prober, at)
        return progress.find(), progress.steps
    if failure.startswith("energy:"):
        # A program that takes no notice of anything takes no more work for that.
        return Finding("what took the work is not known", is_cause=False), []
    return _anything(record, scene, prober, at)


def _anything(record: RunRecord, scene: Scene, prober: Prober | None, at: Nanos) -> tuple[Finding, list[ChainLink]]:
    """Look for what keeps a program from anything: wheels that do not obey, a reset, a program that looks no more."""
    steps: list[ChainLink] = []
    found = obeyed(record, scene.step_mps, at, steps)
    if found is not None:
        return found, steps
    if prober is not None:
        at = min(at, prober.replay.end)
        resets = [reset for reset in prober.replay.resets if 0 <= at - reset.at < _AFTER_RESET_NS]
        if resets:
            reset = resets[-1]
            steps.append(ChainLink(t=reset.at, part="firmware",
                                   says=f"is reset by {reset.cause}, while at {reset.place}",
                                   evidence=Evidence.REPLAYED))  # fmt: skip
            tail = fed(prober, reset.cause, steps)
            return Finding(f"{words_of(reset)} reset the chip, {(at - reset.at) / NS_PER_S:.2f} s before{tail}"), steps
        early = max(0, at - NOTICE_NS)
        if not prober.takes_notice(early):
            return ended(prober, early, at, steps), steps
    return Finding(
        f"why the program did not do what was wanted is not known{_ignored(prober, at)}", is_cause=False
    ), steps


def _ignored(prober: Prober | None, at: Nanos) -> str:
    """Return which sensors' pins, high before a time, it took no notice of, though it did of others; else nothing."""
    since = {} if prober is None else {net: t for net in prober.sensors if (t := prober.replay.high_since(net, at))}
    if prober is None or not since:
        return ""
    quiet = [
        net for net, t in since.items()
        if prober.noticed([Hold(wire=net, level=False, since=t, until=at)], at, t) is None
    ]  # fmt: skip
    if not quiet or len(quiet) == len(prober.sensors):
        return ""
    pins = numbers([f"{prober.replay.pin(net)}, high since {since[net] / NS_PER_S:.3f} s" for net in quiet])
    return f"; until then it took no notice of {pins}"


def _contact(scene: Scene, prober: Prober | None, hit: Contact) -> tuple[Finding, list[ChainLink]]:
    resets = [] if prober is None else [r for r in prober.replay.resets if 0 <= hit.t - r.at < _AFTER_RESET_NS]
    analysis = ContactAnalysis(scene, prober, hit)
    if prober is not None and hit.t > prober.replay.end:
        analysis = ContactAnalysis(scene, None, hit)
    if prober is not None and resets:
        reset = resets[-1]
        analysis._tell_motion()  # noqa: SLF001 - the same steps without its links
        steps = analysis.steps
        steps.append(ChainLink(t=reset.at, part="firmware", says=f"is reset by {reset.cause}, while at {reset.place}",
                               evidence=Evidence.REPLAYED))  # fmt: skip
        tail = fed(prober, reset.cause, steps)
        return Finding(
            f"{words_of(reset)} reset the chip {(hit.t - reset.at) / NS_PER_S:.2f} s before the contact{tail}"
        ), steps
    return analysis.find(), analysis.steps


def _died(record: RunRecord, prober: Prober | None, at: Nanos) -> tuple[Finding, list[ChainLink]] | None:
    """Return the death of the firmware, where it came before what failed."""
    died = next((fault for fault in record.faults if fault.op == "died" and fault.t <= at), None)
    if died is None:
        return None
    steps = [ChainLink(t=died.t, part="firmware", says=died.words, evidence=Evidence.RECORDED)]
    where = ""
    fault = None
    if prober is not None:
        prober.replay.run(died.t, min(died.t + NS_PER_MS, prober.replay.end))
        fault = prober.replay.board.fault
    if fault is not None and prober is not None:
        place = prober.replay.line(fault.pc)
        where = f" at {place}"
        steps.append(
            ChainLink(
                t=fault.at_ns, part="firmware", says=f"the instruction is that of {place}", evidence=Evidence.REPLAYED
            )
        )
    return Finding(f"the firmware died at {died.t / NS_PER_S:.3f} s{where}: {died.words}"), steps


def _decided(record: RunRecord, failure: str) -> Nanos:
    """Return when a failure was decided, as far as the trace tells; its end where it does not."""
    if failure.startswith((*_TOUCH, "contact")) and record.contacts:
        return record.contacts[0].t
    says = failure.partition(": ")[2]
    missed: Verdict | None = next(
        (v for v in record.verdicts if not v.met and _kind_of(v.says) == _kind_of(says)), None
    )
    return record.last_ns if missed is None else missed.t


def _kind_of(says: str) -> str:
    """Return the beginning of a verdict without its figures, which a later one of the same goal has otherwise."""
    return re.sub(r"\d+", "#", says)[:30]


def _odd(prober: Prober | None) -> list[str]:
    """Return what is odd about the program, whether or not it has to do with a failure."""
    if prober is None:
        return []
    replay, found = prober.replay, list[str]()
    if replay.resets:
        first = replay.resets[0]
        found.append(
            f"resets: {len(replay.resets)}, the first by {first.cause} at {first.at / NS_PER_S:.3f} s, at {first.place}"
        )
    moments = prober.moments(replay.end, 3)
    if moments and all(prober.takes_notice(at) for at in moments):
        inputs = [*prober.sensors, *replay.role(WireRole.ENCODER)]
        unseen = [net for net in inputs if all(prober.flip_noticed([net], at) is None for at in moments)]
        if unseen:
            found.append(f"nothing in the program depended on {numbers([replay.pin(net) for net in unseen])} at "
                         f"{len(moments)} times that were tried")  # fmt: skip
    if moments:
        at = moments[0]
        for line, times in replay.reads(at, at + NS_PER_S).items():
            gaps = [b - a for a, b in itertools.pairwise(times)]
            if gaps and max(gaps) > _SLOW_NS:
                found.append(f"{line} reads the input pins only each {max(gaps) / 1e6:.0f} ms")
    return found
