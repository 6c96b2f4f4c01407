"""What a firmware file says of itself: image, symbols, lines, functions, basic blocks."""
