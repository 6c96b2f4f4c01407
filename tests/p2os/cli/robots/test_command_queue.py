"""Commands of pages wait in a bounded queue, in their order; stops come out first, and through whatever waits."""

import threading
from dataclasses import replace

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from p2os.cli.robots.command_queue import CommandQueue, is_stop
from p2os.view.run_control import RunCommand

MOST = 4
STOP, LET_GO = RunCommand(do="stop"), RunCommand(do="drive")
ASKS = st.sampled_from([RunCommand(do="pause"), RunCommand(do="save", words="test"), RunCommand(do="step")])
DRIVES = st.builds(lambda mps: RunCommand(do="drive", forward_mps=mps), st.sampled_from([0.1, -0.2]))


class QueueMachine(RuleBasedStateMachine):
    """The queue beside a list of all that was offered and not yet taken, each with its number."""

    def __init__(self) -> None:
        super().__init__()
        self.queue = CommandQueue(MOST)
        self.waiting: list[RunCommand] = []
        self.numbers = 0

    def offer(self, command: RunCommand) -> bool:
        """Offer a command that is known by its number."""
        self.numbers += 1
        command = replace(command, number=self.numbers)
        is_taken = self.queue.offer(command)
        if is_taken:
            self.waiting.append(command)
        return is_taken

    @rule(command=st.one_of(ASKS, DRIVES))
    def ask(self, command: RunCommand) -> None:
        has_room = len([one for one in self.waiting if not is_stop(one)]) < MOST
        assert self.offer(command) is has_room

    @rule(command=st.sampled_from([STOP, LET_GO]))
    def stop(self, command: RunCommand) -> None:
        assert self.offer(command), "a stop finds room whatever waits"
        self.waiting = [one for one in self.waiting if one.do != "drive" or is_stop(one)]
        # A stop makes what stops before it mean nothing; letting go twice is letting go.
        stops = [one for one in self.waiting if is_stop(one)]
        idle = stops[:-1] if command is STOP else stops[-1:] if [one.do for one in stops[-2:]] == ["drive"] * 2 else []
        self.waiting = [one for one in self.waiting if one not in idle]

    @rule()
    def take(self) -> None:
        taken = self.queue.take()
        stops = [one for one in self.waiting if is_stop(one)]
        assert taken == next(iter(stops or self.waiting), None)
        if taken is not None:
            self.waiting.remove(taken)

    @invariant()
    def it_is_bounded_and_stops_come_before_what_came_later(self) -> None:
        assert len(self.queue) == len(self.waiting) <= MOST + 2


TestQueue = QueueMachine.TestCase
TestQueue.settings = settings(max_examples=40, stateful_step_count=30)


def test_who_waits_is_woken_by_what_comes_from_another_thread() -> None:
    queue, found = CommandQueue(), list[RunCommand | None]()
    waiting = threading.Thread(target=lambda: found.append(queue.take(60.0)), daemon=True)
    waiting.start()
    assert queue.offer(STOP)
    waiting.join(60.0)
    assert found == [STOP]
    assert queue.take() is None


def test_stops_come_before_what_waited_and_drop_what_was_to_be_driven() -> None:
    queue = CommandQueue()
    pause, drive = RunCommand(do="pause"), RunCommand(do="drive", forward_mps=0.1)
    for command in (pause, drive, STOP, LET_GO, drive):
        assert queue.offer(command)
    assert [queue.take() for _ in range(5)] == [STOP, LET_GO, pause, drive, None]
