"""The bodies agree on every hit that is not disputed, and the disputed ones are those on which they do not."""

import pytest

from p2os.pioneer.body.contacts import DISPUTED_BESIDE_M, DISPUTED_DEG
from p2os.pioneer.body.factory import engines
from p2os.robots.parameters import load_parameters
from tools.surveys.oblique_hits import (
    AGREED_DEG,
    POST_M,
    WALL_DEG,
    Approach,
    ObliqueHit,
    approaches,
    are_agreed,
    hit,
    main,
    row,
    survey,
)

P2DX = load_parameters("p2dx")


def test_angles_and_posts_lie_on_both_sides_of_the_limits_and_on_them() -> None:
    assert {*DISPUTED_DEG} <= {*WALL_DEG}
    assert DISPUTED_BESIDE_M in POST_M
    found = {one.thing: one.is_disputed for one in approaches(P2DX)}
    assert (found["wall at 25°"], found["wall at 30°"]) == (False, True)
    assert (found["wall at 75°"], found["wall at 80°"]) == (True, False)
    assert (found["post 0.05 m left"], found["post 0.10 m left"]) == (False, True)


@pytest.mark.parametrize(
    ("goes_on", "turned_deg", "is_agreed"),
    [(True, 0.0, True), (False, 0.0, False), (True, AGREED_DEG - 0.1, True), (True, AGREED_DEG, False)],
)
def test_what_is_agreed_on(goes_on: bool, turned_deg: float, is_agreed: bool) -> None:
    first = ObliqueHit(thing="w", is_disputed=True, body="a", goes_on=True, way_m=1.0, turned_deg=0.0)
    second = ObliqueHit(thing="w", is_disputed=True, body="b", goes_on=goes_on, way_m=1.5, turned_deg=turned_deg)
    assert are_agreed([first, second]) is is_agreed
    assert row([first, second]) == (
        f"| w | goes on, 1.00 m, +0° | {second} | 0.50 m, {turned_deg:.0f}°: "
        f"{'agreed' if is_agreed else '**not agreed**'}, disputed |"
    )


def walls(*degrees: float) -> list[Approach]:
    return list(approaches(P2DX, walls=degrees, posts=()))


def test_the_plan_view_goes_along_a_wall_and_stands_before_it() -> None:
    along, before = (hit("kinematic", one, P2DX, 0.3) for one in walls(20, 60))
    assert (along.goes_on, round(along.turned_deg)) == (True, -20)
    assert (before.goes_on, round(before.turned_deg)) == (False, 0)


@pytest.mark.slow
@pytest.mark.bullet
@pytest.mark.mujoco
def test_the_engines_turn_where_the_plan_view_does_not() -> None:
    (approach,) = walls(60)
    hits = [hit(name, approach, P2DX, 0.3) for name in ("kinematic", "bullet", "mujoco")]
    assert approach.is_disputed
    assert not are_agreed(hits)
    assert [one.goes_on for one in hits] == [False] * 3
    assert all(one.turned_deg > AGREED_DEG for one in hits[1:])


@pytest.mark.soak
@pytest.mark.bullet
@pytest.mark.mujoco
@pytest.mark.parametrize("model", ["p2dx", "p3at"])
def test_the_bodies_agree_on_every_hit_that_is_not_disputed(model: str) -> None:
    hits = list(survey(engines(), load_parameters(model), 0.3))
    assert [one[0].thing for one in hits if not one[0].is_disputed and not are_agreed(one)] == []
    assert [one[0].thing for one in hits if one[0].is_disputed and not are_agreed(one)], "none of them is disputed"


@pytest.mark.soak
@pytest.mark.bullet
@pytest.mark.mujoco
def test_the_table_ends_with_what_is_beyond(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    assert capsys.readouterr().out.endswith("not agreed, and not among the disputed: none\n")
