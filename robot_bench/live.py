"""A running bench for Foxglove and Lichtblick (an entry point of `robot_bench.viewers`): what happens, by WebSocket.

The messages are those of `robot_bench.recording.scene_messages`, over Foxglove's own protocol (subprotocol
`foxglove.sdk.v1`, by the library foxglove-sdk, extra `foxglove`). The server binds to loopback unless told otherwise.
Who connects in the midst of a run is told the whole scene anew. Pages of the web do not get there: viewers meet
`robot_bench.origin_gate`, and the library's own server has an address of loopback that nobody is told.

Invariant: nobody who looks on decides anything: the trace is the same with and without.
"""

import contextlib
import json
import random
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any

from adapter_sim.pinout import load_pinout
from robot_bench.bench import Bench, run_of
from robot_bench.events.kinds import PinEdge
from robot_bench.origin_gate import OriginGate
from robot_bench.recording.scene_messages import Message, SceneMessages, topics
from robot_bench.run import RunBench, meta_of
from robot_bench.scenario.scenario import Scenario
from simbase.errors import MissingDependencyError, UsageError

HOST = "127.0.0.1"
#: Foxglove's own.
PORT = 8765


class LiveScene:
    """The server.

    Args:
        known: Topic → schema of what the run will tell. They are there before anybody connects: the library forgets
            who subscribes to a topic in the moment in which it is made.
        host: Where it binds.
        port: 0 takes a free one; `url` says which.
        origins: Of viewers that may look beside the usual ones: `https://HOST`.

    Raises:
        MissingDependencyError: foxglove-sdk is not installed.
        UsageError: The port is taken.
    """

    def __init__(
        self, known: Mapping[str, str], host: str = HOST, port: int = PORT, origins: Collection[str] = ()
    ) -> None:
        try:
            import foxglove
        except ImportError as error:
            raise MissingDependencyError("Foxglove's server needs foxglove-sdk", extra="foxglove") from error
        self._library: Any = foxglove
        self._context = foxglove.Context()
        self._channels = {topic: self._channel(topic, schema) for topic, schema in known.items()}
        self._has_newcomer = False
        foxglove.set_log_level("ERROR")
        try:
            hidden_at, self._server = self._hidden_server()
            try:
                self._gate = OriginGate(host, port, (hidden_at, self._server.port), origins)
            except BaseException:
                self._server.stop()
                raise
        except (OSError, RuntimeError) as error:
            hint = "another port, or 0 for a free one"
            raise UsageError(f"cannot serve at {host}:{port}: {error}", hint=hint) from error
        #: What a viewer opens.
        self.url = f"ws://{host}:{self._gate.port}"

    def _hidden_server(self) -> tuple[str, Any]:
        """Start the library's server where no page can look for it; return at which address of loopback.

        It is one of four million addresses, and any port. Where 127.0.0.1 is the only one (macOS), a page that tries
        every port may find it.
        """
        drawn = random.SystemRandom()
        address = f"127.{drawn.randrange(64, 128)}.{drawn.randrange(256)}.{drawn.randrange(1, 255)}"
        with contextlib.suppress(OSError, RuntimeError):
            return address, self._start(address)
        return HOST, self._start(HOST)

    def _start(self, host: str) -> Any:
        return self._library.start_server(
            name="p2os", host=host, port=0, context=self._context, server_listener=self._listener()
        )

    def _listener(self) -> Any:
        """Return what the library calls, in a thread of its own, when somebody wants a topic."""

        def note(_listener: object, _client: object, _channel: object) -> None:
            self._has_newcomer = True

        base = self._library.ServerListener
        return type("Newcomers", (base,), {"on_subscribe": note})()

    def drive(self, bench: Bench) -> None:
        """Run a bench to its end and tell of it, as `run_scenario` takes it."""
        messages = SceneMessages(meta_of(bench.scenario, bench.parts.world, run_of(bench).note, is_at_port=False))
        for net in bench.parts.harness:
            self._send(messages.of(PinEdge(t=bench.now, wire=net.name, level=net.level(bench.now))))
        self._send(messages.anew(bench.now))

        def tell(event: Any) -> None:
            if self._has_newcomer:
                self._has_newcomer = False
                self._send(messages.anew(event.t))
            self._send(messages.of(event))

        end = bench.events.subscribe(tell)
        try:
            bench.run_until(bench.scenario.duration_ns)
        finally:
            end()

    def _send(self, messages: Iterator[Message]) -> None:
        for message in messages:
            if message.topic not in self._channels:
                self._channels[message.topic] = self._channel(message.topic, message.schema)
            self._channels[message.topic].log(json.dumps(message.data).encode(), log_time=message.t)

    def _channel(self, topic: str, schema: str) -> Any:
        stated = self._library.Schema(name=schema, encoding="jsonschema", data=b'{"type": "object"}')
        return self._library.Channel(topic, schema=stated, message_encoding="json", context=self._context)

    def close(self) -> None:
        """Close the server; who looks on is told."""
        self._server.stop()
        self._gate.close()


def place_before(word: str) -> Sequence[str]:
    """Return the port where Foxglove looks by itself, where the word that follows the option is no place."""
    return () if word.rpartition(":")[2].isdecimal() else (str(PORT),)


@contextlib.contextmanager
def live_scene(
    scenario: Scenario, place: str, on_ready: Callable[[str], None], origins: Collection[str] = ()
) -> Iterator[RunBench]:
    """Serve the run of a scenario for a block; yield what runs it.

    Args:
        scenario: What will be run.
        place: `PORT`, or `HOST:PORT`.
        on_ready: Called with the URL.
        origins: As of `LiveScene`.

    Raises:
        MissingDependencyError, UsageError: As of `LiveScene`; or `place` is none.
    """
    host, _, port = place.rpartition(":")
    if not port.isdecimal() or int(port) > 65535:
        raise UsageError(f"--foxglove takes PORT or HOST:PORT, not {place!r}", hint=f"--foxglove {PORT}")
    own = scenario.own_robot
    wires = [wire.name for wire in (load_pinout().wires if own is None else own.robot.signals)]
    scene = LiveScene(topics(scenario.parameters.sonar_fitted, wires), host or HOST, int(port), origins)
    try:
        on_ready(scene.url)
        yield scene.drive
    finally:
        scene.close()
