"""Who a robot says it is: the answer to SYNC2.

Source: Pioneer 3 manual, page 33; every client takes a single type-2 frame.
"""

from dataclasses import dataclass

from p2os.wire import Frame

IDENTITY_KIND = 0x02


@dataclass(frozen=True, slots=True)
class Identity:
    """Who a robot says it is, in its answer to SYNC2.

    Args:
        name: From FLASH, may be empty; clients keep 19 characters.
        robot_class: Normally "Pioneer".
        subclass: The model, such as "p2dx"; matched without regard to case.
    """

    name: str
    robot_class: str
    subclass: str

    def to_frame(self) -> Frame:
        """Return the single type-2 frame that answers SYNC2."""
        strings = (self.name, self.robot_class, self.subclass)
        return Frame(bytes((IDENTITY_KIND,)) + b"".join(text.encode("latin-1", "replace") + b"\0" for text in strings))

    @classmethod
    def from_frame(cls, frame: Frame) -> "Identity":
        """Read the strings; those that are missing are empty."""
        strings = [text.decode("latin-1") for text in frame.data.split(b"\0")]
        name, robot_class, subclass = [*strings, "", "", ""][:3]
        return cls(name, robot_class, subclass)
