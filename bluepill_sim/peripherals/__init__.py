"""The peripherals of the STM32F103, one a file; none imports another."""
