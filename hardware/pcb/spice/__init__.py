"""Circuit simulation of the board with ngspice: decks, limits, plots.

The models are ours, behavioural and documented (deck.py): they show what the circuit's
values make of the data sheets' figures, not how a given chip behaves beyond them.
"""
