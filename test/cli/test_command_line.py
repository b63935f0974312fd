import argparse
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import wrist_stiffness
from wrist_stiffness.cli.main import COMMANDS, EPILOG, build_parser, main
from wrist_stiffness.errors import GeometryError
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.size import Scale


def command(run):
    """Return a command module `try` with one required number."""

    def add_parser(commands):
        parser = commands.add_parser("try")
        parser.add_argument("--number", type=float, required=True)
        parser.set_defaults(run=run)

    return SimpleNamespace(add_parser=add_parser)


def raising(error):
    def run(arguments):
        raise error

    return run


TRY = ["try", "--number", "3.5"]


@pytest.mark.parametrize("code", [0, 1])
def test_the_answer_of_the_command_is_the_exit_code(code):
    seen = []

    def run(arguments):
        seen.append(arguments.number)
        return code

    assert main(TRY, [command(run)]) == code
    assert seen == [3.5]


def test_wrist_error_is_one_line_on_stderr(capsys):
    error = GeometryError("link_1: radius_mm is -3, must be > 0")
    assert main(TRY, [command(raising(error))]) == 2
    out, err = capsys.readouterr()
    assert (out, err) == ("", "wrist-stiffness: error: link_1: radius_mm is -3, must be > 0\n")


def test_line_break_in_a_name_stays_within_the_line(capsys):
    assert main(TRY, [command(raising(GeometryError("a\nb: cannot be read")))]) == 2
    assert capsys.readouterr().err == "wrist-stiffness: error: a\\nb: cannot be read\n"


PRINTING = (
    "import sys; from types import SimpleNamespace as S; from wrist_stiffness.cli.main import "
    "main\n"
    "run = lambda arguments: print('answer') or 0\n"
    "add = lambda commands: commands.add_parser('try').set_defaults(run=run)\n"
    "sys.exit(main(['try'], [S(add_parser=add)]))\n"
)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_full_disk_behind_stdout_is_one_line():
    with open("/dev/full", "w") as full:
        ran = subprocess.run([sys.executable, "-c", PRINTING], stdout=full, stderr=subprocess.PIPE)
    assert ran.returncode == 2
    assert ran.stderr == (
        b"wrist-stiffness: error: the output cannot be written: No space left on device\n"
    )


def test_a_name_that_is_too_long_is_one_line(capsys):
    assert main(["compare", "monday.mcap", "--model", f"{300 * 'm'}.yaml"]) == 2
    assert capsys.readouterr().err.endswith("File name too long\n")


def test_closed_stdout_is_quiet():
    ran = subprocess.run(
        ["sh", "-c", 'exec "$0" -c "$1" >&-', sys.executable, PRINTING], stderr=subprocess.PIPE
    )
    assert (ran.returncode, ran.stderr) == (0, b"")


def test_a_letter_that_the_terminal_lacks_is_shown_by_its_number():
    printing = PRINTING.replace("answer", "written: gr\\u00f6\\u00dfe.yaml")
    lacking = {**os.environ, "PYTHONIOENCODING": "ascii"}
    ran = subprocess.run([sys.executable, "-c", printing], env=lacking, capture_output=True)
    assert (ran.returncode, ran.stdout) == (0, b"written: gr\\xf6\\xdfe.yaml\n")


def test_a_fault_of_the_program_is_not_hidden():
    with pytest.raises(ZeroDivisionError):
        main(TRY, [command(raising(ZeroDivisionError()))])


@pytest.mark.parametrize(
    ("module", "extra"), [("netgen.occ", "fem"), ("skfem", "fem"), ("matplotlib.figure", "plot")]
)
def test_a_missing_extra_is_named(capsys, module, extra):
    error = ModuleNotFoundError(f"No module named '{module}'", name=module)
    assert main(TRY, [command(raising(error))]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert f"pip install 'wrist_stiffness[{extra}]'" in err


def test_a_missing_module_of_our_own_is_not_hidden():
    with pytest.raises(ModuleNotFoundError):
        main(TRY, [command(raising(ModuleNotFoundError("x", name="wrist_stiffness.fam")))])


def test_interrupt_exits_with_130(capsys):
    assert main(TRY, [command(raising(KeyboardInterrupt()))]) == 130
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        ([], "COMMAND"),
        (["tri"], "'tri'"),
        (["try"], "--number"),
        (["try", "--number", "x"], "'x'"),
    ],
)
def test_wrong_use_is_one_line_that_names_it(argv, named, capsys):
    with pytest.raises(SystemExit) as caught:
        main(argv, [command(lambda arguments: 0)])
    assert caught.value.code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert named in err


@pytest.mark.parametrize(
    ("argv", "told"),
    [
        (["compare", "a.mcap", "--modle", "b.yaml"], "--modle b.yaml; did you mean --model? "),
        (["table", "show", "--zzz"], "--zzz "),
        (
            ["predict", "--angles", "1", "2", "--model", "x.yaml"],
            "--model; here the model file stands without --model ",
        ),
    ],
)
def test_an_unknown_option_is_told_by_its_own_command(argv, told, capsys):
    with pytest.raises(SystemExit):
        main(argv)
    command = " ".join(argv[:-1] if argv[0] == "table" else argv[:1])
    expected = f"unrecognized arguments: {told}(see 'wrist-stiffness {command} --help')"
    assert capsys.readouterr().err == f"wrist-stiffness: error: {expected}\n"


def test_a_command_misspelt_is_told(refused):
    assert "; did you mean diagnose? (see" in refused("diagnos")


def test_a_model_and_a_recording_in_each_others_place_are_told(refused):
    recording = str(Path(__file__).parents[1] / "data" / "wrist_b.mcap")
    model = str(shipped_file("config/palmieri2015_model.yaml"))
    said = refused("compare", recording, "--model", recording)
    assert "is a recording, not a model file" in said
    assert "take it after --model" in refused("compare", model)


@pytest.mark.parametrize(
    ("argv", "told"),
    [
        (["predict", "--angles", "-20,5", "1"], "argument --angles: '-20,5' is no number: "),
        (["simulate", "-o", "a", "--rate", "20,5"], "argument --rate: '20,5' is no number: "),
        (["explain", "--angles", "0", "0", "--temperature", "link_1=20,5"], "link_1=20,5: "),
    ],
)
def test_a_decimal_comma_is_told(argv, told, refused):
    said = refused(*argv)
    assert told in said
    assert "20.5, with a decimal point" in said


@pytest.mark.parametrize("number", ["-3", "-.5", "-1e-6", "-2.5E+3"])
def test_a_negative_number_is_no_option(number):
    seen = []
    assert main(["try", "--number", number], [command(lambda given: seen.append(given) or 0)]) == 0
    assert seen[0].number == float(number)


@pytest.mark.parametrize(
    ("argv", "option"),
    [
        (["diagnose", "monday", "--model", "a.yaml", "--model", "b.yaml"], "--model"),
        (["simulate", "-o", "a", "--output", "b"], "-o/--output"),
        (["predict", "--angles", "0", "0", "--angles", "9", "9"], "--angles"),
    ],
)
def test_a_second_value_does_not_replace_the_first(argv, option, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        main(argv)
    assert caught.value.code == 2
    assert f"argument {option}: given twice" in capsys.readouterr().err


def test_recordings_to_fit_may_be_named_one_by_one(refused):
    """Of --fit monday --fit tuesday only Tuesday was fitted."""
    both = ["--fit", "none_1.mcap", "--fit", "none_2.mcap"]
    assert "none_1.mcap does not exist" in refused("calibrate", *both, "-o", "a.yaml")


def test_version_and_module_entry():
    ran = subprocess.run(
        [sys.executable, "-m", "wrist_stiffness", "--version"], capture_output=True, text=True
    )
    assert (ran.returncode, ran.stdout) == (0, f"wrist-stiffness {wrist_stiffness.__version__}\n")


def test_closed_pipe_is_quiet():
    program = (
        "import sys; from types import SimpleNamespace as S; from wrist_stiffness.cli.main import "
        "main\n"
        "def run(arguments):\n"
        "    sys.stdin.read()\n"
        "    print('answer')\n"
        "    return 0\n"
        "add = lambda commands: commands.add_parser('try').set_defaults(run=run)\n"
        "sys.exit(main(['try'], [S(add_parser=add)]))\n"
    )
    pipe = subprocess.PIPE
    buffered = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=pipe, stdout=pipe, stderr=pipe, env=buffered
    ) as child:
        child.stdout.close()
        child.stdin.close()
        assert child.stderr.read() == b""
    assert child.returncode == 141


def test_commands_that_the_help_teaches_exist():
    parser = build_parser(COMMANDS)
    lines = [line.strip().split("  ")[0] for line in EPILOG.splitlines()]
    taught = [line.split()[1:] for line in lines if line.startswith("wrist-stiffness ")]
    assert len(taught) == 3
    for argv in taught:
        assert isinstance(parser.parse_args(argv), argparse.Namespace)


def test_looking_for_help_loads_no_heavy_library():
    program = (
        "import sys; from wrist_stiffness.cli.main import COMMANDS, build_parser\n"
        "build_parser(COMMANDS).format_help()\n"
        "print({'numpy', 'scipy', 'yaml', 'mcap', 'matplotlib'} & sys.modules.keys())\n"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (ran.stderr, ran.stdout) == ("", "set()\n")


def test_sigterm_cleans_up_and_ends_with_its_code(tmp_path):
    part = tmp_path / "half.part"

    def run(arguments):
        part.write_text("half")
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            return 0
        finally:
            part.unlink()

    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(SystemExit) as left:
        main(TRY, [command(run)])
    assert left.value.code == 128 + signal.SIGTERM
    assert not part.exists()
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize(
    ("effect", "named"),
    [
        ("joint_clearance@joint_9", "joint_clearance is at joint_1, joint_2"),
        ("backlash", "backlash is at motor_1, motor_2 only; write backlash@motor_1"),
        ("joint_clearence@joint_3", "did you mean joint_clearance? known are a"),
        ("backlash@motor_1:doubled", "backlash has the forms single"),
    ],
)
def test_an_effect_where_it_cannot_be_names_the_places(effect, named, tmp_path, capsys):
    argv = ["simulate", "-o", str(tmp_path / "a"), "--seconds", "1", "--effect", effect]
    assert main(argv) == 2
    assert named in capsys.readouterr().err


@pytest.mark.parametrize("secret", [["--blind", "7"], ["--effect", "creep@joint_3"]])
def test_an_existing_recording_is_named_before_the_work(secret, refused, tmp_path, monkeypatch):
    path = tmp_path / "riddle.mcap"
    path.write_bytes(b"")
    monkeypatch.setattr(Scale, "__init__", lambda *given: pytest.fail("worked before it asked"))
    assert "choose another name, or --overwrite" in refused("simulate", "-o", str(path), *secret)


@pytest.mark.parametrize("secret", [["--reveal", "7"], ["--effect", "backlash@motor_1"]])
def test_the_search_for_a_size_says_that_it_is_at_work(secret, tmp_path, capsys, monkeypatch):
    for name in ("SHOWN_AFTER_S", "LINE_EVERY_S"):
        monkeypatch.setattr(f"wrist_stiffness.cli.progress.{name}", 0.0)
    monkeypatch.chdir(tmp_path)
    output = ["-o", "a.mcap"] if "--effect" in secret else []
    assert main(["simulate", "--seconds", "3", *output, *secret]) == 0
    assert "finding how much of the effect has the wanted size, run 1" in capsys.readouterr().err


def test_a_secret_is_told_and_not_recorded(refused):
    assert "leave out -o" in refused("simulate", "--reveal", "3", "-o", "riddle")


@pytest.mark.parametrize("option", ["--json", "--report"])
def test_a_result_replaces_no_recording_and_no_model(option, refused, tmp_path):
    """As where --json is taken for a switch: the recording behind it would be gone."""
    for content in (b"\x89MCAP0\r\n", b"schema: 1\nname: wrist_7\n"):
        path = tmp_path / "monday"
        path.write_bytes(content)
        assert "it is not replaced" in refused("compare", option, str(path), "tuesday.mcap")
        assert path.read_bytes() == content


def test_an_earlier_result_is_replaced_and_said_to_be_written(tmp_path, capsys):
    path = tmp_path / "pose.json"
    for _ in range(2):
        assert main(["predict", "--angles", "0", "0", "--json", str(path)]) == 0
        assert capsys.readouterr().out.splitlines()[-1] == f"written: {path}"


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["compare", "monday", "--report", "x", "--json", "./x"], "--report and --json"),
        (["diagnose", "monday", "--report", "x", "--json", "x"], "--report and --json"),
        (["calibrate", "--fit", "monday", "-o", "x", "--json", "x"], "--output and --json"),
        (["simulate", "-o", "x", "--json", "x"], "--output and --json"),
        (
            ["plan", "--diagnosis", "x", "--loads", "l", "-o", "p", "--json", "x"],
            "--diagnosis and --json",
        ),
    ],
)
def test_two_results_in_one_file_are_refused_before_the_work(
    options, named, refused, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert f"{named} name the same file" in refused(*options)
    assert list(tmp_path.iterdir()) == []


def test_a_device_takes_two_results(refused, capsys):
    both = ["--report", os.devnull, "--json", os.devnull]
    assert "none.mcap does not exist" in refused("compare", "none.mcap", *both)
    assert main(["predict", "--angles", "0", "0", "--json", os.devnull]) == 0
    assert "written" not in capsys.readouterr().out


def test_a_size_without_an_effect_to_have_it_is_refused(refused):
    for others in (["--blind", "7"], ["--reveal", "7"], []):
        assert "--size belongs to --effect" in refused("simulate", "--size", "30", *others)


def test_a_secret_tells_in_which_recordings_it_is(capsys):
    assert main(["simulate", "--reveal", "3", "--seconds", "20", "--base", "wrong"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("in recordings of: simulate --blind 3 --seconds 20.0 ")
    assert last.endswith("--base wrong")
    assert "--instrument interferometer" in last
