"""A bench that runs while variables of its program are looked at, and written into its run folder.

Invariant: the run is the same as one in which nobody looks.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from bluepill_sim.board import BluePill
from bluepill_sim.debug.sampler import VariableSampler
from bluepill_sim.program.image import load_image
from bluepill_sim.program.variables import Variable, read_variables
from robot_bench.bench.bench import Bench, run_of
from robot_bench.recording.variables import VariableWriter
from simbase.errors import UsageError


def variables_of(firmware: Path, names: Sequence[str]) -> list[Variable]:
    """Return a program's variables of these names, each once.

    Raises:
        UsageError: It has none of a name.
        ImageError: Its file cannot be read.
    """
    table = read_variables(load_image(firmware))
    found = [table.variable(name) for name in names]
    return list({one.name: one for one in found}.values())


def recording_variables(
    variables: Sequence[Variable], folder: Path, drive: Callable[[Bench], None] | None
) -> Callable[[Bench], None]:
    """Return what runs a bench as `drive` does (None: to its end) while variables are written into a run folder.

    Raises:
        UsageError: Something else than an emulated BluePill runs the firmware.
    """

    def run(bench: Bench) -> None:
        if not isinstance(bench.chip, BluePill):
            raise UsageError("variables of an emulated BluePill alone can be read", hint="run it without them")
        with VariableWriter(folder, variables) as writer:
            sampler = VariableSampler(bench.chip, writer.take)
            run_of(bench).samplers.append(sampler)
            sampler.watch(variables)
            try:
                if drive is None:
                    bench.run_until(bench.scenario.duration_ns)
                else:
                    drive(bench)
            finally:
                run_of(bench).samplers.remove(sampler)

    return run
