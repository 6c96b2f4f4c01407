"""Debounced inputs: motor wires by majority, p2dx_con by time.

At each sample instant all motor wires are read together as one word. A word is
taken when it makes up more than half of the last samples; while no word does
(the BluePill is half-way through writing its bits), the last one taken stays.
With 5 samples 2 ms apart a change is taken at its third sample: 4 to 6 ms after
the edge. A glitch seen by two samples or fewer passes without effect.

p2dx_con counts as high once it has been seen high for MORE than
`connect_after_ns` without a break, and as low once it has been seen low for
`disconnect_after_ns`. Both spans run from the first sample that saw the level;
a dip between two samples is not seen.
"""

from typing import TypeAlias

from p2os.timing import Nanos

#: Word taken, equal samples in a row, window.
MajoritySnapshot: TypeAlias = tuple[int, int, tuple[int, ...]]
#: Level that counts, level seen, since when.
DebounceSnapshot: TypeAlias = tuple[bool, bool, Nanos]


class Majority:
    """A sliding window over words, with the word that holds its majority."""

    def __init__(self, count: int, word: int = 0) -> None:
        self._count = count
        self._window = [word] * count
        self._same = count
        self.word = word

    @property
    def is_settled(self) -> bool:
        """Tell whether the window holds nothing but the word taken."""
        return self._same >= self._count and self._window[-1] == self.word

    def take(self, word: int) -> bool:
        """Add a sample; tell whether the word taken has changed."""
        window = self._window
        self._same = self._same + 1 if word == window[-1] else 1
        del window[0]
        window.append(word)
        # Only the newest word can have gained a majority that it had not before.
        if word != self.word and 2 * window.count(word) > self._count:
            self.word = word
            return True
        return False

    def reset(self, word: int = 0) -> None:
        """Forget all samples, as if `word` had always been there."""
        self._window = [word] * self._count
        self._same = self._count
        self.word = word

    def snapshot(self) -> MajoritySnapshot:
        """Return all of it as plain values."""
        return self.word, self._same, tuple(self._window)

    def restore(self, snapshot: MajoritySnapshot) -> None:
        """Put back what `snapshot` returned."""
        self.word, self._same, window = snapshot
        self._window = list(window)


class Debounce:
    """A level that must last before it counts.

    Args:
        high_after_ns: High counts once seen for MORE than this.
        low_after_ns: Low counts once seen for this long.
    """

    def __init__(self, high_after_ns: Nanos, low_after_ns: Nanos) -> None:
        self._high_after_ns = high_after_ns
        self._low_after_ns = low_after_ns
        self.level = False
        self._raw = False
        self._since: Nanos = 0

    @property
    def is_settled(self) -> bool:
        """Tell whether the level seen is the level that counts."""
        return self._raw == self.level

    def take(self, raw: bool, now: Nanos) -> bool:
        """Add a sample; tell whether the level that counts has changed."""
        if raw != self._raw:
            self._raw = raw
            self._since = now
        if raw == self.level:
            return False
        lasted = now - self._since
        if raw and lasted <= self._high_after_ns:
            return False
        if not raw and lasted < self._low_after_ns:
            return False
        self.level = raw
        return True

    def reset(self) -> None:
        """Count as low, whatever was seen."""
        self.level = False
        self._raw = False
        self._since = 0

    def snapshot(self) -> DebounceSnapshot:
        """Return all of it as plain values."""
        return self.level, self._raw, self._since

    def restore(self, snapshot: DebounceSnapshot) -> None:
        """Put back what `snapshot` returned."""
        self.level, self._raw, self._since = snapshot
