"""What the emulator may need, and how it is got where no extra brings it."""

from simbase.installation import Need

NEEDS = (
    Need(name="unicorn", kind="package", feature="the emulated BluePill", extra="sim"),
    Need(name="pyelftools", kind="package", feature="ELF programs and their symbols", extra="sim"),
    Need(name="intelhex", kind="package", feature="Intel HEX programs", extra="sim"),
    Need(name="bluepill_sim._native", kind="built", feature="the emulated BluePill"),
    Need(
        name="arm-none-eabi-gcc",
        kind="program",
        feature="building BluePill programs",
        get="sudo apt-get install gcc-arm-none-eabi",
    ),
    Need(
        name="gdb-multiarch",
        kind="program",
        feature="debugging BluePill programs",
        get="sudo apt-get install gdb-multiarch",
    ),
)
