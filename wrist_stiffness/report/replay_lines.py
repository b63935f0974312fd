"""What `replay` tells on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wrist_stiffness.commands.output_changes import TopicChanges
    from wrist_stiffness.commands.replay_summary import ReplaySummary


def replay_lines(summary: ReplaySummary) -> list[str]:
    """Return what a replay did."""
    lines = [
        f"{summary.predictions} predictions for {summary.joint_states} joint states, "
        f"{summary.corrections} of {summary.commands} commands corrected"
    ]
    if summary.trajectories:
        corrected = summary.corrected_trajectories
        lines.append(f"{corrected} of {summary.trajectories} trajectories corrected")
    if summary.predictions:
        for name, sizes in (("s [um]", summary.shift_um), ("phi [mdeg]", summary.phi_mdeg)):
            means = f"mean {sizes.mean:8.3f}   max {sizes.most:8.3f}"
            lines.append(f"  predicted {name:10} {means}")
    if summary.damage:
        lines.append(f"input is damaged: {summary.damage}")
    if summary.replaced:
        lines.append(f"{summary.replaced} outputs of an earlier run in the input left out")
    for warning, count in summary.warnings.most_common():
        lines.append(f"{count} predictions: {warning}")
    for reason, count in summary.refused.most_common():
        lines.append(f"{count} refused, the first: {reason}")
    return lines


def change_line(topic: TopicChanges) -> str:
    """Return what changed on a topic, as one line."""
    text = f"{topic.topic:26} {topic.common} in both, {topic.changed or 'none'} changed"
    if topic.first_ns is not None:
        text += f", first at {1e-9 * topic.first_ns:.6f} s"
    for largest in topic.largest:
        text += f"; {largest.quantity} by {largest.size:.3g} at {1e-9 * largest.stamp_ns:.6f} s"
    for count, where in ((topic.only_old, "old"), (topic.only_new, "new")):
        text += f"; {count} only in the {where} one" if count else ""
    return text
