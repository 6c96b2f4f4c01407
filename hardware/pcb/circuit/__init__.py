"""What is on the board and how it is connected: parts, nets, modules, and the arithmetic on them."""
