"""What a world file may not say, beside misspelt keys: each refusal names the file and the place."""

import re

import pytest

from p2os.errors import WorldError
from p2os.pioneer.world import parse_world

HEAD = 'name = "a"\nextent_m = [0, 0, 1, 1]\n'
BOX = '[[box]]\nname = "b"\nx_m = 0\ny_m = 0\nlength_m = 1\nwidth_m = 1\n'


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("arena = 5\n", "arena"),
        ("[arena]\ncount = 5\n", "[arena]: unknown key 'count'"),
        (BOX.replace("width_m = 1", "width_m = -1"), "[[box]] 1: width_m = -1"),
        (BOX.replace("x_m = 0", "x_m = nan"), "[[box]] 1: x_m"),
        (BOX + 'kind = "tree"\n', 'kind = "tree"'),
        ('[[wall]]\nname = "w"\nfrom_m = [0, 0]\nto_m = [0, 0]\nthickness_m = 0\n', "[[wall]] 1: thickness_m = 0"),
        (BOX + BOX, "two obstacles"),
    ],
)
def test_a_refusal_is_one_line_with_file_and_place(text: str, place: str) -> None:
    with pytest.raises(WorldError) as caught:
        parse_world(HEAD + text, "mine.toml")
    message = str(caught.value)
    assert re.match(r"mine\.toml:\d+: ", message)
    assert place in message
    assert "\n" not in message
