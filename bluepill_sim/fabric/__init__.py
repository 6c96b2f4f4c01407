"""What the parts of the chip meet through: registers, pins and clocks."""
