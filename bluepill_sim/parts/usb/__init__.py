"""A host at the BluePill's USB socket: it enumerates the device, and carries what goes over its endpoints.

Not a hub, and no host of a class but CDC ACM: reports of HID devices and bulk data of others are packets here.
Invariant: all that it does follows from the time and what it was told to do.
"""

from bluepill_sim.parts.usb.descriptors import ConfigurationInfo, DeviceInfo, EndpointInfo, InterfaceInfo
from bluepill_sim.parts.usb.host import HostState, UsbHost, UsbRequestError
from bluepill_sim.parts.usb.pipes import UsbPacket
from bluepill_sim.parts.usb.serial import UsbSerial

__all__ = [
    "ConfigurationInfo",
    "DeviceInfo",
    "EndpointInfo",
    "HostState",
    "InterfaceInfo",
    "UsbHost",
    "UsbPacket",
    "UsbRequestError",
    "UsbSerial",
]
