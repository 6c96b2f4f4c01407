"""Occupancy images with their YAML, as ROS's map_server reads and writes them.

Taken: `image` (PNG, PGM, or what else Pillow reads), `resolution`, `origin` with its
yaw, `negate`, `occupied_thresh`, `free_thresh`, `mode` (trinary, scale, raw). A cell
that is occupied becomes solid; free and unknown cells are free. Cells are put
together to few boxes.

Source: the documentation of ROS's map_server and of nav2_map_server.
"""

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml
from PIL import Image

from p2os.errors import WorldError
from p2os.pioneer.world.formats.collection import Collection
from p2os.pioneer.world.formats.local_file import find_local
from p2os.pioneer.world.formats.rectangles import rectangles
from p2os.pioneer.world.model import FARTHEST_M, Obstacle, ObstacleKind, Pose, World
from p2os.pioneer.world.placing import Placing, placed_points
from p2os.pioneer.world.text_file import read_foreign_text

MODES = ("trinary", "scale", "raw")
KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode")
WALL_HIGH_M = 1.0
MOST_PIXELS = 32_000_000
LARGEST_YAML = 1 << 20
#: A start is searched on every so many pixels, so far from what is occupied, m.
START_STEP, START_FREE_M = 8, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class _Settings:
    image: Path
    resolution_m: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str


def read(path: Path, up: str) -> World:
    """Return the world of an occupancy image.

    Raises:
        WorldError: The YAML or the image is not what it should be, or the image is too large.
    """
    if up != "auto":
        raise WorldError(f"{path}: a map has no up axis")
    settings = _settings(path)
    width, height, values = _image(settings)
    occupied = _table(settings, solid=True)
    free = _table(settings, solid=False)
    rows = [values[row * width : (row + 1) * width] for row in range(height)]
    collection, size = Collection(path), settings.resolution_m
    placing = Placing(x_m=settings.origin[0], y_m=settings.origin[1], heading_rad=settings.origin[2])
    solid = [row.translate(occupied) for row in rows]
    for number, (column, row, columns, count) in enumerate(rectangles(solid), start=1):
        middle = ((column + columns / 2) * size, (height - row - count / 2) * size, 0.0)
        ((x, y, _),) = placed_points([middle], placing)
        collection.add_thing(
            Obstacle(
                name=f"block {number}",
                x_m=x,
                y_m=y,
                heading_rad=settings.origin[2],
                length_m=columns * size,
                width_m=count * size,
                height_m=WALL_HIGH_M,
                kind=ObstacleKind.WALL,
                fixed=True,
            )
        )
    corners = [(0.0, 0.0, 0.0), (width * size, 0.0, 0.0), (width * size, height * size, 0.0), (0.0, height * size, 0.0)]
    xs, ys, _ = zip(*placed_points(corners, placing), strict=True)
    start = _start([row.translate(free) for row in rows], solid, size, placing)
    return collection.world(start, (min(xs), min(ys), max(xs), max(ys)))


def _settings(path: Path) -> _Settings:
    if path.stat().st_size > LARGEST_YAML:
        raise WorldError(f"{path}: larger than {LARGEST_YAML >> 20} MiB", hint="the YAML of a map is a few lines")
    try:
        table = yaml.safe_load(read_foreign_text(path))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark is not None else ""
        raise WorldError(f"{path}{line}: {getattr(error, 'problem', None) or 'the file is not YAML'}") from error
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        # What the library raises where a tag and its value do not fit: `!!int ''`, `!!bool maybe`, `!!timestamp x`.
        raise WorldError(f"{path}: a value does not fit its tag", hint="plain numbers and words need no tag") from error
    if not isinstance(table, Mapping) or "image" not in table:
        raise WorldError(f"{path}: no map: it names no image", hint=f"a map has {', '.join(KEYS)}")
    origin = table.get("origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise WorldError(f"{path}: origin must be [x, y, yaw]", hint="metres and radians")
    mode = table.get("mode", "trinary")
    if mode not in MODES:
        raise WorldError(f"{path}: mode = {_shown(mode)} is unknown", hint=f"one of {', '.join(MODES)}")
    if not isinstance(table["image"], str):
        raise WorldError(f"{path}: image must name a file")
    x, y, yaw = (_number(path, "origin", value, -FARTHEST_M, FARTHEST_M) for value in origin)
    return _Settings(
        image=find_local(table["image"], path),
        resolution_m=_number(path, "resolution", table.get("resolution"), 1e-4, 100.0),
        origin=(x, y, yaw),
        negate=bool(table.get("negate", 0)),
        occupied_thresh=_number(path, "occupied_thresh", table.get("occupied_thresh", 0.65), 0.0, 1.0),
        free_thresh=_number(path, "free_thresh", table.get("free_thresh", 0.25), 0.0, 1.0),
        mode=mode,
    )


def _number(path: Path, key: str, value: object, least: float, most: float) -> float:
    if isinstance(value, str):  # PyYAML's YAML 1.1 has no number 1e-05; yaml-cpp, by which maps are saved, writes it
        with contextlib.suppress(ValueError):
            value = float(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= most:
        raise WorldError(f"{path}: {key} = {_shown(value)} must be a number from {least:g} to {most:g}")
    return float(value)


def _shown(value: object) -> str:
    """Return a value for a message; YAML's anchors make small files of huge values, which are not written out."""
    if isinstance(value, str):
        return f"{value[:40]!r}"
    if isinstance(value, int) and abs(value) > MOST_PIXELS:
        return "a huge number"
    return f"{value!r}" if value is None or isinstance(value, (int, float)) else f"a {type(value).__name__}"


def _image(settings: _Settings) -> tuple[int, int, bytes]:
    """Return width, height and the lightness of every pixel; a transparent pixel is unknown."""
    path = settings.image
    try:
        with Image.open(path) as image:
            _check_size(image, settings)
            lightness = _lightness(image)
            width, height = image.size
    except Image.DecompressionBombError as error:
        raise WorldError(f"{path}: its pixels are too many", hint=f"at most {MOST_PIXELS} in all") from error
    except (OSError, ValueError, SyntaxError, IndexError, EOFError) as error:
        raise WorldError(f"{path}: the image cannot be read", hint="it may be cut short") from error
    return width, height, lightness


def _check_size(image: Image.Image, settings: _Settings) -> None:
    """Refuse an image that is too large, before its pixels are asked for."""
    width, height = image.size
    where = settings.image
    if width * height > MOST_PIXELS:
        raise WorldError(f"{where}: {width} x {height} pixels are too many", hint=f"at most {MOST_PIXELS} in all")
    if max(width, height) * settings.resolution_m > FARTHEST_M:
        raise WorldError(f"{where}: at {settings.resolution_m:g} m a pixel it is larger than {FARTHEST_M:g} m")
    if image.mode in {"I", "I;16", "I;16B", "F"}:
        raise WorldError(f"{where}: 16 and 32 bit images are not read", hint="save it with 8 bits")


def _lightness(image: Image.Image) -> bytes:
    """Return the average of the colours, 0 to 255, rounded; 205, that is unknown, where a pixel is transparent."""
    if image.mode in {"L", "1"}:
        return image.convert("L").tobytes()
    rgba = image.convert("RGBA")
    red, green, blue, alpha = (band.tobytes() for band in rgba.split())
    return bytes((r + g + b + 1) // 3 if a else 205 for r, g, b, a in zip(red, green, blue, alpha, strict=True))


def _table(settings: _Settings, *, solid: bool) -> bytes:
    """Return, for each lightness, 1 where it is occupied (or free) and 0 where not."""
    values = []
    for lightness in range(256):
        if settings.mode == "raw":
            # 0 free to 100 occupied, 255 unknown.
            random_source = lightness / 100 if lightness <= 100 else math.nan
        else:
            random_source = lightness / 255 if settings.negate else (255 - lightness) / 255
        is_it = random_source > settings.occupied_thresh if solid else random_source < settings.free_thresh
        if settings.mode == "raw" and solid:
            is_it = random_source >= settings.occupied_thresh
        values.append(int(is_it))
    return bytes(values)


def _start(free: list[bytes], solid: list[bytes], size: float, placing: Placing) -> Pose | None:
    """Return a free cell near the world's origin or the map's middle, with room around it."""
    height, width = len(free), len(free[0])
    reach = max(1, math.ceil(START_FREE_M / size))

    def has_room(column: int, row: int) -> bool:
        top, left = max(0, row - reach), max(0, column - reach)
        rows = solid[top : row + reach + 1]
        return bool(free[row][column]) and not any(b"\x01" in line[left : column + reach + 1] for line in rows)

    def place(column: int, row: int) -> tuple[float, float]:
        ((x, y, _),) = placed_points([((column + 0.5) * size, (height - row - 0.5) * size, 0.0)], placing)
        return x, y

    step = max(1, min(START_STEP, width // 16, height // 16))
    cells = [(column, row) for row in range(0, height, step) for column in range(0, width, step)]
    for target in ((0.0, 0.0), place(width // 2, height // 2)):
        nearest = min(cells, key=lambda cell: math.dist(place(*cell), target))
        if math.dist(place(*nearest), target) < 2 * step * size and has_room(*nearest):
            break
    else:
        middle = (width // 2, height // 2)
        by_distance = sorted(cells, key=lambda cell: math.dist(cell, middle))
        found = next((cell for cell in by_distance if has_room(*cell)), None)
        if found is None:
            return None
        nearest = found
    x, y = place(*nearest)
    return Pose(round(x, 3), round(y, 3), 0.0)
