"""What has no row, since it could not be had or run where this table was made: what was tried, and the error."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class TriedProgram:
    """A program without a row."""

    name: str
    #: What was tried.
    tried: str
    #: What came of it: the error, word for word where there was one.
    error: str


TRIED = (
    TriedProgram(
        name="dfu-util, lsusb and host drivers by USB/IP",
        tried="usbip 2.0; our own host speaks to the boot loaders (dfuse, stm32duino)",
        error="modprobe: FATAL: Module vhci-hcd not found; no /dev/bus/usb",
    ),
    TriedProgram(
        name="Blackmagic with GDB on a second emulated chip",
        tried="the probe's own GDB server and its scan (row blackmagic-gdb)",
        error="SW-DP scan failed! The debug port at PA13 and PA14 is not modelled",
    ),
    TriedProgram(
        name="Zephyr",
        tried="its repository; its images in fuzzware-experiments (CVE-2020-10065, -10066, uEmu.zephyrsocketcan)",
        error="1.5 GB, too large to copy; the images are for STM32L4 (RCC+0x58, nucleo_l432kc)",
    ),
    TriedProgram(
        name="mbed OS", tried="the repository ARMmbed/mbed-os", error="593 MB, too large to copy"
    ),
    TriedProgram(
        name="Rust", tried="rustc 1.95 for thumbv7m-none-eabi",
        error="error[E0463]: can't find crate for `core`; no registry at hand has the target",
    ),
    TriedProgram(
        name="TinyGo", tried="Debian, PyPI and npm",
        error="No matching distribution found for tinygo; npm 404; no Debian package"
    ),
    TriedProgram(
        name="CANopenNode", tried="its sources",
        error="no driver for bxCAN was written; Modbus represents the field buses"
    ),
    TriedProgram(
        name="AriaPy and AriaJava", tried="AriaCoda's wrapper.i with swig 4.1, without its missing headers",
        error="wrapper.i:272: Error: Unknown directive '%char'",
    ),
    TriedProgram(
        name="MRPT", tried="its driver of ActivMedia robots",
        error="it links ARIA 2.7, which the rows aria-… judge",
    ),
    TriedProgram(
        name="slam_toolbox, Nav2 servers, robot_localization as nodes",
        tried="Debian; PyPI (ros-jazzy-…); sources (slam_toolbox a3442d2f68, navigation2 f4108e5b1c)",
        error="no ros-jazzy-navigation2 in Debian, no ros-jazzy-rclcpp on PyPI; 257 C++ files were not built",
    ),
    TriedProgram(
        name="VRI's library, RACK", tried="search by name and by protocol terms", error="not found"
    ),
)  # fmt: skip
