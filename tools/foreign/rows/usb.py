"""Programs at the USB socket: serial lines, disks, reports, boot loaders, probes."""

from bluepill_sim import BluePill
from simbase.timing import NS_PER_S
from tools.foreign.judges.dialogue import Dialogue, Exchange
from tools.foreign.judges.hosted import Hosted
from tools.foreign.judges.scripted import Scripted
from tools.foreign.judges.usb_classes import PAGE_BYTES, WAIT_RESET, Dfu, MassStorage, lamp_program
from tools.foreign.row import ProgramKind, Row, RowError, RowPlace, Source

TINYUSB = Source(
    folder="tinyusb", url="https://github.com/hathach/tinyusb", commit="fd70160a2f5fd23de1abfbaefb6399746a90b588"
)
EXAMPLES = Source(
    folder="libopencm3-examples", url="https://github.com/libopencm3/libopencm3-examples",
    commit="15637e291b8ca228e35d5f657ed15f3b8958fa0c",
)  # fmt: skip
DAP = Source(folder="dap42", url="https://github.com/devanlai/dap42", commit="1d6d916be0639a47437db9a8817cea4bc5ece21b")
MAPLE = Source(
    folder="stm32duino-bootloader", url="https://github.com/rogerclarkmelbourne/STM32duino-bootloader",
    commit="df689808b6030280480c0d151ee9c552ecf6b405",
)  # fmt: skip
MONSTER = Source(
    folder="bluepill-serial-monster",
    url="https://github.com/r2axz/bluepill-serial-monster",
    commit="7ca8ddbdf43d4e1b849ba11d797daba839ecbd61",
)
PROBE = Source(
    folder="blackmagic",
    url="https://github.com/blacksphere/blackmagic",
    commit="f89b07d892c6034ea68494a72e047b2c437754f7",
)
SERPROG = Source(
    folder="stm32-vserprog", url="https://github.com/dword1511/stm32-vserprog",
    commit="c74b4ed5704907f56e6ed1fa59d1874fd8de1bda",
)  # fmt: skip
_EXAMPLE = "tinyusb/source/examples/device/{0}/_build/stm32f103_bluepill/{0}.elf"
_BOARD = "example {} for stm32f103_bluepill"
_SECTOR = 512


def _configured(board: BluePill) -> str:
    return board.usb.wait_configured("8 s").texts[1 + 1]


def _ports(board: BluePill, _place: RowPlace) -> str:
    _configured(board)
    board.usb.listen(0x84)
    board.usb.listen(0x82)
    board.usb.write(0x02, b"Hello over port 0\r\n")
    board.run_for("200 ms")
    first, second = board.usb.read(0x82), board.usb.read(0x84)
    if b"hello over port 0" not in first or b"HELLO OVER PORT 0" not in second:
        raise RowError(f"port 0 said {first!r}, port 1 {second!r}")
    return "port 0 in small letters, port 1 in capitals"


def _disk(board: BluePill, _place: RowPlace) -> str:
    _configured(board)
    disk = MassStorage(board, 0x03, 0x83)
    vendor = disk.command(bytes((0x12, 0, 0, 0, 36, 0)), 36)[8:32].decode()
    last, size = (int.from_bytes(part, "big") for part in _halves(disk.command(bytes((0x25, *[0] * 9)), 8)))
    sectors = [disk.command(bytes((0x28, 0, 0, 0, 0, n, 0, 0, 1, 0)), _SECTOR) for n in range(last + 1)]
    if size != _SECTOR or not b"".join(sectors).count(b"README"):
        raise RowError(f"{vendor}: {last + 1} sectors of {size}, no README in its directory")
    changed = bytes(range(256)) * 2
    disk.command(bytes((0x2A, 0, 0, 0, 0, last, 0, 0, 1, 0)), data=changed)
    if disk.command(bytes((0x28, 0, 0, 0, 0, last, 0, 0, 1, 0)), _SECTOR) != changed:
        raise RowError("what was written was not read back")
    return f"{' '.join(vendor.split())}: {last + 1} sectors read, README found, one written and read back"


def _halves(data: bytes) -> tuple[bytes, bytes]:
    return data[:4], data[4:]


def _reports(board: BluePill, _place: RowPlace) -> str:
    _configured(board)
    reports = [bytes((number + at) & 0xFF for at in range(64)) for number in range(20)]
    for report in reports:
        board.usb.write(0x01, report)
        if (came := board.usb.wait_packet(0x81).data) != report:
            raise RowError(f"report {report.hex()} came back as {came.hex()}")
    return f"{len(reports)} reports of 64 bytes come back"


def _partitions(board: BluePill, _place: RowPlace) -> str:
    _configured(board)
    said = Dfu(board).upload(0, 64)
    if b"Hello world from TinyUSB DFU" not in said:
        raise RowError(f"upload gave {said!r}")
    state = Dfu(board).download(0, b"new contents")
    return f"upload gives {said.decode()!r}, a block is taken, state {state}"


def _dfuse(board: BluePill, _place: RowPlace) -> str:
    """Flash a program by DfuSe at 0x08002000, and see it run."""
    product, base = _configured(board), 0x0800_2000
    dfu = Dfu(board)
    dfu.download(0, b"\x41" + base.to_bytes(4, "little"))
    dfu.download(0, b"\x21" + base.to_bytes(4, "little"))
    dfu.download(2, lamp_program(base))
    if board.read_memory(base, len(lamp_program(base))) != lamp_program(base):
        raise RowError("the program is not in the flash")
    dfu.end()
    board.reset()
    return f"{product}: flashed at {base:#x}, {_lamp(board)}"


def _lamp(board: BluePill) -> str:
    """Return when the flashed program has lit its LED for good."""
    for _ in range(50):
        board.run_for("100 ms")
        if board.led_is_on and board.pc >= 0x0800_2000:
            return f"its LED is on at {board.now_ns / NS_PER_S:.1f} s"
    raise RowError(f"the program that was flashed does not run; at {board.where()}; {board.verdict}")


def _stm32duino(board: BluePill, _place: RowPlace) -> str:
    """Flash a program by DFU 1.1, alternate setting 2, and see it run after the boot loader's own reset."""
    product, base = _configured(board), 0x0800_2000
    dfu = Dfu(board, alternate=2)
    program = lamp_program(base)
    blocks = [program[at : at + PAGE_BYTES] for at in range(0, len(program), PAGE_BYTES)]
    for number, block in enumerate(blocks):
        dfu.download(number, block)
    dfu.end()
    if (state := dfu.status()[2]) != WAIT_RESET:
        raise RowError(f"state {state} after the last block")
    if board.read_memory(base, 32) != program[:32]:
        raise RowError("the program is not in the flash")
    board.usb.reset()  # as dfu-util does: it ends the boot loader
    return f"{product}: flashed at {base:#x}, {_lamp(board)}"


def _cmsis_dap(board: BluePill, _place: RowPlace) -> str:
    product = _configured(board)
    said = []
    for number in (4, 0xF0, 0xFE):  # version of the protocol, capabilities, packets that it holds
        board.usb.write(0x01, bytes((0, number)))
        came = board.usb.wait_packet(0x81).data
        if came[0] != 0 or not came[1]:
            raise RowError(f"DAP_Info {number:#x} gave {came.hex()}")
        said.append(came[2 : 2 + came[1]].rstrip(b"\0").hex(" "))
    board.usb.write(0x01, bytes((2, 1)))
    if board.usb.wait_packet(0x81).data[:2] != bytes((2, 1)):
        raise RowError("DAP_Connect to SWD failed")
    board.usb.write(0x01, bytes((5, 0, 1, 2)))  # DAP_Transfer: read IDCODE; nobody is at its wires
    if (came := board.usb.wait_packet(0x81, "2 s").data)[0] != 5:
        raise RowError(f"DAP_Transfer gave {came.hex()}")
    return f"{product}: version, capabilities, packets {', '.join(said)}; SWD with nobody there answers {came[2]}"


def _bridge(board: BluePill, _place: RowPlace) -> str:
    """Carry bytes from USB to its UART and back."""
    product = _configured(board)
    board.usb_serial.receive(b"to the wire")
    board.run_for("100 ms")
    ports = {name: port.read() for name, port in board.serial_ports.items()}
    name = next((name for name, data in ports.items() if b"to the wire" in data), "")
    if not name:
        raise RowError(f"nothing on the UARTs: {ports}")
    board.serial_ports[name].receive(b"from the wire")
    board.run_for("100 ms")
    if b"from the wire" not in (came := board.usb_serial.read()):
        raise RowError(f"{name} took it, and USB gave back {came!r}")
    return f"{product}: USB to {name} and back"


_FLASHROM = ("flashrom", "-p", "serprog:dev={line}:4000000")

USB = (
    Row(
        name="cdc-echo", kind=ProgramKind.FIRMWARE, source=EXAMPLES, program="example f1/stm32-h103/usb_cdcacm",
        said="echoes its input",
        judge=Dialogue(
            image="libopencm3-examples/source/examples/stm32/f1/stm32-h103/usb_cdcacm/cdcacm.elf", port="usb",
            steps=(Exchange(say=b"echo of 21 bytes, two", hear=rb"echo of 21 bytes, two"),
                   Exchange(say=bytes(range(1, 64)), hear=bytes(range(60, 64)))),
        ),
    ),
    Row(
        name="tinyusb-cdc", kind=ProgramKind.FIRMWARE, source=TINYUSB, program=_BOARD.format("cdc_dual_ports"),
        said="echoes port 0 at both ports, in lower and upper case",
        judge=Scripted(image=_EXAMPLE.format("cdc_dual_ports"), script=_ports),
    ),
    Row(
        name="tinyusb-disk", kind=ProgramKind.FIRMWARE, source=TINYUSB, program=_BOARD.format("cdc_msc"),
        said="INQUIRY, READ CAPACITY, every sector; one written and read back",
        judge=Scripted(image=_EXAMPLE.format("cdc_msc"), script=_disk),
    ),
    Row(
        name="tinyusb-hid", kind=ProgramKind.FIRMWARE, source=TINYUSB, program=_BOARD.format("hid_generic_inout"),
        said="echoes each report", judge=Scripted(image=_EXAMPLE.format("hid_generic_inout"), script=_reports),
    ),
    Row(
        name="tinyusb-dfu", kind=ProgramKind.FIRMWARE, source=TINYUSB, program=_BOARD.format("dfu"),
        said="upload of a partition, download of a block",
        judge=Scripted(image=_EXAMPLE.format("dfu"), script=_partitions),
    ),
    Row(
        name="dfuse", kind=ProgramKind.FIRMWARE, source=EXAMPLES, program="example f1/stm32-h103/usb_dfu",
        said="erase, set the address, program, leave; the program runs",
        judge=Scripted(
            image="libopencm3-examples/source/examples/stm32/f1/stm32-h103/usb_dfu/usbdfu.elf", script=_dfuse
        ),
    ),
    *(
        Row(
            name=name, kind=ProgramKind.FIRMWARE, source=MAPLE, program=f"its binary {file}",
            said="DFU 1.1 to alternate setting 2; the flashed program runs",
            judge=Scripted(
                image=f"stm32duino-bootloader/source/bootloader_only_binaries/{file}", script=_stm32duino
            ),
        )
        for name, file in (
            ("stm32duino-pc13", "generic_boot20_pc13.bin"), ("stm32duino-maple-mini", "maple_mini_boot20.bin")
        )
    ),
    Row(
        name="cmsis-dap", kind=ProgramKind.FIRMWARE, source=DAP, program="target STM32F103-BLUEPILL",
        said="DAP_Info, DAP_Connect, a transfer without a target",
        judge=Scripted(image="dap42/source/src/DAP42.elf", script=_cmsis_dap),
    ),
    Row(
        name="usb-bridge", kind=ProgramKind.FIRMWARE, source=MONSTER, program="its Makefile's build",
        said="passes bytes from USB to a UART and back",
        judge=Scripted(image="bluepill-serial-monster/source/bluepill-serial-monster.elf", script=_bridge),
    ),
    Row(
        name="blackmagic-gdb", kind=ProgramKind.FIRMWARE, source=PROBE, program="platform swlink, at 0x08000000",
        said="GDB reads the version over USB and scans for a target; none is there",
        judge=Hosted(
            image="blackmagic/source/src/blackmagic.elf", port="usb", host_needs=("gdb-multiarch",),
            hosts=((
                "gdb-multiarch", "-batch", "-nx", "-ex", "target extended-remote {line}",
                "-ex", "monitor version", "-ex", "monitor swdp_scan",
            ),),
            hears=(r"(Black Magic Probe)", r"(SW-DP scan failed!)"),
            codes=frozenset({0, 1}),
        ),
        found="",
    ),
    Row(
        name="flashrom", kind=ProgramKind.FIRMWARE, source=SERPROG,
        program="board stm32-bluepill, W25Q16 at SPI1",
        said="flashrom finds the chip, erases and writes 32 KiB, verifies; a second run verifies again",
        judge=Hosted(
            image="stm32-vserprog/source/stm32-vserprog.elf", port="usb", host_needs=("flashrom",),
            attach=("w25q16,on=SPI1,select=PA4",),
            files=(("layout", "00000000:00007fff first\n00008000:001fffff rest\n"),),
            hosts=(
                ("sh", "-c", "seq 400000 | head -c 2097152 > {scratch}/image.bin"),
                (*_FLASHROM, "-l", "{scratch}/layout", "-i", "first", "--noverify-all", "-w", "{scratch}/image.bin"),
                (*_FLASHROM, "-l", "{scratch}/layout", "-i", "first", "-v", "{scratch}/image.bin"),
            ),
            hears=(r'(Found \w+ flash chip "[^"]+")', r"Erase/write (done)", r"(VERIFIED)", r"(VERIFIED)"),
            hosts_s=150.0,
        ),
    ),
)  # fmt: skip
