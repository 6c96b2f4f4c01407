"""Whole captures to columns: millions of packets a second, every field, equal to the object decoder row by row.

```python
from p2os.capture.columns.tables import decode
from p2os.protocol.profiles import Profile

capture = decode(data, Profile.P2OS)
sip = capture.tables["sip"]
sip["raw_x"], sip.structured(), sip.ragged["sonar"].columns["raw_range"]
```

Needs NumPy (`pip install numpy`).
"""

from p2os.capture.columns.framing import RejectedCounts, find_frames
from p2os.capture.columns.table import Table
from p2os.capture.columns.tables import Columns, decode
from p2os.capture.columns.walker import Ragged, Spans

__all__ = ["Columns", "Ragged", "RejectedCounts", "Spans", "Table", "decode", "find_frames"]
