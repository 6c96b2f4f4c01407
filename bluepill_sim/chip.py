"""The whole chip: core, memories, bus and peripherals, brought forward together.

This is not the board: pins are handed out and images are loaded by `board.py`; the bus is `memory/bus.py`;
the tables of the chip are `stm32f103.py`.

Theory of operation. At each block boundary: SysTick and the fabric's queue act on
what is due, a requested reset is done, then the core goes on to the earliest of the
limit and the next deadline (the native core does all that by itself). A peripheral
that moves a deadline or an interrupt line inside an access brings the end of the
core's slice forward, so that what happens never depends on where the caller's slices
end. Subscribers get what has happened when the chip has run.

Source: RM0008 section 3.1.
Invariant: time never goes back; `now_ns` inside a peripheral's access is the
time of the accessing instruction.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from bluepill_sim.core import GENERAL, BlockRecorder
from bluepill_sim.core.block_cost import NO_BLOCK, BasicBlock, measure_block
from bluepill_sim.core.debugging.comparators import cycles_to_match
from bluepill_sim.core.debugging.debug_unit import Watchpoint
from bluepill_sim.core.forced_bits import forced_bits
from bluepill_sim.core.halts import ChipReached, HaltKind
from bluepill_sim.core.nvic import NMI
from bluepill_sim.core.processor import FaultListener
from bluepill_sim.core.system_control import PPB_BASE, PPB_BYTES, SystemControl
from bluepill_sim.fabric.clocks import Clocks
from bluepill_sim.fabric.cycle_clock import CycleClock
from bluepill_sim.fabric.low_power import STOP_WAKE_NS, LowPower, PowerMode
from bluepill_sim.fabric.power import LEAST_SUPPLY_MV, MOST_SUPPLY_MV, Power
from bluepill_sim.fabric.registers import WORD, Peripheral
from bluepill_sim.memory.arrays import Memory
from bluepill_sim.memory.bus import (
    ALIAS_BYTES,
    PERIPHERAL_ALIAS,
    PERIPHERAL_BYTES,
    SRAM_ALIAS,
    PeripheralBus,
    SramBitBand,
)
from bluepill_sim.native.interrupt_latency import InterruptLatency
from bluepill_sim.native.processor import make_core
from bluepill_sim.native.registers import share_registers
from bluepill_sim.peripherals.flash import OPTION_BYTES, PROGRAM_NS
from bluepill_sim.peripherals.rcc import OUTSIDE, ResetCause
from bluepill_sim.stm32f103 import (
    FLASH_BASE,
    FLASH_BYTES_FITTED,
    FREEZE_BITS,
    OPTION_BYTES_BASE,
    PERIPHERAL_BASE,
    SRAM_BASE,
    SRAM_BYTES,
    SYSTEM_MEMORY_BASE,
    WAKING_IRQS,
    is_in_sram,
    make_parts,
    make_pins,
    without_alias,
)
from simbase.state import Stateful
from simbase.timing import Nanos, Reason

#: The upper byte of the first halfword of a 32-bit instruction is this or more.
_FIRST_WIDE_BYTE = 0xE8
#: The flash is programmed by halfwords.
_FLASH_WRITE_BYTES = 2

#: Takes a message, its key, and the address of the instruction that caused it.
WarningListener = Callable[[str, str, int], None]


class Chip(Stateful):
    """An STM32F103 with its flash filled by the caller; `ChipPorts` for its peripherals."""

    STATE = (
        "memory",
        "processor",
        "system",
        "pins",
        "parts",
        "clocks",
        "power",
        "low_power",
        "_clock",
        "_bus",
        "_stop_requested",
        "_requested_reset",
        "_flash_repairs",
        "_stopped_tick",
        "_stopped_cycle",
        "is_held",
        "latency",
    )
    DERIVED = ("_flash_access", "_written_code", "_frozen_since", "resets")

    def __init__(self, memory: Memory, vector_table: int, on_warning: WarningListener, on_fault: FaultListener) -> None:
        """Make the chip, in the state after power-on.

        Args:
            memory: its memories.
            vector_table: where the program's vectors are.
            on_warning: called with each warning.
            on_fault: called with each HardFault and lockup.
        """
        self.memory = memory
        #: Returns where the vectors are that a reset starts at: what the BOOT pins say.
        self.boot_address: Callable[[], int] = lambda: vector_table
        #: Called with the cause before each reset.
        self.on_reset: Callable[[ResetCause], None] | None = None
        self._on_warning = on_warning
        self.clocks = Clocks()
        self.power = Power()
        self.low_power = LowPower(self)
        #: When Stop began, and when SysTick would have acted next, in cycles.
        self._stopped_cycle = 0
        self._stopped_tick: int | None = None
        #: Since when time passes with the core halted by a debugger; None: it does not. And the resets so far.
        self._frozen_since: Nanos | None = None
        self.resets = 0
        self._clock = CycleClock(self.clocks.hclk_hz)
        #: Called before each reset, for tools.
        self.reset_listeners: list[Callable[[], None]] = []
        self._stop_requested = False
        #: Whether the core is held in reset until one from outside: its program resets for ever.
        self.is_held = False
        self._requested_reset: ResetCause | None = None
        self._flash_access = self.clocks.flash_wait_states, self.clocks.flash_prefetch
        self._flash_repairs: list[tuple[int, bytes]] = []
        #: What a bus master has written over code in SRAM since the last boundary: addresses and sizes.
        self._written_code: list[tuple[int, int]] = []
        #: Whether the pins, and whether the peripherals exist: making them already calls back.
        self._is_made = self._is_complete = False
        self.engine, self.processor = make_core(self._measure, memory)
        self.processor.on_fault = on_fault
        self.processor.awaits_reset = lambda: self._requested_reset is not None
        self.processor.on_deep_sleep = self._begin_low_power
        self.processor.on_entry = self._act_on_due
        self.pins = make_pins(self)
        self.fabric = self.pins.fabric
        self.uses_native_core = self.engine.join(self.fabric.handle)
        self._is_made = True
        self._time_changed()
        self.parts = make_parts(self)
        self._reporters = [part for part in self.parts.by_name.values() if type(part).deliver is not Peripheral.deliver]
        self._is_complete = True
        memory.on_reprogrammed = self._drop_flash
        self.parts.flash.memory = _FlashArray(memory, self._flash_repairs)
        self.system = SystemControl(self.processor, self)
        self.processor.on_unmodelled = lambda what: self.warn(f"{what}: not modelled", once=what)
        self._match_slot = self.fabric.add_slot("DWT", self._count_matched)
        self.latency = InterruptLatency(self.engine, self.fabric)
        self._map()
        self.reset(ResetCause.POWER)

    # Time.

    @property
    def now_ns(self) -> Nanos:
        """The exact time of the accessing instruction or event inside a peripheral, else the time reached."""
        event_ns = self.fabric.event_ns if self._is_made else None
        if event_ns is not None:
            return event_ns
        return self._clock.ns_of(self.engine.access_cycle)

    @property
    def access_cycle(self) -> int:
        """The time of the accessing instruction, in cycles."""
        return self.engine.access_cycle

    @property
    def access_pc(self) -> int:
        """The accessing instruction, else the next one."""
        return self.engine.access_pc

    def ns_of(self, cycle: int) -> Nanos:
        """Return when a cycle of the present frequency began."""
        return self._clock.ns_of(cycle)

    def cycle_at(self, at_ns: Nanos) -> int:
        """Return the first cycle, at the present frequency, that begins at or after a time."""
        return self._clock.cycle_at(at_ns)

    def next_deadline(self) -> Nanos | None:
        """Return when a peripheral or SysTick next acts by itself; the core itself may act at any time."""
        tick = self.processor.systick.next_cycle
        tick_ns = None if tick is None else self._clock.ns_of(tick)
        return min(
            (at for at in (self.fabric.next_ns, tick_ns, self.low_power.wake_ns) if at is not None), default=None
        )

    def advance_to(self, limit_ns: Nanos) -> ChipReached:
        """Run to the first block boundary at or after a time, or to what stops the chip before."""
        try:
            return self._advance(limit_ns, self.processor.run)
        finally:
            self.deliver()

    def step(self, limit_ns: Nanos) -> ChipReached:
        """Run one instruction, or the entry of the exception that comes before it: HALT with a STEP.

        A core that sleeps first goes on to what wakes it; DEADLINE where that comes after `limit_ns`.
        """
        try:
            return self._advance(limit_ns, self.processor.step)
        finally:
            self.deliver()

    def deliver(self) -> None:
        """Hand the subscribers what has happened."""
        if self.fabric.has_news:
            self.pins.deliver()
            for part in self._reporters:
                part.deliver()

    def record_blocks(self, capacity: int, on_full: Callable[[BlockRecorder], None] | None = None) -> BlockRecorder:
        """Record each block, exception entry and exception return from now on; `stop_recording` ends it.

        Args:
            capacity: how many rows are kept for `drain`.
            on_full: called when that many wait, to drain them; without it the oldest are lost.

        Raises:
            ValueError: the capacity is below 1.
        """
        self.engine.recorder = recorder = BlockRecorder(capacity, on_full)
        return recorder

    def record_accesses(self, points: Iterable[Watchpoint]) -> list[tuple[Nanos, int]]:
        """Return a list that gets each access of the program that one of the points waits for: when, and by which PC.

        Nothing halts. `stop_recording` ends it. Blocks that were recorded are not any more.
        """
        rows: list[tuple[Nanos, int]] = []

        def add(cycle: int, pc: int) -> None:
            row = self.ns_of(cycle), pc
            if rows[-1:] != [row]:  # an access in parts, or one that is begun again
                rows.append(row)

        self.engine.recorder = BlockRecorder(1)  # so that each round of a loop is run
        self.engine.record_accesses(points, add)
        return rows

    def stop_recording(self) -> None:
        """Record no more."""
        self.engine.recorder = None
        self.engine.record_accesses((), lambda _cycle, _pc: None)

    def _advance(self, limit_ns: Nanos, go_on: Callable[[int], None]) -> ChipReached:
        processor, engine, clock, fabric = self.processor, self.engine, self._clock, self.fabric
        while True:
            may_end = self._may_end
            if may_end:
                self._act()
            now = clock.ns_of(engine.cycle)
            if self._stop_requested and may_end:
                self._stop_requested = False
                return ChipReached(now, Reason.EDGE)
            is_over = self.is_held or (processor.is_locked_up and not self.parts.has_running_watchdog)
            if is_over and now >= limit_ns:
                return ChipReached(now, Reason.HALT)
            if now >= limit_ns and may_end:
                return ChipReached(now, Reason.DEADLINE)
            if self._core_stands_still():
                self._pass_time(limit_ns)
                continue
            go_on(self._stop_cycle(limit_ns))
            fabric.check()
            if fabric.take_stop():
                self._stop_requested = True
            elif fabric.has_news:
                self.deliver()
            if processor.halt is not None:
                halt, processor.halt = processor.halt, None
                return ChipReached(clock.ns_of(engine.cycle), Reason.HALT, halt)

    def reset(self, cause: ResetCause) -> None:
        """Reset core and peripherals; time goes on. A power cut clears the SRAM too."""
        self._requested_reset = None
        self.is_held = self.is_held and cause not in OUTSIDE
        if self.on_reset is not None:
            self.on_reset(cause)
        for listener in self.reset_listeners:
            listener()
        self.resets += 1
        self.low_power.end()
        self.power.is_stopped = False
        vectors = self.boot_address()
        if cause is ResetCause.POWER:
            self._lose_sram()
            self.system.lose_power()
        self.parts.reset(cause)
        self.system.reset()
        # A program at the start of the flash is found through its alias at 0, where VTOR points after a reset.
        self.processor.reset(0 if vectors == FLASH_BASE else vectors)
        if self._frozen_since is not None:
            self._freeze()

    # What the peripherals ask for.

    def irq_changed(self, irq: int, level: bool) -> bool:
        """Take a new level of an interrupt line to the NVIC; return whether it is enabled (called by the fabric)."""
        self.processor.nvic.set_level(irq, level)
        if level:
            self.processor.pending_changed()
        return bool(self.processor.nvic.enabled >> irq & 1)

    def end_slice(self) -> None:
        """End the slice at the boundary of the running block (called by the fabric)."""
        self.processor.stop_at_boundary()

    def event_due(self, cycle: int) -> None:
        """End the slice at a cycle at the latest (called by the fabric)."""
        self.engine.stop_at = min(self.engine.stop_at, cycle)

    def reach_registers(self, address: int, size: int, written: int | None) -> int | None:
        """Make an access of a bus master to the peripherals (called by the fabric)."""
        return self._bus.reach(address - PERIPHERAL_BASE, size, written)

    def code_written(self, address: int, size: int) -> None:
        """Forget, before the next block, what was translated from these bytes (called by the fabric)."""
        self._written_code.append((address, size))
        self.processor.stop_at_boundary()

    def clock_changed(self) -> None:
        """Go on at the frequency and the wait states now in `clocks`."""
        clocks = self.clocks
        self._clock.set_frequency(clocks.hclk_hz, self.engine.access_cycle)
        self._time_changed()
        if self._is_complete:
            self.plan_match()
        self._take_flash_access()
        if self._is_complete:
            self.parts.clock_changed()
        self.processor.stop_at_boundary()

    def set_supply(self, supply_mv: int) -> None:
        """Change the supply, in mV.

        Raises:
            ValueError: The chip does not work at it.
        """
        if not LEAST_SUPPLY_MV <= supply_mv <= MOST_SUPPLY_MV:
            limits = f"{LEAST_SUPPLY_MV / 1000:g} to {MOST_SUPPLY_MV / 1000:g} V"
            raise ValueError(f"the chip works at {limits}, not at {supply_mv / 1000:g} V")
        self.power.supply_mv = supply_mv
        self.parts.pwr.supply_changed()

    def flash_began(self) -> None:
        """Have the core wait where it needs the flash: before the next access of the block, or at its end."""
        self.engine.shared.waits = self.engine.access_pc < SYSTEM_MEMORY_BASE
        self.processor.stop_at_boundary()

    @contextmanager
    def halted_core(self) -> Iterator[None]:
        """Have time pass without the core, as while a debugger halts it; what DBGMCU_CR freezes stands still too."""
        systick = self.processor.systick
        cycle, tick, systick.next_cycle = self.engine.cycle, systick.next_cycle, None
        count = self.resets
        self._freeze()
        try:
            yield
        finally:
            self._frozen_since, since_ns = None, self._frozen_since or 0
            for part in self._frozen_parts():
                part.thaw(self.now_ns - since_ns)
            if self.resets == count:
                self.processor.skip_cycles(self.engine.cycle - cycle, tick)
                self.plan_match()

    def _freeze(self) -> None:
        self._frozen_since = self.now_ns
        for part in self._frozen_parts():
            part.freeze()

    def _frozen_parts(self) -> list[Peripheral]:
        """Return what DBGMCU_CR freezes; in Stop all of it but IWDG stands still already."""
        bits = self.system.dbgmcu_cr & (1 << FREEZE_BITS["IWDG"] if self.power.is_stopped else WORD)
        return [part for name, part in self.parts.by_name.items() if bits >> FREEZE_BITS.get(name, 32) & 1]

    def request_stop(self) -> None:
        """End the slice at the boundary of the running block."""
        self._stop_requested = True
        self.processor.stop_at_boundary()

    def reset_peripheral(self, name: str) -> None:
        """Reset one peripheral."""
        part = self.parts.by_name.get(name)
        if part is not None:
            part.reset()
            self.processor.stop_at_boundary()

    def reset_backup_domain(self) -> None:
        """Reset what the backup domain holds."""
        self.parts.reset_backup_domain()
        self.processor.stop_at_boundary()

    def request_reset(self) -> None:
        """Reset the chip at the boundary of the running block (SYSRESETREQ)."""
        self._requested_reset = ResetCause.SOFTWARE
        self.processor.stop_at_boundary()

    def watchdog_expired(self, name: str) -> None:
        """Reset the chip at the boundary of the running block, because of the watchdog of that name."""
        self._requested_reset = ResetCause[name]
        self.processor.stop_at_boundary()

    def signal(self, name: str) -> None:
        """Do what an event means to the core: WFE's, NMI, PWR's wake-up, the loss of its clock."""
        if name == "event":
            self.processor.send_event()
        elif name == "nmi" and not self.processor.nvic.active >> NMI & 1:
            self.processor.pend(NMI)
        elif name == "no clock":
            self.low_power.lose_clock()
            self.processor.stop_at_boundary()
        elif name == "wake":
            self.low_power.wake()
            self.processor.stop_at_boundary()

    def warn(self, message: str, *, once: str, pc: int | None = None) -> None:
        """Pass on a warning."""
        master = self.fabric.master if self._is_made else None
        if master is not None:
            message = f"{message} by {master}"
        self._on_warning(message, once, self.engine.access_pc if pc is None else pc)

    def _restored(self) -> None:
        """Forget what was worked out before: due times, and costs of blocks at other wait states."""
        self._take_flash_access()
        self._time_changed()
        self.fabric.resume()

    # Internals.

    def _take_flash_access(self) -> None:
        """Have blocks measured again where their costs depend on wait states that are others now."""
        access = self.clocks.flash_wait_states, self.clocks.flash_prefetch
        if access != self._flash_access:
            self._flash_access = access
            self.engine.forget_costs()

    def _time_changed(self) -> None:
        """Tell the fabric where cycles and nanoseconds are tied together."""
        frequency_hz, base_ns, base_cycle = self._clock.base
        self.fabric.set_time(base_ns, base_cycle, frequency_hz)

    def _act(self) -> None:
        """At a boundary: do what was left for it, and what is due."""
        if self._flash_repairs:
            self._repair_flash()
        self._drop_written_code()
        self._act_on_due(self.engine.cycle)  # before a reset that the last block has asked for: C does so too
        self._drop_written_code()
        if self._requested_reset is not None:
            self.reset(self._requested_reset)

    def _act_on_due(self, cycle: int) -> None:
        systick = self.processor.systick
        if systick.next_cycle is not None and cycle >= systick.next_cycle:
            systick.advance_to(cycle)
        self.fabric.run_events(self._clock.ns_of(cycle))

    def _drop_written_code(self) -> None:
        for address, size in self._written_code:
            self.engine.drop_code(address, size)
        self._written_code.clear()

    def _stop_cycle(self, limit_ns: Nanos) -> int:
        """Return the cycle up to which the core may run: C stops at deadlines by itself.

        Code in SRAM goes on while the flash is busy, up to where it, or the handler of an interrupt, needs flash: each
        boundary has to be looked at.
        """
        if self.parts.flash.is_busy:
            next_cycle = self._next_cycle(limit_ns)
            return next_cycle if self.processor.is_asleep else min(next_cycle, self.engine.cycle + 1)
        return self._clock.cycle_at(limit_ns) if self.uses_native_core else self._next_cycle(limit_ns)

    def _next_cycle(self, limit_ns: Nanos) -> int:
        """Return the cycle of the earliest of the limit and the deadlines."""
        due = self.next_deadline()
        return self._clock.cycle_at(limit_ns if due is None else min(due, limit_ns))

    def plan_match(self) -> None:
        """Work out when CYCCNT next comes to what the DWT compares it with."""
        now = self.engine.access_cycle
        cycles = cycles_to_match(self.processor.shared, self.system.count_at(now))
        self.fabric.schedule(self._match_slot, None if cycles is None else self._clock.ns_of(now + cycles))

    def _count_matched(self, _now_ns: Nanos) -> None:
        self.processor.comparator_matched(0)
        self.plan_match()

    # Where the core stands still (`LowPowerPorts`).

    def _core_stands_still(self) -> bool:
        """Tell whether time passes without the core: locked up, in a low-power mode, or while it waits for flash."""
        if self._frozen_since is not None or self.processor.is_locked_up or self.is_held:
            return True
        if self.low_power.mode is not PowerMode.RUN and self.low_power.holds():
            return True
        self.engine.shared.waits = is_waiting = self.parts.flash.is_busy and self.engine.pc < SYSTEM_MEMORY_BASE
        return is_waiting

    @property
    def _may_end(self) -> bool:
        """Whether time may stop here; a core that a debugger halts stands still for long, within a block as well."""
        return not self.engine.is_inside_block or self._frozen_since is not None

    def _pass_time(self, limit_ns: Nanos) -> None:
        engine = self.engine
        if self._may_end:
            engine.cycle = max(engine.cycle, self._next_cycle(limit_ns))
            return
        # What ends the wait is no boundary of the program: SysTick and the limit wait for one.
        due = min((at for at in (self.fabric.next_ns, self.low_power.wake_ns) if at is not None), default=limit_ns)
        engine.cycle = max(engine.cycle, self._clock.cycle_at(due))
        self.fabric.run_events(self._clock.ns_of(engine.cycle))
        if self._requested_reset is not None:
            self.reset(self._requested_reset)

    def _begin_low_power(self) -> None:
        self.low_power.begin()
        self.processor.stop_at_boundary()

    @property
    def flash_is_busy(self) -> bool:
        """Whether the flash is programmed or erased."""
        return self.parts.flash.is_busy

    @property
    def resets_instead(self) -> bool:
        """Whether the option bytes make a reset of the mode that SLEEPDEEP means."""
        return self.power.resets_at_standby if self.wants_standby else self.power.resets_at_stop

    def reset_instead(self) -> None:
        """Reset the chip because of the option bytes."""
        self.reset(ResetCause.LOW_POWER)

    @property
    def wants_standby(self) -> bool:
        """Whether SLEEPDEEP means Standby."""
        return self.parts.pwr.stands_by

    @property
    def stop_wake_ns(self) -> Nanos:
        """How long the end of Stop takes."""
        return STOP_WAKE_NS[self.parts.pwr.regulator_is_slow]

    def refusal(self) -> str | None:
        """Return what forbids the mode that SLEEPDEEP means (RM0008 tables 14 and 15)."""
        if self.wants_standby:
            return "PWR_CSR WUF is set" if self.parts.pwr.is_woken else None
        lines = self.parts.exti.pending
        if lines:
            return f"EXTI_PR is {lines:#x}"
        return "RTC_CRL ALRF is set" if self.parts.rtc.has_alarm else None

    def pass_over(self, why: str) -> None:
        """Go on behind the instruction."""
        mode = "Standby" if self.wants_standby else "Stop"
        self.warn(f"{mode} does not begin: {why}", once=f"PWR:{mode}")
        self.processor.wake()

    def is_woken_from_stop(self) -> bool:
        """Whether an interrupt of EXTI, or the event of a WFE, is there."""
        return self.processor.is_woken_by(WAKING_IRQS)

    def enter_stop(self) -> None:
        """Have the clocks of the core stand still."""
        self.power.is_stopped = True
        self.parts.stop()
        self.fabric.schedule(self._match_slot, None)
        systick = self.processor.systick
        self._stopped_cycle, self._stopped_tick, systick.next_cycle = self.engine.cycle, systick.next_cycle, None

    def leave_stop(self, stopped_ns: Nanos) -> None:
        """Have them go on."""
        self.power.is_stopped = False
        self.processor.skip_cycles(self.engine.cycle - self._stopped_cycle, self._stopped_tick)
        self.plan_match()
        self.parts.resume(stopped_ns)

    def enter_standby(self) -> None:
        """Forget SRAM and registers."""
        self.power.is_stopped = True
        self._lose_sram()
        self.parts.stand_by()
        self.system.reset()

    def leave_standby(self) -> None:
        """Start anew."""
        self.reset(ResetCause.STANDBY)

    def _lose_sram(self) -> None:
        self.memory.lose_power()
        self.engine.drop_code(SRAM_BASE, SRAM_BYTES)

    def _measure(self, address: int, size: int) -> BasicBlock:
        """Return the costs of a block at the present flash settings."""
        code = self.engine.flash_patch.fetched(address, self.memory.read(address, size) or b"")
        is_sram = is_in_sram(address)
        wait_states, has_prefetch = (0, True) if is_sram else self._flash_access
        return measure_block(code, address, wait_states, has_prefetch=has_prefetch)

    def _map(self) -> None:
        """Give the engine its memories and its I/O regions."""
        engine = self.engine
        for region in self.memory.regions:
            engine.map_memory(region.base, region.buffer, is_writable=region.is_writable)
            if region.base:  # the alias at 0 is the core's
                self.fabric.add_memory(region.base, region.buffer, is_writable=region.is_writable)
        self._bus = bus = PeripheralBus(self.parts.by_name, self.parts.rcc, self)
        engine.map_io(PERIPHERAL_BASE, PERIPHERAL_BYTES, bus.read, bus.write)
        engine.map_io(PERIPHERAL_ALIAS, PERIPHERAL_BYTES * ALIAS_BYTES, bus.read_bit, bus.write_bit)
        bits = SramBitBand(self.memory.sram)
        engine.map_io(SRAM_ALIAS, SRAM_BYTES * ALIAS_BYTES, bits.read_bit, bits.write_bit)
        engine.map_io(PPB_BASE, PPB_BYTES, self._read_system, self._write_system)
        share_registers(engine, self.parts.by_name.values(), self.parts.rcc)
        self.fabric.forced = self._forced
        engine.on_read_only_write = self._write_flash
        engine.on_read_only_write_at_once = self._program_at_once
        engine.on_read_only_written = self._repair_flash

    def _read_system(self, offset: int, size: int) -> int:
        """Read the private peripheral bus; a thread without privilege faults (ARM B3.1.1)."""
        if not self.processor.is_privileged and not self.system.is_open_to_all(offset):
            self.engine.stop_before(HaltKind.READ_ERROR, self.engine.access_pc, PPB_BASE + offset)
            return 0
        word = self.system.read(offset, size)
        if not self.system.is_modelled(offset):
            self.engine.declare_zero(PPB_BASE + offset)
        return word

    def _write_system(self, offset: int, size: int, value: int) -> None:
        """Write to the private peripheral bus, as `_read_system`; STIR may be opened by CCR.USERSETMPEND."""
        if not self.processor.is_privileged and not self.system.is_open_to_all(offset):
            self.engine.stop_before(HaltKind.WRITE_ERROR, self.engine.access_pc, PPB_BASE + offset)
            return
        if not self.system.write(offset, size, value) and not self.system.is_modelled(offset):
            self.engine.declare_zero(PPB_BASE + offset)

    def _forced(self, address: int) -> tuple[int, dict[int, int]]:
        """Return which bits of the word at an address the running store means, and what that hangs on."""
        engine, memory = self.engine, self.memory
        pc = engine.access_pc
        start = pc if engine.block is NO_BLOCK else engine.block.start
        second = memory.read(pc, 2)
        is_wide = second is not None and second[1] >= _FIRST_WIDE_BYTE
        code = engine.flash_patch.fetched(start, memory.read(start, pc - start + (4 if is_wide else 2)) or b"")
        return forced_bits(code, lambda number: engine.registers[GENERAL[number]], address, memory.read)

    def _write_flash(self, address: int, size: int, value: int) -> bool:
        """Take a write of the core to flash or option bytes: their controller decides; False: a bus error."""
        option = address - OPTION_BYTES_BASE
        if 0 <= option <= OPTION_BYTES - size:
            if not self.parts.flash.program_option(option, size, value):
                return False
            self._flash_repairs.append((OPTION_BYTES_BASE, self.memory.options))
            return True
        offset = without_alias(address) - FLASH_BASE
        if not 0 <= offset <= FLASH_BYTES_FITTED - size:
            return False
        if not self.parts.flash.program(offset, size, value):
            return False
        # The engine stores the value whatever the controller says: put back what should be there.
        self._flash_repairs.append((FLASH_BASE + offset, self.memory.read_flash(offset, size)))
        return True

    def _program_at_once(self, address: int, size: int, pc: int, cycle: int, stop_at: int) -> int | None:
        """Program a halfword for code in flash, which waits for it, where nothing else is due before it ends."""
        offset = without_alias(address) - FLASH_BASE
        if (
            size != _FLASH_WRITE_BYTES
            or offset % size
            or pc >= SYSTEM_MEMORY_BASE
            or not 0 <= offset <= FLASH_BYTES_FITTED - size
        ):
            return None
        done = self._clock.cycle_at(self._clock.ns_of(cycle) + PROGRAM_NS)
        return done if done < stop_at and self.parts.flash.program_at_once(offset) else None

    def _drop_flash(self) -> None:
        self.engine.drop_code(FLASH_BASE, FLASH_BYTES_FITTED)
        self.engine.drop_code(0, FLASH_BYTES_FITTED)

    def _repair_flash(self) -> None:
        for address, data in self._flash_repairs:
            if address == OPTION_BYTES_BASE:
                self.memory.options = data
                continue
            offset = address - FLASH_BASE
            self.memory.load_flash(offset, data)
            self.engine.drop_code(FLASH_BASE + offset, len(data))
            self.engine.drop_code(offset, len(data))
        self._flash_repairs.clear()


class _FlashArray:
    """The flash array, as its controller sees it; changes become code at the next boundary."""

    def __init__(self, memory: Memory, repairs: list[tuple[int, bytes]]) -> None:
        self._memory = memory
        self._repairs = repairs

    @property
    def size(self) -> int:
        return len(self._memory.flash)

    def read(self, offset: int, size: int) -> bytes:
        return self._memory.read_flash(offset, size)

    def write(self, offset: int, data: bytes) -> None:
        self._memory.load_flash(offset, data)
        self._repairs.append((FLASH_BASE + offset, data))

    @property
    def options(self) -> bytes:
        return self._memory.options

    def write_options(self, options: bytes) -> None:
        self._memory.options = options
