"""What is taken home: the model, the report, and the same as commands."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.commands.diagnose import Diagnosed
from wrist_stiffness.commands.provenance import Provenance
from wrist_stiffness.commands.read_sessions import recording_sha256
from wrist_stiffness.identification.wrist_diagnosis import WristDiagnosis
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import file_sha256, save_model
from wrist_stiffness.planning.plan import Plan
from wrist_stiffness.report.diagnosis_report import report_of_diagnosis
from wrist_stiffness.report.page import write_page
from wrist_stiffness.web.workspace import Workspace


def as_commands(model: Path, recordings: Sequence[Path], added: Sequence[str]) -> list[str]:
    """Return what a terminal would do the same with.

    `added`: options of `extend`, in their order.
    """
    days = shlex.join(str(path) for path in recordings)
    lines = [f"wrist-stiffness calibrate {shlex.quote(str(model))} --fit {days} -o step_1.yaml"]
    lines.append(f"wrist-stiffness diagnose {days} --model step_1.yaml")
    lines += [
        f"wrist-stiffness extend step_{n}.yaml {option} --fit {days} -o step_{n + 1}.yaml"
        for n, option in enumerate(added, 1)
    ]
    return lines


def write_result(
    workspace: Workspace,
    model: ErrorModel,
    lines: Sequence[str],
    parent: Path,
    recordings: Sequence[Path],
    answer: WristDiagnosis | None,
) -> tuple[tuple[str, str], ...]:
    """Write a model, commands and, where something was asked, the report.

    Their names are returned with what each is.

    `workspace`: where to; `model`: to write; `lines`: commands; `parent`: model with which it
    began; `recordings`: that were opened; `answer`: what was found last.
    """
    name = workspace.free("wrist")
    files = [(f"{name}.yaml", "model"), (f"{name}.txt", "commands that do the same")]
    save_model(model, workspace.path(files[0][0]))
    with replacing(workspace.path(files[1][0])) as path:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if answer is not None:
        files.append((f"{name}.html", "report of the diagnosis"))
        hashes = {path.name: recording_sha256(path) for path in recordings}
        date = datetime.now(UTC).isoformat(timespec="seconds")
        made = {parent.stem: file_sha256(parent)}
        provenance = Provenance("wrist-stiffness workbench", date, made, hashes)
        answered = Diagnosed(answer, tuple(hashes), "", (), provenance)
        write_page(workspace.path(files[2][0]), report_of_diagnosis(answered))
    return tuple(files)


def told_plan(found: Plan) -> str:
    """Return what a planned experiment would settle, in words."""
    timeline = found.timeline
    lines = ["No experiment with this weight helps."]
    if timeline is not None:
        lines = [
            f"{timeline.duration_s / 60.0:.1f} minutes, {len(timeline.dwells)} dwells:",
        ]
    for answer in found.answers:
        what = f"{answer.goal.truth} from {answer.goal.rival}" if answer.goal.rival else ""
        if what:
            lines.append(f"{'tells' if answer.settled else 'does not surely tell'} {what}")
    return "\n".join(lines)
