"""Operating systems, languages and benchmarks that judge themselves, and say so on a serial port."""

from tools.foreign.judges.dialogue import Dialogue, Exchange
from tools.foreign.row import ProgramKind, Row, Source

CHIBIOS = Source(
    folder="chibios", url="https://github.com/ChibiOS/ChibiOS", commit="0c20d86ff1a4a104666be9af1d08b6bcba6c9a8b"
)
COREMARK = Source(
    folder="coremark", url="https://github.com/eembc/coremark", commit="d5fad6bd094899101a4e5fd53af7298160ced6ab"
)
FREERTOS = Source(
    folder="freertos", url="https://github.com/FreeRTOS/FreeRTOS-Kernel",
    commit="4269c69a16f924c11adeedbb31591f6fad9f41b2",
)  # fmt: skip
MECRISP = Source(
    folder="mecrisp", url="https://github.com/jjonethal/mecrisp-stellaris",
    commit="a36d6d36aab4e5580e9156efc3abba2112917d14",
)  # fmt: skip
#: Images of P2IM's unit tests: NuttX, RIOT and Arduino on an STM32F103RB.
P2IM = Source(
    folder="fuzzware-experiments", url="https://github.com/fuzzware-fuzzer/fuzzware-experiments",
    commit="1b03b728ea660b777571bf2a6c1ecfa9072f0bf5",
)  # fmt: skip
NUTTX = Source(folder="nuttx", url="https://github.com/apache/nuttx", commit="4ebc8a7291df955dece09073b8798db2dfd6490b")
RIOT = Source(folder="riot", url="https://github.com/RIOT-OS/RIOT", commit="c8bd52ff13daea7da132b8a37986e21d47cde0fe")
_UNITS = "fuzzware-experiments/source/01-access-modeling-for-fuzzing/p2im-unittests/F103"


def _unit(name: str) -> str:
    return f"{_UNITS}/{name}/{name}.elf"


#: RIOT's tests wait for their host.
_START = (Exchange(hear=rb"Press s to start"), Exchange(say=b"s\n", hear=rb"START", within="5 s"))


def _riot(name: str, *steps: Exchange) -> Row:
    return Row(
        name=f"riot-{name.replace('_', '-')}", kind=ProgramKind.FIRMWARE, source=RIOT,
        program=f"its test {name} for bluepill-stm32f103c8, USART1",
        said="what the test's own script expects",
        judge=Dialogue(image=f"riot/tests_{name}.elf", steps=(*_START, *steps)),
    )  # fmt: skip


SYSTEMS = (
    Row(
        name="coremark", kind=ProgramKind.FIRMWARE, source=COREMARK,
        program="performance run, 1500 iterations at 72 MHz, timed by SysTick, USART1",
        said="EEMBC's CRCs for this run, and its own verdict",
        judge=Dialogue(
            image="coremark/coremark.elf",
            steps=(
                Exchange(hear=rb"seedcrc\s+: 0xe9f5.*crclist\s+: 0xe714.*crcmatrix\s+: 0x1fd7.*crcstate\s+: 0x8e3a",
                     within="20 s"),
                Exchange(hear=rb"Correct operation validated"),
            ),
        ),
    ),
    Row(
        name="freertos", kind=ProgramKind.FIRMWARE, source=FREERTOS,
        # Tick of 1 kHz at 72 MHz: a producer every 10 ticks, a consumer, two tasks that share a mutex, a timer of 50.
        program="kernel, port ARM_CM3, 1 kHz tick: queue, mutex, timer; USART1",
        said="5050 by queue in exactly 1000 ticks, 20 timer events, 4000 turns under the mutex",
        judge=Dialogue(
            image="freertos/tasks.elf",
            steps=(Exchange(hear=rb"sum 5050 ticks 1000 fired 20 shared 4000", within="3 s"),),
        ),
    ),
    Row(
        name="chibios", kind=ProgramKind.FIRMWARE, source=CHIBIOS,
        program="its demo RT-STM32F103-OLIMEX_STM32_P103: button PA0, USART2 at 38400",
        said="the button starts its kernel and library test suites; both end in SUCCESS",
        judge=Dialogue(
            image="chibios/source/demos/STM32/RT-STM32F103-OLIMEX_STM32_P103/build/ch.elf", port="usart2",
            baud=38400, drive=(("PA0", 1),),
            steps=(
                Exchange(hear=rb"RT Test Suite.*Final result: (SUCCESS)", within="200 s"),
                Exchange(hear=rb"OS Library Test Suite.*Final result: (SUCCESS)", within="60 s"),
            ),
        ),
    ),
    Row(
        name="mecrisp", kind=ProgramKind.FIRMWARE, source=MECRISP,
        program="precompiled Forth for the STM32F103, USART1 at 115200",
        said="arithmetic, a word compiled into RAM, and one into flash that survives a reset",
        judge=Dialogue(
            image="mecrisp/source/stm32f103/precompiled/mecrisp-stellaris-stm32f103-with-disassembler-m3.hex",
            steps=(
                Exchange(hear=rb"Mecrisp-Stellaris [\d.]+ for STM32F103.*Koch\s"),
                Exchange(say=b"6 7 * .\r", hear=rb"\. 42  ok\."),
                Exchange(say=b": sq dup * ; 12 sq .\r", hear=rb"\. 144  ok\."),
                Exchange(say=b"compiletoflash : cube dup dup * * ; compiletoram\r", hear=rb"compiletoram.*ok\."),
                Exchange(say=b"reset\r", hear=rb"Mecrisp-Stellaris.*Koch\s"),
                # It has no buffer, and looks through its flash once it has said its name.
                Exchange(pause="50 ms", say=b"11 cube .\r", hear=rb"\. 1331  ok\."),
            ),
        ),
        found="code behind a reset request was reported as a fault",
    ),
    Row(
        name="nuttx-usart", kind=ProgramKind.FIRMWARE, source=P2IM,
        program="NuttX with P2IM's program that reads ttyS0",
        said="starts its application and echoes its input",
        judge=Dialogue(
            image=_unit("NUTTX-USART"),
            steps=(
                Exchange(hear=rb"Myapp running!!.*Reading from /dev/ttyS0"),
                Exchange(say=b"hello world\r\n", hear=rb"rx:h \r\nrx:el \r\nrx:lo \r\nrx: w"),
            ),
        ),
    ),
    Row(
        name="nuttx-adc", kind=ProgramKind.FIRMWARE, source=P2IM, program="NuttX with its example adc",
        said="samples the ADC with half the supply at every input",
        judge=Dialogue(
            image=_unit("NUTTX-F103-ADC"),
            volts=tuple((f"P{port}{number}", 1.65) for port in "AB" for number in (0, 1)),
            steps=(Exchange(hear=rb"channel: \d+ value: (204[789])", within="3 s"),),
        ),
    ),
    Row(
        name="nuttx-pwm", kind=ProgramKind.FIRMWARE, source=P2IM, program="NuttX with its example pwm",
        said="reports its 100 Hz output and its end",
        judge=Dialogue(
            image=_unit("NUTTX-PWM"),
            steps=(
                Exchange(hear=rb"starting output with frequency: 100 duty: 00008000", within="3 s"),
                Exchange(hear=rb"stopping output.*finishing example: 0", within="10 s"),
            ),
        ),
    ),
    _riot("mutex_order", Exchange(hear=rb"T\d+ \(prio 1\): locked mutex now", within="5 s")),
    Row(
        name="nuttx-nsh", kind=ProgramKind.FIRMWARE, source=NUTTX,
        program="stm32f103-minimum:nsh with nuttx-apps, USART1 at 115200",
        said="shell: identity, devices, and a sleep of two seconds that takes two",
        judge=Dialogue(
            image="nuttx/source/nuttx",
            steps=(
                Exchange(hear=rb"NuttShell \(NSH\).*nsh> "),
                Exchange(say=b"uname -a\r", hear=rb"(NuttX .* arm stm32f103-minimum)"),
                Exchange(say=b"ls /dev\r", hear=rb"/dev:\s+(console\s+ttyS0)"),
                Exchange(say=b"sleep 2; echo done\r", hear=rb"\n(done)\r", within="2100 ms"),
            ),
        ),
    ),
    _riot(
        "xtimer_usleep",
        Exchange(hear=rb"Slept for (500\d\d us \(expected: 50000 us\) Offset: \d\d us).*Test ran for", within="60 s"),
    ),
    _riot("irq", Exchange(hear=rb"SUCCESS", within="20 s")),
    _riot("thread_flags", Exchange(hear=rb"SUCCESS", within="10 s")),
)  # fmt: skip
