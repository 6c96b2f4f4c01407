"""What the core has for debugging, and firmware as well: halts, FPB, DWT; a debugger itself is `bluepill_sim/debug`."""
