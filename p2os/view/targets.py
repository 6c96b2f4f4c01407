"""What a person may name to be shown: each package says by an entry point which of its things are.

An entry point of `GROUP` is a function that takes what was named and returns a `ViewTarget`, or None where it is of
another kind; they are asked in the order of their names.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

from p2os.view.header import PageSection, PanelHeader
from p2os.view.live import ShownSource, StillRecording
from simbase.entry_points import installed_points
from simbase.errors import FileError, MissingDependencyError, UsageError
from simbase.installation import way_to_plug_in
from simbase.user_classes import loaded

GROUP = "p2os.view_sources"
#: What shows the inside of what runs: a function of it that returns a `ViewPanel`, or None where it is of another kind.
PANELS = "p2os.view_panels"
#: Who serves a page.
SERVERS = "p2os.view_servers"


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewTarget:
    """Something that is shown: what, and what makes it go on; None: nothing does."""

    source: ShownSource
    run: Callable[[], None] | None = None
    #: Returns it as a robot that its page drives, no faster than m/s and deg/s; None: it is no robot at a port.
    driven: "Callable[[float, float], ViewTarget] | None" = None
    #: Returns it as a program at which GDB halts, too, at a TCP port of this machine (0: a free one); None: it is none.
    debugged: "Callable[[int], ViewTarget] | None" = None


@dataclass(frozen=True, slots=True)
class ViewPanel:
    """A view of what runs, as it is now."""

    name: str
    title: str
    #: What one may look at in it; none: it is one thing.
    choices: Sequence[str]
    #: Returns what it shows of a choice; called while all stands still, at most ten times a second. It changes nothing.
    look: Callable[[str], Sequence[PageSection]]

    @property
    def header(self) -> PanelHeader:
        """What the page knows of it from the start."""
        return PanelHeader(name=self.name, title=self.title, choices=self.choices)


def panels_of(subject: object) -> list[ViewPanel]:
    """Return the panels of what runs, in the order of their entry points' names."""
    points = sorted(installed_points(PANELS).items())
    made = [cast("Callable[[object], ViewPanel | None]", loaded(point))(subject) for _, point in points]
    return [one for one in made if one is not None]


class ServedPage(Protocol):
    """A page that is served."""

    #: What a browser opens; and a link for looking on, empty where nothing can be controlled.
    url: str
    watch_url: str

    def wait(self) -> None:
        """Wait until it ends; an interrupt is raised here."""


def target_of(named: str) -> ViewTarget:
    """Return what a person named.

    Raises:
        FileError, UsageError: It is nothing that can be shown, or it cannot be read.
    """
    for _, point in sorted(installed_points(GROUP).items()):
        found = cast("Callable[[str], ViewTarget | None]", loaded(point))(named)
        if found is not None:
            return found
    raise UsageError(
        f"{named!r} is nothing that can be shown", hint="a run, campaign or capture, a scenario, or a robot's URL"
    )


def capture_target(named: str) -> ViewTarget | None:
    """Return a capture in a file; None where there is no such file, or it holds another thing."""
    path = Path(named)
    if not path.is_file() or path.suffix == ".toml":
        return None
    from p2os.view.capture_recording import open_recording  # reads packets: of no run that was kept

    recording = open_recording(path)
    if not recording.tracks:
        raise FileError(f"{named} holds no bytes of a P2OS line")
    return ViewTarget(source=StillRecording(recording))


def served(
    source: ShownSource, host: str, port: int
) -> AbstractContextManager[ServedPage]:  # fmt: skip
    """Serve a page for a block.

    Raises:
        UsageError: It cannot be served there, or no server is installed.
        MissingDependencyError: What a server needs is not installed.
    """
    point = installed_points(SERVERS).get("page")
    if point is None:
        raise UsageError("--view is not there", hint=way_to_plug_in(SERVERS) or "p2os doctor")
    try:
        serving = cast("Callable[..., AbstractContextManager[ServedPage]]", loaded(point))
    except ModuleNotFoundError as error:
        raise MissingDependencyError(f"the page needs {error.name}", extra="view") from error
    return serving(source, host, port)
