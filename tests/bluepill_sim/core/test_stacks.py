"""What an exception saves and puts back: frames, both stacks, privilege, reservations."""

SHPR2 = 0xE000ED1C


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def test_the_frame_holds_the_registers_and_the_return_address(run) -> None:
    machine = run(
        """
        movs r0, #10
        movs r1, #11
        movs r2, #12
        movs r3, #13
        movs r4, #14
        mov r12, r4
        movs r4, #15
        mov lr, r4
        svc #0
after:  b stop
handler: mov r1, lr
        ldr r0, [sp, #0]
        log r0
        ldr r0, [sp, #4]
        log r0
        ldr r0, [sp, #8]
        log r0
        ldr r0, [sp, #12]
        log r0
        ldr r0, [sp, #16]
        log r0
        ldr r0, [sp, #20]
        log r0
        ldr r0, [sp, #24]
        log r0
        ldr r0, [sp, #28]
        log r0
        mov r0, r1
        log r0
        bx lr""",
        {11: "handler"},
    )
    assert machine.log[:6] == [10, 11, 12, 13, 14, 15]
    assert machine.log[6] == machine.label("after")
    assert machine.log[7] & 0x010001FF == 0x01000000
    assert machine.log[8] == 0xFFFFFFF9


def test_the_stack_is_aligned_to_eight_and_put_back(run) -> None:
    machine = run(
        """
        push {r0}
        mov r6, sp
        svc #0
        mov r0, sp
        subs r0, r6, r0
        log r0
        b stop
handler: mov r0, sp
        log r0
        bx lr""",
        {11: "handler"},
    )
    aligned_at, difference = machine.log
    assert aligned_at % 8 == 0
    assert difference == 0


def test_a_thread_on_psp_without_privilege_is_interrupted_and_goes_on(run) -> None:
    machine = run(
        """
        mov32 r1, #0x20002000
        msr psp, r1
        movs r1, #3
        msr control, r1
        isb
        movs r1, #77
        push {r1}
        svc #0
        mov r0, sp
        log r0
        pop {r0}
        log r0
        mrs r0, control
        log r0
        b stop
handler: mov r0, lr
        log r0
        mrs r0, psp
        log r0
        mov r0, sp
        log r0
        bx lr""",
        {11: "handler"},
    )
    exc_return, psp, msp, thread_sp, popped, control = machine.log
    assert exc_return == 0xFFFFFFFD
    assert psp == 0x2000_2000 - 4 - 4 - 32  # the word pushed, alignment, the frame
    assert msp == 0x2000_5000
    assert (thread_sp, popped, control) == (0x2000_1FFC, 77, 3)


def test_nested_interrupts_of_an_unprivileged_thread_unwind_in_order(run) -> None:
    machine = run(
        store(SHPR2, 0x80 << 24)
        + """
        mov32 r1, #0x20002000
        msr psp, r1
        movs r1, #3
        msr control, r1
        isb
        svc #0
        log #4
        mrs r0, control
        log r0
        b stop
handler: log #1
        mov32 r1, #0xE000ED04
        mov32 r2, #0x10000000
        str r2, [r1, #0]
        isb
        log #3
        bx lr
pendsv: mov r0, lr
        log r0
        log #2
        bx lr""",
        {11: "handler", 14: "pendsv"},
    )
    assert machine.log == [1, 0xFFFFFFF1, 2, 3, 4, 3]


def test_a_context_switch_in_pendsv_starts_another_thread(run) -> None:
    """The handler makes a frame on another stack and returns to it by EXC_RETURN 0xFFFFFFFD."""
    machine = run(
        """
        svc #0
        log #9
        b stop
handler: mov32 r1, #0x20003000
        mov32 r2, #thread
        str r2, [r1, #24]
        mov32 r2, #0x01000000
        str r2, [r1, #28]
        msr psp, r1
        mov32 r2, #0xFFFFFFFD
        mov lr, r2
        bx lr
thread: mov r0, sp
        log r0
        mrs r0, control
        log r0
        b stop""",
        {11: "handler"},
    )
    assert machine.log == [0x2000_3020, 2]


def test_an_exception_breaks_the_exclusive_reservation(run) -> None:
    machine = run(
        """
        mov32 r1, #0x20000800
        ldrex r2, [r1]
        strex r0, r2, [r1]
        log r0
        ldrex r2, [r1]
        svc #0
        strex r0, r2, [r1]
        log r0
        b stop
handler: bx lr""",
        {11: "handler"},
    )
    assert machine.log == [0, 1]
