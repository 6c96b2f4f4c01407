"""The self-test of an adapter board: both modules walk through every wire, and each fault is named.

ends       the two consoles: what each module can be told and asked
walk       the measurement: one wire after the other is driven, every pad is read
verdicts   what a measurement means
emulated   a board without electronics: the emulated BluePill, the simulated ESP32, the circuit between with faults
"""
