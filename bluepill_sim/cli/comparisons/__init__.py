"""`p2os mcu compare-…` and `races`: what a program does beside what it does elsewhere, or at other latencies."""
