"""Descriptors of a USB device as a host reads them: hostile until they are parsed.

Source: USB 2.0 specification, section 9.6; CDC 1.2, section 5.2; HID 1.11, section 6.2.
Invariant: whatever the bytes, parsing gives a description or a `DescriptorError`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import IntEnum

from bluepill_sim.errors import BluePillError

DEVICE_BYTES, CONFIGURATION_BYTES = 18, 9
_INTERFACE_BYTES, _ENDPOINT_BYTES = 9, 7
_CONTROL_PACKETS = (8, 16, 32, 64)
#: Full speed: bytes of a packet by the kind of endpoint (5.5.3 to 5.8.3).
_MOST_PACKET = (64, 1023, 64, 64)


class DescriptorError(BluePillError):
    """A descriptor is damaged."""


class DescriptorType(IntEnum):
    """Types of descriptors."""

    DEVICE = 1
    CONFIGURATION = 2
    STRING = 3
    INTERFACE = 4
    ENDPOINT = 5
    HID_REPORT = 0x22


class EndpointKind(IntEnum):
    """Kinds of transfer, as bmAttributes has them."""

    CONTROL = 0
    ISOCHRONOUS = 1
    BULK = 2
    INTERRUPT = 3


class InterfaceClass(IntEnum):
    """Classes of interfaces that a host here knows."""

    COMMUNICATIONS = 0x02
    HID = 0x03
    CDC_DATA = 0x0A


@dataclass(frozen=True, slots=True)
class EndpointInfo:
    """An endpoint."""

    #: 1 to 15, with 0x80 for IN.
    address: int
    kind: EndpointKind
    packet_bytes: int
    #: Milliseconds between two polls of an interrupt or isochronous endpoint.
    interval_frames: int

    @property
    def is_in(self) -> bool:
        """Whether the device sends."""
        return bool(self.address & 0x80)


@dataclass(frozen=True, slots=True)
class InterfaceInfo:
    """An interface in its first setting."""

    number: int
    kind: int
    subclass: int
    protocol: int
    endpoints: tuple[EndpointInfo, ...]


@dataclass(frozen=True, slots=True)
class ConfigurationInfo:
    """A configuration."""

    value: int
    interfaces: tuple[InterfaceInfo, ...]

    @property
    def endpoints(self) -> tuple[EndpointInfo, ...]:
        """Those of all interfaces."""
        return tuple(endpoint for interface in self.interfaces for endpoint in interface.endpoints)


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """A device."""

    vendor: int
    product: int
    kind: int
    #: Bytes of a packet of endpoint 0.
    packet_bytes: int
    #: Numbers of the strings for maker, product and serial number; 0 for none.
    strings: tuple[int, int, int]
    configurations: int
    #: The strings that it has sent, by their numbers.
    texts: dict[int, str] = field(default_factory=dict, hash=False)
    configuration: ConfigurationInfo | None = None

    def __str__(self) -> str:
        """Return "0483:5740 maker, product, serial number"."""
        known = ", ".join(self.texts[number] for number in self.strings if number in self.texts)
        return f"{self.vendor:04x}:{self.product:04x} {known}".rstrip()


def packet_bytes_of(data: bytes) -> int:
    """Return the bytes of a packet of endpoint 0, from the first 8 bytes of a device descriptor.

    Raises:
        DescriptorError: it is none.
    """
    if len(data) < 8 or data[1] != DescriptorType.DEVICE or data[7] not in _CONTROL_PACKETS:
        raise DescriptorError(f"no device descriptor: {data.hex(' ')}")
    return data[7]


def parse_device(data: bytes) -> DeviceInfo:
    """Return what a device descriptor says.

    Raises:
        DescriptorError: it is damaged.
    """
    packet_bytes = packet_bytes_of(data)
    if len(data) < DEVICE_BYTES or data[0] < DEVICE_BYTES or not data[17]:
        raise DescriptorError(f"a device descriptor of {len(data)} bytes without a configuration: {data.hex(' ')}")
    vendor, product = int.from_bytes(data[8:10], "little"), int.from_bytes(data[10:12], "little")
    return DeviceInfo(vendor, product, data[4], packet_bytes, (data[14], data[15], data[16]), data[17])


def total_bytes_of(data: bytes) -> int:
    """Return how long a configuration descriptor is with all that follows it.

    Raises:
        DescriptorError: it is none.
    """
    total = int.from_bytes(data[2:4], "little")
    if len(data) < CONFIGURATION_BYTES or data[1] != DescriptorType.CONFIGURATION or total < CONFIGURATION_BYTES:
        raise DescriptorError(f"no configuration descriptor: {data.hex(' ')}")
    return total


def parse_configuration(data: bytes) -> ConfigurationInfo:
    """Return what a configuration descriptor says; of an interface its first setting.

    Raises:
        DescriptorError: it is damaged.
    """
    total_bytes_of(data)
    interfaces: list[InterfaceInfo] = []
    is_first = False
    for one in _descriptors(data[: total_bytes_of(data)]):
        if one[1] == DescriptorType.INTERFACE:
            if len(one) < _INTERFACE_BYTES:
                raise DescriptorError(f"an interface descriptor of {len(one)} bytes")
            is_first = one[3] == 0
            if is_first:
                interfaces.append(InterfaceInfo(one[2], one[5], one[6], one[7], ()))
        elif one[1] == DescriptorType.ENDPOINT:
            endpoint = _endpoint(one)
            if not interfaces:
                raise DescriptorError("an endpoint before any interface")
            if is_first:
                last = interfaces[-1]
                interfaces[-1] = replace(last, endpoints=(*last.endpoints, endpoint))
    if not interfaces:
        raise DescriptorError("a configuration without interfaces")
    return ConfigurationInfo(data[5], tuple(interfaces))


def parse_string(data: bytes) -> str:
    """Return the text of a string descriptor; what is no text is replaced."""
    return data[2 : data[0] if data else 0].decode("utf-16-le", errors="replace")


def _descriptors(data: bytes) -> Iterator[bytes]:
    at = 0
    while at < len(data):
        length = data[at]
        if length < 2 or at + length > len(data):
            raise DescriptorError(f"a descriptor of {length} bytes at byte {at} of {len(data)}")
        yield data[at : at + length]
        at += length


def _endpoint(data: bytes) -> EndpointInfo:
    if len(data) < _ENDPOINT_BYTES or not data[2] & 0xF or data[2] & 0x70:
        raise DescriptorError(f"a damaged endpoint descriptor: {data.hex(' ')}")
    kind = EndpointKind(data[3] & 3)
    size = int.from_bytes(data[4:6], "little") & 0x7FF
    if not size or size > _MOST_PACKET[kind]:
        raise DescriptorError(f"endpoint {data[2]:#04x} has packets of {size} bytes")
    interval = 1 << min(max(data[6], 1) - 1, 15) if kind is EndpointKind.ISOCHRONOUS else max(data[6], 1)
    return EndpointInfo(data[2], kind, size, interval)
