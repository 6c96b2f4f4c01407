"""Write the TypeScript of the page's data: kinds of channels with their columns, the header, the messages.

Made of `p2os/view/channels.py`, `header.py` and `run_control.py`; a test holds the committed file to what comes out.
Usage: python tools/generators/page_types.py
"""

from dataclasses import fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from p2os.view import channels, header, run_control
from p2os.view.channels import KINDS, CellType, ChannelKind, ColumnKind
from p2os.view.frames import FrameFlags

TARGET = Path(__file__).resolve().parents[1] / "page" / "src" / "generated" / "view.ts"
#: A cell's column in TypeScript; times do not fit a number exactly, so they are BigInt64Array on the wire.
COLUMNS = {
    CellType.I64: "BigInt64Array", CellType.F64: "Float64Array", CellType.F32: "Float32Array",
    CellType.U32: "Uint32Array",
    CellType.U8: "Uint8Array", CellType.TEXT: "readonly string[]", CellType.BYTES: "readonly Uint8Array[]",
}  # fmt: skip
HEAD = "// Made by tools/generators/page_types.py of channels.py, header.py, run_control.py (p2os/view): do not edit.\n"


def text() -> str:
    """Return the whole file."""
    return "\n".join([HEAD, *_numbers(), *map(_columns, KINDS), _table(), *_classes()])


def _numbers() -> list[str]:
    flags = ", ".join(f"{flag.name}: {flag.value}" for flag in FrameFlags)
    return [
        f"export const FORMAT = {channels.FORMAT};",
        f"export const WHOLE_PIXELS = {channels.WHOLE_PIXELS};",
        f"export const FLAGS = {{ {flags} }} as const;",
        "export type Cells = " + " | ".join(f'"{cells.value}"' for cells in CellType) + ";",
        _plain_interface("ColumnKind", name="string", cells="Cells", isWide="boolean"),
        _plain_interface("ChannelKind", name="string", number="number", columns="readonly ColumnKind[]"),
    ]


def _plain_interface(called: str, **types: str) -> str:
    rows = "".join(f"  readonly {key}: {of};\n" for key, of in types.items())
    return f"export interface {called} {{\n{rows}}}\n"


def _columns(kind: ChannelKind) -> str:
    rows = "".join(
        f"  /** {column.doc} */\n  readonly {column.name}: {COLUMNS[column.cells]};\n" for column in kind.columns
    )
    return f"/** {kind.doc} */\nexport interface {_name(kind)}Columns {{\n{rows}}}\n"


def _name(kind: ChannelKind) -> str:
    return kind.name.title().replace("_", "")


def _table() -> str:
    rows = "".join(
        f'  {{ name: "{kind.name}", number: {kind.number}, columns: [{", ".join(map(_column, kind.columns))}] }},\n'
        for kind in KINDS
    )
    types = "".join(f"  readonly {kind.name}: {_name(kind)}Columns;\n" for kind in KINDS)
    return f"export const KINDS: readonly ChannelKind[] = [\n{rows}];\n\nexport interface KindColumns {{\n{types}}}\n"


def _column(column: ColumnKind) -> str:
    return f'{{ name: "{column.name}", cells: "{column.cells.value}", isWide: {str(column.is_wide).lower()} }}'


def _classes() -> list[str]:
    found = [getattr(module, name) for module in (header, run_control) for name in module.__all__]
    made = [_interface(one) for one in found if is_dataclass(one)]
    unions = [
        f"export type {name} = {_type(getattr(module, name))};"
        for module, name in (
            (header, "Standing"), (header, "PageBlock"), (run_control, "Doing"), (run_control, "StepUnit"),
        )
    ]  # fmt: skip
    return [*made, *unions, ""]


def _interface(made: Any) -> str:
    hints = get_type_hints(made)
    rows = "".join(f"  readonly {field.name}: {_type(hints[field.name])};\n" for field in fields(made))
    doc = made.__doc__.partition("\n")[0]
    return f"/** {doc} */\nexport interface {made.__name__} {{\n{rows}}}\n"


def _type(hint: Any) -> str:
    origin, words = get_origin(hint), get_args(hint)
    if origin is Literal:
        return " | ".join(f'"{word}"' for word in words)
    if origin is UnionType:
        return " | ".join(map(_type, words))
    if origin is tuple:
        return f"readonly [{', '.join(map(_type, words))}]"
    if words:  # a sequence
        return f"readonly {_bracketed(_type(words[0]))}[]"
    plain = {int: "number", float: "number", str: "string", bool: "boolean", NoneType: "null"}
    return plain.get(hint) or str(hint.__name__)


def _bracketed(name: str) -> str:
    return f"({name})" if " " in name else name


if __name__ == "__main__":
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_text(text(), encoding="utf-8")
