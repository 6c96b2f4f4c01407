"""Game pads of this machine, through SDL: the reports that `p2os.gamepad` takes.

SDL knows where each make has its triggers, sticks and directional pad; a pad
that it does not know is refused by name.
"""

import os
from types import TracebackType
from typing import Any, Self

from p2os.gamepad import STICK_FULL, TRIGGER_FULL, PadReport
from simbase.errors import MissingDependencyError, UsageError

#: SDL's full deflection.
_AXIS_FULL = 32767


class SdlPad:
    """The first game pad that SDL knows.

    Raises:
        MissingDependencyError: pygame-ce is not installed.
        UsageError: There is no pad, or none that SDL knows.
    """

    def __init__(self) -> None:
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            import pygame
            from pygame._sdl2 import controller
        except ImportError as error:
            raise MissingDependencyError(f"a game pad needs pygame-ce: {error}", extra="pad") from error
        self._pygame: Any = pygame
        pygame.display.init()
        pygame.joystick.init()
        controller.init()
        count = pygame.joystick.get_count()
        known = [number for number in range(count) if controller.is_controller(number)]
        if not known:
            names = ", ".join(pygame.joystick.Joystick(number).get_name() for number in range(count))
            self.close()
            raise UsageError(
                f"no game pad is known here: {names or 'none is connected'}",
                hint="connect one by cable or Bluetooth, or drive by keyboard: p2os teleop URL",
            )
        self._pad: Any = controller.Controller(known[0])
        #: What it calls itself.
        self.name: str = self._pad.name

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Let the pad and SDL go."""
        self._pygame.joystick.quit()
        self._pygame.display.quit()

    def report(self) -> PadReport | None:
        """Return how the pad stands now; None once it is gone."""
        pygame, pad = self._pygame, self._pad
        pygame.event.pump()
        if not pad.attached():
            return None
        return PadReport(
            up=bool(pad.get_button(pygame.CONTROLLER_BUTTON_DPAD_UP)),
            down=bool(pad.get_button(pygame.CONTROLLER_BUTTON_DPAD_DOWN)),
            forward=max(0, pad.get_axis(pygame.CONTROLLER_AXIS_TRIGGERRIGHT)) * TRIGGER_FULL // _AXIS_FULL,
            backward=max(0, pad.get_axis(pygame.CONTROLLER_AXIS_TRIGGERLEFT)) * TRIGGER_FULL // _AXIS_FULL,
            turn=round(pad.get_axis(pygame.CONTROLLER_AXIS_RIGHTX) * STICK_FULL / _AXIS_FULL),
        )
