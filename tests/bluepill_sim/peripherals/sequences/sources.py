"""Where a sentence stands: a line of a public repository at a commit, a section of a manual, or a page of ours.

Facts are taken from there, and nothing else: sentences are written in our words, and no code of others is here.
"""

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Citation:
    """A line of a file of a public repository."""

    repository: "Repository"
    path: str
    line: int

    def __str__(self) -> str:
        """Return it as Markdown, with the address of that line."""
        place = f"{self.repository.commit}/{self.path}#L{self.line}"
        text = f"{self.repository.name} {self.path.rpartition('/')[2]}:{self.line}"
        return f"[{text}](https://github.com/{self.repository.owner}/blob/{place})"


@dataclass(frozen=True, slots=True)
class Repository:
    """A public repository at the commit that was read; called with a path and a line it makes a citation."""

    name: str
    #: Owner and name on GitHub.
    owner: str
    commit: str
    #: A path in it, by what a citation names.
    pattern: str = "{}"

    def __call__(self, path: str, line: int) -> Citation:
        """Return the citation of a line."""
        return Citation(self, self.pattern.format(path), line)


@dataclass(frozen=True, slots=True)
class Manual:
    """A section of one of the manuals that our pages cite."""

    name: str
    section: str
    #: False: the number was put down without the manual at hand, and nobody has looked.
    looked_up: bool = True

    def __str__(self) -> str:
        """Return it as people cite it."""
        return f"{self.name} {self.section}" + ("" if self.looked_up else " (section not looked up)")


@dataclass(frozen=True, slots=True)
class Page:
    """A section of a page of ours, by its heading."""

    page: str
    heading: str

    def __str__(self) -> str:
        """Return it as Markdown."""
        return f"[{self.heading}]({self.page})"


Source: TypeAlias = Citation | Manual | Page


def rm(section: str, *, looked_up: bool = True) -> Manual:
    """Return a section of the reference manual RM0008, revision 21."""
    return Manual("RM0008", section, looked_up)


def pm(section: str, *, looked_up: bool = True) -> Manual:
    """Return a section of the flash programming manual PM0075."""
    return Manual("PM0075", section, looked_up)


def arm(section: str) -> Manual:
    """Return a section of the ARMv7-M architecture manual."""
    return Manual("ARMv7-M", section)


def ours(heading: str) -> Page:
    """Return a section of docs/peripherals.md."""
    return Page("peripherals.md", heading)


_HAL = ("ST HAL", "STMicroelectronics/stm32f1xx_hal_driver", "bf83dda39877a51647d249eab56895ccce8a4f31")
#: Its sources and its headers, by the peripheral in their names.
HAL, HAL_H = Repository(*_HAL, "Src/stm32f1xx_hal_{}.c"), Repository(*_HAL, "Inc/stm32f1xx_hal_{}.h")
#: Those of what a peripheral has beyond the others of its kind.
HAL_EX = Repository(*_HAL, "Src/stm32f1xx_hal_{}_ex.c")
_LOCM3 = ("libopencm3", "libopencm3/libopencm3", "2da12dc96e0b9e42a3332348dd9b02a0a17981f8")
#: Its drivers of the family, and its headers.
LOCM3, LOCM3_H = Repository(*_LOCM3, "lib/stm32/{}.c"), Repository(*_LOCM3, "include/libopencm3/{}.h")
LOCM3_CORE = Repository(*_LOCM3, "lib/cm3/{}.c")
#: ST's older library, as Baseflight has it.
SPL = Repository(
    "ST SPL", "multiwii/baseflight", "e582e0ce6321b7dd2293a60264e1040d0cbac5a4",
    "lib/STM32F10x_StdPeriph_Driver/src/stm32f10x_{}.c",
)  # fmt: skip
PANDA = Repository("panda", "commaai/panda", "0154330040ee36050df9a05c4b8f9e833a1c031d", "board/drivers/{}.h")
_PORTS = "os/hal/ports/STM32/{}.c"
CHIBIOS = Repository("ChibiOS", "ChibiOS/ChibiOS", "0c20d86ff1a4a104666be9af1d08b6bcba6c9a8b", _PORTS)
NUTTX = Repository("NuttX", "apache/nuttx", "4ebc8a7291df955dece09073b8798db2dfd6490b", "arch/arm/src/{}.c")
RIOT = Repository("RIOT", "RIOT-OS/RIOT", "c8bd52ff13daea7da132b8a37986e21d47cde0fe", "cpu/stm32/periph/{}.c")
_TINYUSB = "src/portable/st/stm32_fsdev/{}"
TINYUSB = Repository("TinyUSB", "hathach/tinyusb", "fd70160a2f5fd23de1abfbaefb6399746a90b588", _TINYUSB)
KLIPPER = Repository("Klipper", "Klipper3d/klipper", "84104bbbd7625d28b4eaaad83f4562972460ecd9", "src/stm32/{}.c")
RUST = Repository("stm32f1xx-hal", "stm32-rs/stm32f1xx-hal", "b6d6bad7bf25d22a41e75aae66685348b9ffadf8", "src/{}.rs")
_PAC = "stm32f1/src/stm32f103/{}.rs"
RUST_PAC = Repository("stm32-rs", "stm32-rs/stm32-rs-nightlies", "056891d492ae56ea8fc1f739fa2ed39f501578ed", _PAC)
CMSIS = Repository(
    "CMSIS", "ARM-software/CMSIS_5", "51f8f89612c8330c0116479cfe3a2cb04c390e2b", "CMSIS/Core/Include/{}.h"
)
