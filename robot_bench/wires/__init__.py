"""What parts meet at: nets with levels, serial lines with bytes, and the endpoints that join a part to them."""
