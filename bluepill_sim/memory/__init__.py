"""What addresses lead to: the memories as bytes, and the bus with its bit-band regions."""
