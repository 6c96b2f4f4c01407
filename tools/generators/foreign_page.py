"""The table of docs/foreign.md, from the rows and what their last run came to.

Usage: python -m tools.generators.foreign_page
"""

from tools.foreign.page import write_page
from tools.foreign.rows.table import ROWS

if __name__ == "__main__":
    write_page(ROWS)
