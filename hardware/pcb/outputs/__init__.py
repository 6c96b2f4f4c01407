"""Every file made of the design: schematic, board, bill of materials, pictures."""
