"""Virtual robots on real lines, in real or scaled time: one host, a fleet, or a robot in a `with` block."""

from p2os.pioneer.serve.background_host import served_pioneer

__all__ = ["served_pioneer"]
