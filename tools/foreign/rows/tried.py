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
        name="dfu-util, lsusb and the host's drivers by USB/IP",
        tried="usbip 2.0 with the kernel at hand; the boot loaders are spoken to by our own host (dfuse, stm32duino)",
        error="modprobe: FATAL: Module vhci-hcd not found; no /dev/bus/usb, so libusb has no bus",
    ),
    TriedProgram(
        name="Blackmagic with GDB on a second emulated chip",
        tried="the probe's own GDB server and its scan (row blackmagic-gdb)",
        error="SW-DP scan failed! The debug port behind PA13 and PA14 is not modelled, so nobody answers on SWD",
    ),
    TriedProgram(
        name="Zephyr",
        tried="the repository zephyrproject-rtos/zephyr; its images in fuzzware-experiments (zephyr-CVE-2020-10065, "
        "-10066, uEmu.zephyrsocketcan)",
        error="1.5 GB, more than could be copied; the images are for STM32L4 (RCC+0x58, nucleo_l432kc), another chip",
    ),
    TriedProgram(
        name="mbed OS", tried="the repository ARMmbed/mbed-os", error="593 MB, more than could be copied"
    ),
    TriedProgram(
        name="Rust", tried="rustc 1.95 for thumbv7m-none-eabi",
        error="error[E0463]: can't find crate for `core`: the target is not installed, and no registry at hand has it",
    ),
    TriedProgram(
        name="TinyGo", tried="Debian, PyPI and npm",
        error="No matching distribution found for tinygo; npm 404; no Debian package"
    ),
    TriedProgram(
        name="CANopenNode", tried="its sources were had",
        error="no driver for bxCAN was written for it; Modbus stands for the field buses"
    ),
    TriedProgram(
        name="AriaPy and AriaJava", tried="AriaCoda's wrapper.i with swig 4.1, headers that have gone left out",
        error="wrapper.i:272: Error: Unknown directive '%char'",
    ),
    TriedProgram(
        name="MRPT", tried="its driver of ActivMedia robots",
        error="it links ARIA 2.7; the same library is judged by the rows aria-…",
    ),
    TriedProgram(
        name="slam_toolbox, Nav2's servers and robot_localization, as nodes",
        tried="Debian (apt-get install ros-jazzy-…), PyPI (ros-jazzy-…: rcl, rmw, rclpy and the messages, headers "
        "too), and their sources (slam_toolbox a3442d2f68, navigation2 f4108e5b1c) to be built on those wheels, as "
        "tf2_msgs was; what Nav2 plans with, and Karto, run as libraries in the row ros2-karto-navfn",
        error="E: Unable to locate package ros-jazzy-navigation2; No matching distribution found for ros-jazzy-rclcpp; "
        "rclcpp, tf2_ros, slam_toolbox and Nav2's servers are 257 files of C++ beside their messages, and were not "
        "built: tf2_msgs, four messages, took two minutes on the two shared cores at hand",
    ),
    TriedProgram(
        name="VRI's library, RACK", tried="searched for by their names, and by words of the protocol", error="not found"
    ),
)  # fmt: skip
