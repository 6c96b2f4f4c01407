"""What the robot's own firmware does, as a passive state machine above a body."""

from p2os.pioneer.controller.controller import ControllerState, EventCallback, Pioneer
from p2os.pioneer.controller.settings import ControllerSettings, SonarPerSip

__all__ = ["ControllerSettings", "ControllerState", "EventCallback", "Pioneer", "SonarPerSip"]
