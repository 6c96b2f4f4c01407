"""A hostile neighbour on this machine: every socket of every verb is attacked while wheels are watched.

    python -m tools.hostile                       all targets, all attacks; `make hostile`
    python -m tools.hostile serve sniff --attack post --attack flood
    python -m tools.hostile --p2os ../older/.venv/bin/p2os     judge another checkout

It is an outsider: it starts `p2os` as a program, speaks P2OS by code of its own (`packets.py`), and reads sockets and
memory of the processes from the kernel's tables (`kernel.py`). What is attacked are rows of `targets.py`, what is done
to it rows of `attacks.py`, and what has to hold is in `judgement.py`.
"""
