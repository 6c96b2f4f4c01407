"""Why a run failed, in words: evidence from the trace, and from the chip replayed with what its pins held."""
