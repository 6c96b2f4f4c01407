"""Programs that answer a protocol of their trade on a serial line, each with its own host."""

from tools.foreign.judges.dialogue import Dialogue, Exchange
from tools.foreign.judges.hosted import CountedEdges, Hosted
from tools.foreign.row import ProgramKind, Row, Source
from tools.foreign.rows.systems import P2IM

GRBL = Source(folder="grbl", url="https://github.com/usbcnc/grbl", commit="7e3308b80ae75a74b27729c41515f3ea5ce75b5d")
BASEFLIGHT = Source(
    folder="baseflight", url="https://github.com/multiwii/baseflight", commit="e582e0ce6321b7dd2293a60264e1040d0cbac5a4"
)
MODBUS = Source(
    folder="nanomodbus", url="https://github.com/debevv/nanoMODBUS", commit="035b8d596a954c2dd4bc40e3fa28a7cb2a8c0ec1"
)
OPENBLT = Source(
    folder="openblt", url="https://github.com/feaser/openblt", commit="e43969da80866c6bbd6188ff58b53df4a878bc8a"
)
_PYTHON = "{cache}/py/bin/python"
_PACKAGE = "py/lib/python*/site-packages/"
#: grbl-streamer's own order of things: it resets, waits for the greeting, streams by counting characters.
_STREAM = """import sys
import threading
import time
from grbl_streamer import GrblStreamer

seen, booted, done = [], threading.Event(), threading.Event()


def heard(event, *data):
    seen.append((event, data))
    if event == "on_boot":
        booted.set()
    if event == "on_job_completed":
        done.set()
    if event in ("on_error", "on_alarm"):
        print(event, data)


grbl = GrblStreamer(heard)
grbl.setup_logging()
grbl.cnect(sys.argv[1], 115200)
assert booted.wait(20), "no greeting"
grbl.killalarm()
grbl.poll_start()
time.sleep(3)  # for what it asks by itself of a machine that stands: $#, $G
done.clear()
grbl.incremental_streaming = False
grbl.write("G91\\nG1 X10 Y5 F600\\nG1 X-10 F600\\n" + 20 * "G1 Z0.1 F300\\nG1 Z-0.1\\n" + "G1 Y-5\\n")
grbl.job_run()
assert done.wait(60), "the job did not end"
for _ in range(200):
    states = [data for event, data in seen if event == "on_stateupdate"]
    if states and states[-1][0] == "Idle" and not any(states[-1][1]):
        break
    time.sleep(0.1)
print("greeting and job done;", states[-1][0], "at", *states[-1][1])
grbl.disconnect()
"""
#: 400 steps a millimetre, idle high: the first rise of each is its level after the boot.
_GRBL_EDGES = (
    CountedEdges(pin="PA0", least=8001),
    CountedEdges(pin="PA1", least=4001),
    CountedEdges(pin="PA2", least=1601),
)
#: MSP by its frames; PyPI's package MultiWii decodes no answer of bytes.
_MSP = """import sys
import time
import serial

line = serial.Serial(sys.argv[1], 115200, timeout=2)


def ask(code, data=b""):
    body = bytes((len(data), code)) + data
    check = 0
    for byte in body:
        check ^= byte
    line.reset_input_buffer()
    line.write(b"$M<" + body + bytes((check,)))
    head = line.read(5)
    assert head[:3] == b"$M>" and head[4] == code, head
    answer = line.read(head[3] + 1)
    check = head[3] ^ head[4]
    for byte in answer:
        check ^= byte
    assert len(answer) == head[3] + 1 and check == 0, answer
    return answer[:-1]


def shorts(data):
    return [int.from_bytes(data[at:at + 2], "little", signed=True) for at in range(0, len(data), 2)]


time.sleep(6)
ident = ask(100)
print("IDENT version", ident[0], "type", ident[1])
raw = shorts(ask(102))
print("IMU", raw[:6])
ask(214, b"".join(value.to_bytes(2, "little") for value in (1200, 1300, 1400, 1500, 1000, 1000, 1000, 1000)))
time.sleep(0.5)
print("MOTORS", shorts(ask(104))[:4])
time.sleep(0.5)
"""
_REGISTERS = """import sys
from pymodbus.client import ModbusSerialClient

client = ModbusSerialClient(sys.argv[1], baudrate=19200, timeout=2)
assert client.connect()
done = 0
for start in (0, 5, 20):
    values = [(start * 1000 + at * 7919) & 0xFFFF for at in range(10)]
    assert not client.write_registers(start, values, device_id=17).isError()
    assert client.read_holding_registers(start, count=10, device_id=17).registers == values
    done += 10
assert not client.write_register(3, 0xBEEF, device_id=17).isError()
assert client.read_holding_registers(3, count=1, device_id=17).registers == [0xBEEF]
bits = [at % 3 == 0 for at in range(24)]
assert not client.write_coils(8, bits, device_id=17).isError()
assert client.read_coils(8, count=24, device_id=17).bits[:24] == bits
beyond = client.read_holding_registers(30, count=10, device_id=17)
assert beyond.isError() and beyond.exception_code == 2, beyond
print("registers and coils:", done + 1, "and", len(bits), "written and read back; beyond them exception 2")
"""
_FIRMATA = """import sys
import time
import pyfirmata2

board = pyfirmata2.Board(sys.argv[1], baudrate=57600, layout={
    "digital": tuple(range(14)), "analog": tuple(range(6)), "pwm": (), "use_ports": True, "disabled": (),
})
print("firmware", board.get_firmata_version(), board.firmware)
time.sleep(1)
lamp = board.get_pin("d:13:o")
for _ in range(3):
    for level in (1, 0):
        lamp.write(level)
        time.sleep(0.1)
print("pin 13 six times")
board.exit()
"""

INSTRUMENTS = (
    *(
        Row(
            name=f"grbl-{port}", kind=ProgramKind.FIRMWARE, source=GRBL,
            program=f"grbl 1.1f for an STM32F103, {words}",
            said="grbl-streamer (PyPI) resets, unlocks and streams a job; steps are counted, idle at the end",
            judge=Hosted(
                image=f"grbl/grbl-{port}.elf", port="usart1" if port == "usart" else port,
                host_needs=(f"{_PACKAGE}grbl_streamer",),
                files=(("stream.py", _STREAM),), hosts=((_PYTHON, "{scratch}/stream.py", "{line}"),),
                hears=(r"greeting and (job done; Idle at 0.0 0.0 0.0)",),
                edges=_GRBL_EDGES,
                hosts_s=100.0,
            ),
        )
        for port, words in (("usart", "USART1 at 115200"), ("usb", "USB"))
    ),
    Row(
        name="baseflight-msp", kind=ProgramKind.FIRMWARE, source=BASEFLIGHT,
        program="Baseflight, target NAZE, MPU-6050 at I2C2, motors at TIM1 and TIM4",
        said="MSP: identity, IMU, motors set and read back",
        judge=Hosted(
            image="baseflight/source/obj/baseflight_NAZE.elf", host_needs=(f"{_PACKAGE}serial",),
            attach=("mpu6050,on=I2C2",), files=(("msp.py", _MSP),),
            hosts=((_PYTHON, "{scratch}/msp.py", "{line}"),),
            hears=(r"IDENT (version \d+ type \d+)", r"IMU (\[[^]]*\])", r"MOTORS (\[1200, 1300, 1400, 1500\])"),
        ),
        found="the MPU-6050's revision registers",
    ),
    Row(
        name="modbus", kind=ProgramKind.FIRMWARE, source=MODBUS,
        program="an RTU server on its library: unit 17, USART1 at 19200, 32 registers and coils",
        said="pymodbus (PyPI) writes and reads back registers and coils; beyond them, exception 2",
        judge=Hosted(
            image="nanomodbus/server.elf", host_needs=(f"{_PACKAGE}pymodbus",),
            files=(("client.py", _REGISTERS),), hosts=((_PYTHON, "{scratch}/client.py", "{line}"),),
            hears=(r"registers and coils: ([^\n]+)",),
        ),
    ),
    Row(
        name="firmata", kind=ProgramKind.FIRMWARE, source=P2IM,
        program="P2IM's image Gateway: StandardFirmata on stm32duino, USART2 at 57600",
        said="pyfirmata2 (PyPI) reads the version and sets pin 13; PA5 rises 2, 5 (the version) and 3 times",
        judge=Hosted(
            image="fuzzware-experiments/source/02-comparison-with-state-of-the-art/P2IM/Gateway/Gateway.elf",
            port="usart2", host_needs=(f"{_PACKAGE}pyfirmata2",),
            files=(("blink.py", _FIRMATA),), hosts=((_PYTHON, "{scratch}/blink.py", "{line}"),),
            hears=(r"firmware (\(\d+, \d+\) [^\n]+)", r"pin 13 six times"), edges=(CountedEdges(pin="PA5", least=10),),
        ),
    ),
    Row(
        name="openblt", kind=ProgramKind.FIRMWARE, source=OPENBLT,
        # As Intel HEX of its S-records; BootCommander without its call that raises DTR, which pseudo-terminals lack.
        program="its demo ARMCM3_STM32F1_Nucleo_F103RB_GCC, USART2 at 57600; BootCommander built without DTR",
        said="BootCommander erases, programs and starts the demo program; its LED at PA5 blinks",
        judge=Hosted(
            image="openblt/openblt.hex", port="usart2", host_needs=("openblt/source/Host/BootCommander",),
            hosts=((
                "{cache}/openblt/source/Host/BootCommander", "-s=xcp",
                    # Its patience, for a machine that is busy elsewhere.
                    "-t1=10000", "-t3=10000", "-t4=20000", "-t5=10000", "-t6=1000", "-t7=10000",
                    "-t=xcp_rs232", "-d={line}", "-b=57600",
                "{cache}/openblt/source/Target/Demo/ARMCM3_STM32F1_Nucleo_F103RB_GCC/Prog/bin/demoprog_stm32f103.srec",
            ), ("sleep", "3")),
            hears=(r"Finishing programming session\.\.\.\[\S*(OK)",),
            # The boot loader's own lamp would blink fifteen times.
            edges=(CountedEdges(pin="PA5", least=2, most=9, is_final=True),),
        ),
    ),
    Row(
        name="arduino-adc", kind=ProgramKind.FIRMWARE, source=P2IM,
        program="Arduino's image ARDUINO-F103-ADC",
        said="half the supply at its input is printed as 2.50 of 5 V on USART2",
        judge=Dialogue(
            image="fuzzware-experiments/source/01-access-modeling-for-fuzzing/p2im-unittests/F103/ARDUINO-F103-ADC/"
            "ARDUINO-F103-ADC.elf",
            port="usart2", volts=tuple((f"P{port}{number}", 1.65) for port in "AB" for number in (0, 1)),
            steps=(Exchange(hear=rb"(2\.50)\r\n2\.50", within="3 s"),),
        ),
    ),
)  # fmt: skip
