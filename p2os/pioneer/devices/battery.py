"""The battery: it drains with what the robot does, and sags under load where that is switched on.

A lead-acid battery of nominal 12 V as a straight line between full and empty;
the drain is counted when the controller looks, once a packet. Not modelled:
temperature, ageing, the recovery of a rested battery.
"""

from dataclasses import dataclass

from simbase.timing import NS_PER_S, Nanos

#: chosen: resting volts of a full and of an empty lead-acid battery of six cells.
FULL_V, EMPTY_V = 12.9, 11.1
#: chosen: one battery of 7 Ah, in coulombs.
CAPACITY_C = 7 * 3600
#: chosen: what the electronics take, what enabled motors add, and what driving adds per m/s of each rim, amperes.
IDLE_A, MOTORS_A, DRIVING_A_PER_MPS = 0.9, 0.3, 2.0
#: chosen: a stalled motor draws so much, amperes.
STALLED_A = 3.0
#: chosen: charging current, amperes.
CHARGING_A = 2.0


@dataclass(slots=True)
class Battery:
    """The charge that is left, and what the voltmeter shows."""

    charge_c: float = CAPACITY_C
    #: Ohms between the cells and the voltmeter; 0 hides the load.
    resistance_ohm: float = 0.0
    #: Amperes at the last look, + out of the battery.
    current_a: float = IDLE_A
    looked_ns: Nanos = 0
    #: Decivolts that a test command or a fault pretends; None shows the true ones.
    pretended_decivolts: int | None = None
    #: A client pretends them (BATTEST), until it closes; else a fault does.
    is_test: bool = False
    #: Whether the charger is plugged in.
    is_charging: bool = False

    @classmethod
    def resting_at(cls, volts: float, resistance_ohm: float) -> "Battery":
        """Return a battery whose resting voltage is `volts`, within what it can hold."""
        part = min(max((volts - EMPTY_V) / (FULL_V - EMPTY_V), 0.0), 1.0)
        return cls(charge_c=part * CAPACITY_C, resistance_ohm=resistance_ohm)

    def look(self, now: Nanos, *, motors_on: bool, rims_mps: float, stalled: int) -> None:
        """Drain what has flowed since the last look, and take the load of this moment.

        Args:
            now: The time, ns.
            motors_on: Whether the motors have power.
            rims_mps: Sum of both rims' speeds without their signs.
            stalled: How many wheels are stalled.
        """
        self.charge_c -= self.current_a * (now - self.looked_ns) / NS_PER_S
        self.charge_c = min(max(self.charge_c, 0.0), float(CAPACITY_C))
        self.looked_ns = now
        self.current_a = IDLE_A + motors_on * MOTORS_A + rims_mps * DRIVING_A_PER_MPS + stalled * STALLED_A
        if self.is_charging:
            self.current_a -= CHARGING_A

    @property
    def volts(self) -> float:
        """The voltage at the terminals."""
        resting = EMPTY_V + (FULL_V - EMPTY_V) * self.charge_c / CAPACITY_C
        return resting - self.current_a * self.resistance_ohm

    @property
    def decivolts(self) -> int:
        """What the packet carries, 0.1 V."""
        shown = round(self.volts * 10) if self.pretended_decivolts is None else self.pretended_decivolts
        return min(max(shown, 0), 0xFF)

    @property
    def state_of_charge(self) -> int:
        """The charge in percent."""
        return round(100 * self.charge_c / CAPACITY_C)
