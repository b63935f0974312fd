"""Wrong inputs for every parser: nothing but a WristError, nothing slow, nothing large.

Run as ``python bench/fuzz_inputs.py [--cases N] [--seconds S] [--seed N] [--only PARSER]``; a
minute of it runs in ``.ci/run``.  Each case is a good input with bits, bytes, words or lines
changed; of `flips` one bit of a recording, which must give the same result or tell its damage.
A case that raises anything but a WristError, takes more than 2 s of the processor or
500 MB is kept in a folder and ends the run with exit code 1.
"""

from __future__ import annotations

import argparse
import io
import random
import re
import resource
import signal
import struct
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer

from wrist_stiffness.commands.import_csv import import_csv
from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.compensation.intake import frames_from_yaml
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.inputs.document import yaml_node
from wrist_stiffness.lookup.table_file import load_table, save_table
from wrist_stiffness.mechanism.geometry_file import load_geometry
from wrist_stiffness.model.formula import Formula
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.planning.loads_file import read_loads
from wrist_stiffness.planning.rivals import read_rivals
from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.recording.cdr import decode, encode
from wrist_stiffness.recording.fixed_layout import FixedReader, decode_batches
from wrist_stiffness.recording.messages import MESSAGE_TYPES
from wrist_stiffness.sessions.gauges import read_gauges

PROJECT = Path(__file__).parents[1]
SLOW_S, LARGE_BYTES = 2.0, 500 << 20
HANGING_S, BLOCKED_S = 20, 300
"""Of the processor; on the clock, which other programs stretch."""

EDGES = [0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1]
WORDS_APART = r"""null|~|true|.nan|.inf|-.inf|1e400|1e6|1.0e+400|-1|0|"x"|[]|{}|[1,2]|[[1]]|{a: 1}
2001-13-99|0x10|1_000|!!python/name:os.system|!!binary|!!bool maybe|!!timestamp x|&a [*a]|*x|<<|1:30
../../x|/dev/zero|>|?|%|@|`|-|:|#|---|...|1,5|;|nan|inf|1e999999999|9**9**9|p999999999x_mm"""
WORDS = [*re.split(r"[|\n]", WORDS_APART), "9" * 500, "[" * 5000, "\t", "a" * 300]

LOADS = """schema: 1
loads:
- {kind: weight, name: cup, mass_kg: 0.1, point_mm: [0, 0, 40], change_s: 20}
- kind: actuator
  name: pusher
  frame: wrist_base
  point_mm: [0, 0, 30]
  force_min_N: [0, 0, -1]
  force_max_N: [1, 0, 0]
  moment_min_Nm: [0, 0, 0]
  moment_max_Nm: [0, 0, 0.01]
  change_s: 2
"""
FRAMES = (
    "{ft: {parent: wrist_platform, position_mm: [0, 0, 40], rpy_deg: [0, 0, 90],"
    " acts_on: environment}, b: {parent: wrist_base}}"
)
RIVALS = """{"schema": 2, "noise": {"s_um": 1.0, "phi_mdeg": 2.0}, "suspects": [], "findings":
[{"class": [{"effect": "backlash", "component": "motor_1"}],
"parameters": {"width_mdeg": [20.0, 2.0]}}], "not_excited": []}"""
GAUGES = """schema: 1
gauges:
  - {column: a_um, point_mm: [25, 0, -12], direction: [0, 0, 1]}
  - {column: level_mdeg, direction: [1, 0, 0]}
"""
OWN = """  link_1: {stiffness: {origin_mm: [0, 0, 0], x: [1, 0, 0], y: [0, 1, 0], matrix_N_mm: [
             [9000, 0, 0, 0, 0, 0], [0, 9000, 0, 0, 0, 0], [0, 0, 9000, 0, 0, 0],
             [0, 0, 0, 9000000, 0, 0], [0, 0, 0, 0, 9000000, 0], [0, 0, 0, 0, 0, 9000000]]},
           """
TABLE = """\
time_s,motor_1_deg,motor_2_deg,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm,x_mm,y_mm,z_mm,T_link_1_degC
0,10,5,0,0,-1,0,0,0,0.001,0.002,0.003,20
1,11,5,0,0,-1,0,0,0,0.001,,0.003,20.5
"""
VARIABLES = ("sag", "fz", "theta_1", "theta_2")
FORMULA = "sag * tanh(fz / 0.5) + 1e-6 * max(theta_1, abs(theta_2) ** 2)"

Mutate = Callable[[bytes, random.Random], bytes]


def bytes_changed(data: bytes, rng: random.Random) -> bytes:
    """Flip bits, set numbers, cut, copy, insert."""
    out = bytearray(data or b"\0")
    for _ in range(rng.choice([1, 1, 1, 2, 3, 8])):
        place, width = rng.randrange(len(out) or 1), rng.choice([1, 2, 4, 8, 16, 100])
        kind = rng.randrange(8)
        if kind == 0 and out:
            out[place] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del out[place:]
        elif kind == 2:
            del out[place : place + width]
        elif kind == 3:
            out[place:place] = out[place : place + width]
        elif kind == 4:
            size = rng.choice([1, 2, 4, 8])
            value = rng.choice(EDGES) & ((1 << 8 * size) - 1)
            out[place : place + size] = value.to_bytes(size, rng.choice(["little", "big"]))
        elif kind == 5:
            out[place:place] = rng.randbytes(width)
        elif kind == 6:
            other = rng.randrange(len(out) or 1)
            out[place : place + width] = out[other : other + width]
        else:
            out[place : place + width] = bytes(width)
    return bytes(out)


def words_changed(data: bytes, rng: random.Random) -> bytes:
    """Put words in the place of others; drop, repeat, swap and indent lines."""
    lines = data.decode("utf-8", "replace").split("\n")
    for _ in range(rng.choice([1, 1, 2, 3])):
        place, other = rng.randrange(len(lines)), rng.randrange(len(lines))
        kind, line = rng.randrange(8), lines[place]
        if kind == 0 and len(lines) > 1:
            del lines[place]
        elif kind == 1:
            lines.insert(place, lines[other])
        elif kind == 2:
            lines[place], lines[other] = lines[other], line
        elif kind == 3:
            lines[place] = "  " + line
        elif kind == 4:
            lines[place] = line + rng.choice(WORDS)
        elif found := [match.span() for match in re.finditer(r"[-\w.]+", line)]:
            begin, end = rng.choice(found)
            lines[place] = line[:begin] + rng.choice(WORDS) + line[end:]
    changed = "\n".join(lines).encode("utf-8", "replace")
    return bytes_changed(changed, rng) if rng.random() < 0.2 else changed


def records(data: bytes) -> list[tuple[int, int, int]]:
    """Return opcode, begin and length of the records of an MCAP file."""
    found, position = [], 8
    while position + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, position)
        found.append((opcode, position, length))
        position += 9 + length
    return found


def one_bit_flipped(data: bytes, rng: random.Random) -> bytes:
    """Flip one bit in a record, each kind of record as often as any other."""
    places = records(data)
    kind = rng.choice(sorted({opcode for opcode, _, _ in places if opcode in range(1, 16)}))
    _, begin, length = rng.choice([place for place in places if place[0] == kind])
    out = bytearray(data)
    out[begin + rng.randrange(9 + length)] ^= 1 << rng.randrange(8)
    return bytes(out)


def records_changed(data: bytes, rng: random.Random) -> bytes:
    """Change heads of MCAP records, drop and repeat them; take their checksums out."""
    out, heads = bytearray(data), records(data)
    for opcode, begin, _ in heads:
        if opcode == 6 and rng.random() < 0.5:
            out[begin + 33 : begin + 37] = bytes(4)
    for _ in range(rng.choice([0, 1, 1, 2])):
        _, place, length = rng.choice(heads)
        kind = rng.randrange(5)
        if kind == 0:
            out[place : place + 1] = bytes([rng.randrange(20)])
        elif kind == 1:
            out[place + 1 : place + 9] = struct.pack("<Q", rng.choice([*EDGES, length + 1]))
        elif kind == 2:
            out[place:place] = out[place : place + 9 + length]
        elif kind == 3:
            del out[place : place + 9 + length]
        else:
            inside = place + 9 + rng.randrange(min(length, 60) or 1)
            out[inside : inside + 8] = struct.pack("<Q", rng.choice(EDGES))
    return bytes_changed(bytes(out), rng) if rng.random() < 0.5 else bytes(out)


def recordings() -> list[bytes]:
    """Small recordings in every form of MCAP."""
    source = open_recording(PROJECT / "test/data/replay/recording.mcap")
    forms: list[dict] = [{"compression": kind} for kind in CompressionType]
    forms += [{"use_chunking": False, "enable_data_crcs": True}]
    forms += [{"index_types": IndexType.NONE, "use_statistics": False}]
    made = []
    for form in forms:
        out = io.BytesIO()
        writer = Writer(out, chunk_size=4096, **form)
        writer.start("ros2")
        writer.add_attachment(1, 2, "a.txt", "text/plain", b"attached")
        writer.add_metadata("made", {"by": "a benchmark"})
        known: dict[str, int] = {}
        for count, (channel, time_ns, payload) in enumerate(source.raw_messages()):
            if channel.topic not in known:
                schema = writer.register_schema(channel.ros_type, "ros2msg", channel.schema_text)
                known[channel.topic] = writer.register_channel(channel.topic, "cdr", schema)
            writer.add_message(known[channel.topic], time_ns, payload, time_ns)
            if count > 60:
                break
        writer.finish()
        made.append(out.getvalue())
    return made


class SilentError(Exception):
    """A recording gave something else, and told nothing."""


def same_or_told(goods: list[bytes]) -> Callable[[Path], None]:
    """Return who reads a flipped recording and holds it against the good one of its size."""
    whole: dict[int, object] = {}

    def read(path: Path) -> None:
        size = path.stat().st_size
        recording = open_recording(path)
        raw = list(recording.raw_messages())
        columns = [
            (name, times.tolist(), [bytes(row) for row in rows])
            for name, times, rows in recording.payloads([info.name for info in recording.topics])
        ]
        blocks = [message for block in recording.blocks() for message in block.messages()]
        found = (recording.topics, raw, columns, blocks)
        if whole.setdefault(size, found) != found and not recording.damage:
            raise SilentError

    with tempfile.TemporaryDirectory() as folder:
        for number, good in enumerate(goods):
            path = Path(folder) / f"{number}.mcap"
            path.write_bytes(good)
            read(path)
    if len(whole) != len(goods):
        raise ValueError("two recordings of one size")
    return read


def read_recording(path: Path) -> None:
    """Read a recording in all ways."""
    recording = open_recording(path)
    for _ in recording.messages():
        pass
    for _ in recording.payloads([info.name for info in recording.topics]):
        pass
    for block in recording.blocks():
        recording.decoded(block, np.arange(len(block)))
    read_samples(recording)


def read_payload(data: bytes) -> None:
    """Decode a payload as each type, one by one and in columns."""
    for message_type in MESSAGE_TYPES.values():
        decode_batches(message_type, [data, data])
        try:
            decode(message_type, data)
        except WristError:
            continue
        FixedReader(message_type).read(data)


def parsers(folder: Path) -> dict[str, tuple[list[bytes], Mutate, Callable[[bytes], object]]]:
    """Return good inputs, what changes them and who reads them, by name."""
    data = PROJECT / "test/data/replay"
    whole = load_table(PROJECT / "precomputed/palmieri2015.npz")
    some = slice(None, None, 18)
    save_table(
        replace(
            whole,
            nodes=whole.nodes[some],
            operators=whole.operators[some],
            map_values=whole.map_values[some],
        ),
        folder / "t.npz",
    )
    table = (folder / "t.npz").read_bytes()
    shipped = (PROJECT / "config/palmieri2015.yaml").read_text()
    model = re.sub(r"path: .*npz", "path: t.npz", (data / "effects.yaml").read_text())
    model = re.sub(r"\n *checksum: .*", "", model)

    def file(name: str, read: Callable[[Path], object]) -> Callable[[bytes], object]:
        path = folder / name

        def run(content: bytes) -> object:
            path.write_bytes(content)
            return read(path)

        return run

    def bag(path: Path) -> None:
        read_recording(path.parent)

    (folder / "bag").mkdir()
    (folder / "bag/b_0.mcap").write_bytes(recordings()[0])
    metadata = b"""rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  relative_file_paths: [b_0.mcap]
  files: [{path: b_0.mcap, starting_time: {nanoseconds_since_epoch: 1}, duration: {nanoseconds: 2},
    message_count: 62}]
  topics_with_message_count: [{topic_metadata: {name: /joint_states}, message_count: 3}]
"""
    gravity = np.array([0.0, 0.0, -9.81])
    payloads = [encode(kind()) for kind in MESSAGE_TYPES.values()]
    texts: dict[str, tuple[list[bytes], Callable[[bytes], object]]] = {
        "yaml": (
            [model.encode(), FRAMES.encode(), LOADS.encode()],
            lambda d: yaml_node(d.decode("utf-8", "replace"), "x", InputError),
        ),
        "frames": ([FRAMES.encode()], lambda d: frames_from_yaml(d.decode("utf-8", "replace"))),
        "formula": ([FORMULA.encode()], lambda d: Formula(d.decode("utf-8", "replace"), VARIABLES)),
        "geometry": (
            [shipped.encode(), shipped.replace("  link_1: {", OWN).encode()],
            file("g.yaml", load_geometry),
        ),
        "model": ([model.encode()], file("m.yaml", load_model)),
        "parameters": ([(data / "parameters.yaml").read_bytes()], file("p.yaml", node_settings)),
        "loads": ([LOADS.encode()], file("l.yaml", lambda path: read_loads(path, gravity, 20.0))),
        "gauges": ([GAUGES.encode()], file("gauges.yaml", read_gauges)),
        "rivals": ([RIVALS.encode()], file("r.json", read_rivals)),
        "metadata": ([metadata], file("bag/metadata.yaml", bag)),
        "csv": (
            [TABLE.encode()],
            file("t.csv", lambda path: import_csv(path, folder / "o.mcap", overwrite=True)),
        ),
    }
    return {
        "cdr": (payloads, bytes_changed, read_payload),
        "flips": (recordings(), one_bit_flipped, file("f.mcap", same_or_told(recordings()))),
        "mcap": (recordings(), records_changed, file("r.mcap", read_recording)),
        "table": ([table], bytes_changed, file("x.npz", load_table)),
        **{name: (goods, words_changed, read) for name, (goods, read) in texts.items()},
    }


class Hanging(BaseException):
    """A case that does not end."""


def peak() -> int:
    """Return the most memory that this process has had [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def verdict(read: Callable[[bytes], object], case: bytes) -> tuple[str, float]:
    """Return what is wrong with how a case ended, empty if nothing, and its time [s]."""
    before, begin, said = peak(), time.process_time(), ""
    signal.setitimer(signal.ITIMER_PROF, HANGING_S)
    signal.alarm(BLOCKED_S)
    try:
        read(case)
    except WristError as error:
        said = "several lines" if "\n" in str(error) else ""
    except (Exception, Hanging) as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__} at {Path(place.filename).name}:{place.lineno}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
    took = time.process_time() - begin
    if not said and took > SLOW_S:
        said = f"more than {SLOW_S:g} s"
    return said or ("more than 500 MB" if peak() - before > LARGE_BYTES else ""), took


def _hangs(*_: object) -> None:
    raise Hanging


def main() -> int:
    """Print one line for each parser; return 1 if a case was not refused as it must be."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--cases", type=int, default=10_000_000)
    options.add_argument("--seconds", type=float, default=60.0)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--only", default="")
    options.add_argument("--keep", type=Path, default=Path("fuzz_findings"))
    given = options.parse_args()
    for number in (signal.SIGPROF, signal.SIGALRM):
        signal.signal(number, _hangs)
    rng, counts, slowest = random.Random(given.seed), Counter(), Counter()
    found: dict[str, Path] = {}
    end = time.monotonic() + given.seconds
    with tempfile.TemporaryDirectory() as folder:
        known = parsers(Path(folder))
        known = {name: known[name] for name in ([given.only] if given.only else known)}
        for goods, _, read in known.values():
            for good in goods:
                read(good)
        while counts.total() < given.cases and time.monotonic() < end:
            for name, (goods, mutate, read) in known.items():
                # As many as take this parser about as long as any other.
                turn = time.monotonic() + 0.05
                while time.monotonic() < turn and counts.total() < given.cases:
                    case = mutate(rng.choice(goods), rng)
                    said, took = verdict(read, case)
                    counts[name] += 1
                    slowest[name] = max(slowest[name], took)
                    if said and f"{name}: {said}" not in found:
                        given.keep.mkdir(exist_ok=True)
                        path = given.keep / f"{name}_{len(found)}"
                        path.write_bytes(case)
                        found[f"{name}: {said}"] = path
    for name, count in counts.items():
        print(f"{name:12s} {count:9d} cases, slowest {slowest[name]:.2f} s")
    print(f"{counts.total()} cases, seed {given.seed}, at most {peak() >> 20} MB")
    for said, path in found.items():
        print(f"{said}: {path}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
