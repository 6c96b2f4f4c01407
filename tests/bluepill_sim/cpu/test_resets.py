"""Resets, their causes, and where a program starts."""

AIRCR = 0xE000ED0C


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def test_a_reset_by_software_starts_the_program_again(boot) -> None:
    machine = boot(
        """
        mov32 r3, #0x20001000
        ldr r0, [r3, #0]
        adds r0, #1
        str r0, [r3, #0]
        cmp r0, #3
        beq stop
        """
        + store(AIRCR, 0x05FA0004)
        + "here: b here"
    )
    machine.run(500)
    assert machine.is_done
    assert machine.board.read_memory(0x20001000, 4) == b"\x03\0\0\0"
    assert machine.board.now_ns >= 500_000


def test_a_write_to_aircr_without_its_key_does_nothing(run) -> None:
    assert run(store(AIRCR, 0x12340004) + "log #1").log == [1]


def test_vectors_follow_vtor(run) -> None:
    machine = run(
        """
        mov32 r1, #0x20004000
        mov32 r2, #handler+1
        str r2, [r1, #44]
        mov32 r3, #0xE000ED08
        str r1, [r3, #0]
        ldr r0, [r3, #0]
        svc #0
        log r0
        b stop
handler: log #1
        bx lr"""
    )
    assert machine.log == [1, 0x20004000]


def test_a_program_above_a_boot_loader_starts_at_its_own_vectors(boot) -> None:
    machine = boot("svc #0\nlog #2\nb stop\nhandler: log #1\nbx lr", {11: "handler"}, origin=0x0800_2000).run()
    assert machine.log == [1, 2]
    assert machine.board.image.vector_table == 0x0800_2000
