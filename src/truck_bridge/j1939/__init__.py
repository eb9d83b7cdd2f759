"""SAE J1939: identifiers, codec, checksums, transport protocol, address claim."""

from truck_bridge.j1939.codec import Codec, Decoded, Layout, Signal, load
from truck_bridge.j1939.ids import Identifier

__all__ = ["Codec", "Decoded", "Identifier", "Layout", "Signal", "load"]
