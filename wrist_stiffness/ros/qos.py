"""Qualities of service of the wrist's topics."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

SENSOR_QOS = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Sensors in: hears reliable and best-effort drivers; 0.2 s of a 1 kHz stream may wait."""

COMMAND_QOS = QoSProfile(depth=10)
"""Commands in: reliable, but a corrector that cannot keep up drops old ones and does not lag."""

RELIABLE_QOS = QoSProfile(depth=200)
"""Everything out."""

ALARM_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A state: who comes later hears the newest, also where poses have stopped."""

STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As tf2 sends `/tf_static`: what was said before is heard, too."""

RECORDING_QOS = QoSProfile(depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""The recorder hears everybody."""

NOTES_QOS = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Notes reach a recorder that comes later."""
