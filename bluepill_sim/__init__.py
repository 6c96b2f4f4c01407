"""An emulated STM32F103 on its BluePill board; knows nothing of robots or P2OS."""
