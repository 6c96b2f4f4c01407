"""The table."""

from tools.foreign.row import Row
from tools.foreign.rows.clients import CLIENTS
from tools.foreign.rows.firmware import FIRMWARE
from tools.foreign.rows.models import MODELS
from tools.foreign.rows.stacks import STACKS

ROWS: tuple[Row, ...] = (*FIRMWARE, *CLIENTS, *MODELS, *STACKS)
