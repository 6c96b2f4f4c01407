"""A drive train driven through all that a bridge does: speeds, currents and aims of each stage, as they are kept."""

import pytest

from robot_bench.direct.differential.bridge import Shares
from robot_bench.direct.differential.drive_train import DriveTrain, box_inertia, no_load_radps
from tests.robot_bench.direct.robots import kinetic_j, rover
from tests.robot_bench.recording.kept_lines import is_as_kept

STAGES = [
    (Shares(0.6, 0, 0.4), Shares(0.5, 0.1, 0)), (Shares(0, 0.7, 0), Shares(1, 0, 0)),
    (Shares(0, 0, 1), Shares(0, 0, 0)),
    (Shares(0, 0, 0), Shares(0, 0.05, 0)), (Shares(0.01, 0, 0), Shares(0, 0, 0.5)), (Shares(0, 1, 0), Shares(0, 1, 0)),
]  # fmt: skip


def shown(*values: float) -> str:
    return " ".join(f"{value:.8g}" for value in values)


def test_a_train_through_its_stages() -> None:
    lines = [shown(no_load_radps(rover()), box_inertia(1.4, 0.3, 0.2, 0.05))]
    changes: list[dict[str, dict[str, object]]] = [
        {},
        {"motor": {"friction_nm": 0.0, "damping_nm_s": 0.0}},
        {"bridge": {"drop_v": 1.5}},
    ]
    for parts in changes:
        train = DriveTrain(rover(**parts), 1e-3)
        lines += [f"{parts} {shown(train.struct.own, train.struct.other)}"]
        for left, right in STAGES:
            for volts in (7.4, 0.5):
                supply = train.supply_v(left, right, volts, 0.3, 0.1)
                lines += [shown(supply, *(value for aim in train.aims(left, right, supply) for value in aim))]
                for _ in range(40):
                    done = train.step(left, right, supply)
                lines += [shown(*done, train.left_radps, train.right_radps, kinetic_j(train))]
    assert is_as_kept(lines, "train_whole")


@pytest.mark.parametrize("speed", [0.0, 5.0, -5.0])
def test_a_motor_aims_at_rest_where_friction_is_stronger(speed: float) -> None:
    train = DriveTrain(rover(), 1e-3)
    train.left_radps = speed
    aim, _ = train.aims(Shares(0, 0, 1), Shares(0, 0, 0), 7.4)
    assert aim.rate_radps == 0.0
    assert aim.torque_nm > 0.0


@pytest.mark.parametrize(("dropped", "left"), [(0.0, 1.0), (0.25, 0.75), (1.0, 0.0), (1.1, 0.0)])
def test_a_bridge_that_drops_a_part_of_the_volts_takes_it_from_the_fastest_speed(dropped: float, left: float) -> None:
    whole = rover(bridge={"drop_v": 0.0})
    robot = rover(bridge={"drop_v": dropped * whole.battery.full_v})
    assert no_load_radps(robot) == pytest.approx(left * no_load_radps(whole))
