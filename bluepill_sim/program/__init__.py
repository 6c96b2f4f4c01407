"""What a firmware file contains: image, symbols, lines, functions, basic blocks."""
