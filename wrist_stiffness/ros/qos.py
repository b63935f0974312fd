"""Qualities of service of the wrist's topics."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

SENSOR_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Sensors in: hears reliable and best-effort drivers; a second of a 1 kHz stream may wait."""

COMMAND_QOS = QoSProfile(depth=50)
"""Commands in: reliable.  50 ms of a 1 kHz stream may wait for a corrector that is held up; one
that cannot keep up drops older ones, so that it does not lag further."""

RELIABLE_QOS = QoSProfile(depth=1000)
"""Everything out."""

STATE_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A state: who comes later hears the newest, also where poses have stopped."""

STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As tf2 sends `/tf_static`: what was said before is heard, too."""

RECORDING_QOS = QoSProfile(depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""The recorder hears everybody."""

NOTES_QOS = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Notes reach a recorder that comes later."""
