"""The tutorial's stories by mouse, in a browser without the internet."""

import re

import pytest

pytestmark = pytest.mark.slow

LONG_MS = 240_000
IDLE = "getComputedStyle(document.querySelector('#busy')).display === 'none'"


class Hand:
    """A person before the page."""

    def __init__(self, browser, address, pictures, size=(1366, 768)):
        self.page = browser.new_page(viewport=dict(zip(("width", "height"), size, strict=True)))
        self.page.set_default_timeout(LONG_MS)
        self.errors = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(address)
        self.page.wait_for_selector("text=Examples")
        self._pictures, self._size = pictures, size

    def open(self, *names, model=""):
        self.page.locator(".q-select").first.click()
        for name in names:
            self.page.get_by_role("option", name=name).click()
        self.page.keyboard.press("Escape")
        if model:
            self.page.locator(".q-select").nth(1).click()
            self.page.get_by_role("option", name=model).click()
        self.click("Open")
        self.idle()

    def click(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def panel(self, name):
        self.page.get_by_role("tab", name=name).click()

    def idle(self):
        self.page.wait_for_timeout(500)
        self.page.wait_for_function(IDLE, timeout=LONG_MS)
        self.page.wait_for_timeout(500)

    def text(self):
        return self.page.inner_text("body")

    def picture(self, name):
        self.page.screenshot(path=self._pictures / f"{name}_{self._size[0]}.png")

    def held_out(self, symbol):
        """Numbers of the largest line: before and after, or only now."""
        (line,) = re.findall(rf"{symbol} on unseen data\n(.*) (?:µm|mdeg)", self.text())
        return [float(number.replace(",", "")) for number in line.split(" → ")]

    def done(self):
        self.page.close()
        assert self.errors == []


def test_a_known_fault_and_then_one_that_nobody_knows(address, browser, pictures):
    url, folder = address
    hand = Hand(browser, url, pictures)
    hand.open("monday.mcap")
    assert hand.page.locator("#plot-map .point").count() > 100
    assert "3.0 min" in hand.text()
    hand.picture("1_opened")
    # A region is chosen on the map, and all views follow.
    before = hand.text()
    box = hand.page.locator("#plot-map .nsewdrag").bounding_box()
    hand.page.mouse.move(box["x"] + 5, box["y"] + 5)
    hand.page.mouse.down()
    for x, y in ((0.5, 0.02), (0.5, 0.98), (0.02, 0.98)):
        hand.page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"], steps=4)
    hand.page.mouse.up()
    hand.page.wait_for_selector("text=on the selection")
    hand.picture("2_selected")
    hand.click("show all")
    hand.page.wait_for_selector("text=on all of these data")
    assert "over 214 units" in before
    # What is missing, and what it would explain before it is added.
    hand.panel("Missing")
    hand.click("What is missing?")
    hand.idle()
    assert "Missing in the model: backlash@motor_2, over 99.9 % sure." in hand.text()
    hand.page.locator("button:has-text('backlash@motor_2')").first.click()
    hand.idle()
    assert "If backlash@motor_2 were added" in hand.text()
    assert "approach one angle from both sides" in hand.text()
    assert hand.held_out("φ")[-1] > 30.0
    hand.picture("3_seen")
    hand.click("Add it")
    hand.idle()
    calibrated, added = hand.held_out("φ")
    assert calibrated > 30.0
    assert added < 6.0
    hand.click("Versions")
    hand.page.wait_for_selector("#plot-lower .bars")
    hand.picture("4_added")
    hand.panel("Models")
    hand.click("Export")
    hand.idle()
    assert (folder / "wrist_1.yaml").is_file()
    assert "--effect backlash@motor_2" in (folder / "wrist_1.txt").read_text()
    hand.click("Undo the newest")
    hand.idle()
    assert hand.held_out("φ") == [calibrated]
    hand.done()

    # Another day a clamp stands beside the wrist; no law of the catalogue knows it.
    hand = Hand(browser, url, pictures, (1920, 1080))
    hand.open("wednesday.mcap", "thursday.mcap", model="wrist_1.yaml")
    hand.panel("Missing")
    hand.click("What is missing?")
    hand.idle()
    assert "no effect in the catalogue explains it" in hand.text()
    hand.click("Try a straight line over clamp_bar")
    formula = hand.page.get_by_role("textbox", name="formula")
    formula.fill("__import__('os') * clamp_bar")
    hand.page.wait_for_timeout(500)
    assert "This can be fitted." not in hand.text()
    assert hand.page.get_by_role("button", name="See what it would explain").is_disabled()
    formula.fill("lift_um * clamp_bar")
    hand.page.wait_for_selector("text=This can be fitted.")
    hand.picture("5_formula")
    hand.click("See what it would explain")
    hand.idle()
    hand.picture("6_formula_seen")
    hand.click("Add it")
    hand.idle()
    before, after = hand.held_out("s")
    assert before > 3.0
    assert after < 1.0
    hand.picture("7_formula_added")
    hand.done()


def test_a_bad_file_gets_a_sentence_and_a_long_call_can_be_cancelled(address, browser, pictures):
    hand = Hand(browser, address[0], pictures)
    hand.open("broken.mcap")
    assert "broken.mcap" in hand.page.inner_text(".q-notification")
    hand.click("OK")
    hand.done()
    hand, other = (Hand(browser, address[0], pictures) for _ in range(2))
    hand.open("monday.mcap")
    hand.panel("Missing")
    hand.click("What is missing?")
    hand.page.wait_for_timeout(1000)
    hand.page.keyboard.press("Escape")
    hand.page.wait_for_selector("text=Cancelled; everything is as it was")
    assert "33.6 mdeg" in hand.text()
    # Another tab knows nothing of it.
    assert "nothing opened" in other.text()
    hand.done()
    other.done()
