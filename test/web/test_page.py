"""The tutorial's stories by mouse, in a browser without the internet."""

import re
from pathlib import Path

import pytest

from wrist_stiffness.cli.main import main

pytestmark = pytest.mark.slow

TUTORIAL = Path(__file__).parents[1] / "data" / "tutorial"
MONDAY = "monday.mcap"
LONG_MS = 120_000
MOST_STOPS = 60
NAME = "(e => (e.ariaLabel || e.innerText || e.value || '').trim())(document.activeElement)"
DONE = "before => Number(document.querySelector('#busy').dataset.calls) > before"


class Hand:
    """A person before the page."""

    def __init__(self, browser, address, pictures, size=(1366, 768)):
        self.page = browser.new_page(viewport=dict(zip(("width", "height"), size, strict=True)))
        self.page.set_default_timeout(LONG_MS)
        self.errors = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(address)
        self.page.wait_for_selector("text=Examples")
        # Drawing what turns, and asking at every frame, take half a core from what is waited for.
        self.page.add_style_tag(content="#busy svg { display: none }")
        self._pictures, self._size = pictures, size

    def open(self, *names, model=""):
        self.page.locator(".q-select").first.click()
        for name in names:
            self.page.get_by_role("option", name=name).click()
        self.page.keyboard.press("Escape")
        if model:
            self.page.locator(".q-select").nth(1).click()
            self.page.get_by_role("option", name=model).click()
        self.does(lambda: self.click("Open"))

    def click(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def asks(self, name):
        self.does(lambda: self.click(name))

    def does(self, begin):
        """Begin what takes long, and wait until it is done and all is drawn."""
        before = int(self.page.locator("#busy").get_attribute("data-calls"))
        begin()
        self.page.wait_for_function(DONE, arg=before, polling=100)

    def panel(self, name):
        self.page.get_by_role("tab", name=name).click()

    def press(self, key):
        self.page.keyboard.press(key)

    def tabs_to(self, name):
        """Press Tab until something of that name has the focus, and is seen to have it."""
        for _ in range(MOST_STOPS):
            self.press("Tab")
            if self.page.evaluate(NAME) == name:
                style = "getComputedStyle(document.activeElement).outlineStyle"
                assert self.page.evaluate(style) == "solid"
                return
        raise AssertionError(f"{name} has no place in the order of Tab")

    def text(self):
        return self.page.inner_text("body")

    def picture(self, name):
        self.page.screenshot(path=self._pictures / f"{name}_{self._size[0]}.png")

    def held_out(self, symbol):
        """Numbers of the largest line: before and after, or only now."""
        (line,) = re.findall(rf"Held-out error of {symbol}\n(.*) (?:µm|mdeg)", self.text())
        return [float(number.replace(",", "")) for number in line.split(" → ")]

    def done(self):
        self.page.close()
        assert self.errors == []


def test_a_known_fault_and_then_one_that_nobody_knows(address, browser, pictures):
    url, folder = address
    hand = Hand(browser, url, pictures)
    hand.open("monday.mcap")
    hand.page.wait_for_function("document.querySelectorAll('#plot-map .point').length > 50")
    for text in ("1.5 min", "10 Hz", "interferometer", "registered to"):
        assert text in hand.text()
    assert "Every recorded condition was varied." in hand.text()
    hand.picture("1_opened")
    # A region is chosen on the map, and all views follow.
    (everything,) = set(re.findall(r"all \d+ poses", hand.text()))
    box = hand.page.locator("#plot-map .nsewdrag").bounding_box()
    hand.page.mouse.move(box["x"] + 5, box["y"] + 5)
    hand.page.mouse.down()
    for x, y in ((0.5, 0.02), (0.5, 0.98), (0.02, 0.98)):
        hand.page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"], steps=4)
    hand.page.mouse.up()
    hand.page.wait_for_selector("text=Remaining φ, selected")
    hand.picture("2_selected")
    hand.click("Show all")
    hand.page.wait_for_selector(f"text={everything}")
    # What is missing, and what it would explain before it is added.
    hand.panel("Missing")
    hand.asks("What is missing?")
    assert "Missing in the model: backlash@motor_2, over 99.9 % sure." in hand.text()
    hand.does(hand.page.locator("button:has-text('backlash@motor_2')").first.click)
    assert "If backlash@motor_2 were added" in hand.text()
    assert "approach one angle from both sides" in hand.text()
    assert hand.held_out("φ")[-1] > 20.0
    (before, after) = re.findall(r"\n([\d.]+) → ([\d.]+) mdeg\nwith backlash", hand.text())[0]
    assert float(after) < 6.0 < 20.0 < float(before)
    hand.picture("3_seen")
    hand.page.get_by_text("Which experiment would decide?").click()
    hand.asks("Plan it")
    assert "Written into the workspace: next_experiment_1" in hand.text()
    hand.asks("Add it")
    calibrated, added = hand.held_out("φ")
    assert calibrated > 20.0
    assert added < 6.0
    # Without a click more the page shows how the error fell, and towards what.
    hand.page.wait_for_selector("#plot-lower .bars")
    assert "goal: noise floor" in hand.text()
    hand.picture("4_added")
    # What was pressed is gone; the version that it made has the focus.
    hand.page.wait_for_function("document.activeElement.dataset.focus === 'version-2'", polling=100)
    for other in ("version 0: as given", "version 1: calibrated"):
        hand.page.get_by_role("combobox", name="compare in all pictures with").click()
        hand.page.get_by_role("option", name=other).click()
        hand.page.wait_for_selector(f"text=Where: remaining error, {other}")
        (now, then) = re.findall(rf"\n([\d.]+) → ([\d.]+) mdeg\n{other}", hand.text())[0]
        assert float(now) < 6.0 < 20.0 < float(then)
    hand.asks("Export")
    assert (folder / "wrist_1.yaml").is_file()
    assert "--effect backlash@motor_2" in (folder / "wrist_1.txt").read_text()
    with hand.page.expect_download() as saved:
        hand.page.get_by_role("button", name="model: wrist_1.yaml").click()
    assert saved.value.suggested_filename == "wrist_1.yaml"
    hand.asks("Undo the newest")
    assert hand.held_out("φ") == [calibrated]
    hand.done()

    # Another day a clamp stands beside the wrist; no law of the catalogue knows it.
    hand = Hand(browser, url, pictures, (1920, 1080))
    hand.open("wednesday.mcap", model="wrist_1.yaml")
    hand.panel("Missing")
    hand.page.get_by_text("An effect of your own, by formula").click()
    hand.page.wait_for_selector("text=It may use: clamp_bar")
    assert "a name that ends in a unit (_um, _mdeg, _N ...) is a number to be found" in hand.text()
    hand.asks("What is missing?")
    assert "no effect in the catalogue explains it" in hand.text()
    hand.page.locator("button:has-text('Proposed'):has-text('clamp_bar')").first.click()
    formula = hand.page.get_by_role("textbox", name="formula")
    hand.page.wait_for_selector("text=This can be fitted.")
    formula.fill("__import__('os') * clamp_bar")
    hand.page.wait_for_selector("button:has-text('See what it would explain'):disabled")
    assert "This can be fitted." not in hand.text()
    formula.fill("lift_um * clamp_bar")
    hand.page.wait_for_selector("text=This can be fitted.")
    hand.picture("5_formula")
    hand.asks("See what it would explain")
    hand.picture("6_formula_seen")
    hand.asks("Add it")
    before, after = hand.held_out("s")
    assert before > 3.0
    assert after < 1.0
    hand.picture("7_formula_added")
    # What was written of one recording is gone when another is opened.
    hand.panel("Open")
    hand.page.get_by_text("Your own recordings").click()
    hand.asks("Open")
    hand.panel("Missing")
    assert formula.input_value() == ""
    hand.done()


def test_only_what_was_measured_is_offered(address, browser, pictures):
    url, folder = address
    seen = ["--sees", "points", "--seconds", "40", "--rate", "10"]
    assert main(["simulate", "-o", str(folder / "points.mcap"), *seen]) == 0
    hand = Hand(browser, url, pictures)
    hand.open("points.mcap")
    assert "shift s [µm]" in hand.text()
    assert "rotation φ [mdeg]" not in hand.text()
    hand.click("z")
    hand.page.wait_for_selector("text=When: s along z")
    hand.done()


def test_whoever_leaves_an_analysis_is_asked_first(address, browser, pictures):
    hand = Hand(browser, address[0], pictures)

    def reload():
        hand.page.evaluate("setTimeout(() => location.reload())")

    def stays():
        hand.page.wait_for_selector("#busy[data-loses=true]", state="attached")
        with hand.page.expect_event("dialog") as asked:
            reload()
        assert asked.value.type == "beforeunload"
        asked.value.dismiss()

    hand.open("monday.mcap")
    stays()
    assert "1.5 min" in hand.text()
    hand.panel("Models")
    hand.asks("Export")
    hand.page.wait_for_selector("#busy[data-loses=false]", state="attached")
    hand.panel("Missing")
    hand.click("What is missing?")
    hand.page.wait_for_selector("#busy", state="visible")
    stays()
    hand.press("Escape")
    hand.page.wait_for_selector("#busy[data-loses=false]", state="attached")
    reload()
    hand.page.wait_for_selector("text=nothing opened")
    hand.done()


def test_a_bad_file_gets_a_sentence_and_a_good_one_arrives(address, browser, pictures):
    url, folder = address
    hand = Hand(browser, url, pictures)
    hand.open("broken.mcap")
    assert "broken.mcap" in hand.page.inner_text(".q-notification")
    hand.click("OK")
    # What is dropped arrives in the workspace, if it is something that the workbench takes.
    drop = hand.page.locator("input[type=file]")
    drop.set_input_files(TUTORIAL / "tuesday.mcap")
    hand.page.wait_for_selector(".q-chip:has-text('tuesday.mcap')")
    assert (folder / "tuesday.mcap").read_bytes() == (TUTORIAL / "tuesday.mcap").read_bytes()
    drop.set_input_files({"name": "law.py", "mimeType": "text/plain", "buffer": b"import os"})
    hand.page.wait_for_selector("text=the workbench takes recordings")
    assert not (folder / "law.py").exists()
    hand.done()


def test_the_keyboard_alone_opens_asks_and_cancels_and_tabs_are_apart(address, browser, pictures):
    url, _ = address
    hand, other = (Hand(browser, url, pictures) for _ in range(2))
    hand.tabs_to("recordings")
    hand.press("ArrowDown")
    hand.page.wait_for_selector("[role=option]")
    option = hand.page.locator("[role=option].q-manual-focusable--focused")
    for _ in range(MOST_STOPS):
        hand.press("ArrowDown")
        if option.inner_text() == MONDAY:
            break
    hand.press("Enter")
    hand.page.wait_for_selector(f".q-chip:has-text('{MONDAY}')")
    hand.press("Escape")
    hand.page.wait_for_selector("[role=option]", state="detached")
    hand.tabs_to("Open")
    hand.does(lambda: hand.press("Enter"))
    remaining = hand.held_out("φ")
    # Tab stops at the panel that is open; arrows go to the others.
    hand.tabs_to("1 Open")
    hand.press("ArrowRight")
    hand.press("Enter")
    hand.tabs_to("What is missing?")
    hand.press("Enter")
    hand.page.wait_for_selector("text=missing so far")
    hand.press("Escape")
    hand.page.wait_for_selector("text=Cancelled. Nothing was changed.")
    assert hand.held_out("φ") == remaining
    # Another tab knows nothing of it.
    assert "nothing opened" in other.text()
    hand.done()
    other.done()
